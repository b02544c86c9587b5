"""Continuous integration runs every command of the repository, in full or with tiny sizes."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent

TESTED = {
    "benchmarks.calibration",
    "benchmarks.gradients",
    "benchmarks.real_tracks",
    "benchmarks.referees",
    "studies.budgets",
    "studies.failures",
    "studies.figures",
    "studies.frozen_tasks",
    "studies.leaderboard",
    "studies.learning",
    "studies.readme",
    "studies.scatter",
    "studies.self_play",
    "studies.timestep",
    "studies.timestep_shots",
}
"""The commands whose tests call `main` with tiny sizes."""
STARTED = {"benchmarks.release.shots", "benchmarks.simulators_worker"}
"""The programs that other commands start."""

MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")
TARGETS = re.findall(r"^CI := (.*)$", MAKEFILE, re.MULTILINE)[0].split()


def test_continuous_integration_runs_make_ci_with_make_test():
    assert ".ci/run" in (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    assert "\nmake ci " in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert "test" in TARGETS
    assert "$(MAKE) -k " in MAKEFILE  # a failure of lint hides no test


def test_actions_are_pinned_and_publishing_is_off_by_default():
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8"))
    used = {step["uses"] for job in workflow["jobs"].values() for step in job["steps"] if "uses" in step}
    assert all(re.fullmatch(r"(actions|pypa)/[a-z-]+@[0-9a-f]{40}", one) for one in used)
    publish = workflow["jobs"]["publish"]
    assert "vars.PYPI_PROJECT == 'billiards-env'" in publish["if"]
    assert workflow["permissions"] == {"contents": "read"}
    assert publish["permissions"] == {"id-token": "write"}


@pytest.mark.skipif(shutil.which("make") is None, reason="no make on the PATH")
@pytest.mark.parametrize("broken", [(), ("test",), ("docs", "pythons")])
def test_make_ci_runs_all_targets_and_names_those_that_fail(broken, tmp_path):
    """A Makefile without work replaces the recipes."""
    recipe = re.findall(r"^ci:.*\n(?:\t.*\n)*", MAKEFILE, re.MULTILINE)[0]
    rules = "".join(f"{target}:\n\t@{'false' if target in broken else 'true'}\n" for target in TARGETS)
    (tmp_path / "Makefile").write_text(f"SHELL := bash\nCI := {' '.join(TARGETS)}\n{recipe}{rules}")
    done = subprocess.run(["make", "ci", "WITHOUT=web"], cwd=tmp_path, capture_output=True, text=True)
    ran = re.findall(r"^(\w+) (passed|failed) in \d+ s$", done.stdout, re.MULTILINE)
    assert ran == [(t, "failed" if t in broken else "passed") for t in TARGETS if t != "web"]
    assert bool(done.returncode) == bool(broken)


def test_make_ci_or_a_test_runs_every_command():
    recipes = dict(re.findall(r"^([a-z]+):[^=\n][^\n]*\n((?:\t[^\n]*\n)*)", MAKEFILE, re.MULTILINE))
    run = set(re.findall(r"-m (benchmarks[\w.]*)", "".join(recipes[target] for target in TARGETS)))
    sources = [*(ROOT / "benchmarks").rglob("*.py"), *(ROOT / "studies").glob("*.py")]
    programs = [path for path in sources if "\n    main()" in path.read_text(encoding="utf-8")]
    commands = {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__main__") for path in programs}
    assert commands == TESTED | STARTED | run
    assert not TESTED & run
