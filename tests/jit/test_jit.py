import ctypes
import pickle
import shutil
import sys
from typing import Any, NamedTuple

import gymnasium as gym
import numba
import numpy as np
import pytest
from numba.core.errors import NumbaWarning, TypingError

from billiards_env.jit import compiler, folders
from billiards_env.jit import decorators as jit
from billiards_env.physics import elementary
from tests.helpers.arrays import counted_arrays
from tests.helpers.processes import run, start


@pytest.fixture
def package(tmp_path, monkeypatch):
    """The folder of a package, with its decorators."""
    (tmp_path / "jit").mkdir()
    (tmp_path / "jit" / "decorators.py").write_text("")
    monkeypatch.setattr(folders, "_PACKAGE", tmp_path)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    return tmp_path


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """The folder of the compiled code, which is empty."""
    monkeypatch.setattr(jit, "_FOLDER", tmp_path / "cache")
    monkeypatch.setattr(compiler, "LONG", 300.0)  # no announcement on a busy machine
    return tmp_path / "cache"


def double(x):
    return 2 * x


def half(x):
    for _ in range(3):
        x = x / 2
    return x


def calling(inner):
    return jit.entry_point(lambda x: inner(x) + 1)


def test_the_cache_folder_is_selected_in_the_package_or_the_user_s(package, monkeypatch):
    name = f"kernels-{folders.versions_hash()}"
    assert folders.cache_folder() == package / "__pycache__" / name
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(package / "given"))
    assert folders.cache_folder() == package / "given" / name
    (package / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(package / "file"))
    with pytest.warns(RuntimeWarning, match=r"NUMBA_CACHE_DIR = .*file': expected a folder that can be written"):
        assert folders.cache_folder() == package / "__pycache__" / name
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    shutil.rmtree(package / "__pycache__")
    (package / "__pycache__").touch()  # no folder can be made here
    assert folders.cache_folder() == package / "user" / "billiards_env" / name


def test_functions_compile_without_a_cache_folder_with_a_warning(package, monkeypatch):
    (package / "__pycache__").touch()
    (package / "user").touch()
    with pytest.warns(RuntimeWarning, match="NUMBA_CACHE_DIR = None: expected a folder that can be written; every"):
        assert folders.cache_folder() is None
    monkeypatch.setattr(jit, "_FOLDER", None)
    assert jit.entry_point(double)(3) == 6


@pytest.mark.parametrize(("seconds", "lines"), [(0.0, 3), (300.0, 0)])
def test_each_long_compilation_is_announced_in_one_line(cache, monkeypatch, capsys, seconds, lines):
    monkeypatch.setattr(compiler, "LONG", seconds)
    for function in (double, half, lambda x: x):
        jit.entry_point(function)(3)
    said = capsys.readouterr().err.splitlines()
    assert said == ["billiards_env: compiling, up to a minute ..."] * lines


DOUBLES = """
from numba.core import config
from billiards_env.jit import compiler, decorators as jit
compiler.LONG, before = 0.0, config.CACHE_DIR
@jit.entry_point
def double(x):
    return 2 * x
assert config.CACHE_DIR == before  # other packages keep their folder
assert double(3) == 6
print(sum(double.stats.cache_hits.values()))
"""


def test_processes_share_a_cache_and_load_its_code_without_a_message(tmp_path):
    (tmp_path / "doubles.py").write_text(DOUBLES)
    command = "-W", "error", str(tmp_path / "doubles.py")
    folder = tmp_path / "cache"
    for process in [start(*command, NUMBA_CACHE_DIR=str(folder)) for _ in range(2)]:  # at the same time
        assert process.communicate()[0] in {"0\n", "1\n"}
    files = {path.name: path.stat().st_mtime_ns for path in folder.glob("kernels-*/**/*.nb[ci]")}
    assert len(files) == 2
    assert run(*command, NUMBA_CACHE_DIR=str(folder)) == ("1\n", "")
    assert {path.name: path.stat().st_mtime_ns for path in folder.glob("kernels-*/**/*.nb[ci]")} == files


CALLS = """
from billiards_env.jit import compiler, decorators as jit
compiler.LONG = 300.0
@jit.kernel
def half(x):
    return x / 2
@jit.entry_point
def quarter(x):
    return half(half(x))
assert quarter(8.0) == 2.0
print(sum(quarter.stats.cache_hits.values()))
"""


def test_code_without_optimisation_is_cached(tmp_path):
    (tmp_path / "calls.py").write_text(CALLS)
    variables = {"NUMBA_OPT": "0", "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert [run(str(tmp_path / "calls.py"), **variables) for _ in range(2)] == [("0\n", ""), ("1\n", "")]


def test_code_with_an_address_of_the_process_is_not_cached(cache):
    address = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(abs)
    function = jit.entry_point(lambda x: address(x))
    with pytest.warns(NumbaWarning, match="as it uses dynamic globals"):
        assert function(-3.0) == 3.0
    assert not list(cache.rglob("*.nbc"))


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_a_truncated_cache_is_discarded_with_one_line(cache, capsys, suffix):
    """Numba alone raises EOFError or UnpicklingError in every process until the folder is deleted."""
    assert hits() == 0
    (path,) = cache.rglob(f"*.{suffix}")
    content = path.read_bytes()
    for share in (0.0, 0.3, 0.9):
        path.write_bytes(content[: int(share * len(content))])
        assert hits() == 0
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("billiards_env: discards the compiled code of double in ")
        assert hits() == 1
        assert capsys.readouterr().err == ""


def test_a_cache_that_cannot_be_written_prints_a_line_and_the_call_succeeds(cache, monkeypatch, capsys):
    def fail(self, key, data):
        raise OSError("disk full")

    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.save", fail)
    assert jit.entry_point(double)(3) == 6
    (line,) = capsys.readouterr().err.splitlines()
    assert "disk full" in line


CHANGES = [
    (lambda patch: None, True),
    (lambda patch: patch.setenv("BILLIARDS_ENV_COMPILE", "0"), True),
    (lambda patch: patch.setenv("BILLIARDS_ENV_COMPILE", "1"), False),
    (lambda patch: patch.setattr(folders.numba, "__version__", "0.0"), False),
    (lambda patch: patch.setattr(folders.llvmlite, "__version__", "0.0"), False),
    (lambda patch: patch.setattr(sys.implementation, "cache_tag", "cpython-30"), False),
    (lambda patch: (folders._PACKAGE / "jit" / "decorators.py").write_text("more = 1"), False),
]


@pytest.mark.parametrize(("change", "is_shipped"), CHANGES)
def test_the_code_of_the_package_is_found_for_its_versions_and_decorators(package, monkeypatch, change, is_shipped):
    assert folders.shipped_folder() is None
    expected = folders.code_folder()
    expected.mkdir(parents=True)
    change(monkeypatch)
    assert folders.shipped_folder() == (expected if is_shipped else None)


def test_a_wrong_choice_of_code_is_rejected(package, monkeypatch):
    monkeypatch.setenv("BILLIARDS_ENV_COMPILE", "yes")
    with pytest.raises(ValueError, match="BILLIARDS_ENV_COMPILE = 'yes': expected '0' or '1'"):
        folders.shipped_folder()


@pytest.fixture
def shipped(cache, tmp_path, monkeypatch):
    """The folder of the package with the code of `double` for int64 and any CPU; `cache` is empty."""
    monkeypatch.setattr(jit, "_SHIPPED", tmp_path / "shipped")
    made: Any = jit.entry_point(double)
    assert made(3) == 6
    made = made._cache._cache_file
    overloads = {(sig, (magic[0], *jit.GENERIC), code): name for (sig, magic, code), name in made._load_index().items()}
    made._save_index(overloads)
    (tmp_path / "shipped").mkdir()
    (source,) = (path for path in cache.iterdir() if path.is_dir())  # the others are locks
    source.rename(tmp_path / "shipped" / source.name)
    return tmp_path / "shipped"


def hits(number: float = 3) -> int:
    """Returns the number of functions that a new `double` loads for a call."""
    function: Any = jit.entry_point(double)
    assert function(number) == 2 * number
    return sum(function.stats.cache_hits.values())


@pytest.mark.parametrize("folder", [True, False])
def test_the_code_of_the_package_is_used_also_without_a_cache_folder(shipped, cache, monkeypatch, folder):
    if not folder:
        monkeypatch.setattr(jit, "_FOLDER", None)
    assert hits() == 1
    assert list(cache.rglob("*.nb[ci]")) == []
    assert hits(0.5) == 0  # not in the package
    assert len(list(cache.rglob("*.nb[ci]"))) == 2 * folder
    assert hits(0.5) == folder


def test_the_cache_comes_before_the_code_of_the_package(shipped, monkeypatch, capsys):
    with monkeypatch.context() as patch:
        patch.setattr(jit, "_SHIPPED", None)
        assert hits() == 0
    for path in shipped.rglob("*.nb[ci]"):
        path.write_bytes(b"")
    assert hits() == 1
    assert capsys.readouterr().err == ""


def test_a_selected_cpu_does_not_use_the_code_of_the_package(shipped, monkeypatch):
    monkeypatch.setattr(jit._config, "CPU_NAME", "znver3")
    assert hits() == 0


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
def test_damaged_code_of_the_package_is_replaced_in_the_cache_with_one_line(shipped, cache, capsys, suffix):
    assert hits(0.5) == 0
    (path,) = shipped.rglob(f"*.{suffix}")
    path.write_bytes(path.read_bytes()[:40])
    assert hits() == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"billiards_env: discards the compiled code of double in {shipped}")
    assert hits() == hits(0.5) == 1
    assert capsys.readouterr().err == ""


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

    def swapped(array, up, out):
        numbers, number = swap(Numbers(None, array, Switches(up, not up)), 2)
        out[0], out[1], out[2], out[3] = number, numbers.array[0], numbers.switches.up, numbers.switches.down

    out = np.zeros(4)
    entry = jit.entry_point(swapped)
    for up in (False, True):
        entry(np.arange(5.0), up, out)
        assert list(out) == [2, 2, not up, up]


def test_a_function_of_numba_s_own_compiler_can_call_a_kernel():
    inner: Any = jit.kernel(double)
    outer: Any = jit.kernel(lambda x: inner(x))
    assert numba.njit(lambda x: outer(x))(3) == 6


def test_a_kernel_links_what_only_its_second_call_needs():
    """LLVM removes the first call and links nothing for it, also not what both calls need."""
    inner: Any = jit.kernel(double)
    one, two = jit.kernel(lambda x: inner(x) + 1), jit.kernel(lambda x: inner(x) + 2)

    def both(x):
        y = 0
        if x > x:
            y = one(x)
        return y + two(x)

    assert calling(jit.kernel(both))(3) == 9


def test_kernels_are_plain_functions_if_numba_is_disabled_with_one_warning(tmp_path):
    (tmp_path / "file").touch()
    code = (
        "import warnings; warnings.simplefilter('always'); from billiards_env import engine, envs\n"
        "from billiards_env.physics import elementary as e; assert e.norm(3, 4) == 5; assert e.norm.__code__"
    )
    _, errors = run("-c", code, NUMBA_DISABLE_JIT="1", NUMBA_CACHE_DIR=str(tmp_path / "file"))
    assert errors.count("RuntimeWarning") == errors.count("NUMBA_CACHE_DIR = ") == 1


@pytest.mark.parametrize("other", [jit.kernel, jit.entry_point])
def test_only_allocating_functions_can_create_arrays(other):
    assert jit.allocating(lambda n: np.empty(n).size)(3) == 3
    with pytest.raises(TypingError):
        other(lambda n: np.empty(n).size)(3)


@pytest.mark.parametrize("decorate", [jit.kernel, jit.entry_point])
def test_other_functions_can_call_an_allocating_one_that_returns_no_arrays(decorate):
    """Numba would compile the other call too, and nothing would free the arrays."""
    make: Any = jit.allocating(lambda n: (n, np.empty(n)))
    count: Any = jit.allocating(lambda n: make(n)[1].size)
    with counted_arrays() as arrays:
        assert calling(decorate(lambda n: count(n)))(3) == 4
    assert arrays == [1, 0]
    with pytest.raises(TypingError, match="expected a caller that may create arrays"):
        calling(decorate(lambda n: make(n)[1].size))(3)


def test_an_entry_point_keeps_the_reference_counts_of_its_arrays():
    add: Any = jit.entry_point(lambda arrays: arrays[0].shape[0] + arrays[1][0])
    arrays = np.ones(3), np.ones(2)
    before = [sys.getrefcount(array) for array in arrays]
    for _ in range(10):
        assert add(arrays) == 4.0
    assert [sys.getrefcount(array) for array in arrays] == before


def test_kernels_and_environments_are_copied_to_another_process(tmp_path):
    """An environment refers to entry points, which the other process compiles again, with the same compiler."""
    assert pickle.loads(pickle.dumps(elementary.norm))(3.0, 4.0) == 5.0
    made: Any = gym.make("Billiards-v0")
    made.reset(seed=0)
    path = tmp_path / "both.pickle"
    path.write_bytes(pickle.dumps((elementary.norm, made)))
    code = (
        f"import pickle; norm, env = pickle.load(open({str(path)!r}, 'rb')); env.step(env.action_space.sample())\n"
        "assert norm(3.0, 4.0) == 5.0"
    )
    run("-c", code)


def test_a_division_by_zero_is_an_infinity_and_nothing_is_reassociated():
    divide = jit.kernel(lambda x, y: x / y)
    assert divide(1.0, 0.0) == float("inf")
    lost = jit.kernel(lambda x, y: (x + y) - x)
    assert lost(1e16, 1.0) == 0.0
    fused = jit.kernel(lambda x, y: x * x - y)
    x = 1.0 + 2.0**-30
    assert fused(x, x * x) == 0.0  # a fused multiply-add would give the rounding error of x * x
