"""`Opponents` plays the turns of the other players, so a game looks like an environment of one player."""

import dataclasses
from typing import Any, cast

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

from billiards_env.envs import BilliardsEnv, Opponents, make_env, make_vector_env
from billiards_env.games import Call, Stroke
from billiards_env.players.env_player import acting_in, action_of, env_situation
from billiards_env.players.named import find_player
from billiards_env.scene import Scene
from tests.helpers.games import in_a_row

GAME: dict[str, Any] = {"task": "nine_ball", "n_players": 2, "max_shots": 6}
CALLED: dict[str, Any] = {"task": "straight", "n_players": 2, "n_object_balls": 3, "can_call": True, "layout": "random"}


def rolled(size: int, seed: int = 0) -> Any:
    rng = np.random.default_rng(seed)
    return lambda observations, rows: rng.uniform(-1, 1, (len(rows), size))


@pytest.mark.parametrize("seat", [None, 0, 1])
def test_a_step_ends_with_the_learners_turn_and_sums_all_rewards(seat):
    games = make_vector_env(16, **GAME)
    envs, rng = Opponents(games, rolled(4), seat), np.random.default_rng(1)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    _, infos = envs.reset(seed=0)
    assert (infos["next_player"] == envs.seats).all()
    for _ in range(8):
        seats = envs.seats.copy()
        before = games.get_state()["game"]
        assert (before["player"] == seats).all()
        _, rewards, over, truncated, infos = envs.step(rng.uniform(-1, 1, (16, 4)))
        assert (infos["next_player"] == envs.seats).all()
        assert not truncated.any()
        if over.any():
            final = infos["final_info"]
            won = np.where(final["winner"] < 0, 0.0, np.where(final["winner"] == seats, 1.0, -1.0))
            assert (rewards[over] == won[over]).all()
            assert all((infos["final_obs"][k] is None) != over[k] for k in range(16))
            assert ((envs.seats != seats) == (over & (seat is None))).all()
        assert (rewards[~over] == 0.0).all()


def test_the_opponent_plays_as_if_it_were_alone_at_the_table():
    """A learner that plays the shots of the other policy has the games of two copies of this policy."""
    policy = lambda observations: 0.5 * np.sin(10.0 * observations[:, :4])  # noqa: E731
    envs = Opponents(make_vector_env(4, **GAME), lambda observations, rows: policy(observations), seat=0)
    alone = make_vector_env(4, "Disabled", **GAME)
    seen, _ = envs.reset(seed=3)
    expected, infos = alone.reset(seed=3)
    while True:
        assert (seen == expected).all()
        seen, rewards, over, _, _ = envs.step(policy(seen))
        total, ends = np.zeros(4), np.zeros(4, bool)
        mask = np.ones(4, bool)
        while mask.any():
            expected, _, ends, _, infos = alone.step_where(mask, policy(expected))
            total += np.where(mask, infos["rewards"][:, 0], 0.0)
            mask &= ~ends & (infos["next_player"] != 0)
        assert (rewards == total).all()
        assert (over == ends).all()
        if over.any():
            break


def test_step_where_changes_only_the_environments_in_the_mask():
    envs = make_vector_env(6, **GAME)
    with pytest.raises(ResetNeeded):
        envs.step_where(np.ones(6, np.bool_), np.zeros((6, 4)))
    envs.reset(seed=0)
    twin, mask = make_vector_env(6, **GAME), np.arange(6) % 2 == 0
    twin.set_state(envs.get_state())
    actions = np.random.default_rng(0).uniform(-1, 1, (6, 4))
    before, (_, rewards, *_, infos) = envs.get_state(), envs.step_where(mask, actions)
    after, (_, all_rewards, *_) = envs.get_state(), twin.step(actions)
    assert (after[~mask] == before[~mask]).all()
    assert (after[mask] == twin.get_state()[mask]).all()
    assert (rewards == np.where(mask, all_rewards, 0.0)).all()
    assert (infos["_player"] == mask).all()


@pytest.mark.parametrize(
    ("kwargs", "name"),
    [(GAME, "geometric"), ({**GAME, "can_place": False}, "search:5"), (CALLED, "search:5"), (CALLED, "planner:20")],
    ids=str,
)
def test_players_play_in_games_of_an_environment(kwargs, name):
    games = make_vector_env(2, **kwargs)
    player = find_player(name, games.single_env)
    envs = Opponents(games, acting_in(player, games, seed=0))
    envs.reset(seed=0)
    for _ in range(2):
        *_, infos = envs.step(rolled(games.single_env.action_space.shape[0])(None, range(2)))
        assert (infos["next_player"] == envs.seats).all()


def test_the_action_of_a_stroke_plays_the_stroke():
    env = BilliardsEnv(make_vector_env(1, **CALLED).single_env.model)
    env.reset(seed=1)
    player = find_player("search:40", env)
    for k in range(6):
        stroke = player(env_situation(env), np.random.default_rng(k))
        _, _, over, _, info = env.step(action_of(env, stroke))
        played = cast(Any, env.stroke)
        assert played.velocity == pytest.approx(stroke.velocity, abs=1e-12)
        if stroke.place is not None:
            assert played.place == pytest.approx(stroke.place, abs=1e-9)
        if stroke.call.ball >= 0:
            assert played.call == stroke.call
        assert info["player"] in (0, 1)
        if over:
            env.reset()


def test_wrong_arguments_are_refused():
    with pytest.raises(ValueError, match="n_players = 1: expected a game"):
        Opponents(make_vector_env(2), rolled(2))
    with pytest.raises(TypeError, match="expected a BilliardsVectorEnv"):
        Opponents(3, rolled(2))  # pyright: ignore[reportArgumentType]
    with pytest.raises(ValueError, match="seat = 2"):
        Opponents(make_vector_env(2, **GAME), rolled(4), seat=2)


def test_is_success_is_that_of_the_learner():
    games = make_vector_env(32, task="straight", n_players=2, n_object_balls=1, layout="random")
    player = find_player("geometric", games.single_env)
    envs = Opponents(games, acting_in(player, games, seed=0), seat=0)
    envs.reset(seed=0)
    for _ in range(3):
        *_, over, _, infos = envs.step(np.zeros((32, 4)))
        assert over.any()
        final = infos["final_info"]
        assert (final["is_success"][over] == (final["winner"][over] == 0)).all()
        assert not final["is_success"].any()


def test_rewards_before_the_first_turn_of_the_learner_count():
    games = make_vector_env(8, task="snooker", n_players=2, n_object_balls=8, max_shots=4)
    envs = Opponents(games, lambda observations, rows: np.zeros((len(rows), 4)), seat=1)
    envs.reset(seed=0)
    total = np.zeros(8)
    while True:
        _, rewards, over, _, infos = envs.step(np.zeros((8, 4)))
        total += rewards
        if over.all():
            break
    scores = infos["final_info"]["scores"]
    assert (total == scores[:, 1] - scores[:, 0]).all()


def test_games_that_end_before_the_learners_turn_move_the_seat_or_raise():
    games = make_vector_env(2, **{**GAME, "max_shots": 1})
    envs = Opponents(games, rolled(4))
    _, infos = envs.reset(seed=0)
    assert envs.seats.tolist() == [0, 0] == infos["next_player"].tolist()
    assert len(envs.unplayed) == 1
    with pytest.raises(ValueError, match="expected a larger max_shots"):
        Opponents(games, rolled(4), seat=1).reset(seed=0)


def test_a_reset_with_a_mask_keeps_the_seats_of_the_other_games():
    envs, mask = Opponents(make_vector_env(4, **GAME), rolled(4)), np.array([True, False, False, False])
    envs.reset(seed=0)
    envs.reset()
    assert envs.seats.tolist() == [1, 0, 1, 0]
    envs.reset(seed=5, options={"reset_mask": mask})
    assert envs.seats.tolist() == [0, 0, 1, 0]
    with pytest.raises(TypeError, match="reset_mask"):
        envs.reset(options={"reset_mask": [True] * 4})
    assert envs.seats.tolist() == [0, 0, 1, 0]


def test_after_an_exception_of_the_policy_the_games_have_to_be_reset():
    def failing(observations, rows):
        raise RuntimeError

    envs = Opponents(make_vector_env(4, **GAME), rolled(4), seat=0)
    with pytest.raises(ResetNeeded):
        envs.step(np.zeros((4, 4)))
    envs.reset(seed=0)
    envs.policy = failing
    with pytest.raises(RuntimeError):
        envs.step(np.zeros((4, 4)))
    with pytest.raises(ResetNeeded, match="interrupted"):
        envs.step(np.zeros((4, 4)))
    envs.reset(seed=0)


def test_a_stroke_without_a_call_nominates_the_ball_that_it_touches_in_snooker():
    scene = dataclasses.replace(Scene.named("snooker", 8), physics=Scene.named("real_pool").physics)
    env = make_env(task="snooker", n_players=2, can_call=True, layout="random", scene=scene)
    env.reset(seed=0)
    positions = env.positions
    env.reset(options={"positions": positions, "state": {"colour": True}})
    stroke = find_player("search:30", env)(env_situation(env), np.random.default_rng(0))
    info = env.step(action_of(env, stroke))[4]
    assert (info["foul"], info["scores"][1]) == (0, 0)


def test_the_action_of_a_shot_that_is_handed_back():
    env = make_env(task="nine_ball", n_players=2, can_call=True, scene="real_pool", action="strike")
    env.reset(options={"positions": in_a_row(10), "state": {"choices": ["hand_back"]}})
    action = action_of(env, Stroke((0.0, 0.0), call=Call(kind="hand_back")))
    env.step(action)
    assert env.stroke == Stroke((0.0, 0.0), call=Call(kind="hand_back"))
