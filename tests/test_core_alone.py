"""The core of the package runs without the attachments, and names them in one file only."""

import ast
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

from billiards_env.jit.folders import cache_folder
from tests.helpers.imports import imported

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "billiards_env"
CORE = {
    *("__init__.py", "billiards_v0.py", "doors.py", "version.py"),
    *("engine", "envs", "games", "jit", "physics", "scene", "shots", "support"),
}


def test_only_the_table_of_doors_names_an_attachment():
    attachments = "|".join(path.stem for path in PACKAGE.glob("[a-z]*") if path.name not in CORE)
    for path in PACKAGE.rglob("*.py"):
        if path.relative_to(PACKAGE).parts[0] in CORE - {"doors.py"}:
            nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
            texts = [node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]
            names = " ".join([*imported(path), *(text for text in texts if " " not in text)])
            assert re.findall(rf"billiards_env\.(?:{attachments})\b\S*", names) == [], path


def test_the_core_runs_without_attachments(tmp_path):
    def left_out(folder, names):
        return {*names} - CORE if Path(folder) == PACKAGE else ()

    shutil.copytree(PACKAGE, tmp_path / "billiards_env", ignore=left_out)
    compiled = cache_folder()
    assert compiled is not None
    paths = tmp_path, ROOT, sysconfig.get_path("purelib"), sysconfig.get_path("platlib")
    environment = {"PYTHONPATH": os.pathsep.join(map(str, paths)), "NUMBA_CACHE_DIR": str(compiled.parent)}
    command = sys.executable, "-S", "-m", "tests.helpers.core_alone"  # -S: without the package of an editable install
    done = subprocess.run(command, cwd=tmp_path, env=os.environ | environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
