"""The strategies in `Billiards-v0`."""

import numpy as np
import pytest

from billiards_env import simulate
from billiards_env.envs import make_env
from billiards_env.envs.actions import PLAYED
from billiards_env.players.env_player import action_of, env_situation
from billiards_env.players.named import find_player
from billiards_env.players.strategies import FINALISTS, REPEATS, geometric, random, search
from tests.helpers.layouts import NAMED_POTS, at

RNG = np.random.default_rng


def chosen(env, player, rng, *arguments, **fields):
    """Returns the action of a player; `fields` are other fields of the situation."""
    return action_of(env, player(env_situation(env)._replace(**fields), rng, *arguments))


@pytest.mark.parametrize(("positions", "pocket"), NAMED_POTS.values(), ids=NAMED_POTS)
def test_the_geometric_player_pots_the_ball(positions, pocket):
    env = at(positions)
    pots = env_situation(env).pots()
    assert pocket in pots.pocket
    for direction, speed, goal in zip(pots.direction, pots.speed, pots.pocket, strict=True):
        there = env.scene.table.pockets[goal]
        assert simulate(env.scene, positions, speed * direction).positions[1].tolist() == [there.x, there.y]
    *_, info = env.step(chosen(env, geometric, RNG(0)))
    assert info["is_success"]
    assert info["cushions"][1] == 0


def test_without_a_direct_pot_the_geometric_player_plays_a_bank():
    # Straight across the table, ball 1 by the far cushion: every direct pot has a cut of nearly 90 degrees.
    env = at([[-0.325, -0.476], [-0.334, 0.599]])
    *_, info = env.step(chosen(env, geometric, RNG(0)))
    assert info["is_success"]
    assert info["cushions"][1] == 1


def test_without_a_pot_the_geometric_player_hits_the_nearest_ball_hard():
    env = at([[0.0, 0.0], [-0.1, 0.0], [0.5, 0.0]], scene="carom", n_object_balls=None, task="carom")
    assert len(env_situation(env).pots().speed) == 0
    action = chosen(env, geometric, RNG(0))
    assert np.hypot(*action) == pytest.approx(1.0)
    *_, info = env.step(action)
    assert info["first_hit"] == 1


@pytest.mark.parametrize("kwargs", [{"n_object_balls": 3, "max_shots": 4}, {"task": "carom", "layout": "random"}])
def test_ratings_are_the_rewards_of_steps(kwargs):
    env = make_env(**kwargs, scratch_penalty=0.3)
    rng = RNG(0)
    for seed in range(5):
        env.reset(seed=seed)
        over = False
        while not over:
            before = env.positions
            actions = np.concatenate((rng.uniform(-1, 1, (50, 2)), chosen(env, search, rng, 200)[None]))
            rated = env.try_actions(actions).rewards
            assert env.positions.tobytes() == before.tobytes()
            k = int(np.argmax(rated))
            _, reward, over, _, _ = env.step(actions[k])
            assert reward == rated[k]


def test_the_search_player_is_repeatable_and_as_good_as_the_geometric_one():
    env, rng = make_env(), RNG(0)
    earned: dict[str, list[float]] = {"geometric": [], "search:1": [], "search:50": []}
    for name in earned:
        player = find_player(name, env)
        for seed in range(60):
            env.reset(seed=seed)
            earned[name].append(float(env.step(chosen(env, player, rng))[1]))
    gain = np.array(earned["search:50"]) - np.array(earned["geometric"])
    assert (gain >= 0).all()
    assert (gain > 0).any()
    assert sum(earned["search:1"]) > 0.8 * sum(earned["geometric"])  # the same shot, where there is a pot
    env.reset(seed=5)
    assert chosen(env, search, RNG(1), 100).tobytes() == chosen(env, search, RNG(1), 100).tobytes()


def test_with_noise_the_search_plays_the_most_robust_of_the_best_shots():
    env, rated = at([[0.4, -0.235], [0.97, 0.335]]), []

    def rate(actions):
        """Rates all shots equally at first. With errors, slower shots are better."""
        rated.append(actions)
        return np.ones(len(actions)) if len(rated) == 1 else -np.hypot(*actions.T)

    action = chosen(env, search, RNG(0), 40, rate=rate, noise=(0.1, 0.05))
    first, perturbed = rated
    finalists = first[:FINALISTS]
    assert perturbed.shape == (REPEATS * FINALISTS, 2)
    errors = np.hypot(*(perturbed.reshape(REPEATS, -1, 2) - finalists).transpose(2, 0, 1))
    assert 0.001 < errors.mean() < 0.05
    slowest = finalists[np.argmin(np.hypot(*finalists.T))]
    assert np.hypot(*action) == pytest.approx(np.hypot(*slowest), abs=0.03)
    assert action.tolist() in finalists.tolist()


def test_the_search_tries_strikes_with_spin():
    options = {"positions": [[0.2, 0.0], [0.9, 0.3]]}
    env = make_env(scene="real_pool", task="position", action="strike", scratch_penalty=0.0)
    env.reset(seed=0, options={**options, "goal": [0.0, -0.3]})
    tried = []

    def rate(actions):
        tried.append(actions)
        return env.try_actions(actions).rewards

    action = chosen(env, search, RNG(0), 400, rate=rate)
    assert action.shape == (5,)
    (actions,) = tried
    assert actions.shape == (400, 5)
    spun = actions[:, 2:4].any(axis=1)
    assert 150 < spun.sum() <= 200
    assert np.hypot(*actions[:, 2:4].T).max() < 1.0
    assert not actions[:, 4].any()
    assert chosen(env, geometric, RNG(0))[2:].tolist() == [0.0, 0.0, 0.0]
    (expected,) = env.try_actions(action[None]).rewards
    assert env.step(action)[1] == expected


def test_the_search_jumps_over_a_ball():
    env, tried = make_env(task="jump", action="strike", max_speed=6.0), []
    env.reset(seed=0, options={"positions": [[-0.2, -0.1], [0.6, 0.3], [0.2, 0.1]]})

    def rate(actions):
        tried.append(actions)
        return env.try_actions(actions).rewards

    action = chosen(env, search, RNG(0), 200, rate=rate)
    (actions,) = tried
    assert actions.shape == (200, 5)
    raised = actions[:, 4] > 0
    assert raised.sum() == 50
    assert action[4] > 0
    *_, info = env.step(action)
    assert info["is_success"]


ACTIONS = {"velocity": [0.9, 0.8], "strike": [0.5, 0.1, 0.3, -0.2, 0.1], "cut": [0.3, 0.1], "plan": 12}


@pytest.mark.parametrize("action", ACTIONS)
def test_an_environment_plays_the_action_of_an_unchanged_stroke(action):
    env = make_env(action=action, scene="real_pool", n_object_balls=2, max_shots=2)
    env.reset(seed=0)
    stroke, before = env_situation(env).stroke(ACTIONS[action]), env.positions
    assert action_of(env, stroke).tolist() == ACTIONS[action]
    changed = stroke._replace(velocity=(1.0, 0.5), spin=(0.0, 0.0, 0.0))
    if action in PLAYED:
        assert action_of(env, changed)[:2] == pytest.approx([0.25, 0.125])
    else:
        for player in (geometric, random, search):
            with pytest.raises(ValueError, match=f"action of the environment of a player = '{action}': expected one"):
                player(env_situation(env), RNG(0))
        with pytest.raises(ValueError, match="action of the environment of a player"):
            action_of(env, changed)
    env.step(ACTIONS[action])
    spins = [stroke.spin, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
    shot = simulate(env.scene, before, [stroke.velocity, (0.0, 0.0), (0.0, 0.0)], spins=spins)
    assert shot.positions.tobytes() == env.positions.tobytes()


@pytest.mark.parametrize("task", ["pot", "place", "position", "carom", "three_cushion"])
def test_the_aim_player_solves_more_than_the_search(task):
    env, solved = make_env(task=task), {"aim": 0, "search:200": 0}
    for name in solved:
        for seed in range(12):
            env.reset(seed=seed)
            solved[name] += env.step(chosen(env, find_player(name, env), RNG(0)))[1] > 0
    assert solved["aim"] >= max(11 if task != "position" else 9, solved["search:200"])


def test_without_a_goal_the_aim_player_searches():
    env = make_env(task="sum_to_three")
    env.reset(seed=1)
    assert env_situation(env).goals == ()
    aimed = chosen(env, find_player("aim", env), RNG(3))
    np.testing.assert_array_equal(aimed, chosen(env, search, RNG(3)))
