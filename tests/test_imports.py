"""Test modules import nothing from the tests except `tests.helpers`."""

import ast
import re
from pathlib import Path

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
    for package in ("agents", "benchmarks", "billiards_env", "reference", "release", "studies"):
        for path in (root / package).rglob("*.py"):
            assert all(name.split(".")[0] != "tests" for name in imported(path)), path
