import contextlib
import gc
import importlib
import operator
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numba
import numpy as np
import pytest
from numba.core.errors import TypingError
from numba.core.registry import cpu_target

from billiards_env.jit import compiler
from billiards_env.jit import decorators as jit
from billiards_env.physics import motion


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with a module of kernels, a module that it imports, and another one."""
    (tmp_path / "jit").mkdir()
    (tmp_path / "jit" / "__init__.py").write_text("from billiards_env.jit.decorators import entry_point, inlined\n")
    (tmp_path / "jit" / "decorators.py").write_text("")
    (tmp_path / "kernels.py").write_text("from billiards_env.jit import inlined\n")
    (tmp_path / "engine.py").write_text(
        "from billiards_env.constants import GAP\nfrom billiards_env.jit import entry_point as compiled\n"
    )
    (tmp_path / "constants.py").write_text("GAP = 1\n")
    (tmp_path / "other.py").write_text("x = 1\n")
    monkeypatch.setattr(jit, "_PACKAGE", tmp_path)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    return tmp_path


@pytest.mark.parametrize("name", ["jit/decorators.py", "kernels.py", "engine.py", "constants.py"])
def test_every_edit_of_a_kernel_or_its_constants_changes_the_hash(package, name):
    before = jit.source_hash()
    assert jit.source_hash() == before
    with (package / name).open("a") as file:
        file.write("# more\n")
    assert jit.source_hash() != before


def test_a_new_module_of_kernels_changes_the_hash(package):
    before = jit.source_hash()
    (package / "more.py").write_text("from billiards_env.jit import kernel\n")
    assert jit.source_hash() != before


def test_other_files_do_not_change_the_hash(package):
    before = jit.source_hash()
    (package / "other.py").write_text("x = 2\n")
    (package / "jit" / "notes.txt").write_text("x")
    assert jit.source_hash() == before


def test_every_module_with_a_decorator_is_hashed():
    """A module that uses a decorator has it, or `jit`, in its namespace, whatever the form of its import."""
    root = Path(jit.__file__).resolve().parents[1]
    decorators = [
        jit.kernel,
        jit.inlined,
        jit.allocating,
        jit.entry_point,
        jit.allocating_entry_point,
    ]
    hashed = jit.kernel_sources()
    for path in root.rglob("*.py"):
        if path.name == "__init__.py":  # has its submodules in its namespace, and no functions
            continue
        name = ".".join(path.relative_to(root.parent).with_suffix("").parts)
        names = vars(importlib.import_module(name)).values()
        if any(value is jit or any(value is decorator for decorator in decorators) for value in names):
            assert path in hashed


def test_the_cache_folder_is_in_the_package(package):
    assert jit.cache_folder() == package / "__pycache__" / f"kernels-{jit.source_hash()}"


def test_the_environment_variable_selects_the_cache_folder(package, monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "given"))
    assert jit.cache_folder() == tmp_path / "given" / f"kernels-{jit.source_hash()}"


def test_a_selected_folder_that_cannot_be_written_is_replaced_with_a_warning(package, monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    with pytest.warns(RuntimeWarning, match=r"NUMBA_CACHE_DIR = .*file': expected a folder that can be written"):
        assert jit.cache_folder() == package / "__pycache__" / f"kernels-{jit.source_hash()}"


def test_the_user_s_cache_replaces_a_package_folder_that_cannot_be_written(package):
    (package / "__pycache__").touch()  # no folder can be made here
    assert jit.cache_folder() == package / "user" / "billiards_env" / f"kernels-{jit.source_hash()}"


def test_kernels_compile_without_a_cache_folder_with_a_warning(package, monkeypatch):
    (package / "__pycache__").touch()
    (package / "user").touch()
    with pytest.warns(RuntimeWarning, match="set NUMBA_CACHE_DIR to one"):
        assert jit.cache_folder() is None
    monkeypatch.setattr(jit, "_FOLDER", None)
    double = jit.entry_point(lambda x: 2 * x)
    assert double(3) == 6


def test_an_entry_point_is_cached_and_numba_s_setting_does_not_change(tmp_path):
    (tmp_path / "module.py").write_text(
        "from billiards_env.jit import entry_point\n"
        "from numba.core import config\n"
        "before = config.CACHE_DIR\n"
        "@entry_point\n"
        "def double(x):\n"
        "    return 2 * x\n"
        "assert config.CACHE_DIR == before\n"
        "assert double(3) == 6\n"
        "print(sum(double.stats.cache_hits.values()))\n"
    )
    root = Path(jit.__file__).parents[2]
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": f"{root}{os.pathsep}{tmp_path}"}
    hits = [
        int(subprocess.run([sys.executable, "-m", "module"], env=env, check=True, capture_output=True).stdout)
        for _ in range(2)
    ]
    assert hits == [0, 1]
    assert list((tmp_path / "cache").glob("kernels-*/**/*.nbc"))


COMPILES = """
import sys, time
from billiards_env.physics import jit
jit.LONG = float(sys.argv[1])
for k in range(3):
    jit.entry_point(lambda x: k * x)(3)
time.sleep(0.1)
"""


@pytest.mark.parametrize(("seconds", "lines"), [(0.0, 1), (300.0, 0)])
def test_long_compilations_are_announced_in_one_line(tmp_path, seconds, lines):
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(Path(jit.__file__).parents[2])}
    code = tmp_path / "compiles.py"
    code.write_text(COMPILES)
    done = subprocess.run([sys.executable, code, str(seconds)], env=env, check=True, capture_output=True, text=True)
    said = done.stderr.splitlines()
    assert said == ["billiards_env: compiling, up to a minute, kept for later runs ..."] * lines


def test_code_in_the_cache_is_loaded_without_a_message(tmp_path):
    (tmp_path / "shoots.py").write_text("from billiards_env.physics import jit\njit.LONG = 0.0\n" + SHOOTS)
    for lines in (1, 0):
        env = os.environ | {
            "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
            "PYTHONPATH": str(Path(jit.__file__).parents[2]),
        }
        start = [sys.executable, tmp_path / "shoots.py"]
        done = subprocess.run(start, env=env, check=True, capture_output=True, text=True)
        assert len(done.stderr.splitlines()) == lines


SHOOTS = """
import sys
from billiards_env.physics import jit
@jit.entry_point
def double(x):
    return 2 * x
assert double(3) == 6
"""


def shoot(tmp_path, cache):
    """Runs SHOOTS with a cache folder; returns the lines on stderr."""
    (tmp_path / "shoots.py").write_text(SHOOTS)
    root = Path(jit.__file__).parents[2]
    env = os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": f"{root}{os.pathsep}{tmp_path}"}
    start = [sys.executable, "-m", "shoots"]
    return subprocess.run(start, env=env, check=True, capture_output=True, text=True).stderr.splitlines()


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_truncated_cache_is_discarded_with_one_line(tmp_path, suffix, share):
    """Numba alone raises EOFError or UnpicklingError in every process until the folder is deleted."""
    assert shoot(tmp_path, tmp_path / "cache") == []
    (path,) = (tmp_path / "cache").glob(f"kernels-*/**/*.{suffix}")
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    (line,) = shoot(tmp_path, tmp_path / "cache")
    assert line.startswith("billiards_env: discards a damaged cache file: __main__.double in ")
    assert shoot(tmp_path, tmp_path / "cache") == []
    assert path.stat().st_size > 0


def test_a_cache_that_cannot_be_written_prints_a_line_and_the_call_succeeds(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(jit, "_FOLDER", tmp_path)

    def fail(self, key, data):
        raise OSError("disk full")

    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.save", fail)
    assert calling(jit.kernel(lambda x: 2 * x))(3) == 7
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("billiards_env: cannot keep compiled code: ")


def test_a_process_warns_once_about_a_cache_folder_that_cannot_be_written(tmp_path):
    (tmp_path / "file").touch()
    code = "import warnings; warnings.simplefilter('always'); from billiards_env import engine, envs"
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "file"), "PYTHONPATH": str(Path(jit.__file__).parents[2])}
    done = subprocess.run([sys.executable, "-c", code], env=env, check=True, capture_output=True, text=True)
    assert done.stderr.count("RuntimeWarning") == done.stderr.count("NUMBA_CACHE_DIR = ") == 1


def test_processes_that_compile_at_the_same_time_share_one_cache(tmp_path):
    (tmp_path / "shoots.py").write_text(SHOOTS)
    root = Path(jit.__file__).parents[2]
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": f"{root}{os.pathsep}{tmp_path}"}
    start = [sys.executable, "-W", "error", "-m", "shoots"]
    started = [subprocess.Popen(start, env=env) for _ in range(4)]
    assert [process.wait() for process in started] == [0] * 4
    index = next((tmp_path / "cache").glob("kernels-*/**/*.nbi"))
    kept = {path.name for path in index.parent.iterdir()}
    subprocess.run(start, env=env, check=True)
    assert {path.name for path in index.parent.iterdir()} == kept


def calling(inner):
    return jit.allocating_entry_point(lambda x: inner(x) + 1)


@pytest.mark.parametrize("decorate", [jit.kernel, jit.inlined, jit.allocating])
def test_the_wrapper_for_python_is_compiled_only_if_python_calls_the_kernel(decorate):
    double = decorate(lambda x: 2 * x)
    assert calling(double)(3) == 7
    (compiled,) = double.overloads.values()
    assert not [f.name for f in compiled.library.get_defined_functions() if "cpython" in f.name or "cfunc" in f.name]
    assert double(3) == 6


@pytest.mark.parametrize("decorate", [jit.kernel, jit.inlined, jit.allocating])
def test_only_the_callers_of_a_kernel_have_machine_code(decorate):
    double: Any = decorate(lambda x: 2 * x)
    caller: Any = calling(double)
    caller(3)
    for function, expected in ((double, False), (caller, True)):
        (compiled,) = function.overloads.values()
        engine = compiled.library._codegen._engine
        assert engine.is_symbol_defined(compiled.fndesc.llvm_func_name) is expected


def test_a_constant_as_an_argument_does_not_compile_a_kernel_again():
    power: Any = jit.kernel(lambda x, y: x**y)
    caller: Any = jit.entry_point(lambda x: power(x, x) + power(x, 2) + power(3, y=x) + power(4, 5))
    assert caller(2) == 4 + 4 + 9 + 1024
    assert len(power.overloads) == 1


def half(x):
    for _ in range(3):
        x = x / 2
    return x


def test_callers_optimise_inlined_kernels():
    code = []
    functions: Any = jit.kernel(half), jit.inlined(half)
    for function in functions:
        assert calling(function)(8) == 2.0
        (compiled,) = function.overloads.values()
        code.append(compiled.library.get_llvm_str())
    optimised, plain = code
    assert "alloca" in plain
    assert "alloca" not in optimised


def test_a_kernel_does_not_inherit_the_inlining_of_its_caller():
    inner: Any = jit.kernel(half)
    outer: Any = jit.inlined(lambda x: inner(x))
    calling(outer)(8)
    for function, expected in ((inner, False), (outer, True)):
        (compiled,) = function.overloads.values()
        assert compiled.fndesc.inline is expected


class Switches(NamedTuple):
    up: bool
    down: bool


class Numbers(NamedTuple):
    nothing: None
    array: np.ndarray
    switches: Switches


@pytest.mark.parametrize("decorate", [jit.kernel, jit.inlined])
def test_functions_pass_and_return_named_tuples(decorate):
    """A bool has 1 bit as a value and 8 bits in a result."""

    def swap(numbers, number):
        switches = numbers.switches
        return Numbers(numbers.nothing, numbers.array[number:], Switches(switches.down, switches.up)), number

    swap = decorate(swap)

    def run(array, up, out):
        numbers, number = swap(Numbers(None, array, Switches(up, not up)), 2)
        out[0], out[1], out[2], out[3] = number, numbers.array[0], numbers.switches.up, numbers.switches.down

    out = np.zeros(4)
    for up in (False, True):
        jit.entry_point(run)(np.arange(5.0), up, out)
        assert list(out) == [2, 2, not up, up]


def test_a_function_of_numba_s_own_compiler_cannot_call_a_kernel():
    """It passes NamedTuples as separate words."""
    double: Any = jit.kernel(lambda x: 2 * x)
    with pytest.raises(TypingError, match=r"expected a caller with a decorator of billiards_env\.physics\.jit"):
        numba.njit(lambda x: double(x))(3)


def test_kernels_are_plain_functions_if_numba_is_disabled():
    root = Path(jit.__file__).parents[2]
    code = "from billiards_env.physics import motion as m; assert m.norm(3, 4) == 5 and not hasattr(m.norm, 'py_func')"
    env = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(root)}
    subprocess.run([sys.executable, "-c", code], env=env, check=True)


@pytest.mark.parametrize(
    ("allocates", "other"), [(jit.allocating, jit.kernel), (jit.allocating_entry_point, jit.entry_point)]
)
def test_only_allocating_functions_can_create_arrays(allocates, other):
    assert allocates(lambda n: np.zeros(n).sum())(3) == 0.0
    with pytest.raises(TypingError):
        other(lambda n: np.zeros(n).sum())(3)


@pytest.mark.parametrize("decorate", [jit.kernel, jit.entry_point])
def test_a_function_that_cannot_create_arrays_cannot_call_an_allocating_one(decorate):
    """Without the check, numba compiles the call if `make` is compiled already, and the arrays are never freed."""
    make: Any = jit.allocating(lambda n: np.zeros(n))
    assert jit.allocating_entry_point(lambda n: make(n)[0])(3) == 0.0
    with pytest.raises(TypingError, match="expected a caller that may create arrays"):
        calling(decorate(lambda n: make(n)[0]))(3)


def test_an_entry_point_keeps_the_reference_counts_of_its_arrays():
    add: Any = jit.entry_point(lambda arrays: arrays[0].shape[0] + arrays[1][0])
    arrays = np.ones(3), np.ones(2)
    before = [sys.getrefcount(array) for array in arrays]
    for _ in range(10):
        assert add(arrays) == 4.0
    assert [sys.getrefcount(array) for array in arrays] == before


@pytest.mark.parametrize("function", [lambda x: x + 1, lambda x: x.missing])
@pytest.mark.parametrize(("first", "expected"), [(700, 100_000), (0, 0)])
def test_a_compilation_raises_and_restores_the_thresholds_of_the_garbage_collector(
    function, first, expected, monkeypatch
):
    before, during, original = gc.get_threshold(), [], compiler.ShortCompiler.compile_extra

    def compile_extra(self, func):
        during.append(gc.get_threshold()[0])
        return original(self, func)

    monkeypatch.setattr(jit, "_FOLDER", None)
    monkeypatch.setattr(compiler.ShortCompiler, "compile_extra", compile_extra)
    gc.set_threshold(first)
    try:
        with contextlib.suppress(TypingError):
            jit.entry_point(function)(3)
        assert (during, gc.get_threshold()[0]) == ([expected], first)
    finally:
        gc.set_threshold(*before)


def test_a_kernel_can_be_copied_to_another_process():
    copy = pickle.loads(pickle.dumps(motion.norm))
    assert copy(3.0, 4.0) == 5.0
    code = f"import pickle; assert pickle.loads({pickle.dumps(motion.norm)!r})(3.0, 4.0) == 5.0"
    env = os.environ | {"PYTHONPATH": str(Path(jit.__file__).parents[2])}
    subprocess.run([sys.executable, "-c", code], env=env, check=True)


def test_a_pickled_environment_runs_shots_in_another_process(tmp_path):
    """It refers to entry points, which the other process compiles again, with the same compiler."""
    made: Any = gym.make("Billiards-v0")
    made.reset(seed=0)
    path = tmp_path / "env.pickle"
    path.write_bytes(pickle.dumps(made))
    code = f"import pickle; env = pickle.load(open({str(path)!r}, 'rb')); env.step(env.action_space.sample())"
    env = os.environ | {"PYTHONPATH": str(Path(jit.__file__).parents[2])}
    subprocess.run([sys.executable, "-c", code], env=env, check=True)


def test_the_signature_of_an_operator_is_resolved_once_for_the_same_types():
    original: Any = cpu_target.typing_context
    signatures = compiler._typing_context(original)._signatures
    assert jit.entry_point(lambda x, y: x[0] + y)(np.ones(2), 2) == 3.0
    first = dict(signatures)
    assert {getattr(key[0], "typing_key", key[0]) for key in first} >= {operator.add, operator.getitem}
    assert jit.entry_point(lambda x, y: x[1] + y)(np.ones(2), 2) == 3.0
    assert all(signatures[key] is first[key] for key in first)
    assert len(signatures) == len(first)


def test_options_are_equal_if_the_same_ones_are_set_to_the_same_values():
    options, other = compiler._Flags(), compiler._Flags()
    assert options == other
    assert hash(options) == hash(other)
    setattr(other, "nrt", True)  # noqa: B010  (a property that numba creates)
    assert options != other
    assert other == other.copy()
    assert hash(other) == hash(other.copy())


def test_a_division_by_zero_is_an_infinity_and_nothing_is_reassociated():
    divide = jit.kernel(lambda x, y: x / y)
    assert divide(1.0, 0.0) == float("inf")
    lost = jit.kernel(lambda x, y: (x + y) - x)
    assert lost(1e16, 1.0) == 0.0
    fused = jit.kernel(lambda x, y: x * x - y)
    x = 1.0 + 2.0**-30
    assert fused(x, x * x) == 0.0  # a fused multiply-add would give the rounding error of x * x
