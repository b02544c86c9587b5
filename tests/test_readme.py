"""The examples in the README and in the documentation run, and their tables and commands agree with the code."""

import ast
import dataclasses
import importlib.util
import inspect
import json
import os
import pkgutil
import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from agents.config import Config, load
from agents.learners import LEARNERS
from agents.ppo import AIM_PPO, make_ppo, make_vec_env
from benchmarks import speed
from billiards_env.envs import BilliardsEnv, arguments, make_env, make_vector_env, observations
from billiards_env.envs.tasks import TASKS
from billiards_env.scene import PARAMETERS, SCENES, Cue, Physics, Scene, layouts
from billiards_env.scene import scene as scenes
from billiards_env.scene.layouts import LAYOUTS
from studies import readme

ROOT = Path(__file__).resolve().parent.parent
README = ROOT / "README.md"
PAGES = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in readme.PAGES}
PAGES["CONTRIBUTING.md"] = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
NOT_RUN = {
    "CONTRIBUTING.md": ["billiards_env/envs/observations.py"],
    "docs/cluster.md": ["RLlib's own runner"],
    "docs/own_package.md": ["my_billiards.py", "use.py", "cowboy_pool.py"],
}
"""The titles of the blocks of Python that are not run on their own. A recipe has its own test, and so has the page of a
package (`tests/test_own_package.py`); the other needs Ray."""
FENCE = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
EXAMPLES = [
    pytest.param(code, id=f"{page}-{k}")
    for page, text in PAGES.items()
    for k, (language, options, code) in enumerate(FENCE.findall(text))
    if language == "python" and not options
]
TUTORIALS = [page for page, text in PAGES.items() if '```python exec="true"' in text]


def table(text: str, head: str) -> dict[str, list[str]]:
    """Returns the rows of the table whose first column is `head`, by that column's text without its backticks."""
    _, rest = re.split(rf"\n\| {head} *\|", text, maxsplit=1)
    rows = rest.partition("\n\n")[0].splitlines()[2:]
    cells = [[cell.strip() for cell in row.strip("| ").split(" | ")] for row in rows]
    assert cells
    return {first.strip("`"): others for first, *others in cells}


def one_update(code: str) -> str:
    """Returns the code of an example with trainings of one update."""
    return re.sub(r"\.learn\([\d_]+", ".learn(1", code)


@pytest.mark.filterwarnings("ignore:rich is experimental")
@pytest.mark.parametrize("code", EXAMPLES)
def test_examples_run_and_print_the_output_shown(code, capsys, tmp_path, monkeypatch):
    if "import jax\n" in code:
        pytest.importorskip("jax")
    (tmp_path / "studies").symlink_to(ROOT / "studies")  # an example loads a policy from the repository
    monkeypatch.chdir(tmp_path)  # an example writes a file
    exec(compile(one_update(code), "example", "exec"), {"__name__": "example"})
    printed, shown = capsys.readouterr().out.splitlines(), re.findall(r"^print\(.*\)  # (.*)$", code, re.MULTILINE)
    if ".learn(" in code:  # a training prints its progress, and results that one update does not reach
        assert shown == []
    else:
        assert printed == shown


# A continuous integration must run the tutorials, so it has no skip.
@pytest.mark.skipif(
    not os.environ.get("CI") and importlib.util.find_spec("griffe") is None,
    reason="the tutorials need the extra docs: pip install -e '.[docs]'",
)
@pytest.mark.parametrize("page", TUTORIALS)
def test_tutorials_run(page):
    names = {"__name__": "tutorial"}
    for language, options, code in FENCE.findall(PAGES[page]):
        assert language == "python", f"{page}: the build runs blocks of Python only"
        assert 'exec="true"' in options
        exec(compile(one_update(code), page, "exec"), names)


RECIPES = re.split(r"^## (?=How to add|Where smaller)", PAGES["CONTRIBUTING.md"], flags=re.MULTILINE)[1:]


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.splitlines()[0])
def test_a_recipe_names_files_and_names_that_exist(recipe):
    """A name is in one of the files that the recipe names, or the package defines it."""
    words = {" ".join(word.split()) for word in re.findall(r"`([^`]+)`", re.sub(r"(?ms)^```.*?^```$", "", recipe))}
    paths = {word for word in words if "/" in word}
    assert [path for path in paths if not (ROOT / path).exists()] == []
    files = "".join((ROOT / path).read_text(encoding="utf-8") for path in paths if (ROOT / path).is_file())
    package = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "billiards_env").rglob("*.py"))
    for word in words - paths:
        if re.fullmatch(r"(billiards )?[\w.]+", word):
            name = re.split(r"[ .]", word)[-1]
            assert re.search(rf"\b{name}\b", files) or re.search(rf"\b(class|def) {name}\b", package), word


def test_the_recipe_of_an_observation_works(tmp_path, monkeypatch):
    (code,) = (code for _, options, code in FENCE.findall(PAGES["CONTRIBUTING.md"]) if "observations.py" in options)
    monkeypatch.setitem(observations.FEATURES, "shots_played", None)  # removed after the test
    (tmp_path / "recipe.py").write_text(code)  # numba looks for the file of a function that it compiles
    exec(compile(code, tmp_path / "recipe.py", "exec"), vars(observations).copy())
    arguments = {"observe": ("shots_left", "shots_played"), "max_shots": 3}
    env, envs = make_env(**arguments), make_vector_env(2, **arguments)
    seen = [env.reset(seed=0)[0], *(env.step([0.01, 0.0])[0] for _ in range(2))]
    many = [envs.reset(seed=0)[0], *(envs.step([[0.01, 0.0]] * 2)[0] for _ in range(2))]
    assert np.array(seen) == pytest.approx(np.array([[1, 0], [2 / 3, 1 / 3], [1 / 3, 2 / 3]]), abs=1e-7)
    assert np.array_equal(np.array(many), np.stack((seen, seen), 1))
    assert env.decode(seen[1])["shots_played"] == seen[1][1]


def test_the_layers_have_no_exceptions():
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8").partition('"Data flows one way"')[2]
    assert "ignore_imports" not in text.partition("[[")[0]


def test_every_block_of_python_is_run_or_listed():
    left = {}
    for page, text in PAGES.items():
        for language, options, _ in FENCE.findall(text):
            if language == "python" and options and 'exec="true"' not in options:
                left.setdefault(page, []).append(re.sub(r'^ title="(.*)"$', r"\1", options))
    assert left == NOT_RUN


def test_every_default_of_a_scene_has_a_source():
    """0, 1 and None switch a law off."""
    rows = tuple(re.findall(r"^(\w+\.\w+) +\S.* \S", scenes.__doc__ or "", re.MULTILINE))
    for prefix, kind in (("physics", Physics), ("cue", Cue)):
        for field in dataclasses.fields(kind):
            if isinstance(field.default, float) and field.default not in (0.0, 1.0):
                known = PARAMETERS[field.name].source if kind is Physics else f"{prefix}.{field.name}".startswith(rows)
                assert known, field.name


def test_the_readme_is_short():
    assert len(PAGES["README.md"].splitlines()) <= 130
    assert sum(language == "python" for language, _, _ in FENCE.findall(PAGES["README.md"])) == 3
    assert len(TUTORIALS) == 5


def test_the_training_of_the_readme_is_the_row_that_make_train_trains():
    """The numbers below the code are those of this row."""
    text = PAGES["README.md"]
    (code,) = (code for language, _, code in FENCE.findall(text) if language == "python" and ".learn(" in code)
    row = load("pot")
    (task,) = re.findall(r"^task = (.*?)  #", code, re.MULTILINE)
    shown, trained = (make_env(**env) for env in (ast.literal_eval(task), row.env))
    for name in trained.model.arguments:
        assert getattr(shown, name) == getattr(trained, name)
    assert shown.observation_space == trained.observation_space
    assert re.findall(r"\.learn\(([\d_]+)", code) == [f"{row.timesteps:_}"]
    assert re.findall(r"num_envs=(\d+)", code) == [str(row.n_envs)]
    assert row.settings == AIM_PPO
    assert "**PPO_SETTINGS)" in code
    assert "agents.train pot\n" in (ROOT / "Makefile").read_text(encoding="utf-8")


def test_the_readme_shows_the_commands_of_a_fresh_clone():
    """`make train` runs the example. For `make test` see `tests/test_ci.py`."""
    lines = {line.split("#")[0].strip(): line for line in PAGES["README.md"].splitlines() if line.startswith("make ")}
    assert list(lines) == ["make train", "make test"]
    assert all(re.search(r"\d+ minutes", line) for line in lines.values())


def test_the_configuration_shown_trains():
    texts = (code for language, _, code in FENCE.findall(PAGES["docs/training.md"]) if language == "yaml")
    by_likelihood, config = (Config.from_dict(yaml.safe_load(text)) for text in texts)
    assert (by_likelihood.learner, config.learner) == ("likelihood", "ppo")
    defaults = {name: setting.default for name, setting in LEARNERS["likelihood"].settings.items()}
    assert by_likelihood.settings == {name: value for name, value in defaults.items() if value is not None}
    assert all(f"`{name}: " in PAGES["docs/training.md"] for name, value in defaults.items() if value is None)
    envs = make_vec_env(config)
    model = make_ppo(config, envs)
    before = [weights.clone() for weights in model.policy.parameters()]
    model.learn(1)  # one update
    envs.close()
    assert any((old != new).any() for old, new in zip(before, model.policy.parameters(), strict=True))


def test_arguments_are_those_of_the_environment():
    of_env = inspect.signature(BilliardsEnv).parameters["render_mode"]
    parameters = [*inspect.signature(arguments.make_model).parameters.values(), of_env]
    rows = table(inspect.getdoc(BilliardsEnv) or "", "Argument")
    assert list(rows) == [p.name for p in parameters]
    for p in parameters:
        assert ast.literal_eval(rows[p.name][1].strip("`")) == p.default


def test_every_layout_is_listed():
    assert [name.strip('"') for name in table(PAGES["docs/scenes.md"], "Layout")] == list(LAYOUTS)
    assert [name for name in LAYOUTS if f'\n"{name}"\n' not in (layouts.__doc__ or "")] == []


def test_every_scene_is_listed():
    rows = {name.strip('"'): others for name, others in table(PAGES["docs/scenes.md"], "Scene").items()}
    assert tuple(rows) == SCENES
    for name, (count, _) in rows.items():
        usual, most = (int(n) for n in re.findall(r"\d+", count))
        assert Scene.named(name).n_balls == 1 + usual
        assert Scene.named(name, most).n_balls == 1 + most
        with pytest.raises(ValueError, match="n_object_balls"):
            Scene.named(name, most + 1)


def test_every_field_of_physics_is_listed():
    tables = PAGES["docs/scenes.md"].partition("\n## Physics\n")[2].split("\n<!-- ")
    rows = {name: default for text in tables[:2] for name, (default, *_) in table(text, "Field").items()}
    assert {name: ast.literal_eval(default.strip("`")) for name, default in rows.items()} == {
        f"physics.{field.name}": field.default for field in dataclasses.fields(Physics)
    }


def test_commands_exist():
    pages = "\n".join(PAGES.values())
    modules = set(re.findall(r"python -m ([\w.]+)", pages))
    assert modules >= {"agents.train", "agents.evaluate", "benchmarks.speed"}
    assert [module for module in sorted(modules) if not importlib.util.find_spec(module)] == []
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(re.findall(r"(?:^|`)make (?:\w+=\S+ )?(\w+)", pages, re.MULTILINE)) <= set(targets)
    assert [path for path in re.findall(r"configs/[\w/]+\.yaml", pages) if not (ROOT / path).is_file()] == []
    paths = re.findall(r"`((?:billiards_env|agents|benchmarks|tests|docs)/[\w/.]+\.\w+)`", pages)
    assert [path for path in paths if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("page", PAGES)
def test_links_exist(page):
    folder, text = (ROOT / page).parent, re.sub(r"<!-- site .*? -->", "", PAGES[page])  # play.html is only in the site
    for link in re.findall(r"\]\(([^)]+)\)|href=\"([^\"]+)\"", text):
        path, _, anchor = "".join(link).partition("#")
        if path.startswith("https://"):
            continue
        path = path or Path(page).name  # a heading of the same page
        assert (folder / path).exists(), link
        # contributing.md includes CONTRIBUTING.md, and a link to a shot opens play.html in the site
        if anchor and path != "contributing.md" and not anchor.startswith("game="):
            headings = re.findall(r"^#+ (.*)$", (folder / path).read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in [heading.lower().replace(" ", "-") for heading in headings], link


@pytest.mark.parametrize("page", sorted(path.name for path in (ROOT / "docs" / "api").glob("*.md")))
def test_the_reference_lists_names_that_exist(page):
    text = (ROOT / "docs" / "api" / page).read_text(encoding="utf-8")
    block = re.compile(r"^::: (\S+)\n    options:\n(?: {6}.*\n)*? {6}members: \[(.*)\]", re.MULTILINE)
    for path, members in block.findall(text):
        if path != "billiards_env.jax" or importlib.util.find_spec("jax"):
            owner = pkgutil.resolve_name(path)
            assert [name for name in filter(None, members.split(", ")) if not hasattr(owner, name)] == [], path


def test_the_environment_describes_every_task():
    assert [name for name in TASKS if f'`task="{name}"`' not in (BilliardsEnv.__doc__ or "")] == []


def test_measured_tables_are_those_of_the_committed_results():
    readme.main(["--check"])


def test_all_results_are_shown():
    shown = {source for text in PAGES.values() for source in re.findall(r"^<!-- (\w+): ", text, re.MULTILINE)}
    assert shown == {*readme.SOURCES, *readme.GENERATED}
    written = {path.stem for folder in ("*", "*/*") for path in ROOT.glob(f"{folder}/results/*.json")}
    assert written == set(readme.SOURCES)
    assert all(readme.results(source).exists() for source in written)


@pytest.fixture
def page(tmp_path, monkeypatch):
    path = tmp_path / "page.md"
    path.write_text("# Title\n\n<!-- speed: calls -->\nold\n<!-- end -->\n\nText.\n")
    monkeypatch.setattr(readme, "PAGES", (path,))
    return path


def test_only_text_between_markers_is_replaced(page):
    readme.main([])
    result = json.loads(readme.results("speed").read_text())
    calls = speed.blocks(result)["calls"]
    filled = f"# Title\n\n<!-- speed: calls -->\n\n{calls}\n\n<!-- end -->\n\nText.\n"
    assert page.read_text() == filled
    assert [path.name for path in page.parent.iterdir()] == ["page.md"]
    readme.main([])
    assert page.read_text() == filled


def test_an_outdated_page_is_reported_and_not_changed(page):
    before = page.read_text()
    with pytest.raises(SystemExit, match=r"not up to date: page\.md"):
        readme.main(["--check"])
    assert page.read_text() == before
    readme.main([])
    readme.main(["--check"])


def test_a_missing_result_is_marked_as_not_measured(page, tmp_path):
    assert "*Not measured yet: `python -m benchmarks.speed`.*" in readme.fill_page(page.read_text(), tmp_path)


WRONG_MARKERS = [
    (
        "<!-- sped: shots -->\n<!-- end -->",
        "expected one of ablation, accuracy, calibration, comparison, cushion_error",
    ),
    ("<!-- speed: shot -->\n<!-- end -->", "expected one of machine, how, shots"),
    ("<!-- speed: shots -->\n", "no <!-- end --> follows"),
    ("<!-- speed: shots -->\n<!-- speed: calls -->\n<!-- end -->", "expected before <!-- speed: calls -->"),
    ("<!-- end -->", "ends nothing"),
]


@pytest.mark.parametrize(("wrong", "message"), WRONG_MARKERS)
def test_wrong_markers_are_rejected(page, wrong, message):
    page.write_text(wrong)
    with pytest.raises(SystemExit, match=message):
        readme.main([])
    assert page.read_text() == wrong
