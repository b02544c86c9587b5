"""The planner and its levels: it plays every game, keeps its budget, expects noise and plans a good leave."""

import types
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from billiards_env import Engine, Scene, strike
from billiards_env.bench.evaluation import measure
from billiards_env.games import GameState, Setup, Stroke, choices, custom_opening, opening, play
from billiards_env.games.game_state import BEHIND, NOT_IN_HAND, changed
from billiards_env.players import candidates, planner
from billiards_env.players.batch import play_batch
from billiards_env.players.candidates import TIPS, _with_spin
from billiards_env.players.env_player import acting
from billiards_env.players.levels import EXPECTED, LEVELS, expected, level_of, with_noise
from billiards_env.players.named import find_player
from billiards_env.players.planner import Options, _draw_noise, noisy_strokes, plan
from billiards_env.players.situation import game_situation
from billiards_env.players.strategies import geometric
from billiards_env.players.values import Values
from billiards_env.pots import indirect
from tests.helpers.games import hanging, setup

RNG = np.random.default_rng
NOISE = (0.125, 0.075)


@pytest.mark.parametrize("rules", ["snooker", "eight_ball"])
def test_slow_shots_keep_the_time_of_a_decision(rules, monkeypatch):
    """The clock of this test counts work: 2 ms for a shot, 20 ms with its derivatives, 3 ms for the pots of a place."""
    now = 0.0

    def timed(module, name, seconds, count):
        function = getattr(module, name)

        def slow(*args, **kwargs):
            nonlocal now
            now += seconds * count(*args)
            return function(*args, **kwargs)

        monkeypatch.setattr(module, name, slow)

    monkeypatch.setattr("billiards_env.pots.budget.time", types.SimpleNamespace(thread_time=lambda: now))
    timed(planner, "play_batch", 0.002, lambda setup, game, velocities, *_: len(velocities))
    timed(indirect, "simulate_batch", 0.02, lambda scene, places, strokes: len(places))
    timed(candidates, "find_pots", 0.003, lambda tables: len(tables.positions))
    game = setup(rules)
    table = opening(game, RNG(1), "random")
    in_hand = GameState(table.positions, changed(table.state, in_hand=BEHIND))
    for seconds in (0.02, 0.2, 1.0):
        for start in (table, in_hand):
            now = 0.0
            planner.plan(game, start, 6.0, RNG(0), seconds=seconds)
            assert now < 1.1 * seconds + 0.07
            assert now > 0.8 * seconds


def test_a_decision_with_hardly_any_time_simulates_four_shots(monkeypatch):
    played = []

    def counted(setup, game, velocities, *args, **kwargs):
        played.append(len(velocities))
        return play_batch(setup, game, velocities, *args, **kwargs)

    monkeypatch.setattr(planner, "play_batch", counted)
    game = setup("snooker")
    table = opening(game, RNG(1), "random")
    stroke = find_player("planner:0.001ms", game)(game_situation(game, table, 6.0), RNG(0))
    assert played == [4]
    decision = plan(game, table, 6.0, RNG(0), seconds=1e-6)
    assert played == [4, 4, 4]  # the leaves too
    assert (decision.stroke, decision.samples, len(decision.alternatives)) == (stroke, 1, 3)
    assert decision.probability in (0.0, 1.0)
    assert np.isfinite(decision.leave).all()


def snookered(choices):
    """Returns nine ball with ball 1 far away behind a row of balls."""
    game = setup("nine_ball")
    places = [[-1.2, 0.0], [1.2, 0.0], *([-1.1, 0.18 - 0.06 * k] for k in range(7)), [1.2, 0.5]]
    return game, custom_opening(game, places, {"choices": choices})


def test_it_plays_a_push_out_where_the_rules_offer_it_and_every_shot_is_bad():
    game, table = snookered(["push_out"])
    decision = plan(game, table, 6.0, RNG(0), np.inf, 1500, NOISE)
    assert decision.stroke.call.kind == "push_out"
    assert decision.probability == 0.0
    assert choices(play(game, table, decision.stroke).game.state) == ("hand_back",)
    assert "push_out" in str(decision)


def test_it_hands_a_bad_position_back():
    game, table = snookered(["hand_back"])
    decision = plan(game, table, 6.0, RNG(0), np.inf, 600, NOISE)
    assert decision.stroke.call.kind == "hand_back"
    assert decision.value > 0.0
    assert play(game, table, decision.stroke).game.state.player == 1
    easy = custom_opening(game, [[0.6, 0.1], [1.07, 0.435], *table.positions[2:]], {"choices": ["hand_back"]})
    assert plan(game, easy, 6.0, RNG(0), np.inf, 600, NOISE).stroke.call.kind == "shot"


def test_only_the_present_turn_counts_in_a_run():
    game, table = hanging()
    played, push_out = play_batch(game, table, [[-0.1, 0.0], [1.5, 1.035]]), np.zeros(2, bool)
    errors = np.radians(NOISE[0]), NOISE[1]
    both = Values(game, table, 4.0, errors).of(played, push_out)
    alone = Values(game, table, 4.0, errors, run_out=True).of(played, push_out)
    assert both[0] < alone[0] == -1.0  # a foul that leaves the opponent an easy pot
    assert both[1] == alone[1] > 1.0  # a pot


def test_a_plan_has_what_it_expects():
    game, table = hanging(call_shot=True)
    decision = plan(game, table, 4.0, RNG(0), np.inf, 2000, NOISE)
    played = play(game, table, decision.stroke)
    assert (decision.stroke.call.ball, decision.stroke.call.pocket) == (decision.ball, decision.pocket) == (1, 3)
    assert played.verdict.points == 1
    assert decision.probability > 0.95
    np.testing.assert_array_equal(decision.leave[0], played.shot.positions[0])
    assert len(str(decision).splitlines()) == 1 + len(decision.alternatives) > 2
    assert "ball 1 in pocket 3, probability" in str(decision)
    assert decision.value >= max(other.value for other in decision.alternatives)


def test_a_planner_passes_on_the_shots_that_it_considers():
    game, table = hanging(call_shot=True)
    seen: list[tuple[planner.Plan, ...]] = []
    options = Options(leaves=False)
    decision = plan(game, table, 4.0, RNG(0), np.inf, 2000, NOISE, options)
    watched = plan(game, table, 4.0, RNG(0), np.inf, 2000, NOISE, options._replace(watch=seen.append))
    assert (watched.stroke, watched.value) == (decision.stroke, decision.value)
    assert seen[-1][0].stroke == decision.stroke
    assert len(seen) > 1
    for plans in seen:
        assert len({(one.ball, one.pocket) for one in plans}) == len(plans) <= planner.FINALISTS
    assert [one[0].samples for one in seen] == sorted(one[0].samples for one in seen)


def test_the_probability_is_that_of_played_shots_with_errors():
    game = setup("nine_ball")
    for seed in range(3):
        table = opening(game, RNG(seed), "random")
        decision = plan(game, table, 6.0, RNG(0), np.inf, 4000, NOISE)
        errors = RNG(1).standard_normal((200, 2)) * (np.radians(NOISE[0]), NOISE[1])
        stroke = np.array([decision.stroke.velocity]).repeat(200, 0), np.array([decision.stroke.spin]).repeat(200, 0)
        velocities, spins = (array.tolist() for array in noisy_strokes(*stroke, errors, 6.0))
        kept = [
            play(game, table, decision.stroke._replace(velocity=tuple(v), spin=tuple(w)))
            for v, w in zip(velocities, spins, strict=True)
        ]
        share = np.mean([played.verdict.continues or played.game.state.winner == 0 for played in kept])
        assert abs(share - decision.probability) < 0.15


def test_it_sinks_more_balls_under_noise_than_search():
    game = setup("straight", 1)
    points = {}
    for name in ("planner:1500", "search:1500"):
        player, rng, points[name] = find_player(name, game), RNG(3), 0
        for _ in range(60):
            table = opening(game, rng, "random")
            stroke = player(game_situation(game, table, 6.0, NOISE), RNG(0))
            errors = rng.standard_normal((1, 2)) * (np.radians(NOISE[0]), NOISE[1])
            (v,), (w,) = noisy_strokes(np.array([stroke.velocity]), np.array([stroke.spin]), errors, 6.0)
            points[name] += play(game, table, stroke._replace(velocity=tuple(v), spin=tuple(w))).verdict.points
    assert points["planner:1500"] >= points["search:1500"]
    assert points["planner:1500"] > 35


def test_a_stroke_with_spin_is_one_of_the_cue():
    scene = Scene.named("real_pool", 1)
    velocities = np.array([[1.0, 0.5], [-2.0, 0.1], [0.3, -3.0]])
    tips = np.array([1, 3, 6])
    made, spins = _with_spin(scene, velocities, tips, 8.0)
    np.testing.assert_allclose(made, velocities, atol=1e-12)
    for velocity, spin, tip in zip(velocities, spins, tips, strict=True):
        unit = strike(scene, 1.0, 0.0, *TIPS[tip])
        cue = np.hypot(*velocity) / np.hypot(*unit.velocity)
        heading = np.arctan2(velocity[1], velocity[0]) - np.arctan2(unit.velocity[1], unit.velocity[0])
        expected = strike(scene, cue, heading, *TIPS[tip])
        np.testing.assert_allclose(velocity, expected.velocity, atol=1e-12)
        np.testing.assert_allclose(spin, expected.spin, atol=1e-9)
    fast, _ = _with_spin(scene, 9.0 * velocities, tips, 8.0)
    assert (np.hypot(*fast.T) < 9.0 * np.hypot(*velocities.T)).all()


def test_errors_are_normal_and_stratified():
    errors = _draw_noise(50, 64, (0.1, 2.0), RNG(0)).reshape(50, 64, 2)
    np.testing.assert_allclose(errors.std(axis=(0, 1)), (0.1, 2.0), rtol=0.01)
    assert abs(errors.mean(axis=1)).max() < 0.1 * 2.0
    assert abs(np.corrcoef(errors.reshape(-1, 2).T)[0, 1]) < 0.05


@pytest.mark.slow
def test_a_setup_with_the_fixed_timestep_is_played():
    game = Setup("nine_ball", Scene.named("pool", 9), engine=Engine("pit", 1 / 120))
    assert plan(game, opening(game, RNG(0), "random"), 6.0, RNG(0), np.inf, 300).probability >= 0.0


def test_an_evaluation_function_decides():
    game, table = hanging()

    def to_the_left(played):
        return -played.positions[:, 0, 0]

    decision = plan(game, table, 4.0, RNG(0), np.inf, 1000, NOISE, Options(values=to_the_left))
    assert decision.leave[0, 0] < -1.0
    assert -decision.leave[0, 0] == pytest.approx(decision.value, abs=0.15)


# Levels


def test_stronger_levels_pot_more_balls():
    levels = ("beginner", "league", "pro")
    pots = [measure(f"planner:{level}", {}, (0.0, 0.0), 60, 1)["success_rate"] for level in levels]
    assert pots[0] < pots[1] < pots[2]


def test_the_errors_have_the_size_of_the_level():
    stroke, (degrees, speed) = Stroke((3.0, 0.0), None, (0.0, 40.0, 0.0)), LEVELS["club"].noise
    played = [with_noise(stroke, LEVELS["club"].noise, 4.0, RNG(seed)) for seed in range(500)]
    x, y = np.array([one.velocity for one in played]).T
    assert np.degrees(np.arctan2(y, x)).std() == pytest.approx(degrees, rel=0.1)
    assert np.hypot(x, y).std() == pytest.approx(speed, rel=0.1)
    assert np.hypot(x, y).max() <= 4.0
    assert played[0].spin[1] / 40.0 == pytest.approx(np.hypot(*played[0].velocity) / 3.0 * x[0] / np.hypot(x[0], y[0]))
    assert with_noise(Stroke((0.0, 0.0)), (1.0, 1.0), 4.0, RNG(0)) == Stroke((0.0, 0.0))


def test_a_game_and_an_environment_accept_a_level():
    game, table = hanging()
    player: Any = find_player("planner:beginner", game)
    situation = game_situation(game, table, 4.0)
    assert player(situation, RNG(0)) == player(situation, RNG(0))
    assert player(situation, RNG(0)) != player.intend(situation, RNG(0))
    env = gym.make("Billiards/Pot1-v0")
    observation, _ = env.reset(seed=0)
    other: Any = find_player("noisy:club:geometric", game)
    assert (other.intend, other.noise) == (geometric, LEVELS["club"].noise)
    with pytest.raises(ValueError, match="level of the player 'noisy' = 'geometric': expected one of 'beginner'"):
        find_player("noisy:geometric", game)
    assert acting(find_player("planner:pro", env), env, seed=0)(observation).shape == (2,)


def test_a_planner_plays_without_derivatives_in_a_scene_with_flights():
    """No pot is easy, so without flights the planner looks for indirect pots, which need derivatives."""
    game = Setup("nine_ball", Scene.named("jump_pool", 9))
    table = changed(opening(game, RNG(0), "random").state, in_hand=NOT_IN_HAND, break_shot=False)
    places = [[0.0, 0.0], [0.9, 0.0], *([0.2 + 0.06 * k, 0.0] for k in range(8))]
    stroke = find_player("planner:pro", game)(game_situation(game, GameState(np.array(places), table), 6.0), RNG(0))
    assert np.hypot(*stroke.velocity) > 0.0


def test_a_planner_expects_the_errors_of_its_level_and_of_the_game():
    assert expected((0.1, 0.0), level_of("pro")) == pytest.approx((0.1 * 2**0.5, 0.05))
    assert expected((0.0, 0.0), level_of("beginner")) == EXPECTED
    with pytest.raises(ValueError, match=r"a number of shots, or a level: 'beginner', 'club', 'league', 'pro'"):
        level_of("clubs")
