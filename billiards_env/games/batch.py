"""Judging many shots from one position. Each distinct outcome is judged once.

The shots of a search have few distinct outcomes: the ball touched first, the potted balls, and whether a cushion was
met after the hit. Compiled code finds them, and the rules of the game judge each of them once.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.checks import numbers
from billiards_env.games.facts import Facts
from billiards_env.games.game import GameState, Setup
from billiards_env.games.outcomes import group_rows, write_outcomes
from billiards_env.games.rules import Rules
from billiards_env.games.state import NO_CALL, Call, RuleState, Verdict
from billiards_env.scene import Scene
from billiards_env.shots.simulation import BatchResult, simulate_batch

_MOST_CUSHIONS = 3  # more cushion contacts before a hit make no difference


def judge_batch(
    setup: Setup, game: GameState, velocities: ArrayLike, spins: ArrayLike | None = None, threads: int | None = None
) -> tuple[list[Verdict], NDArray[np.int64]]:
    """Simulates m shots of the cue ball from one position and judges them.

    The verdict is that of `game.play`, with these differences: in a game with called shots the player calls the first
    legal ball that the shot pots; potted balls count as potted in the order of their numbers; and of several balls
    touched at the same instant one counts as touched first.

    Args:
        setup: The settings of the game.
        game: The state before the shot, with the cue ball in its place.
        velocities: (m, 2) velocities of the cue ball, m/s.
        spins: (m, 3) its angular velocities, rad/s; None for zero.
        threads: As in `simulate_batch`.

    Returns:
        The distinct verdicts, and the index (m,) of the verdict of each shot.

    Example:
        >>> from billiards_env.games import opening
        >>> setup = Setup("nine_ball", Scene.named("pool", 9))
        >>> game = opening(setup, np.random.default_rng(0))
        >>> verdicts, which = judge_batch(setup, game, [[0.0, 1.0], [2.0, 0.0], [-1.0, 0.0]])
        >>> [verdict.foul for verdict in verdicts], which.tolist()
        (['no_hit', 'wrong_ball'], [0, 1, 0])
    """
    state = game.state
    balls = (state.cue_balls[0], *sorted(state.object_balls))  # the engine strikes the first ball
    speeds = numbers("velocities", velocities)
    batch = simulate_batch(
        _scene_of(setup.scene, balls),
        np.broadcast_to(game.positions[list(balls)], (len(speeds), len(balls), 2)),
        speeds,
        mode=setup.mode,
        dt=setup.dt,
        fix=setup.fix,
        spins=spins,
        threads=threads,
    )
    pockets, cushion_after = np.empty(batch.potted.shape, np.int8), np.empty(len(speeds), np.bool_)
    counts = batch.cushions, batch.cushions_before_hit, batch.first_hit
    centres = np.array([(p.x, p.y) for p in setup.scene.table.pockets]).reshape(-1, 2)
    write_outcomes(centres, batch.positions, batch.potted, *counts, pockets, cushion_after)
    which, examples = _grouped(setup.game_rules, state, batch, pockets, cushion_after)
    facts = [_facts(batch, k, pockets[k].tolist(), bool(cushion_after[k]), balls) for k in examples]
    calls = [best_call(setup.game_rules, state, found) for found in facts]
    verdicts = [setup.game_rules.judge(state, found, call) for found, call in zip(facts, calls, strict=True)]
    return verdicts, which


def best_call(rules: Rules, state: RuleState, facts: Facts) -> Call:
    """Returns the call of the first legal ball that a shot pots; no call if there is none or the game needs none."""
    if state.called and not state.break_shot:
        legal = rules.legal(state, state.player)
        for ball, pocket in zip(facts.potted, facts.pockets, strict=True):
            if ball in legal:
                return Call(ball, pocket)
    return NO_CALL


@functools.lru_cache(maxsize=64)
def _scene_of(scene: Scene, balls: tuple[int, ...]) -> Scene:
    """Returns the scene with some of its balls in a given order."""
    radius, mass = (tuple(values[i] for i in balls) for values in (scene.balls.radius, scene.balls.mass))
    return dataclasses.replace(scene, balls=dataclasses.replace(scene.balls, radius=radius, mass=mass))


def _grouped(
    rules: Rules,
    state: RuleState,
    batch: BatchResult,
    pockets: NDArray[np.int8],
    cushion_after: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], list[int]]:
    """Groups shots with the same outcome; returns the group of each shot, and the first shot of each group."""
    columns = [pockets, batch.first_hit[:, None], cushion_after[:, None]]
    if state.break_shot:
        columns.append(batch.cushions > 0)
    if not rules.pockets:
        columns.append(np.minimum(batch.cushions_before_hit, _MOST_CUSHIONS))
    rows = np.concatenate([column.astype(np.int8) for column in columns], axis=1)
    group, examples = np.empty(len(rows), np.int64), np.empty(len(rows), np.int64)
    count = group_rows(rows, group, examples)
    return group, examples[:count].tolist()


def _facts(batch: BatchResult, k: int, pockets: list[int], cushion_after: bool, balls: tuple[int, ...]) -> Facts:
    """Returns the facts of shot k of `balls`. The potted balls are in the order of their numbers, not of time."""
    first, cushions = int(batch.first_hit[k]), batch.cushions[k].tolist()
    before = batch.cushions_before_hit[k].tolist()
    touched = sorted((ball for ball in range(len(balls)) if before[ball] >= 0), key=lambda i: (before[i], i != first))
    potted = sorted((balls[i], pocket) for i, pocket in enumerate(pockets) if pocket >= 0)
    return Facts(
        () if first < 0 else (balls[first],),
        tuple((balls[i], before[i]) for i in touched),
        tuple(ball for ball, _ in potted),
        cushion_after,
        frozenset(balls[i] for i in range(1, len(balls)) if cushions[i] > 0 or pockets[i] >= 0),
        tuple(pocket for _, pocket in potted),
        cushions[0] > 0 or pockets[0] >= 0,
    )
