"""Compiles the engines to WebAssembly: `python -m docs.web.build`, or `make page`.

Writes three files: `engine.wasm`, the JavaScript module `engine.js`, and `play.html`, a page that contains both. The
package gets a copy of the page, which `billiards web` opens. Needs the packages of the extra `web`, unless `build/web`
has the engines of these kernels.

Numba compiles the same functions that Python calls, with the same types of arguments. Its own optimisation is left out,
because it uses the size of a pointer on this machine. LLVM then optimises the code for wasm32, and the linker of the
package `ziglang` links it with `runtime.c`. The kernels use only `+ - * /` and `sqrt`, so WebAssembly computes the same
bits. The section "billiards" of `engine.wasm` contains the scenes as arrays.
"""

from __future__ import annotations

import argparse
import base64
import functools
import gc
import hashlib
import importlib.util
import json
import math
import re
import subprocess
import sys
import tempfile
import zlib
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter
from typing import Any
from unittest.mock import patch

import llvmlite
import llvmlite.binding as llvm
import numba
import numpy as np
from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler_lock import global_compiler_lock
from numba.core.types.functions import BaseFunction
from numpy.typing import NDArray

from billiards_env.__main__ import PLAY_PAGE
from billiards_env.commands import ending
from billiards_env.drawing import page
from billiards_env.engine import compile as compiling
from billiards_env.engine import frozen_strike, pic, pit, strikes
from billiards_env.engine.compile import PIC, scene_fields, scene_kernels
from billiards_env.engine.log import KINDS, empty_log
from billiards_env.engine.overlaps import FIXES, TREATMENTS
from billiards_env.engine.shot_input import is_valid_fast
from billiards_env.engine.shots import STATUS, empty_shots, start_fields
from billiards_env.jit.code_hash import code_hash
from billiards_env.jit.compiler import Kernel, _resolve_once
from billiards_env.physics.strike import cue_numbers, many_strikes
from billiards_env.scene import PARAMETERS, Scene, layouts
from billiards_env.support.checks import RANGES, range_text
from billiards_env.support.files import write_atomically
from studies.failures import FAILURES

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
NUMBA = "0.68"
"""The version of numba whose calling convention the build uses."""

SECTION = "billiards"
TRIPLE, FEATURES = "wasm32-unknown-unknown", "+bulk-memory,+mutable-globals,+nontrapping-fptoint,+sign-ext"
STACK = 1 << 20  # bytes

SCENES = "pool", "carom", "ideal", "blocked_pool", "sum_to_three", "real_pool", "real_carom"
BALLS = 15
"""Largest number of object balls."""

OPPONENT = "five_balls"
"""The published policy that plays in the page."""

GAMES = {
    "nine": ("Nine ball", ("pool", "real_pool"), "nine_ball", 9),
    "duel": ("Against the computer", ("pool",), "random", 5),
    "free": ("Free table", ("pool", "real_pool"), "random", 3),
    "carom": ("Carom", ("carom", "real_carom"), "carom_opening", 2),
}
"""The games of the page: the title, the tables, the layout and the number of object balls."""


def scenes() -> dict[str, Scene]:
    """Returns the scenes of the module by name: `SCENES` and those of the four failures of a timestep."""
    return {name: Scene.named(name, BALLS) for name in SCENES} | {name: case.scene for name, case in FAILURES.items()}


@functools.cache
def entry_points() -> list[tuple[str, Any, tuple[Any, ...]]]:
    """Returns the functions that JavaScript calls: the name in the module, the compiled function, example arguments."""
    cue = tuple(cue_numbers(Scene.named("pool")))
    calls: list[tuple[str, Any, tuple[Any, ...]]] = []
    for kind in dict.fromkeys(map(kind_of, scenes().values())):
        scene = Scene.named(kind, 1)
        shots, log = tuple(empty_shots(1, scene.n_balls)), tuple(empty_log(1, 1))
        kernels, fields, starts = scene_kernels(scene), scene_fields(scene), start_fields(shots)
        run = 0, 1, fields, math.inf, 1, shots, log
        calls.append((f"pic_{kind}", pic.run_shots, (pic.PicKernels(kernels, pic.ALL_PAIRS), *run)))
        calls += [
            (f"pit_{kind}_{name}", pit.run_shots, (pit.PitKernels(kernels, fix.kernels), *run))
            for name, fix in TREATMENTS.items()
        ]
        calls.append((f"valid_{kind}", is_valid_fast, (kernels, 0, 1, fields, starts)))
        calls.append((f"drive_{kind}", frozen_strike._drive, (kernels, 0, 1, 0, cue, fields, starts)))
    strike = np.empty((1, 5)), np.empty((1, 2)), np.empty((1, 3)), np.empty(1, np.bool_)
    calls.append(("strike", many_strikes, (cue, *strike)))
    return calls


@functools.cache
def kind_of(scene: Scene) -> str:
    """Returns the first of `SCENES` that has the types of a scene, and so the same compiled code."""

    def types(scene: Scene) -> Any:
        return numba.typeof((scene_kernels(scene), scene_fields(scene)))

    return next(name for name in SCENES if types(Scene.named(name)) == types(scene))


def as_json(value: Any) -> Any:
    """Returns an argument of an entry point as JSON: arrays as their type, shape and content, kernels as []."""
    if isinstance(value, tuple):
        return [as_json(item) for item in value]
    if isinstance(value, np.ndarray):
        content = [plain_number(number) for number in value.ravel().tolist()]
        return {"type": value.dtype.str[1:], "shape": list(value.shape), "content": content}
    if isinstance(value, Kernel):
        return []
    return plain_number(value) if isinstance(value, float) else value


def plain_numbers(record: NDArray[Any]) -> dict[str, Any]:
    """Returns the numbers of a scene as JSON, by name."""
    names: Any = record.dtype.names
    integers = [name for name in names if record.dtype[name].kind == "i"]
    return {"content": {name: plain_number(record[name][0].item()) for name in names}, "integers": integers}


def plain_number(number: float) -> float | str:
    """Returns a number as JSON, which has no infinity."""
    return number if math.isfinite(number) else "Infinity" if number > 0 else "-Infinity"


class Product:
    """A number of `Physics` or a product of two numbers, as JSON: a name or a list of two factors."""

    def __init__(self, form: Any) -> None:
        self.form = form

    def __mul__(self, other: Any) -> Product:
        return Product([self.form, other.form if isinstance(other, Product) else other])

    def __rmul__(self, other: float) -> Product:
        return Product([other, self.form])


def formulas(scene: Scene) -> dict[str, Any]:
    """Returns how the numbers of the engine follow from those of `Physics`: the forms of products, by name."""
    names: Any = {name: Product(name) for name in PARAMETERS if getattr(scene.physics, name) is not None}
    numbers = compiling._numbers(scene, PIC, names)._asdict()
    return {name: number.form for name, number in numbers.items() if isinstance(number, Product)}


def ranges() -> dict[str, Any]:
    """Returns the ranges of the arguments that JavaScript checks, by name.

    Each is the smallest value, the largest one, the text of the error of Python, and whether only whole numbers fit.
    """
    keys = {name: parameter.within for name, parameter in PARAMETERS.items()}
    keys |= {"dt": "dt", "maxTime": "limit", "maxEvents": "max_events"}
    whole = "maxEvents"
    texts = {name: range_text("a whole number" if name == whole else "a number", key) for name, key in keys.items()}
    texts["dt"] = f"the timestep, {texts['dt']}, such as 1/60"
    for name, key in (strikes._PARAMETERS | {"velocities": "speed", "spins": "spin"}).items():
        keys[name], texts[name] = key, range_text("numbers", key)
    return {name: [RANGES[key].least, RANGES[key].most, texts[name], name == whole] for name, key in keys.items()}


def data() -> dict[str, Any]:
    """Returns what the JavaScript module reads from the section `SECTION`."""
    return {
        "kinds": KINDS,
        "status": STATUS,
        "fixes": FIXES,
        "ranges": ranges(),
        "scenes": {
            name: {
                "kind": kind_of(scene),
                "kernels": as_json(pic.PicKernels(scene_kernels(scene), pic.ALL_PAIRS)),
                "fields": [plain_numbers(scene_fields(scene)[0]), *as_json(scene_fields(scene)[1:])],
                "cue": list(cue_numbers(scene)) if scene.physics.motion == "sliding" else None,
                "max_time": scene.physics.max_time,
                "motion": scene.physics.motion,
                "cushion": scene.physics.cushion,
                "physics": {name: value for name in PARAMETERS if (value := getattr(scene.physics, name)) is not None},
                "formulas": formulas(scene),
            }
            for name, scene in scenes().items()
        },
    }


def check_versions() -> None:
    """Raises a RuntimeError if the extra `web` is not installed or numba is not the version that the build supports."""
    if not numba.__version__.startswith(NUMBA + "."):
        raise RuntimeError(
            f"numba = {numba.__version__}: expected numba {NUMBA}; other versions have other calling conventions"
        )
    if importlib.util.find_spec("ziglang") is None:
        raise RuntimeError("ziglang is not installed: expected the extra `web`, as `make page` installs it")


def compile_entry(name: str, function: Any, arguments: tuple[Any, ...]) -> bytes:
    """Returns the object file of a compiled function, with the given name."""
    signature = tuple(numba.typeof(argument) for argument in arguments)
    kernel = Kernel(function.py_func, None, function.targetoptions)
    gc.disable()  # as for an entry point
    with global_compiler_lock:
        kernel.compile(signature)
        compiled = kernel.overloads[signature]
        compiled.library.link()
    gc.enable()
    text = re.sub(r"^target .*$", "", compiled.library.get_llvm_str(), flags=re.MULTILINE)
    # wasm has no common symbols, and has instructions for these functions of the C library
    text = text.replace("= common global", "= internal global")
    text = text.replace("@sqrt(", "@llvm.sqrt.f64(").replace("@ceil(", "@llvm.ceil.f64(")
    module = llvm.parse_assembly(text)
    machine = llvm.Target.from_triple(TRIPLE).create_target_machine(features=FEATURES, opt=3)
    module.triple, module.data_layout = TRIPLE, str(machine.target_data)
    module.get_function(compiled.fndesc.llvm_func_name).name = name
    for defined in module.functions:
        if not defined.is_declaration:
            defined.add_function_attribute("optsize")
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=2))
    builder.getModulePassManager().run(module, builder)
    return machine.emit_object(module)


def build_engine(path: Path) -> None:
    """Writes the file `engine.wasm`, in a process that has not compiled any kernel."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    zig = sys.executable, "-m", "ziglang"
    with tempfile.TemporaryDirectory() as folder, ExitStack() as patches:
        for name in ("_optimize_functions", "_optimize_final_module"):
            patches.enter_context(patch.object(CPUCodeLibrary, name, lambda *_: None))
        patches.enter_context(patch.object(BaseFunction, "get_call_type", _resolve_once))  # as for an entry point
        objects, exports = [f"{folder}/runtime.o"], ["allocate", "reset"]
        target = "-target", "wasm32-freestanding", "-mcpu=generic+bulk_memory", "-O2", "-c"
        subprocess.run([*zig, "cc", *target, str(HERE / "runtime.c"), "-o", objects[0]], check=True)
        for k, (name, function, arguments) in enumerate(entry_points(), start=1):
            begin = perf_counter()
            objects.append(f"{folder}/{name}.o")
            exports.append(name)
            Path(objects[-1]).write_bytes(compile_entry(name, function, arguments))
            print(f"engine {k} of {len(entry_points())}: {name}, {perf_counter() - begin:.1f} s", flush=True)
        linked = Path(folder, "engine.wasm")
        options = "--no-entry", "--gc-sections", "--strip-all", "--stack-first", "-z", f"stack-size={STACK}"
        exported = [f"--export={name}" for name in exports]
        subprocess.run([*zig, "wasm-ld", *options, *exported, *objects, "-o", str(linked)], check=True)
        content = linked.read_bytes() + section(SECTION, zlib.compress(json.dumps(data()).encode(), 9))
    write_atomically(path, content)


def section(name: str, content: bytes) -> bytes:
    """Returns a custom section of a WebAssembly file."""
    content = length(len(name)) + name.encode() + content
    return b"\0" + length(len(content)) + content


def length(number: int) -> bytes:
    """Returns a non-negative integer as LEB128."""
    low, rest = number & 127, number >> 7
    return bytes([low | 128]) + length(rest) if rest else bytes([low])


def module() -> str:
    """Returns the JavaScript module, with its checks."""
    return "\n".join((HERE / name).read_text(encoding="utf-8") for name in ("engine.js", "checks.js"))


def opponent() -> dict[str, Any]:
    """Returns the policy `OPPONENT` as JSON for `policy.js`: the shapes of its weights, and their numbers as base64."""
    from billiards_env.sb3 import load_policy  # PyTorch

    arguments, policy = load_policy(ROOT / "studies" / "results" / "policies" / OPPONENT)
    network: Any = policy.net
    weights = {name: one for name, one in network.state_dict().items() if not name.startswith("critic")}
    return {
        "shapes": {name: list(one.shape) for name, one in weights.items()},
        "numbers": packed(b"".join(one.numpy().tobytes() for one in weights.values())),
        "halfExtents": Scene.named("pool").half_extents,
        "maxSpeed": arguments["max_speed"],
    }


def packed(content: bytes) -> str:
    """Returns bytes deflated, as base64."""
    return base64.b64encode(zlib.compress(content, 9)).decode()


def play_page(engine: bytes) -> str:
    """Returns `play.html`, which contains the engines, the module and the drawings of the tables."""
    carom_scenes = {name: Scene.named(name) for name in SCENES if not Scene.named(name).table.pockets}  # balls of carom
    shown = scenes() | carom_scenes
    drawn = {
        "tables": {
            name: page.table_data(scene) | {"length": scene.table.length, "width": scene.table.width}
            for name, scene in shown.items()
        },
        "games": {
            name: {"title": title, "scenes": names, "positions": {one: rack_of(layout, balls, one) for one in names}}
            for name, (title, names, layout, balls) in GAMES.items()
        },
        "failures": {
            name: {field: getattr(case, field) for field in ("title", "text", "positions", "velocities", "dt")}
            for name, case in FAILURES.items()
        },
        "opponent": opponent(),
    }
    text = (HERE / "play.html").read_text(encoding="utf-8")
    for name, content in (
        ("drawing", page.page_file("table.js")),
        ("module", module().replace("export ", "")),
        ("policy", (HERE / "policy.js").read_text(encoding="utf-8").replace("export ", "")),
        ("data", json.dumps(drawn, separators=(",", ":")).replace("<", "\\u003c")),
        ("engine", packed(engine)),
    ):
        text = text.replace(f"{{{{{name}}}}}", content)
    return text


def rack_of(layout: str, balls: int, scene: str) -> list[list[float]]:
    """Returns the positions of a layout, the same each time."""
    return layouts.draw(layout, Scene.named(scene, balls), np.random.default_rng(3)).tolist()


def engine_file() -> bytes:
    """Returns `engine.wasm` from `build/web`, and compiles it there if the kernels or this file have changed."""
    parts = Path(__file__), HERE / "runtime.c"
    hashes = (code_hash(function.py_func).encode() for _, function, _ in entry_points())
    sources = *(path.read_bytes() for path in parts), *hashes
    versions = f"{numba.__version__} {llvmlite.__version__}".encode()
    kept = ROOT / "build" / "web" / f"{hashlib.sha256(b''.join((*sources, versions))).hexdigest()[:16]}.wasm"
    if not kept.exists():  # in a new process, because kernels that are already compiled are optimised for this machine
        check_versions()
        print("compiling the engines for browsers, about a minute", flush=True)
        program = "import pathlib, sys; from docs.web import build; build.build_engine(pathlib.Path(sys.argv[1]))"
        subprocess.run([sys.executable, "-c", program, str(kept)], check=True, cwd=ROOT)
    return kept.read_bytes()


def files() -> dict[str, bytes]:
    """Returns the files that the site has, by name."""
    engine = engine_file()
    return {"engine.wasm": engine, "engine.js": module().encode(), "play.html": play_page(engine).encode()}


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m docs.web.build --help`."""
    parser = argparse.ArgumentParser(prog="python -m docs.web.build", description="Compile the engines to WebAssembly.")
    parser.add_argument("--output", type=Path, default=ROOT / "site", help="the folder of the files")
    parser.add_argument("--page", type=Path, default=PLAY_PAGE, help="the copy of the page (default: %(default)s)")
    args = parser.parse_args(arguments)
    with ending():
        made = {args.output / name: content for name, content in files().items()}
        for path, content in (made | {args.page: made[args.output / "play.html"]}).items():
            write_atomically(path, content)
            print(f"{path}: {len(content) / 1000:.0f} kB")


if __name__ == "__main__":
    main()
