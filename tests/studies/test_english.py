"""The study of english."""

from agents.config import load
from benchmarks import machine
from studies.english import CONFIGS, FIRST, PLAYERS, RECIPES, STRIKE, VELOCITY, blocks, configs


def test_the_policies_of_a_seed_have_the_same_steps_and_start_from_the_first(tmp_path):
    for name in RECIPES:
        runs = configs(name, 11, tmp_path)
        assert runs[FIRST].start_from is None
        assert {run.seed for run in runs.values()} == {11}
        assert {run.timesteps for run in runs.values()} == {load(CONFIGS / f"{name}.yaml").timesteps}
        assert runs[VELOCITY].start_from == runs[STRIKE].start_from == str(tmp_path / FIRST)
        assert [run.env["action"] for run in runs.values()] == ["velocity", "velocity", "strike"]


def test_the_tables_show_the_gain_by_strikes_and_the_effect_of_the_timestep():
    players = {
        action: {player: {"success_rate": rate, "mean_score": 2.5} for player in PLAYERS}
        for action, rate in ((VELOCITY, 0.5), (STRIKE, 0.7))
    }
    recipe = {
        "start": {VELOCITY: [0.2, 0.2], STRIKE: [0.35, 0.35]},
        "exact": {FIRST: [0.2, 0.2], VELOCITY: [0.3, 0.3], STRIKE: [0.4, 0.4]},
        "stepped": {VELOCITY: [0.25, 0.25], STRIKE: [0.1, 0.1]},
        "players": players,
    }
    made = blocks({"machine": machine(), "recipes": {"position": recipe}, "run_outs": {"nine_ball": players}})
    assert "| position | search:200          |" in made["results"]
    assert "50.0% |" in made["results"]
    start = next(line for line in made["results"].splitlines() if "at the start" in line)
    assert start.split("|")[3].strip() == "20.0% (20.0 to 20.0)"
    assert start.split("|")[4].strip() == "35.0% (35.0 to 35.0)"
    assert "| nine_ball | search:200 |    50.0% |   2.50 |  70.0% |   2.50 |" in made["run_outs"]
    gain = made["gain"].splitlines()[-1]
    assert [cell.strip() for cell in gain.strip("|").split("|")] == [
        "position",
        "10.0 points (10.0 to 10.0)",
        "-5.0 points (-5.0 to -5.0)",
        "-30.0 points (-30.0 to -30.0)",
    ]
