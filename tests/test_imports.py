"""What modules import, what programs load, and the errors without an optional package."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import billiards_env
from tests.helpers.imports import imported

TESTS = Path(__file__).parent
HELPERS = "tests.helpers"


def test_no_test_module_imports_a_test_module():
    for path in TESTS.rglob("*.py"):
        modules = [name for name in imported(path) if name.split(".")[0] == "tests"]
        assert all(f"{name}.".startswith(f"{HELPERS}.") for name in modules), path


def test_the_lists_of_modules_are_complete():
    for package in sorted(TESTS.parent.glob("billiards_env/*/__init__.py")):
        listed = (ast.get_docstring(ast.parse(package.read_text(encoding="utf-8"))) or "").partition("Modules:\n")[2]
        if listed:
            names = {
                name for names in re.findall(r"^    ([a-z_, ]+):", listed, re.MULTILINE) for name in names.split(", ")
            }
            files = [*package.parent.glob("[a-z]*.py"), *(path.parent for path in package.parent.glob("*/__init__.py"))]
            assert names == {path.stem for path in files}, package


def test_only_tests_import_tests():
    root = TESTS.parent
    for package in ("agents", "benchmarks", "billiards_env", "docs", "studies"):
        for path in (root / package).rglob("*.py"):
            assert all(name.split(".")[0] != "tests" for name in imported(path)), path


def test_the_package_imports_the_engine_on_first_use():
    from billiards_env.shots.simulation import simulate, simulate_batch

    assert billiards_env.simulate is simulate
    assert billiards_env.simulate_batch is simulate_batch
    assert {"Scene", "simulate", "simulate_batch"} <= set(dir(billiards_env))
    with pytest.raises(AttributeError, match="module 'billiards_env' has no attribute 'simulat'"):
        billiards_env.simulat  # noqa: B018


HEAVY = "torch jax stable_baselines3 pettingzoo pygame matplotlib PIL"
SHOT = "import gymnasium as gym; env = gym.make('billiards_env:Billiards-v0', {}); env.reset(); env.step([0.1, 0.1])"
MOTION = (
    "import billiards_env as b; shot = b.simulate(b.Scene.named('pool'), [[-1, 0], [1, 0]], [1, 0], record=True); "
    "shot.at(0.5), shot.motion_at(0.5)"
)
GAME = "import billiards_env.billiards_v0 as v0; env = v0.raw_env('carom'); env.reset(0); env.step([0.1, 0.1])"
LOADED = {  # programs, and what they do not load beside `HEAVY`
    "the registration": ("import billiards_env, gymnasium; gymnasium.spec('Billiards-v0')", "numba"),
    "a shot": (SHOT.format(""), "drawing envs.action_frames players pots"),
    "the motion in a shot": (MOTION, "drawing"),
    "an image": (SHOT.format("observe=[('pixels', 9, 9)]"), "drawing.canvas drawing.spheres drawing.window"),
    "a render mode": (SHOT.format("render_mode='rgb_array'"), "drawing.canvas"),
    "records of games": ("import billiards_env.games.records", "play"),
    "a game of PettingZoo": (GAME, "play"),
    "the players": ("import billiards_env.players.named, billiards_env.bench.evaluation", "sb3"),
    "the command of the window": ("import billiards_env.play.__main__", "sb3"),
    "the model of the window": ("import billiards_env.play.model, billiards_env.play.labels", "drawing.canvas"),
    "the overview": ("from billiards_env.__main__ import main; main([])", "numba"),
}


@pytest.mark.parametrize("name", LOADED)
def test_a_program_loads_only_what_it_needs(name):
    code, others = LOADED[name]
    unused = {*HEAVY.split(), *others.split(), *(f"billiards_env.{other}" for other in others.split())}
    unused -= {"pettingzoo"} if "PettingZoo" in name else set()
    program = f"import sys; {code}; assert not {unused} & set(sys.modules), {unused} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True, capture_output=True)


PLAY = "from billiards_env.play.__main__ import main; main(['--players', 'human,{}'])"
PICTURE = "from billiards_env.__main__ import main; main(['simulate', '--out', 'shot.png'])"
MISSING = {
    "matplotlib": (
        PICTURE,
        r"^error: matplotlib is not installed.*env\[plot\]' \(in a clone: pip install '.\[plot\]'\)",
    ),
    "pettingzoo": ("import billiards_env.billiards_v0", r"DependencyNotInstalled: .*billiards-env\[multi\]"),
    "pygame": (PLAY.format("human"), r"^error: pygame is not installed.*pip install 'billiards-env\[render\]'"),
    "stable_baselines3": (PLAY.format("policy:x"), "^error: .*stable_baselines3 is not installed.* extra 'train'"),
}


@pytest.mark.parametrize("package", MISSING)
def test_without_an_optional_package_the_error_names_its_extra(package):
    code, message = MISSING[package]
    program = f"import sys; sys.modules[{package!r}] = None; {code}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (1, "")  # before any work
    assert re.search(message, done.stderr, re.DOTALL), done.stderr
