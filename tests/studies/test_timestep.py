"""The study of timesteps: its runs, what it measures, its statistics, and its page."""

import contextlib
import json
import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import yaml

from agents.ppo import deterministic
from billiards_env import Scene, simulate
from billiards_env.bench.evaluation import evaluation_seeds, play_together
from billiards_env.engine import PIC, Engine
from billiards_env.sb3 import load_policy
from billiards_env.sb3.weights import is_slim, read_weights
from studies import executor, timestep, timestep_report, timestep_shots
from studies.readme import fill_page, results
from tests.helpers.processes import InThisProcess

pytest.importorskip("matplotlib")

WORLDS = ("exact", "1/60", "1/15")
TINY = {
    "task": "Pot1-v0",
    "timesteps": 3000,
    "checkpoint_every": 3000,
    "evaluation_episodes": 20,
    "env": {"task": "clear"},
    "learner": "likelihood",
    "policy": {"arguments": {"hidden": 16, "points": 4}},
}
"""The settings of the training in a tiny study."""


@pytest.fixture(scope="module")
def command(tmp_path_factory):
    """A function that runs a tiny study in this process and returns its results, and the folder of its files."""
    folder = tmp_path_factory.mktemp("study")
    (folder / "timestep.yaml").write_text(yaml.safe_dump(TINY))
    small = {
        "SETTINGS": folder / "timestep.yaml",
        "WORLDS": {world: timestep.WORLDS[world] for world in WORLDS},
        "MOVE_BACK": {"1/60 move_back": timestep.MOVE_BACK["1/60 move_back"]},
        "SEEDS": (5, 6),
        "FEW_SEEDS": (5,),
        "LAYOUTS": 200,
        "executor": lambda *_: contextlib.nullcontext(InThisProcess()),
    }

    def run(*more, **changes):
        with pytest.MonkeyPatch.context() as patch:
            for name, value in {**small, **changes}.items():
                patch.setattr(timestep, name, value)
            timestep.main(["--output", str(folder / "timestep.json"), "--images", str(folder), *more])
        return json.loads((folder / "timestep.json").read_text())

    return run, folder


@pytest.fixture(scope="module")
def study(command):
    """The results of a tiny study."""
    return command[0]()


def test_the_results_have_all_runs(study):
    trained = {(world, seed) for world, runs in study["runs"].items() for seed in runs}
    assert trained == {(world, seed) for world in WORLDS for seed in "56"} | {("1/60 move_back", "5")}
    for runs in study["runs"].values():
        for run in runs.values():
            assert run["shots"] >= 3000
            assert 0 < run["own"] - run["false_successes"] <= run["exact"] <= 200
            assert 0 < sum(count for count, *_ in run["aim"]) <= run["own"]
    assert [run["false_successes"] for run in study["runs"]["exact"].values()] == [0, 0]
    assert study["runs"]["1/15"]["5"]["own"] != study["runs"]["1/15"]["5"]["exact"]


def test_the_policies_play_as_measured(command, study):
    published = timestep.policy_folder(command[1] / "timestep.json", "1/60")
    env, policy = load_policy(command[1] / "runs" / "1-60" / "seed5")
    assert (env["mode"], env["dt"]) == ("pit", 1 / 60)
    assert is_slim(read_weights(published / "policy.pt"))
    assert load_policy(published)[0] == env
    assert not timestep.policy_folder(command[1] / "timestep.json", "1/60 move_back").exists()
    run = study["runs"]["1/60"]["5"]
    seeds = evaluation_seeds(timestep.LAYOUT_SEED, 200).tolist()
    for where, arguments in (("own", env), ("exact", {**env, "mode": "pic", "dt": None})):
        envs = gym.make_vec("billiards_env:Billiards-v0", num_envs=200, **arguments)
        assert play_together(envs, deterministic(policy), seeds)["successes"] == run[where]


def test_runs_with_results_are_not_trained_again(command, study, capsys):
    run, folder = command
    run("--address", "no.cluster:1", run_world=None, executor=executor)  # without missing runs it does not connect
    printed = capsys.readouterr().out
    assert all(block in printed for block in timestep_report.blocks(study).values())
    assert (folder / "timestep_aim.png").read_bytes().startswith(b"\x89PNG")

    def interrupted(world, seed, *_):
        calls.append((world, seed))
        raise KeyboardInterrupt

    calls, changed = [], json.loads(json.dumps(study))
    del changed["runs"]["1/60"]["6"]
    (folder / "timestep.json").write_text(json.dumps(changed))
    with pytest.raises(SystemExit) as stopped:
        run(run_world=interrupted)
    assert stopped.value.code == 130
    assert calls == [("1/60", 6)]
    assert run() == study


def test_the_help_shows_defaults_that_are_not_empty(capsys):
    with pytest.raises(SystemExit):
        timestep.main(["--help"])
    shown = " ".join(capsys.readouterr().out.split())
    assert "runs at a time (default: 2)" in shown
    assert "(default: )" not in shown


def _hit(shot: Any) -> float:
    """Returns the time of the first contact of two balls, s."""
    return float(shot.events["time"][list(shot.events["kind"]).index("ball_ball")])


def test_direct_pots_touch_no_cushion():
    scene, count = Scene.named("pool"), 3000
    random = np.random.default_rng(3)
    positions = random.uniform(-0.9, 0.9, (count, 2, 2)) * np.array(scene.half_extents)
    positions = positions[np.linalg.norm(positions[:, 0] - positions[:, 1], axis=1) > 0.1]
    to_ball = positions[:, 1] - positions[:, 0]
    velocities = 2.8 * to_ball / np.linalg.norm(to_ball, axis=1)[:, None] + random.normal(0, 0.08, to_ball.shape)
    direct, pockets = timestep.direct_pots(velocities, positions, scene, PIC)
    potted = 0
    for i, velocity in enumerate(velocities[:600]):
        shot: Any = simulate(scene, positions[i], velocity, record=True)
        kinds, balls = shot.events["kind"].tolist(), shot.events["ball"].tolist()
        before_hit = kinds[: kinds.index("ball_ball")] if "ball_ball" in kinds else kinds
        banked = ("cushion", 1) in zip(kinds, balls, strict=True) or "cushion" in before_hit
        success = bool(shot.potted[1] and not shot.potted[0])
        potted += success
        assert direct[i] == (success and not banked)
        if direct[i]:
            pocket = scene.table.pockets[pockets[i]]
            assert shot.positions[1].tolist() == [pocket.x, pocket.y]
    assert 0 < direct[:600].sum() < potted


@pytest.mark.parametrize("degrees", [25.0, -40.0])
def test_a_line_beside_the_ghost_ball_has_this_error(degrees):
    scene, ball = Scene.named("pool"), np.array([0.3, 0.2])
    pocket = scene.table.pockets[-1]
    to_pocket = np.array([pocket.x, pocket.y]) - ball
    to_pocket /= np.linalg.norm(to_pocket)
    cut, touching = math.radians(degrees), 2 * scene.balls.radius[0]

    def turned(vector: Any, angle: float) -> Any:
        c, s = math.cos(angle), math.sin(angle)
        return np.array([[c, s], [-s, c]]) @ vector

    start = ball - touching * to_pocket - 0.6 * turned(to_pocket, cut)
    to_ball = ball - start
    for offset in (-0.004, 0.0, 0.004):
        beside = math.copysign(touching * math.sin(abs(cut)) + offset, cut)  # distance of the ball from the line
        line = turned(to_ball, math.asin(beside / np.linalg.norm(to_ball)))
        velocity, table = 1.6 * line[None] / np.linalg.norm(line), np.array([[start, ball]])
        aimed = timestep.aims(velocity, table, np.array([-1]), scene, 1 / 60)
        assert aimed.error[0] == pytest.approx(offset, abs=1e-12)
        assert aimed.cut[0] == pytest.approx(abs(degrees), abs=1e-9)


def test_the_speed_at_the_hit_is_that_of_the_engine():
    scene = Scene.named("pool")
    positions = np.tile([[-0.5, 0.3], [0.9, 0.3]], (3, 1, 1))
    speeds = np.array([1.0, 1.5, 3.0])
    velocities = np.stack((speeds, 0.0 * speeds), 1)
    corner = next(k for k, pocket in enumerate(scene.table.pockets) if pocket.x > 0 and pocket.y > 0)
    aimed = timestep.aims(velocities, positions, np.full(3, corner), scene, 0.0)
    for k in range(3):
        shot = simulate(scene, positions[k], velocities[k], record=True)
        at = _hit(shot) - 1e-9
        speed = 1e7 * np.linalg.norm(shot.at(at)[0] - shot.at(at - 1e-7)[0])
        assert speed == pytest.approx(aimed.speed[k], rel=0.02)  # a ghost ball off the line is a little farther


@pytest.mark.parametrize("degrees", [20.0, 40.0])
def test_the_predicted_error_makes_up_for_the_timestep_on_average(degrees):
    scene, dt, speed, count = Scene.named("pool"), 1 / 120, 1.5, 400
    cut, touching = math.radians(degrees), 2 * scene.balls.radius[0]
    distance = np.random.default_rng(0).uniform(0.3, 0.36, count)

    def mean_angle(error: float, engine: Engine = PIC) -> float:
        aside = touching * math.sin(cut) + error
        positions = np.zeros((count, 2, 2))
        positions[:, 0] = np.stack((-distance, np.full(count, -aside)), 1)
        shots = [simulate(scene, start, [speed, 0.0], engine=engine, record=True) for start in positions]
        gone = [shot.at(_hit(shot) + 0.05)[1] for shot in shots]
        return math.degrees(np.mean([math.atan2(y, x) for x, y in gone]))

    at_hit = math.sqrt(speed**2 - 2 * 0.2 * 9.81 * 0.28)
    exact, late = mean_angle(0.0), mean_angle(0.0, Engine("pit", dt))
    corrected = mean_angle(-0.5 * at_hit * dt * math.sin(cut) * math.cos(cut), Engine("pit", dt))
    assert exact == pytest.approx(degrees, abs=0.1)
    assert late > exact + 1.0
    assert abs(corrected - exact) < 0.15 * (late - exact)


def test_the_statistics_of_the_report():
    assert timestep_report.gap(np.array([[0.1, 0.2], [0.3, 0.4]]), np.array([0.1])).round(9).tolist() == [0.05, 0.25]
    exact = [{"aim": [[1, 2.0, 0.0], [0, 0.0, 0.0]]}]
    late = [{"aim": [[1, 2.0, 4.0], [0, 0.0, 0.0]]}, {"aim": [[3, -2.0, 0.0], [0, 0.0, 0.0]]}]
    assert timestep_report.mean_errors(late).tolist() == [[4, -1.0, 1.0], [0, 0.0, 0.0]]
    errors = timestep_report.aim_errors({"exact": exact, "1/60": late})["1/60"]
    assert errors.tolist() == [[4, -3.0, 1.0], [0, 0.0, 0.0]]
    assert timestep_report.square_difference(errors) == 4.0


def test_the_results_of_the_project_are_those_of_its_runs():
    content = json.loads(results("timestep").read_text(encoding="utf-8"))
    assert content["settings"]["training"] == yaml.safe_load(timestep.SETTINGS.read_text())
    for worlds, seeds in ((timestep.WORLDS, timestep.SEEDS), (timestep.MOVE_BACK, timestep.FEW_SEEDS)):
        assert all(content["runs"][world].keys() == set(map(str, seeds)) for world in worlds)
    folders = {timestep.policy_folder(timestep.OUTPUT, world) for world in timestep.WORLDS}
    assert set((timestep.RESULTS / "policies" / "timestep").iterdir()) == folders
    assert "Not measured" not in fill_page("<!-- timestep: main -->\n<!-- end -->")


def test_the_page_has_shots_that_only_their_own_world_pots(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(timestep_shots, "SHOWN", 2)
    output = tmp_path / "shots.json"
    timestep_shots.main(["--output", str(output)])
    layouts = json.loads(output.read_text(encoding="utf-8"))["layouts"]
    assert layouts == json.loads(results("timestep_shots").read_text(encoding="utf-8"))["layouts"][:2]
    for layout in layouts:
        assert list(layout["shots"]) == list(timestep.WORLDS)
        for world, exact in (("exact", True), (timestep_shots.COARSE, False)):
            assert layout["shots"][world]["own"]
            assert layout["shots"][world]["exact"] == exact
    assert 'target="shot">potted, missed</a>' in capsys.readouterr().out
