"""The geometric and the searching player: named layouts, their formulas against the engine, and what they reach."""

import json

import gymnasium as gym
import numpy as np
import pytest

from billiards_env import Scene, simulate
from billiards_env.envs import BilliardsEnv
from billiards_env.players import pots
from billiards_env.players.pots import direct_pots
from studies import players
from studies.players import PLAYERS, geometric, main, make_player, measure, rehearse, search

RNG = np.random.default_rng
POOL = Scene.named("pool")
# Corner pockets 0, 1 at x < 0 and 2, 3 at x > 0, side pockets 4 at y < 0 and 5 at y > 0.
LAYOUTS = {
    "straight into the corner": ([[0.4, -0.235], [0.97, 0.335]], 3),
    "straight into the side": ([[0.0, -0.3], [0.0, 0.2]], 5),
    "half-ball cut into the corner": ([[0.3, 0.0], [0.97, 0.335]], 3),
    "thin cut into the corner": ([[0.95, -0.3], [0.97, 0.4]], 3),
    "along the cushion": ([[0.2, 0.5], [0.7, 0.6064]], 3),
    "balls in contact": ([[0.97 - 2 * 0.0202, 0.335 - 2 * 0.0203], [0.97, 0.335]], 3),
    "length of the table": ([[-1.1, -0.5], [0.4, 0.2]], 3),
}
named = pytest.mark.parametrize(("positions", "pocket"), LAYOUTS.values(), ids=LAYOUTS)


def at(positions, **kwargs):
    """An environment with the balls placed so."""
    env = BilliardsEnv(**{"n_object_balls": len(positions) - 1, **kwargs})
    env.reset(options={"positions": positions})
    return env


def pots_of(env):
    return direct_pots(env.scene, env.targets, env.positions, env.potted, env.max_speed)


@named
def test_the_geometric_player_pots(positions, pocket):
    env = at(positions)
    found = pots_of(env)
    assert pocket in found.pocket
    *_, info = env.step(geometric(env, RNG(0)) / env.max_speed)
    assert info["success"]
    assert info["cushions"][1] == 0


@named
def test_every_direct_pot_pots_unless_the_cue_ball_comes_in_between(positions, pocket):
    found = pots_of(at(positions))
    for direction, speed, goal in zip(found.direction, found.speed, found.pocket, strict=True):
        shot = simulate(POOL, positions, speed * direction)
        assert shot.potted[1]
        there = POOL.table.pockets[goal]
        assert shot.positions[1].tolist() == [there.x, there.y]


def test_the_tolerance_is_the_error_that_a_pot_allows():
    positions = [[0.3, 0.0], [0.97, 0.335]]
    found = pots_of(at(positions))
    direction, speed, tolerance = found.direction[0], found.speed[0], found.tolerance[0]

    def drops(error):
        c, s = np.cos(error), np.sin(error)
        turned = [c * direction[0] - s * direction[1], s * direction[0] + c * direction[1]]
        return bool(simulate(POOL, positions, 1.3 * speed * np.array(turned)).potted[1])

    assert drops(0.8 * tolerance)
    assert drops(-0.8 * tolerance)
    assert not drops(1.5 * tolerance)
    assert not drops(-1.5 * tolerance)


def test_blocked_ways_are_seen():
    straight = [[0.4, -0.235], [0.97, 0.335]]
    assert 3 in pots_of(at(straight)).pocket
    for blocker in ([0.7, 0.065], [0.66, 0.065], [1.1, 0.465], [1.15, 0.475]):  # of the cue ball, of ball 1
        found = pots_of(at([*straight, blocker]))
        assert not ((found.ball == 1) & (found.pocket == 3)).any()
    for clear in ([0.62, 0.075], [1.1, 0.38]):
        found = pots_of(at([*straight, clear]))
        assert ((found.ball == 1) & (found.pocket == 3)).any()


def test_potted_balls_are_neither_played_nor_in_the_way():
    positions = np.array([[0.4, -0.235], [0.97, 0.335], [0.7, 0.065]])
    found = direct_pots(Scene.named("pool", 2), np.array([False, True, True]), positions, np.array([0, 0, 1]) > 0, 4.0)
    assert set(found.ball.tolist()) == {1}
    assert 3 in found.pocket


def test_a_pocket_in_the_cue_balls_way_blocks():
    # The cue ball's way to ball 1 runs along the cushion, over the mouth of a side pocket; without one it is a pot.
    positions = [[-0.5, 0.6], [0.5, 0.58]]
    assert not len(pots_of(at(positions)).speed)
    closed = POOL.to_dict()
    closed["table"]["pockets"] = [p for p in closed["table"]["pockets"] if p["x"]]
    assert len(pots_of(at(positions, scene=closed, n_object_balls=None)).speed)


def test_a_shot_is_no_slower_than_it_must_and_no_faster_than_it_may():
    positions = [[-1.1, -0.5], [0.4, 0.2]]
    found = pots_of(at(positions))
    slowest, direction = found.speed.min(), found.direction[np.argmin(found.speed)]
    assert found.speed.max() == 4.0
    slower = pots_of(at(positions, max_speed=0.99 * slowest)).speed.min()  # so slow that it just drops
    assert simulate(POOL, positions, slower * direction).potted[1]
    assert not simulate(POOL, positions, 0.95 * slower * direction).potted[1]
    assert len(pots_of(at(positions, max_speed=0.99 * slower)).speed) == 0


@pytest.mark.parametrize("motion", ["sliding", "rolling"])
@pytest.mark.parametrize("distance", [0.01, 0.2, 1.0, 2.0])
def test_speeds_are_those_of_the_engine(motion, distance):
    scene = Scene.from_dict(
        {
            "balls": {"radius": [0.03], "mass": [0.2]},
            "table": {"length": 1000.0, "width": 1.0},
            "physics": {"motion": motion, "cushion": "restitution"},
        }
    )

    def run(speed, time=None):
        return simulate(scene, [[0.0, 0.0]], [speed, 0.0], max_time=time)

    start = pots._launch(scene, distance, 0.0)
    assert run(start).positions[0, 0] == pytest.approx(distance, rel=1e-12)
    for speed in (0.1, 1.0, 5.0):
        start = pots._launch(scene, distance, speed)
        low, high = 0.0, 100.0
        for _ in range(100):  # when it is there
            middle = (low + high) / 2
            low, high = (middle, high) if run(start, middle).positions[0, 0] < distance else (low, middle)
        shot = run(start, low)
        assert shot.velocities[0, 0] == pytest.approx(speed, rel=1e-9)
        left, slip = pots._arrival(scene, distance, start)
        assert left == pytest.approx(speed, rel=1e-12)
        assert slip == pytest.approx(left - 0.03 * shot.spins[0, 1] if motion == "sliding" else 0.0, abs=1e-9)


def test_a_cue_ball_that_follows_is_foreseen():
    # Straight into the corner: a soft hit leaves the cue ball rolling after the ball, far from a cushion all the way.
    env = at([[0.4, -0.235], [0.97, 0.335]])
    found = pots_of(env)
    mine = found.pocket == 3
    foreseen = dict(zip(found.speed[mine], found.scratch[mine], strict=True))
    assert set(foreseen.values()) == {False, True}
    for speed, scratch in foreseen.items():
        shot = simulate(POOL, env.positions, speed * found.direction[mine][0])
        assert shot.potted[0] == scratch
    assert found.scratch.tolist() == sorted(found.scratch)  # the good ones come first


def test_without_a_direct_pot_the_nearest_ball_is_hit_hard():
    # Straight across the table, ball 1 by the far cushion: every pocket would take a cut of nearly 90 degrees.
    env = at([[-0.325, -0.476], [-0.334, 0.599]])
    assert len(pots_of(env).speed) == 0
    velocity = geometric(env, RNG(0))
    assert np.hypot(*velocity) == pytest.approx(4.0)
    *_, info = env.step(velocity / 4.0)
    assert info["first_hit"] == 1


@pytest.mark.parametrize("kwargs", [{"n_object_balls": 3, "max_shots": 4}, {"scene": "carom", "task": "carom"}])
def test_a_rehearsal_is_what_a_step_would_be(kwargs):
    env = BilliardsEnv(**kwargs, scratch_penalty=0.3)
    rng = RNG(0)
    for seed in range(5):
        env.reset(seed=seed)
        over = False
        while not over:
            before = env.positions
            actions = np.concatenate((rng.uniform(-1, 1, (50, 2)), search(env, rng, 200)[None] / env.max_speed))
            rewards = rehearse(env, actions)
            assert env.positions.tobytes() == before.tobytes()
            k = int(np.argmax(rewards))
            _, reward, over, _, _ = env.step(actions[k])
            assert reward == rewards[k]


def test_the_searching_player_is_as_good_as_the_geometric_one_and_repeatable():
    env, rng = BilliardsEnv(), RNG(0)
    rewards: dict[str, list[float]] = {"geometric": [], "search:1": [], "search:50": []}
    for name in rewards:
        player = make_player(name)
        for seed in range(60):
            env.reset(seed=seed)
            rewards[name].append(float(env.step(player(env, rng) / env.max_speed)[1]))
    gain = np.array(rewards["search:50"]) - np.array(rewards["geometric"])
    assert (gain >= 0).all()
    assert (gain > 0).any()
    assert sum(rewards["search:1"]) > 0.8 * sum(rewards["geometric"])  # the same shot, where there is a direct pot
    env.reset(seed=5)
    assert search(env, RNG(1), 100).tobytes() == search(env, RNG(1), 100).tobytes()


def test_with_noise_the_most_robust_of_the_best_shots_is_played(monkeypatch):
    env, seen = at([[0.4, -0.235], [0.97, 0.335]]), []

    def earns(env, actions):
        """All shots are alike at first; astray, the slower the better."""
        seen.append(actions)
        return np.ones(len(actions)) if len(seen) == 1 else -np.hypot(*actions.T)

    monkeypatch.setattr(players, "rehearse", earns)
    velocity = search(env, RNG(0), 40, noise=(0.1, 0.05))
    first, astray = seen
    finalists = first[: players._FINALISTS]
    assert astray.shape == (players._REHEARSALS * players._FINALISTS, 2)
    errors = np.hypot(*(astray.reshape(players._REHEARSALS, -1, 2) - finalists).transpose(2, 0, 1))
    assert 0.001 < errors.mean() < 0.05
    slowest = finalists[np.argmin(np.hypot(*finalists.T))]
    assert np.hypot(*(velocity / 4)) == pytest.approx(np.hypot(*slowest), abs=0.03)
    assert velocity.tolist() in (4 * finalists).tolist()


def test_what_they_reach():
    arguments = ({}, (0.0, 0.0))
    rates = {n: measure(n, *arguments, 150, 1)["success_rate"] for n in ("random", "geometric", "search:300")}
    assert rates["random"] < 0.05
    assert rates["geometric"] > 0.85
    assert rates["search:300"] > 0.97
    noisy = measure("geometric", {}, (0.125, 0.075), 150, 1)["success_rate"]
    assert noisy < rates["geometric"] - 0.1
    assert measure("geometric", {"n_object_balls": 3, "max_shots": 5}, (0.0, 0.0), 40, 1)["success_rate"] > 0.75
    assert measure("search:300", {"scene": "carom", "task": "carom"}, (0.0, 0.0), 40, 1)["success_rate"] > 0.5


@pytest.mark.parametrize("name", ["serch", "search:", "search:0", "search:x", "search:1.5", "geometric:5", ""])
def test_unknown_players_are_refused(name):
    with pytest.raises(ValueError, match=r"player = .*: expected"):
        make_player(name)


def test_the_table_is_printed_and_written(tmp_path, capsys, monkeypatch):
    output = tmp_path / "players.json"
    arguments = ["--episodes", "20", "--output", str(output)]
    main([*arguments, "--env", '{"n_object_balls": 2}', "--noise", "0.1", "0.05", "--players", "geometric", "search:5"])
    printed = capsys.readouterr().out
    written = json.loads(output.read_text())
    assert [r["player"] for r in written["results"]] == ["geometric", "search:5"]
    for r in written["results"]:
        assert r["env"] == {"n_object_balls": 2}
        assert r["noise"] == [0.1, 0.05]
        assert r["episodes"] == 20
        low, high = r["confidence_interval_95"]
        assert f"| own | {r['player']} | {r['success_rate']:.1%} | {low:.1%} - {high:.1%} |" in printed
    cases = {name: ({}, (std, 0.0), ("random",)) for name, std in (("first", 0.0), ("last", 1.0))}
    monkeypatch.setattr(players, "CASES", cases)
    main(arguments)
    assert [r["case"] for r in json.loads(output.read_text())["results"]] == ["first", "last"]


def test_bad_arguments_end_with_their_message(tmp_path):
    for arguments, message in (
        (["--players", "nobody"], "player = 'nobody'"),
        (["--env", "{"], "Expecting property name"),
        (["--env", '{"scen": 1}'], "unexpected keyword argument 'scen'"),
        (["--env", "{}", "--noise", "-1", "0"], "angle_std = -1.0"),
        (["--episodes", "0"], "episodes = 0: expected a whole number >= 1"),
        (["--seed", "-1"], "seed = -1: expected a whole number >= 0"),
    ):
        with pytest.raises(SystemExit, match=message):
            main([*arguments, "--output", str(tmp_path / "never.json")])
    assert not list(tmp_path.iterdir())


def test_every_case_is_possible():
    for env, noise, names in players.CASES.values():
        gym.make("Billiards-v0", **env).reset(seed=0)
        assert all(make_player(name, noise) for name in names)
    assert {name.partition(":")[0] for *_, names in players.CASES.values() for name in names} == set(PLAYERS)
