"""Judging many shots from one position. Each distinct outcome is judged once.

The shots of a search have few distinct outcomes: the ball touched first, the potted balls, and whether a cushion was
met after the hit. Compiled code finds them, and the rules of the game judge each of them once.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.games.facts import Facts
from billiards_env.games.game import GameState, Setup
from billiards_env.games.outcomes import group_rows, write_outcomes
from billiards_env.games.rules import Rules
from billiards_env.games.state import NO_CALL, Call, RuleState, Verdict
from billiards_env.scene import Balls, Scene
from billiards_env.simulation import BatchResult, simulate_batch

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
        >>> setup = Setup("nine_ball", Scene.named("pool", 9))
        >>> from billiards_env.games.game import opening
        >>> game = opening(setup, np.random.default_rng(0))
        >>> verdicts, which = judge_batch(setup, game, [[0.0, 1.0], [2.0, 0.0], [-1.0, 0.0]])
        >>> [verdicts[k].foul for k in which]
        ['no_hit', 'illegal_break', 'no_hit']
    """
    state, cue, n = game.state, game.state.cue_balls[0], setup.scene.n_balls
    order = [cue, *(ball for ball in range(n) if ball != cue)]  # the engine strikes the first ball
    lying = np.isin(order, sorted(state.on_table))
    speeds = np.asarray(velocities, np.float64)
    batch = simulate_batch(
        setup.scene if cue == 0 else _reordered(setup.scene, order),
        np.broadcast_to(game.positions[order], (len(speeds), n, 2)),
        speeds,
        mode=setup.mode,
        dt=setup.dt,
        fix=setup.fix,
        spins=spins,
        in_play=lying,
        threads=threads,
    )
    pockets, cushion_after = np.empty(batch.potted.shape, np.int8), np.empty(len(speeds), np.bool_)
    counts = batch.cushions, batch.cushions_before_hit, batch.first_hit
    centres = np.array([(p.x, p.y) for p in setup.scene.table.pockets]).reshape(-1, 2)
    write_outcomes(centres, lying, batch.positions, batch.potted, *counts, pockets, cushion_after)
    which, examples = _grouped(setup.game_rules, state, batch, pockets, cushion_after)
    facts = [_facts(batch, k, pockets[k].tolist(), bool(cushion_after[k]), order) for k in examples]
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


def _reordered(scene: Scene, order: Sequence[int]) -> Scene:
    """Returns the scene with its balls in another order."""
    balls = scene.balls
    radius, mass = (tuple(values[i] for i in order) for values in (balls.radius, balls.mass))
    return dataclasses.replace(scene, balls=Balls(radius, mass, balls.colours, balls.shape))


def _grouped(
    rules: Rules,
    state: RuleState,
    batch: BatchResult,
    pockets: NDArray[np.int8],
    cushion_after: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], list[int]]:
    """Groups the shots with the same verdict-relevant outcome; returns the group of each shot and its first shot."""
    columns = [pockets, batch.first_hit[:, None], cushion_after[:, None]]
    if state.break_shot:
        columns.append(batch.cushions > 0)
    if not rules.pockets:
        columns.append(np.minimum(batch.cushions_before_hit, _MOST_CUSHIONS))
    rows = np.concatenate([column.astype(np.int8) for column in columns], axis=1)
    group, examples = np.empty(len(rows), np.int64), np.empty(len(rows), np.int64)
    count = group_rows(rows, group, examples)
    return group, examples[:count].tolist()


def _facts(batch: BatchResult, k: int, pockets: list[int], cushion_after: bool, order: list[int]) -> Facts:
    """Returns the facts of shot k. The potted balls are in the order of their numbers, not of time."""
    first, cushions = int(batch.first_hit[k]), batch.cushions[k].tolist()
    before = batch.cushions_before_hit[k].tolist()
    touched = sorted((ball for ball in range(len(order)) if before[ball] >= 0), key=lambda i: (before[i], i != first))
    potted = sorted((order[i], pocket) for i, pocket in enumerate(pockets) if pocket >= 0)
    return Facts(
        () if first < 0 else (order[first],),
        tuple((order[i], before[i]) for i in touched),
        tuple(ball for ball, _ in potted),
        cushion_after,
        frozenset(order[i] for i in range(1, len(order)) if cushions[i] > 0 or pockets[i] >= 0),
        tuple(pocket for _, pocket in potted),
        cushions[0] > 0,
    )
