"""The study of timesteps: its runs, what it measures, its statistics, and its page."""

import contextlib
import json
import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from billiards_env import Scene, simulate
from billiards_env.engine import PIC, Engine
from studies import executor, timestep, timestep_report, timestep_shots
from studies.readme import fill_page, results
from tests.helpers.processes import InThisProcess

pytest.importorskip("matplotlib")

TINY = "--shots 2048 --envs 1024 --hidden 16 --points 4 --epochs 1"


WORLDS = {"exact": {}, "1/60": timestep.WORLDS["1/60"], "1/15": timestep.WORLDS["1/15"]}
TUNED = timestep.Run("fine_tuning", "1/60", 5, [{}], TINY + " --evaluate-every 1024", "main_1-60_5")
PARTS = {
    "main": [timestep.Run("main", world, seed, [env], TINY) for seed in (5, 6) for world, env in WORLDS.items()],
    "random": [timestep.Run("random", "random", 5, [WORLDS["1/60"], WORLDS["1/15"]], TINY)],
    "fine_tuning": [TUNED],
    "long": [timestep.Run("long", world, 5, [WORLDS[world]], TINY) for world in ("exact", "1/60")],
    "carom": [
        timestep.Run("carom", world, 5, [{**timestep.GAMES["carom"][0], **env}], TINY + " --aim layout")
        for world, env in WORLDS.items()
    ],
}


def shrink(patch: pytest.MonkeyPatch) -> None:
    """Makes the study tiny, and trains in this thread."""
    patch.setattr(timestep, "WORLDS", WORLDS)
    patch.setattr(timestep, "WORLDS_OF_GAMES", tuple(WORLDS))
    patch.setattr(timestep, "PARTS", PARTS)
    patch.setattr(timestep, "LAYOUTS", 200)
    patch.setattr(timestep, "executor", lambda *_: contextlib.nullcontext(InThisProcess()))
    patch.setattr(timestep_report, "SHOTS_OF_FINE_TUNING", (0, 1024, 2048))


def arguments(folder):
    return ["--output", str(folder / "timestep.json"), "--images", str(folder)]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The folder and the results of a tiny study."""
    folder = tmp_path_factory.mktemp("study")
    with pytest.MonkeyPatch.context() as patch:
        shrink(patch)
        timestep.main(arguments(folder))
    return folder, json.loads((folder / "timestep.json").read_text())


def test_the_results_have_all_runs(study):
    folder, content = study
    assert content["runs"].keys() == {run.name for runs in PARTS.values() for run in runs}
    assert {path.stem for path in timestep.policy_folder(folder / "timestep.json").iterdir()} == {
        run.name for run in PARTS["main"]
    }
    for run in content["runs"].values():
        assert run["curve"][-1]["shots"] == 2048
        assert run["success"].keys() == WORLDS.keys()
        if run["part"] in timestep.GAMES:
            assert run["own"] == run["success"][run["world"]]
        else:
            assert run["own"] - run["false_successes"] == run["success"]["exact"] - run["false_failures"]
    assert content["runs"]["main_1-15_6"]["own"] == content["runs"]["main_1-15_6"]["success"]["1/15"]
    assert content["runs"]["main_exact_5"]["false_successes"] == 0


def test_runs_with_results_are_not_trained_again(study, monkeypatch, capsys):
    folder, content = study
    shrink(monkeypatch)
    with monkeypatch.context() as patch:
        patch.setattr(timestep, "train", None)
        patch.setattr(timestep, "executor", executor)
        timestep.main([*arguments(folder), "--address", "no.cluster:1"])  # without missing runs it does not connect
    printed = capsys.readouterr().out
    assert all(block in printed for block in timestep_report.blocks(content).values())
    assert (folder / "timestep_aim.png").read_bytes().startswith(b"\x89PNG")

    trained = []

    def train(run, start, layouts):
        trained.append(run.name)
        raise KeyboardInterrupt

    changed = {**content, "runs": {name: run for name, run in content["runs"].items() if name != "main_1-60_6"}}
    changed["runs"]["random_random_5"] = {**changed["runs"]["random_random_5"], "options": "--shots 1"}
    with monkeypatch.context() as patch:
        patch.setattr(timestep, "train", train)
        patch.setattr(timestep.json, "loads", lambda _: changed)
        with pytest.raises(SystemExit) as stopped:
            timestep.main(arguments(folder))
    assert stopped.value.code == 130
    assert trained == ["main_1-60_6"]
    assert not timestep.is_result(changed, PARTS["random"][0])


def test_the_help_shows_defaults_that_are_not_empty(capsys):
    with pytest.raises(SystemExit):
        timestep.main(["--help"])
    shown = " ".join(capsys.readouterr().out.split())
    assert "runs at a time (default: 2)" in shown
    assert "(default: )" not in shown


def test_the_committed_weights_play_as_measured(study):
    folder, content = study
    args = timestep.ppo.arguments(TINY.split())
    policy = timestep.policy_of(timestep.load_arrays(folder / "policies" / "timestep" / "main_1-60_5.npz"), args)
    envs: Any = gym.make_vec(timestep.ppo.ENV_ID, num_envs=200, **timestep.WORLDS["1/60"])
    seed = timestep.LAYOUT_SEED
    assert timestep.ppo.success(policy, envs, seed) == content["runs"]["main_1-60_5"]["own"] / 200


def _hit(shot: Any) -> float:
    """Returns the time of the first contact of two balls, s."""
    return float(shot.events["time"][list(shot.events["kind"]).index("ball_ball")])


def test_direct_pots_touch_no_cushion():
    scene, count = Scene.named("pool"), 3000
    random = np.random.default_rng(3)
    positions = random.uniform(-0.9, 0.9, (count, 2, 2)) * np.array(scene.half_extents)
    positions = positions[np.linalg.norm(positions[:, 0] - positions[:, 1], axis=1) > 0.1]
    to_ball = positions[:, 1] - positions[:, 0]
    actions = 0.7 * to_ball / np.linalg.norm(to_ball, axis=1)[:, None] + random.normal(0, 0.02, to_ball.shape)
    direct, pockets = timestep.direct_pots(actions, positions, scene, 4.0, {})
    potted = 0
    for i, action in enumerate(actions[:600]):
        shot: Any = simulate(scene, positions[i], 4.0 * action, record=True)
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
        action, table = 0.4 * line[None] / np.linalg.norm(line), np.array([[start, ball]])
        aimed = timestep.aims(action, table, np.array([-1]), scene, 4.0, 1 / 60)
        assert aimed.error[0] == pytest.approx(offset, abs=1e-12)
        assert aimed.cut[0] == pytest.approx(abs(degrees), abs=1e-9)


def test_the_speed_at_the_hit_is_that_of_the_engine():
    scene = Scene.named("pool")
    positions = np.tile([[-0.5, 0.3], [0.9, 0.3]], (3, 1, 1))
    speeds = np.array([1.0, 1.5, 3.0])
    velocities = np.stack((speeds, 0.0 * speeds), 1)
    corner = next(k for k, pocket in enumerate(scene.table.pockets) if pocket.x > 0 and pocket.y > 0)
    aimed = timestep.aims(velocities / 4.0, positions, np.full(3, corner), scene, 4.0, 0.0)
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
    runs = [
        {"aim": {"cut angle": [[1, 2.0, 4.0], [0, 0.0, 0.0]]}},
        {"aim": {"cut angle": [[3, -2.0, 0.0], [0, 0.0, 0.0]]}},
    ]
    assert timestep_report.mean_errors(runs, "cut angle").tolist() == [[-1.0, 1.0], [0.0, 0.0]]
    run = {"curve": [{"shots": 10, "success": 0.1}, {"shots": 20, "success": 0.4}]}
    assert timestep_report.success_after(run, 15) == 0.4


def test_the_results_of_the_project_are_those_of_its_runs():
    content = json.loads(results("timestep").read_text(encoding="utf-8"))
    assert all(timestep.is_result(content, run) for runs in timestep.PARTS.values() for run in runs)
    assert len(content["runs"]) == sum(map(len, timestep.PARTS.values()))
    policies = timestep.policy_folder(timestep.OUTPUT)
    assert {path.stem for path in policies.iterdir()} == {r.name for p in timestep.SAVED for r in timestep.PARTS[p]}
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
