"""Compiles recorded functions for another processor, and runs their calls there, emulated by qemu.

LLVM compiles the code that `record` writes, and a cross compiler of Debian links it with `replay.c`. No Python runs on
the other processor, so any target of LLVM can be compared.
"""

from __future__ import annotations

import itertools
import json
import re
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import numpy as np

from benchmarks.machines.record import Call, arrays_of, load

HERE = Path(__file__).resolve().parent
MASK = 2**64 - 1
_CONSTANT = re.compile(r'(@\.const\.array\.data[^"\n]* c")([^"]*)"')
"""A constant array, whose bytes have the order of this machine. The items have 8 bytes."""


class Target(NamedTuple):
    """A processor.

    Attributes:
        gcc: The name of the cross compiler of Debian, without "-gcc".
        cpu: The processor of LLVM.
        options: Other options of the target machine of LLVM.
        big: Whether the byte order is big-endian.
    """

    gcc: str
    cpu: str = ""
    options: Mapping[str, Any] = MappingProxyType({})
    big: bool = False


_RISCV = {"features": "+m,+a,+f,+d,+c", "abiname": "lp64d"}
TARGETS = {
    "riscv64": Target("riscv64-linux-gnu", "", _RISCV),
    "s390x": Target("s390x-linux-gnu", "z10", big=True),
    "ppc64le": Target("powerpc64le-linux-gnu", "ppc64le"),
    "arm": Target("arm-linux-gnueabihf", "cortex-a9", {"features": "+vfp3,+d32,-neon"}),
}
"""The processors by the names of qemu; arm has 32 bits."""

CONTROL = Target("aarch64-linux-gnu")
"""A processor that can fuse a product and a sum."""
CONTROL_FUNCTIONS = 10
"""The control compiles only the first functions, this many."""


def tool(name: str, package: str) -> str:
    """Returns the path of a program.

    Raises:
        FileNotFoundError: If it is missing; the message names the package of Debian.
    """
    path = shutil.which(name)
    if path is None:
        raise FileNotFoundError(f"{name}: not found; install it with: apt-get install {package}")
    return path


def emulator(name: str) -> str:
    """Returns the path of an emulator of qemu."""
    return tool(f"qemu-{name}-static", "qemu-user-static")


def replay(name: str, folder: Path) -> dict[str, int]:
    """Compiles the functions of a folder of `record` for a processor and runs their calls there.

    Args:
        name: One of `TARGETS`, or "aarch64" for `CONTROL`, where LLVM may fuse products and sums.
        folder: The folder.

    Returns:
        The numbers of functions, calls and bytes, of those calls and bytes that differ, and of calls that cannot run
        here: those of kernels, those that raise an exception, and those whose arrays overlap.
    """
    target, work = TARGETS.get(name, CONTROL), folder / f"kernels {name}"
    qemu, compiler = emulator(name), tool(f"{target.gcc}-gcc", f"gcc-{target.gcc}")
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    calls = load(folder)
    numbers = sorted(int(path.stem) for path in (folder / "ir").glob("*.json"))
    if target is CONTROL:
        numbers = numbers[:CONTROL_FUNCTIONS]
    work.mkdir(exist_ok=True)
    objects = [work / f"{number}.o" for number in numbers]
    for number, path in zip(numbers, objects, strict=True):
        path.write_bytes(compiled(folder / "ir", number, target))
    declared = "".join(f"int call_{number}(void *, void *, void *);\n" for number in numbers)
    table = ", ".join(f"call_{number}" for number in numbers)
    (work / "entries.c").write_text(f"{declared}int (*const entries[])(void *, void *, void *) = {{{table}}};\n")
    program, recorded = work / "replay", work / "calls"
    sources = HERE / "replay.c", work / "entries.c"
    subprocess.run([compiler, "-O1", "-static", "-w", *sources, *objects, "-lm", "-o", program], check=True)
    packed = [row for call in calls if (row := packed_call(call, numbers)) is not None]
    recorded.write_bytes(pack(packed, target.big))
    output = subprocess.run([qemu, program, recorded], check=True, capture_output=True, text=True).stdout
    *differences, result = output.splitlines()
    print(*differences[:5], sep="\n", end="\n" if differences else "", flush=True)
    return {"functions": len(numbers), **json.loads(result), "left_out": len(calls) - len(packed)}


def compiled(folder: Path, number: int, target: Target) -> bytes:
    """Returns the object file of a function, with `call_<number>`, which reads its arguments from words."""
    about = json.loads((folder / f"{number}.json").read_text(encoding="utf-8"))
    text = (folder / f"{number}.ll").read_text(encoding="utf-8")
    text = re.sub(r"^target .*$", "", text, flags=re.MULTILINE).replace("= common global", "= internal global")
    text = text.replace("@sqrt(", "@llvm.sqrt.f64(").replace("@ceil(", "@llvm.ceil.f64(")
    if target.big:
        text = _CONSTANT.sub(lambda found: f'{found[1]}{other_order(found[2])}"', text)
    if target is CONTROL:
        text = re.sub(r"= f(mul|add|sub) double", r"= f\1 contract double", text)
    module = llvm.parse_assembly(text)
    kinds = [str(kind.type) for kind in module.get_function(about["function"]).arguments]
    module.link_in(llvm.parse_assembly("\n".join(caller(number, about, kinds))))
    triple = target.gcc.replace("-", "-unknown-", 1)
    options = {"opt": 3, "reloc": "pic", "cpu": target.cpu, **target.options}
    machine = llvm.Target.from_triple(triple).create_target_machine(**options)
    module.triple, module.data_layout = triple, str(machine.target_data)
    for function in module.functions:
        if not function.is_declaration and function.name != f"call_{number}":
            function.linkage = "internal"
    passes = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=2))
    passes.getModulePassManager().run(module, passes)
    return machine.emit_object(module)


def other_order(text: str) -> str:
    """Returns the bytes of a constant of LLVM with each 8 of them in the other order."""
    letters = re.findall(r"\\\\|\\..|.", text, re.DOTALL)  # LLVM writes a backslash as two
    return "".join(itertools.chain.from_iterable(letters[k : k + 8][::-1] for k in range(0, len(letters), 8)))


def caller(number: int, about: dict[str, Any], kinds: list[str]) -> Iterator[str]:
    """Yields the LLVM code of a function that reads arguments from words and writes the result to words."""
    yield f'declare i32 @"{about["function"]}"({", ".join(kinds)})'
    yield f"define i32 @call_{number}(ptr %slots, ptr %out, ptr %error) {{"
    yield f"%result = alloca {about['result']}"
    values = ["ptr %result", "ptr %error"]
    for k, kind in enumerate(kinds[2:]):
        yield f"%p{k} = getelementptr i64, ptr %slots, i64 {k}"
        whole = kind in ("ptr", "i64", "double")
        yield f"%v{k} = load {kind}, ptr %p{k}" if whole else f"%w{k} = load i64, ptr %p{k}"
        if not whole:
            yield f"%v{k} = trunc i64 %w{k} to {kind}"
        values.append(f"{kind} %v{k}")
    yield f'%status = call i32 @"{about["function"]}"({", ".join(values)})'
    yield f"%r = load {about['result']}, ptr %result"
    for k, (path, kind) in enumerate(about["leaves"]):
        leaf = f"%l{k}"
        yield f"{leaf} = extractvalue {about['result']} %r, {', '.join(map(str, path))}" if path else ""
        leaf = leaf if path else "%r"
        yield f"%o{k} = getelementptr i64, ptr %out, i64 {k}"
        if re.fullmatch(r"i\d+", kind) and kind != "i64":
            yield f"%x{k} = zext {kind} {leaf} to i64"
            kind, leaf = "i64", f"%x{k}"
        yield f"store {kind} {leaf}, ptr %o{k}"
    yield "ret i32 %status"
    yield "}"


Row = tuple[list[int], list[Any], list[Any], list[Any]]


def packed_call(call: Call, numbers: list[int]) -> Row | None:
    """Returns a call for `pack`, or None if it cannot run.

    The row is the function, the arrays (before, after), and the words of the arguments and of the result.
    """
    if call.number not in numbers or call.error is not None:
        return None
    places: dict[tuple[int, int, int], tuple[int, Any, Any]] = {}  # by address and end; empty arrays are all kept
    indices = []
    for before, after, address in zip(arrays_of(call.arguments), call.after, call.addresses, strict=True):
        place = address, address + before.nbytes, 0 if before.nbytes else len(places)
        indices.append(places.setdefault(place, (len(places), before, after))[0])
    begins = sorted(place for place in places if place[0] < place[1])
    if any(one[1] > other[0] for one, other in itertools.pairwise(begins)):
        return None
    index = iter(indices)
    arguments = [(kind, next(index) if kind == 1 else value) for kind, value in words(call.arguments)]
    return [numbers.index(call.number)], [place[1:] for place in places.values()], arguments, [*words(call.result)]


def words(value: Any) -> Iterator[tuple[int, Any]]:
    """Yields the words of an argument or a result as numba flattens it.

    A word is its kind and value: 0 and a number, 1 and an array, or 2 and 0 for a pointer that is not used.
    """
    if isinstance(value, tuple):
        for item in value:
            yield from words(item)
    elif isinstance(value, np.ndarray):
        yield from ((2, 0), (2, 0), (0, value.size), (0, value.itemsize), (1, value))
        yield from ((0, number) for number in (*value.shape, *value.strides))
    elif isinstance(value, (float, np.floating)):
        yield 0, struct.unpack("<Q", struct.pack("<d", value))[0]
    elif isinstance(value, (bool, int, np.bool_, np.integer)):
        yield 0, int(value) & MASK
    else:
        yield 2, 0


def pack(rows: Sequence[Row], big: bool) -> bytes:
    """Returns the file of calls that `replay.c` reads."""
    head, body, places = [len(rows)], bytearray(), dict[int, int]()
    begin = 8 * (1 + sum(4 + 3 * len(arrays) + 2 * len(used) + 3 * len(results) for _, arrays, used, results in rows))

    def place(array: Any) -> int:
        if id(array) not in places:
            body.extend(bytes(-len(body) % 16))
            places[id(array)] = begin + len(body)
            body.extend((array.byteswap() if big else array).tobytes())
        return places[id(array)]

    for function, arrays, arguments, results in rows:
        head += [*function, len(arrays), len(arguments), len(results)]
        for before, after in arrays:
            head += [before.nbytes, place(before), place(after)]
        head += itertools.chain.from_iterable(arguments)
        for kind, value in results:
            head += [kind, *((place(value), value.nbytes) if kind == 1 else (value, 0))]
    return struct.pack(f"{'>' if big else '<'}{len(head)}Q", *head) + body


if __name__ == "__main__":
    print(json.dumps(replay(sys.argv[1], Path(sys.argv[2]))))
