"""Room for an array on the stack of a kernel, which cannot create arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core import config as _numba_config
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

from billiards_env.jit.decorators import expanded

_config: Any = _numba_config  # numba defines its attributes at run time


def room_for(rows: int, columns: int) -> Any:
    """Returns a function without arguments that kernels call for a float64 array of this shape, with any content.

    The array exists until the kernel returns. Each call in the source has an array of its own.
    """

    @intrinsic
    def place(typing_context: Any) -> Any:
        def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            memory = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), rows * columns))
            array, word = (
                make_array(signature.return_type)(context, builder),
                lambda n: context.get_constant(types.intp, n),
            )
            data, size = builder.bitcast(memory, array.data.type), word(8)
            shape, strides = [word(rows), word(columns)], [word(8 * columns), size]
            populate_array(array, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None)
            return array._getvalue()

        return types.Array(types.float64, 2, "C")(), write

    def room() -> Any:
        return place()  # pyright: ignore[reportCallIssue]  (numba adds the argument)

    def room_of_python() -> Any:
        return np.empty((rows, columns))

    return room_of_python if _config.DISABLE_JIT else expanded(room)
