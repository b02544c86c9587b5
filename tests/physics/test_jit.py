import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.errors import TypingError

from billiards_env.physics import jit


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package folder of a kernel source a pattern."""
    for pattern in jit.KERNEL_SOURCES:
        path = tmp_path / pattern.replace("*", "kernels")
        path.parent.mkdir(exist_ok=True)
        path.write_text("x = 1\n")
    monkeypatch.setattr(jit, "_PACKAGE", tmp_path)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    return tmp_path


@pytest.mark.parametrize("pattern", jit.KERNEL_SOURCES)
def test_every_edit_of_a_kernel_changes_the_hash(package, pattern):
    before = jit.source_hash()
    assert jit.source_hash() == before
    (package / pattern.replace("*", "kernels")).write_text("x = 2\n")
    assert jit.source_hash() != before


@pytest.mark.parametrize("folder", ["physics", "engine"])
def test_another_kernel_file_changes_the_hash(package, folder):
    before = jit.source_hash()
    (package / folder / "more.py").write_text("y = 1\n")
    assert jit.source_hash() != before


def test_every_file_with_kernels_is_hashed():
    root = Path(jit.__file__).parents[1]
    hashed = {path for pattern in jit.KERNEL_SOURCES for path in root.glob(pattern)}
    kernels = {
        path
        for path in root.rglob("*.py")
        if "import entry_point" in path.read_text() or "import kernel" in path.read_text()
    }
    assert kernels <= hashed


def test_other_files_do_not_change_the_hash(package):
    before = jit.source_hash()
    (package / "scene.py").write_text("x = 1\n")
    (package / "physics" / "notes.txt").write_text("x")
    assert jit.source_hash() == before


def test_the_cache_lies_in_the_package_under_the_sources_hash(package):
    assert jit.cache_folder() == package / "__pycache__" / f"kernels-{jit.source_hash()}"


def test_the_environment_s_folder_comes_first(package, monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "given"))
    assert jit.cache_folder() == tmp_path / "given" / f"kernels-{jit.source_hash()}"


def test_an_environment_s_folder_that_cannot_be_written_falls_back_to_the_others(package, monkeypatch, tmp_path):
    """Before, nothing was kept then."""
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    with pytest.warns(RuntimeWarning, match=r"NUMBA_CACHE_DIR = .*file': expected a folder that can be written"):
        assert jit.cache_folder() == package / "__pycache__" / f"kernels-{jit.source_hash()}"


def test_a_package_that_cannot_be_written_falls_back_to_the_user_s_cache(package):
    (package / "__pycache__").touch()  # no folder can be made here
    assert jit.cache_folder() == package / "user" / "billiards_env" / f"kernels-{jit.source_hash()}"


def test_without_a_folder_kernels_still_compile_and_a_warning_says_so(package, monkeypatch):
    (package / "__pycache__").touch()
    (package / "user").touch()
    with pytest.warns(RuntimeWarning, match="set NUMBA_CACHE_DIR to one"):
        assert jit.cache_folder() is None
    monkeypatch.setattr(jit, "_FOLDER", None)
    double = jit.entry_point(lambda x: 2 * x)
    assert double(3) == 6


def test_an_entry_point_is_cached_in_the_folder_and_leaves_numba_s_setting_alone(tmp_path):
    (tmp_path / "module.py").write_text(
        "from billiards_env.physics.jit import entry_point\n"
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
jit.entry_point(lambda x: 2 * x)(3)
time.sleep(0.1)
"""


@pytest.mark.parametrize(("seconds", "lines"), [(0.0, 1), (300.0, 0)])
def test_a_long_compilation_is_announced_in_one_line(tmp_path, seconds, lines):
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(Path(jit.__file__).parents[2])}
    code = tmp_path / "compiles.py"
    code.write_text(COMPILES)
    done = subprocess.run([sys.executable, code, str(seconds)], env=env, check=True, capture_output=True, text=True)
    said = done.stderr.splitlines()
    assert [line.split(" (")[0] for line in said] == ["billiards_env: compiling __main__.<lambda>"] * lines


SHOOTS = """
import sys
from billiards_env.physics import jit
@jit.entry_point
def double(x):
    return 2 * x
assert double(3) == 6
"""


def shoot(tmp_path, cache):
    """Runs SHOOTS with a cache folder; returns what it says on stderr, line by line."""
    (tmp_path / "shoots.py").write_text(SHOOTS)
    root = Path(jit.__file__).parents[2]
    env = os.environ | {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": f"{root}{os.pathsep}{tmp_path}"}
    start = [sys.executable, "-m", "shoots"]
    return subprocess.run(start, env=env, check=True, capture_output=True, text=True).stderr.splitlines()


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_truncated_cache_is_discarded_with_one_line(tmp_path, suffix, share):
    """Before, numba's EOFError or UnpicklingError ended every process until the folder was deleted."""
    assert shoot(tmp_path, tmp_path / "cache") == []
    (path,) = (tmp_path / "cache").glob(f"kernels-*/**/*.{suffix}")
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    (line,) = shoot(tmp_path, tmp_path / "cache")
    assert line.startswith("billiards_env: discards a damaged cache file: __main__.double in ")
    assert shoot(tmp_path, tmp_path / "cache") == []
    assert path.stat().st_size > 0


def test_a_cache_that_cannot_be_written_to_is_mentioned_and_the_call_goes_on(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(jit, "_FOLDER", tmp_path)

    def fail(self, key, data):
        raise OSError("disk full")

    monkeypatch.setattr("numba.core.caching.IndexDataCacheFile.save", fail)
    assert calling(jit.kernel(lambda x: 2 * x))(3) == 7
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("billiards_env: cannot keep compiled code: ")


def test_one_process_warns_once_of_a_cache_folder_that_cannot_be_written(tmp_path):
    """Before, each of the entry points repeated it."""
    (tmp_path / "file").touch()
    code = "import warnings; warnings.simplefilter('always'); from billiards_env import engine, envs"
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "file"), "PYTHONPATH": str(Path(jit.__file__).parents[2])}
    done = subprocess.run([sys.executable, "-c", code], env=env, check=True, capture_output=True, text=True)
    assert done.stderr.count("RuntimeWarning") == done.stderr.count("NUMBA_CACHE_DIR = ") == 1


def test_processes_that_compile_at_once_share_one_cache(tmp_path):
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
    return jit.entry_point(lambda x: inner(x) + 1)


@pytest.mark.parametrize("decorate", [jit.kernel, jit.inlined, jit.allocating])
def test_kernels_are_compiled_for_python_only_if_it_calls_them(decorate):
    double = decorate(lambda x: 2 * x)
    assert calling(double)(3) == 7
    (compiled,) = double.overloads.values()
    assert not [f.name for f in compiled.library.get_defined_functions() if "cpython" in f.name or "cfunc" in f.name]
    assert double(3) == 6


def test_merged_kernels_are_compiled_by_themselves_only_if_python_calls_them():
    double: Any = jit.merged(lambda x: 2 * x)
    assert calling(double)(3) == 7
    assert not double.overloads
    assert double(3) == 6


def test_kernels_are_plain_functions_where_numba_is_turned_off():
    root = Path(jit.__file__).parents[2]
    code = "from billiards_env.physics import motion as m; assert m.norm(3, 4) == 5 and not hasattr(m.norm, 'py_func')"
    env = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(root)}
    subprocess.run([sys.executable, "-c", code], env=env, check=True)


def test_kernels_make_no_arrays_unless_they_are_marked():
    make = lambda n: np.zeros(n).sum()  # noqa: E731
    assert jit.allocating(make)(3) == 0.0
    with pytest.raises(TypingError):
        jit.kernel(make)(3)


def test_a_division_by_zero_is_an_infinity_and_nothing_is_reassociated():
    divide = jit.kernel(lambda x, y: x / y)
    assert divide(1.0, 0.0) == float("inf")
    lost = jit.kernel(lambda x, y: (x + y) - x)
    assert lost(1e16, 1.0) == 0.0
    fused = jit.kernel(lambda x, y: x * x - y)
    x = 1.0 + 2.0**-30
    assert fused(x, x * x) == 0.0  # a fused multiply-add would give the rounding error of x * x


def memory_asked_for(depth, calls=200):
    """How often the system is asked for a page of memory while a function is called, from so many frames deep."""
    if depth:
        return memory_asked_for(depth - 1, calls)
    resource = pytest.importorskip("resource")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(calls):
        _nothing()
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before


def _nothing():
    pass


def test_compiling_has_room_on_the_stack_at_any_depth():
    """Without it there are depths at which every call takes a page, and compiling a quarter longer."""
    assert max(jit._with_room(memory_asked_for, depth) for depth in range(300)) < 100


def test_entry_points_are_compiled_with_room(monkeypatch):
    roomy = []
    monkeypatch.setattr(jit, "_with_room", lambda function, *args: roomy.append(args) or function(*args))
    monkeypatch.setattr(jit, "_FOLDER", None)
    twice = jit.entry_point(lambda x: 2 * x)
    assert twice(3) == 6
    assert len(roomy) == 1
