"""Judging many shots from one position. Each distinct outcome is judged once.

The shots of a search have few distinct outcomes: the ball touched first, the potted balls, and a cushion contact after
the hit. `judge_batch` finds them with array operations and calls the rules of the game only for them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.games.facts import Facts
from billiards_env.games.game import GameState, Setup
from billiards_env.games.rules import Rules
from billiards_env.games.state import NO_CALL, Call, RuleState, Verdict
from billiards_env.scene import Balls, Scene
from billiards_env.simulation import BatchResult, simulate_batch

_MOST_CUSHIONS = 3  # more cushion contacts before a hit make no difference


def judge_batch(
    setup: Setup, game: GameState, velocities: ArrayLike, spins: ArrayLike | None = None, threads: int | None = None
) -> tuple[list[Verdict], NDArray[np.intp]]:
    """Simulates m shots of the cue ball from one position and judges them.

    The verdict is that of `game.play`, with two differences: in a game with called shots the player calls the ball that
    the shot pots, and of several balls touched at the same instant one counts as touched first.

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
    pockets = _pockets(setup.scene, batch, lying)
    cushion_after = _cushion_after(batch, pockets)
    index: dict[bytes, int] = {}
    outcomes = _outcomes(setup.game_rules, state, batch, pockets, cushion_after)
    which = np.array([index.setdefault(outcome, len(index)) for outcome in outcomes], np.intp)
    shots = np.unique(which, return_index=True)[1].tolist()
    facts = [_facts(batch, k, pockets[k].tolist(), bool(cushion_after[k]), order) for k in shots]
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


def _pockets(scene: Scene, batch: BatchResult, lying: NDArray[np.bool_]) -> NDArray[np.int8]:
    """Returns the pocket (m, n) of each ball that a shot pots; -1 for the other balls."""
    pockets = np.full(batch.potted.shape, -1, np.int8)
    shots, balls = np.nonzero(batch.potted & lying)
    centres = np.array([(p.x, p.y) for p in scene.table.pockets]).reshape(-1, 2)
    if len(shots):  # a potted ball is at the centre of its pocket
        away = batch.positions[shots, balls, None] - centres
        pockets[shots, balls] = np.argmin(np.abs(away).sum(axis=-1), axis=1)
    return pockets


def _outcomes(
    rules: Rules,
    state: RuleState,
    batch: BatchResult,
    pockets: NDArray[np.int8],
    cushion_after: NDArray[np.bool_],
) -> list[bytes]:
    """Returns for each shot the bytes of all that its verdict depends on."""
    columns = [pockets, batch.first_hit[:, None], cushion_after[:, None]]
    if state.break_shot:
        columns.append(batch.cushions > 0)
    if not rules.pockets:
        columns.append(np.minimum(batch.cushions_before_hit, _MOST_CUSHIONS))
    rows = np.concatenate([column.astype(np.int8) for column in columns], axis=1)
    return rows.view(f"V{rows.shape[1]}")[:, 0].tolist()


def _cushion_after(batch: BatchResult, pockets: NDArray[np.int8]) -> NDArray[np.bool_]:
    """Returns for each shot whether a ball met a cushion or a pocket after the cue ball's first hit."""
    before = batch.cushions_before_hit[np.arange(len(pockets)), batch.first_hit]
    after = (batch.cushions[:, 1:] > 0).any(axis=1) | (batch.cushions[:, 0] > before) | (pockets >= 0).any(axis=1)
    return after & (batch.first_hit >= 0)


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
