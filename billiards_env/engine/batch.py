"""Many shots at once: one compiled call a thread."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.checks import whole
from billiards_env.engine.log import (
    CUSHIONS,
    CUSHIONS_BEFORE_HIT,
    ENDED,
    FIRST_HIT,
    N_CONTACT_RULE,
    N_EVENTS,
    NO_LOG,
    empty_shots,
)
from billiards_env.engine.shot import MAX_EVENTS, check_mode, check_shot, engine_of, scene_arrays
from billiards_env.engine.threads import spread
from billiards_env.scene import Scene


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class BatchResult:
    """What a batch of m shots gives back: the fields of `ShotResult` with a leading axis.

    They share one piece of memory; a copy of a field can be kept without the others.

    Attributes:
        positions: (m, n, 2) float64, m.
        velocities: (m, n, 2) float64, m/s.
        spins: (m, n, 3) float64, rad/s.
        potted: (m, n) bool.
        time: (m,) float64, s.
        n_events: (m,) int64.
        status: (m,) int64, indices into `engine.STATUS`.
        first_hit: (m,) int64.
        cushions: (m, n) int32.
        cushions_before_hit: (m, n) int32.
        n_contact_rule: (m,) int64.
    """

    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    spins: NDArray[np.float64]
    potted: NDArray[np.bool_]
    time: NDArray[np.float64]
    n_events: NDArray[np.int64]
    status: NDArray[np.int64]
    first_hit: NDArray[np.int64]
    cushions: NDArray[np.int32]
    cushions_before_hit: NDArray[np.int32]
    n_contact_rule: NDArray[np.int64]


def simulate_batch(
    scene: Scene,
    positions: ArrayLike,
    velocities: ArrayLike,
    *,
    mode: str = "pic",
    dt: float | None = None,
    fix: str | None = None,
    spins: ArrayLike | None = None,
    in_play: ArrayLike | None = None,
    max_time: float | None = None,
    max_events: int = MAX_EVENTS,
    threads: int | None = None,
) -> BatchResult:
    """Runs m shots in one scene, each to rest; every one gives the bits that `simulate` gives.

    Args:
        scene: Table, balls and physics.
        positions: (m, n, 2) centres of the balls, m; ball 0 is the cue ball.
        velocities: (m, n, 2) m/s, or (m, 2), the cue balls'.
        mode: The engine, as in `simulate`.
        dt: As in `simulate`.
        fix: As in `simulate`.
        spins: (m, n, 3) or (m, 3) angular velocities, rad/s; none by default.
        in_play: (m, n) or (n,) bool; all balls are in play by default.
        max_time: As in `simulate`.
        max_events: As in `simulate`, for each shot.
        threads: Number of threads; None for one a core.

    Returns:
        The balls at the end of each shot, and what happened.

    Raises:
        ValueError: As `simulate` does, naming the shot.
        TypeError: As `simulate` does.
        KeyboardInterrupt: As `simulate` does.

    Example:
        >>> scene = Scene.named("ideal")
        >>> batch = simulate_batch(scene, [[[-0.5, 0.0], [0.0, 0.0]]] * 3, [[0.1, 0.0], [0.2, 0.0], [0.0, 0.0]])
        >>> batch.first_hit.tolist()
        [1, 1, -1]
    """
    check_mode(mode, dt, fix)
    whole("max_events", max_events, "max_events")
    positions = np.asarray(positions, dtype=np.float64)
    if positions.ndim != 3:
        raise ValueError(f"positions has shape {positions.shape}: expected (m, {scene.n_balls}, 2)")
    if threads is not None:
        whole("threads", threads, "threads")
    m = len(positions)
    shots = empty_shots(m, scene.n_balls)
    given = check_shot(scene, positions, velocities, spins, in_play, max_time, shots, threads)
    engine, arrays, plain = engine_of(mode, scene.n_balls), tuple(scene_arrays(scene, dt, fix)), tuple(shots)
    spread(lambda begin, end: engine(begin, end, arrays, given.limit, max_events, plain, NO_LOG), m, threads)
    counts, hits = shots.counts, shots.hits
    return BatchResult(
        positions=given.positions,
        velocities=given.velocities,
        spins=given.spins,
        potted=~given.in_play,
        time=shots.times,
        n_events=counts[:, N_EVENTS],
        status=counts[:, ENDED],
        first_hit=counts[:, FIRST_HIT],
        cushions=hits[:, :, CUSHIONS],
        cushions_before_hit=hits[:, :, CUSHIONS_BEFORE_HIT],
        n_contact_rule=counts[:, N_CONTACT_RULE],
    )
