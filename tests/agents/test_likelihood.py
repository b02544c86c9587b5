"""Learning from many shots of each layout."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from agents import train as module
from agents.config import Config, load
from agents.likelihood import LikelihoodTraining, corrections, easy_pots, labels_of, learning_rate, random_hits, scores
from agents.ppo import make_evaluation
from billiards_env.players.strategies import hits
from billiards_env.sb3 import load_policy
from billiards_env.sb3.aim_policy import TURN
from tests.helpers.errors import refusals
from tests.helpers.training import trained_run

TINY: dict[str, Any] = {
    "task": "Place-v0",
    "timesteps": 80_000,
    "learner": "likelihood",
    "checkpoint_every": 20_000,
    "evaluation_episodes": 200,
    "policy": {"arguments": {"hidden": 32, "points": 4, "speeds": [0.05, 0.3, 0.8], "waves": 1, "goal_units": 20}},
    "likelihood": {"layouts": 64, "hits": 12, "own": 4},
}


def test_random_hits_touch_a_ball_at_the_given_speeds():
    learner: Any = LikelihoodTraining(
        Config.from_dict({**TINY, "task": "Carom-v0", "policy": {"arguments": {"hidden": 8}}})
    )
    learner.restart()
    envs = learner._envs
    actions = random_hits(envs, learner.policy, 20, np.random.default_rng(0))
    assert actions.shape == (64, 20, 2)
    speeds = np.hypot(*np.moveaxis(actions, 2, 0))
    assert 0.2 <= speeds.min() < 0.25 < 0.7 < speeds.max() <= 0.8
    infos = envs.try_actions(actions.reshape(-1, 2), envs.get_state().repeat(20)).infos
    assert (infos["first_hit"] > 0).mean() > 0.95  # a few slow ones stop before
    assert {1, 2} <= set(infos["first_hit"].tolist())


def test_random_hits_of_strikes_have_random_offsets_and_a_level_cue():
    positions = np.tile([[0.0, 0.0], [0.5, 0.2]], (3, 1, 1))
    actions = hits(positions, (0.0286, 0.0286), 500, (0.1, 0.9), 5, np.random.default_rng(0))
    offsets = np.hypot(*np.moveaxis(actions[..., 2:4], 2, 0))
    assert 0.8 < offsets.max() < 1.0
    assert (actions[..., 4] < 0).all()
    jumps = hits(positions, (0.0286, 0.0286), 500, (0.1, 0.9), 5, np.random.default_rng(0), raised=True)
    assert np.array_equal(jumps[..., :4], actions[..., :4])
    assert (jumps[..., 4] > 0).mean() == 0.5


@pytest.mark.parametrize("task", ["Place-v0", "Position-v0", "Pot1-v0"])
def test_labels_are_shots_that_reach_their_goals(task):
    learner: Any = LikelihoodTraining(Config.from_dict({**TINY, "task": task}))
    learner.restart()
    envs, rng = learner._envs, np.random.default_rng(0)
    states, shots = envs.get_state(), random_hits(envs, learner.policy, 40, rng)
    labels = labels_of(envs, shots, envs.try_actions(shots.reshape(-1, 2), states.repeat(40)), 50, rng)
    rows = labels.rows.numpy()
    assert 20 < len(rows) <= 50
    again = states[rows].copy()
    if labels.goals is None:
        assert task == "Pot1-v0"
        counts = np.bincount(rows, minlength=len(states))[rows]
        assert (labels.weights.numpy() <= 1.0 / counts + 1e-6).all()
    else:
        again["goals"] = labels.goals.numpy() * envs.single_env.scene.half_extents
        assert (labels.weights <= 1).all()
        assert (labels.weights < 1).any()
    success = envs.try_actions(labels.actions.numpy(), again).infos["is_success"]
    assert success.mean() > 0.99  # goals at the rim, and actions in single precision


@pytest.mark.parametrize("changes", [{}, {"noise": {"angle_std": 5.0}}, {"env": {"action": "strike"}}])
def test_corrected_shots_reach_their_goals_near_the_likeliest_shots(changes):
    settings = {**TINY["likelihood"], "goals": 100}
    learner: Any = LikelihoodTraining(Config.from_dict({**TINY, "likelihood": settings, **changes}))
    learner.restart()
    envs, states = learner._envs, learner._envs.get_state()
    mixtures = learner._mixtures(learner._seen(None))
    labels = learner._corrected(mixtures)
    assert learner.shots == 64 * 100 * (2 + labels.actions.shape[1])  # two, and one for each number of an action
    assert len(labels.rows) > 100
    with torch.no_grad():
        likeliest = mixtures(labels.rows, labels.goals).mode()

    def success(actions):
        again = states[labels.rows.numpy()]
        again["goals"] = labels.goals.numpy() * envs.single_env.scene.half_extents
        return envs.try_actions(actions.numpy(), again).infos["is_success"].mean()

    assert success(labels.actions) > 0.99  # actions and goals in single precision
    assert success(likeliest) < 0.9
    assert (labels.actions - likeliest).norm(dim=1).max() < 1.0


def test_corrections_begin_after_part_of_the_training():
    settings = {**TINY["likelihood"], "goals": 3, "imitation": 1.0}
    learner: Any = LikelihoodTraining(Config.from_dict({**TINY, "likelihood": settings}))
    learner.restart()
    learner.update()
    assert learner.shots == 64 * (12 + 4)
    learner.shots = before = TINY["timesteps"] // 2
    learner.update()
    assert learner.shots - before == 64 * (12 + 4 + 3 * 4)


def test_a_correction_solves_a_linear_miss_and_ignores_directions_without_effect():
    slopes = np.array([[[2.0, 0.0], [0.0, 0.5], [0.0, 0.0]], [[1e-6, 0.0], [0.0, 1.0], [0.0, 1.0]]])
    steps = corrections(slopes, np.array([[[0.4, -0.2]], [[0.4, -0.2]]]), 0.1)
    assert np.allclose(steps, [[0.2, -0.4, 0.0], [0.0, -0.1, -0.1]], atol=0.005)


def test_a_resumed_run_ends_with_the_weights_of_an_uninterrupted_one(tmp_path, monkeypatch):
    config = Config.from_dict(TINY | {"evaluation_episodes": 2000})  # so that the success rises by more than chance
    whole = trained_run(config, tmp_path / "whole")
    curve = module.learning_curve(whole)
    assert curve[-1].success > curve[0].success
    update = LikelihoodTraining.update

    def stop(self):
        if self.shots > 70_000:  # in the second phase
            raise KeyboardInterrupt
        return update(self)

    with monkeypatch.context() as patch:
        patch.setattr(LikelihoodTraining, "update", stop)
        with pytest.raises(KeyboardInterrupt):
            trained_run(config, tmp_path / "parts")
    trained_run(config, tmp_path / "parts")
    loaded: Any = load_policy(whole)[1]
    assert torch.equal(loaded.net.std, torch.load(whole / "policy.pt", weights_only=True)["net.std"])
    assert not torch.equal(loaded.net.std, torch.tensor([0.1, 0.025, 0.2]))  # they are learned
    learner = LikelihoodTraining(config)
    module.start_from(learner.policy, str(whole))
    learner.restart()
    learner.update()
    assert torch.allclose(learner.policy.net.std, loaded.net.std, rtol=0.02)
    ours, theirs = (torch.load(tmp_path / run / "policy.pt", weights_only=True) for run in ("whole", "parts"))
    assert all(torch.equal(ours[name], theirs[name]) for name in ours)
    assert load(whole / "config.yaml") == config
    assert [point[:1] + point[2:] for point in module.learning_curve(tmp_path / "parts")] == [
        point[:1] + point[2:] for point in curve
    ]


@pytest.mark.parametrize(
    "changes",
    [
        {"task": "PositionStrike-v0"},
        {"task": "Pot1-v0"},
        {"policy": {"arguments": {"hidden": 16}}},  # the goal is an input of all networks
        {"task": "Carom-v0", "policy": {"arguments": {"hidden": 16, "own_std": True}}},
        {"task": "Pot3Noise-v0", "policy": {"arguments": {"hidden": 16}}},
    ],
)
@pytest.mark.parametrize("imitation", [0.0, 1.0])
def test_both_phases_learn_tasks_with_and_without_goals_and_strikes(changes, imitation):
    settings = {**TINY["likelihood"], "imitation": imitation}
    learner: Any = LikelihoodTraining(Config.from_dict({**TINY, "likelihood": settings, **changes}))
    learner.restart()
    before = {name: tensor.clone() for name, tensor in learner.policy.net.state_dict().items()}
    for _ in range(3):
        assert 0.0 <= learner.update() <= 1.0
    assert learner.shots == 3 * 64 * (12 + 4 if imitation else 32)
    moved = [name for name, tensor in learner.policy.net.state_dict().items() if not torch.equal(tensor, before[name])]
    assert {"std", "first_points", "choice.4.weight"} <= set(moved)


def test_improvement_raises_the_density_of_shots_above_the_mean_of_their_layout(monkeypatch):
    config = {**TINY, "task": "Pot1-v0", "likelihood": {"layouts": 64, "imitation": 0.0}}
    learner: Any = LikelihoodTraining(Config.from_dict(config))
    learner.restart()
    played = {}

    def play(shots):  # a shot to the right scores
        played["shots"] = shots
        scored = shots[..., 0].flatten() > 0
        return SimpleNamespace(rewards=scored.astype(float), infos={"is_success": scored})

    monkeypatch.setattr(learner, "_play", play)
    seen = learner._seen(learner._envs.reset()[0])
    monkeypatch.setattr(learner, "_seen", lambda observations: seen)

    def mean_log() -> float:
        logs = learner.policy.net(**seen)[0].log_prob(torch.from_numpy(played["shots"]))
        right = torch.from_numpy(played["shots"][..., 0] > 0).float()
        return (logs * (right - right.mean(1, keepdim=True))).mean().item()

    learner.update()
    shots, first = played["shots"], mean_log()
    learner.update()
    played["shots"] = shots
    assert mean_log() > first


def test_an_episode_of_several_shots_goes_on_from_a_shot_that_scores(monkeypatch):
    config = {**TINY, "task": "Pot3-v0", "policy": {"arguments": {"hidden": 16}}}
    learner: Any = LikelihoodTraining(Config.from_dict(config))
    learner.restart()
    outcomes = []
    play = learner._play
    monkeypatch.setattr(learner, "_play", lambda shots: outcomes.append(play(shots)) or outcomes[-1])
    learner.update()
    going = ~learner._over
    assert 0.2 < going.mean() < 1.0
    (one,) = outcomes
    assert np.array_equal(going, ((one.rewards > 0) & ~one.states["over"]).reshape(64, -1).any(1))
    assert (learner._envs.get_state()["shots_left"][going] < learner._config.env["max_shots"]).all()
    learner._over[:] = False
    learner.update()  # no new episode begins
    assert not outcomes[1].states["fresh"].any()


def test_the_return_of_a_shot_is_its_reward_and_the_value_after_it(monkeypatch):
    learner: Any = LikelihoodTraining(
        Config.from_dict({**TINY, "task": "Clear5-v0", "policy": {"arguments": {"hidden": 16}}})
    )
    learner.restart()
    monkeypatch.setattr(learner.policy, "predict_values", lambda seen: torch.full((len(seen), 1), 2.0))
    outcomes = learner._play(random_hits(learner._envs, learner.policy, 6, np.random.default_rng(0)))
    expected = np.maximum(outcomes.rewards + 2.0 * ~outcomes.states["over"], 0.0).reshape(64, 6)
    assert {0.0, 2.0} <= set(expected.flatten())
    assert np.allclose(learner._returns(outcomes, 4).numpy(), expected[:, -4:])


def test_random_hits_of_a_run_out_touch_the_legal_balls():
    positions = np.random.default_rng(1).uniform(-1.0, 1.0, (5, 4, 2))
    legal = np.array([[False, True, False]] * 5)
    actions = hits(positions, (0.001,) * 4, 20, (0.1, 0.9), 2, np.random.default_rng(0), legal=legal)
    angles = np.arctan2(actions[..., 1], actions[..., 0])
    ways = positions[:, 2] - positions[:, 0]
    assert np.allclose(angles, np.arctan2(ways[:, 1], ways[:, 0])[:, None], atol=0.1)


def test_other_features_than_positions_and_the_goal_are_refused():
    config = Config.from_dict({**TINY, "env": {"observe": ["positions", "goal", "shots_left"]}})
    with pytest.raises(ValueError, match="expected only 'positions' and 'goal' in a task with a goal"):
        LikelihoodTraining(config)


def test_with_noise_the_shots_of_an_update_are_noisy(monkeypatch):
    learner: Any = LikelihoodTraining(Config.from_dict({**TINY, "task": "Pot1Noise-v0"}))
    learner.restart()
    played = []
    tried = type(learner._envs).try_actions

    def spy(self, actions, **options):
        outcomes = tried(self, actions, **options)
        played.append((actions, outcomes.infos["played_action"]))
        return outcomes

    monkeypatch.setattr(type(learner._envs), "try_actions", spy)
    learner.update()
    ((actions, noisy),) = played
    assert (np.abs(actions - noisy).max(axis=1) > 0).all()


@refusals(
    "changes",
    [
        ({"learner": "sac"}, "learner = 'sac': expected one of 'ppo', 'likelihood'"),
        ({"learner": "ppo"}, "likelihood = .*: expected nothing with learner = 'ppo'"),
        ({"likelihood": {"shots": 3}}, "key of likelihood = 'shots'"),
        ({"likelihood": {"hits": 0}}, "likelihood.hits = 0: expected"),
        ({"likelihood": {"beta2": 1.0}}, "likelihood.beta2 = 1.0: expected a number from 0 to 0.9999"),
        ({"likelihood": {"learning_rate": 0.1}}, "likelihood.learning_rate = 0.1: expected a pair of rates"),
        ({"ppo": {"n_epochs": 2}}, "ppo = .*: expected nothing with learner = 'likelihood'"),
        ({"policy": {"head": "gaussian"}}, "policy.head = 'gaussian': expected 'aim' with learner = 'likelihood'"),
        ({"env": {"max_shots": 2}}, "env.max_shots = 2: expected 1 with learner = 'likelihood'"),
        ({"task": None, "env": {"task": "nine_ball", "n_players": 3}}, "env.n_players = 3: expected 2 with learner"),
        ({"likelihood": {"imitation": 1.5}}, "likelihood.imitation = 1.5: expected"),
        (
            {"likelihood": {"imitation": 1, "improvement_rate": [1e-3, 1e-5]}},
            "likelihood.imitation = 1.0: expected a number above 0 and below 1 with improvement_rate",
        ),
        (
            {"likelihood": {"imitation": 0, "improvement_rate": [1e-3, 1e-5]}},
            "likelihood.imitation = 0.0: expected a number above 0 and below 1 with improvement_rate",
        ),
        ({"likelihood": {"pots": 1}}, "likelihood.pots = 1: expected 0 in a task of one player"),
        ({"task": "Pot1-v0", "likelihood": {"goals": 1}}, "likelihood.goals = 1: expected 0 in a task without a goal"),
        (
            {"task": "Place-v0", "likelihood": {"goals": 1, "imitation": 0.3}},
            "likelihood.imitation = 0.3: expected more than 0.3 with goals",
        ),
    ],
)
def test_wrong_settings_are_refused(changes, message, kind):
    with pytest.raises(kind, match=message):
        Config.from_dict({**TINY, **changes})


GAME: dict[str, Any] = {
    **TINY,
    "task": None,
    "env": {"task": "eight_ball", "n_players": 2, "can_place": False, "max_shots": 40},
    "noise": {"angle_std": 1.0},
    "policy": {"arguments": {"hidden": 16}},
}


def game_learner(**settings) -> Any:
    learner: Any = LikelihoodTraining(Config.from_dict({**GAME, "likelihood": {**TINY["likelihood"], **settings}}))
    learner.restart()
    return learner


@pytest.mark.parametrize("imitation", [0.0, 1.0])
def test_a_game_goes_on_from_any_shot_of_the_policy(imitation, monkeypatch):
    learner = game_learner(imitation=imitation, samples=4)
    outcomes, play = [], learner._play
    monkeypatch.setattr(learner, "_play", lambda shots: outcomes.append(play(shots)) or outcomes[-1])
    for _ in range(3):
        learner.update()
        one, after = outcomes.pop(), learner._envs.get_state()
        own = one.states.reshape(64, -1)[:, -4:]
        assert not learner._over.any()
        assert all((own[k]["positions"] == after[k]["positions"]).all((1, 2)).any() for k in range(64))
    assert set(learner._envs.get_state()["game"]["player"]) == {0, 1}


def test_the_cue_ball_in_hand_is_placed_where_the_value_is_largest(monkeypatch):
    learner = game_learner()
    net = learner.policy.net
    monkeypatch.setattr(net, "values", lambda **seen: seen["positions"][:, 0, 1] - 9.0 * seen["in_hand"].sum(1))
    seen = learner._seen(learner._envs.reset()[0])
    assert seen["in_hand"][:, 0].all()  # the break
    learner._place(seen)
    states, (_, half_width) = learner._envs.get_state(), learner._envs.single_env.scene.half_extents
    assert (states["game"]["in_hand"] == 0).all()
    places = states["positions"][:, 0]
    assert np.allclose(seen["positions"][:, 0, 1].numpy() * half_width, places[:, 1])
    assert (places[:, 1] > 0.5 * half_width).all()
    assert (places[:, 0] <= learner._envs.single_env.scene.table.head_x).all()
    assert not seen["in_hand"].any()
    rows, before = learner._in_hand
    assert len(rows) == 64
    assert before["in_hand"].any(1).all()


def test_the_value_counts_negative_if_the_other_player_has_the_next_turn(monkeypatch):
    learner = game_learner()
    monkeypatch.setattr(learner.policy, "predict_values", lambda seen: torch.full((len(seen), 1), 0.25))
    learner._place(learner._seen(learner._envs.reset()[0]))
    outcomes = learner._play(random_hits(learner._envs, learner.policy, 20, np.random.default_rng(0)))
    keeps = outcomes.infos["next_player"] == outcomes.infos["player"]
    assert {False, True} == set(keeps)
    returns = learner._returns(outcomes, 20).numpy().flatten()
    assert np.allclose(returns, np.where(keeps, 0.25 + TURN, -0.25))
    assert np.array_equal(scores(learner._envs, outcomes), keeps)


def test_some_of_the_random_hits_of_a_game_are_pots_by_geometry(monkeypatch):
    settings = {**TINY["likelihood"], "pots": 6, "imitation": 1.0}
    config = Config.from_dict({**GAME, "env": {**GAME["env"], "layout": "random"}, "likelihood": settings})
    learner: Any = LikelihoodTraining(config)
    learner.restart()
    envs, played, play = learner._envs, [], learner._play
    envs.reset(seed=1)
    easy = easy_pots(envs, 6, np.random.default_rng(0))
    assert easy.any(2).mean() > 0.9
    assert np.hypot(*np.moveaxis(easy, 2, 0)).max() < 1.0 + 1e-9
    monkeypatch.setattr(learner, "_play", lambda shots: played.append(play(shots)) or played[-1])
    learner.update()
    scored = scores(envs, played[0]).reshape(64, 16).mean(0)
    assert scored[:6].mean() > 2 * scored[6:].mean()


def test_a_rival_plays_the_other_turns_when_a_policy_of_a_game_is_measured():
    envs: Any = make_evaluation(Config.from_dict(GAME), 3)
    envs.reset(seed=0)
    infos = envs.step(np.full((3, 2), 0.1))[-1]
    assert (infos["next_player"] == envs.seats).all()


def test_adam_has_the_settings_of_both_phases():
    training = LikelihoodTraining(Config.from_dict(TINY | {"likelihood": {"beta2": 0.9, "eps": 1e-8}}))
    assert [(group["betas"], group["eps"]) for adam in training._optimizers for group in adam.param_groups] == [
        ((0.9, 0.9), 1e-8)
    ] * 2


def test_the_learning_rate_falls_over_the_training_or_over_each_phase():
    rates = {"imitation": 0.5, "learning_rate": [4e-3, 0.0]}
    assert [learning_rate(rates, part) for part in (0.0, 0.25, 0.5, 0.75)] == pytest.approx([4e-3, 3e-3, 1e-3, 5e-4])
    rates["improvement_rate"] = [1e-3, 1e-4]
    assert [learning_rate(rates, part) for part in (0.0, 0.25, 0.5, 0.75)] == pytest.approx([4e-3, 2e-3, 1e-3, 5.5e-4])
    training: Any = LikelihoodTraining(Config.from_dict(TINY | {"likelihood": {"layouts": 16, **rates}}))
    training.restart()
    training.shots = 60_000  # 0.75 of all
    training.update()
    assert training._optimizers[1].param_groups[0]["lr"] == pytest.approx(5.5e-4)
