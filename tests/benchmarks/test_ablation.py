"""A scene compiles and imports nothing of the parts that it does not use."""

import json

import pytest

from benchmarks import ablation
from benchmarks.ablation import started

# The modules of parts, which a step without them does not import, and so no shot.
UNUSED = (
    "agents",
    "billiards_v0",
    "bench.benchmark",
    "derivatives",
    "drawing",
    "envs.turns",
    "games.playing",
    "games.records",
    "games.turn",
    "play",
    "players",
    "pots",
    "sb3",
    "torch",
)
# The modules of parts, of which a step without them compiles nothing. The modules of physics are imported.
NOT_COMPILED = (
    *UNUSED,
    "engine.cell_grid",
    "engine.overlaps",
    "engine.pit",
    "engine.in_space",
    "engine.pit_in_space",
    "engine.pit_on_cloth",
    "engine.unequal_spheres",
    "games",
    "physics.clusters.complementarity",
    "physics.geometry.noses",
    "physics.laws.cushion_mathavan2010",
    "physics.laws.cushion_stronge",
    "physics.laws.flight",
    "physics.laws.mathavan",
    "physics.strike",
)


def of(names, parts):
    """Returns the names that belong to modules or packages of `billiards_env`."""
    return [name for name in names if f"{name}.".startswith(tuple(f"billiards_env.{part}." for part in parts))]


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Returns the row of a step that uses nothing, and what its process found. Its shots have spin and friction."""
    (row,) = (row for row in ablation.ROWS if row.name == "a step that uses nothing")
    with started(row, tmp_path_factory.mktemp("cache")) as ask:
        return {"name": "nothing", "without": "", **ask(), "passes": [ask("play")]}


def test_a_plain_step_imports_no_part(plain):
    assert "billiards_env.engine.pic" in plain["modules"]
    assert of(plain["modules"], UNUSED) == []


def test_a_plain_step_compiles_no_part(plain):
    """Every scene once compiled the law of Mathavan, Jackson and Parkin (2010)."""
    assert "billiards_env.engine.pic.run" in plain["functions"]
    assert of(plain["functions"], NOT_COMPILED) == []
    assert of(plain["functions"], ("physics.clusters.friction",)) == []
    assert "billiards_env.physics.laws.balls.friction_impulse" not in plain["functions"]
    assert of(plain["functions"], ("physics.elementary",)) == ["billiards_env.physics.elementary.norm"]


def test_the_table_compares_rows(plain, tmp_path, monkeypatch, capsys):
    more = plain | {"name": "more", "without": "nothing", "functions": [*plain["functions"], "f"]}
    result = {"machine": ablation.machine(), "shots": 10, "repeats": 1, "rows": [plain, more]}
    monkeypatch.setattr(ablation, "measure", lambda repeats, job: result)
    ablation.main(["--repeats", "1", "--output", str(tmp_path / "a.json")])
    assert json.loads((tmp_path / "a.json").read_text()) == result
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("| more"))
    assert [cell.strip() for cell in line.split("|")][-3:-1] == ["+1", "+0"]
    assert " 1.0 " in line


def test_every_row_follows_the_row_that_it_is_compared_with():
    names = [row.name for row in ablation.ROWS]
    assert all(row.without in ("", *names[:k]) for k, row in enumerate(ablation.ROWS))
