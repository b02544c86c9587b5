"""The workflow of continuous integration and `make ci` run the same targets."""

import re

import yaml

from benchmarks import ROOT

WORKFLOW = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8"))
MAKEFILE = (ROOT / "Makefile").read_text(encoding="utf-8")


def test_the_workflow_runs_the_targets_of_make_ci():
    jobs = [job for name, job in WORKFLOW["jobs"].items() if name != "platforms"]
    lines = [step["run"] for job in jobs for step in job["steps"] if "run" in step]
    assert all(line.startswith("make ") for line in lines)
    (targets,) = re.findall(r"^ci: (.*?)  ##", MAKEFILE, re.MULTILINE)
    assert sorted(line.split()[1] for line in lines) == sorted(targets.split())


def test_the_matrices_have_the_pythons_of_the_makefile():
    (pythons,) = re.findall(r"^PYTHONS := (.*)$", MAKEFILE, re.MULTILINE)
    matrices = [WORKFLOW["jobs"][name]["strategy"]["matrix"]["python"] for name in ("pythons", "wheel")]
    assert matrices == [pythons.split()] * 2


def test_every_platform_runs_the_core_and_compares_the_bits():
    (core,) = re.findall(r"^CORE := (.*)$", MAKEFILE, re.MULTILINE)
    frozen = "tests/envs/test_frozen.py::test_the_results_do_not_change"
    assert WORKFLOW["jobs"]["platforms"]["steps"][-1]["run"] == f"python -m pytest -q {core} {frozen}"
