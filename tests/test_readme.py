"""The README's examples run and print what they say, and its tables and commands agree with the code."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import json
import re
from pathlib import Path

import pytest
import yaml

from agents.config import Config
from agents.ppo import make_model, make_vec_env
from benchmarks import readme, speed
from billiards_env.envs import BilliardsEnv
from billiards_env.layouts import LAYOUTS
from billiards_env.scene import SCENES, Physics, Scene

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
MEASUREMENTS = (ROOT / "docs" / "measurements.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```python\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def table(head: str) -> dict[str, list[str]]:
    """The rows of the table whose first column is called `head`, by that column's text without its backticks."""
    _, _, rest = README.partition(f"\n| {head} |")
    rows = rest.partition("\n\n")[0].splitlines()[2:]
    cells = [[cell.strip() for cell in row.strip("| ").split(" | ")] for row in rows]
    assert cells
    return {first.strip("`"): others for first, *others in cells}


@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_examples_run_and_print_what_they_say(number, capsys):
    code = BLOCKS[number]
    exec(compile(code, f"README.md, python block {number}", "exec"), {"__name__": "readme"})
    assert capsys.readouterr().out.splitlines() == re.findall(r"^print\(.*\)  # (.*)$", code, re.MULTILINE)


def test_the_configuration_shown_trains():
    (text,) = re.findall(r"^```yaml\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)
    assert len(text.splitlines()) <= 10
    config = Config.from_dict(yaml.safe_load(text))
    envs = make_vec_env(config)
    model = make_model(config, envs)
    before = [weights.clone() for weights in model.policy.parameters()]
    model.learn(1)  # one update
    envs.close()
    assert any((old != new).any() for old, new in zip(before, model.policy.parameters(), strict=True))


def test_there_are_examples():
    assert len(BLOCKS) >= 4


def test_arguments_are_those_of_the_environment():
    parameters = list(inspect.signature(BilliardsEnv).parameters.values())
    rows = table("Argument")
    assert list(rows) == [p.name for p in parameters]
    for p in parameters:
        assert ast.literal_eval(rows[p.name][0].strip("`")) == p.default


def test_every_layout_is_listed():
    assert re.findall(r'`"(\w+)"`', table("Argument")["layout"][1].partition(";")[0]) == list(LAYOUTS)


def test_scenes_are_those_there_are():
    rows = {name.strip('"'): others for name, others in table("Scene").items()}
    assert tuple(rows) == SCENES
    for name, (count, _) in rows.items():
        usual, most = (int(n) for n in re.findall(r"\d+", count))
        assert Scene.named(name).n_balls == 1 + usual
        assert Scene.named(name, most).n_balls == 1 + most
        with pytest.raises(ValueError, match="n_object_balls"):
            Scene.named(name, most + 1)


def test_physics_defaults_are_those_of_the_code():
    physics = Physics()
    rows = table("Field")
    assert list(rows) == [f"physics.{name}" for name in inspect.signature(Physics).parameters]
    for name, (default, _) in rows.items():
        assert ast.literal_eval(default.strip("`")) == getattr(physics, name.removeprefix("physics."))


def test_commands_exist():
    pages = README + MEASUREMENTS
    modules = set(re.findall(r"python -m ([\w.]+)", pages))
    assert modules >= {"agents.train", "agents.evaluate", "benchmarks.speed"}
    assert all(importlib.util.find_spec(module) for module in modules)
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(re.findall(r"(?:^|`)make (\w+)", pages, re.MULTILINE)) <= set(targets)
    assert all((ROOT / path).is_file() for path in re.findall(r"configs/[\w/]+\.yaml", README))


@pytest.mark.parametrize(("page", "folder"), [(README, ROOT), (MEASUREMENTS, ROOT / "docs")])
def test_links_lead_somewhere(page, folder):
    links = [link for link in re.findall(r"\]\(([^)]+)\)", page) if not link.startswith("https://")]
    assert links
    for link in links:
        path, _, anchor = link.partition("#")
        assert (folder / path).exists()
        if anchor:
            headings = re.findall(r"^#+ (.*)$", (folder / path).read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in [heading.lower().replace(" ", "-") for heading in headings]


def test_measured_tables_are_those_of_the_committed_results():
    readme.main(["--check"])


def test_all_that_is_measured_is_shown():
    shown = set(re.findall(r"^<!-- (\w+): ", README + MEASUREMENTS, re.MULTILINE))
    assert shown == set(readme.SOURCES)
    written = {path.stem for path in ROOT.glob("*/results/*.json")}
    assert written <= shown
    assert all(readme.results(source).exists() for source in written)


@pytest.fixture
def page(tmp_path, monkeypatch):
    path = tmp_path / "page.md"
    path.write_text("# Title\n\n<!-- speed: threads -->\nold\n<!-- end -->\n\nText.\n")
    monkeypatch.setattr(readme, "PAGES", (path,))
    return path


def test_only_what_is_between_the_markers_is_replaced(page):
    readme.main([])
    result = json.loads(readme.results("speed").read_text())
    threads = speed.blocks(result)["threads"]
    whole = f"# Title\n\n<!-- speed: threads -->\n\n{threads}\n\n<!-- end -->\n\nText.\n"
    assert page.read_text() == whole
    assert [path.name for path in page.parent.iterdir()] == ["page.md"]
    readme.main([])
    assert page.read_text() == whole


def test_a_page_that_is_not_up_to_date_is_told_and_left_alone(page):
    before = page.read_text()
    with pytest.raises(SystemExit, match=r"not up to date: page\.md"):
        readme.main(["--check"])
    assert page.read_text() == before
    readme.main([])
    readme.main(["--check"])


def test_what_is_not_measured_is_no_figure(page, tmp_path):
    assert "*Not measured yet: `python -m benchmarks.speed`.*" in readme.fill(page.read_text(), tmp_path)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("<!-- sped: shots -->\n<!-- end -->", "expected one of ablation, accuracy"),
        ("<!-- speed: shot -->\n<!-- end -->", "expected one of machine, how, shots"),
        ("<!-- speed: shots -->\n", "no <!-- end --> follows"),
        ("<!-- speed: shots -->\n<!-- speed: calls -->\n<!-- end -->", "expected before <!-- speed: calls -->"),
        ("<!-- end -->", "ends nothing"),
    ],
)
def test_wrong_markers_are_refused(page, wrong, message):
    page.write_text(wrong)
    with pytest.raises(SystemExit, match=message):
        readme.main([])
    assert page.read_text() == wrong
