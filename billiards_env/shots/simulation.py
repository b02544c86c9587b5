"""Runs shots: `simulate` runs one, `simulate_batch` runs many."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.engine.compile import (
    MAX_EVENTS,
    PIC,
    Engine,
    Varied,
    check_engine,
    scene_fields,
    typed_run,
    varied_fields,
    varied_shot,
    with_scatter,
)
from billiards_env.engine.frozen_strike import strike_frozen
from billiards_env.engine.log import N_EVENTS_LOGGED, NO_LOG, ShotLog, empty_log, joined, with_room
from billiards_env.engine.measures import checked_measures
from billiards_env.engine.shot_input import ShotInput, check_shot, check_varied
from billiards_env.engine.shots import STATUS, Shots, empty_shots, start_fields
from billiards_env.engine.strikes import Strike
from billiards_env.engine.threads import parallel_for
from billiards_env.physics.scatter import Scatter
from billiards_env.scene import Scene, check_scene
from billiards_env.shots.noise import check_scatter
from billiards_env.shots.result import ShotResult, outcome_of, read_log
from billiards_env.support.checks import Range, array_of, flag, integer, numbers, short

if TYPE_CHECKING:
    from billiards_env.shots.records import ShotRecord


def simulate(
    scene: Scene | str,
    positions: ArrayLike,
    velocities: ArrayLike | Strike,
    *,
    engine: Engine = PIC,
    spins: ArrayLike | None = None,
    in_play: ArrayLike | None = None,
    record: bool = False,
    max_time: float | None = None,
    max_events: int = MAX_EVENTS,
    scatter: Mapping[str, float] | None = None,
    seed: int | None = None,
    measures: Sequence[str] = (),
) -> ShotResult:
    """Runs one shot until every ball rests.

    Args:
        scene: Table, balls and physics, or a name of `Scene.named` with as many balls as `positions`.
        positions: (n, 2) centres of the balls, m; ball 0 is the cue ball. With flight they may be (n, 3), with the
            heights above the cloth, and velocities may have a vertical component.
        velocities: (n, 2) m/s, or (2,) for the cue ball alone, or a `Strike`. Only a `Strike` has a cue, which drives
            balls that touch the cue ball together with it, see `engine.frozen_strike`.
        engine: The engine: exact by default, or one with a timestep, such as `Engine("pit", dt=1 / 60)`.
        spins: (n, 3) or (3,) angular velocities, rad/s, for "sliding" motion only; None for zero, or for a `Strike`,
            which includes the spin.
        in_play: (n,) bool; balls that are not in play are ignored and count as potted. By default all are in play.
        record: Whether to record the events and trajectories.
        max_time: Time at which the shot ends, s; None for the limit of the scene. The events before it are those of
            the whole shot, bit for bit.
        max_events: Number of events after which the engine ends the shot with the status "event_limit". "pit" also
            ends it after `pit.MAX_STEPS` timesteps, with the status "step_limit".
        scatter: The scatter of the cushions: the standard deviations "normal_std", "along_std" and "spin_std", see
            `physics.scatter`. Missing ones have the values of `shots.noise.SCATTER`, and {} has all of them. None for
            no scatter. A shot with scatter has no derivatives.
        seed: The seed of the scatter, from 0 to 2^63 - 1.
        measures: The names of the measures that the shot also records, from `engine.measures.MEASURES`.

    Returns:
        The balls at the end of the shot, and what happened.

    Raises:
        ValueError: If balls overlap, lie outside the table or in a pocket, a value is outside its range (see
            `checks.RANGES`), a ball of infinite mass moves, an argument is unknown or of the wrong shape, or only one
            of `scatter` and `seed` is given.
        TypeError: If an argument is of the wrong type.
        KeyboardInterrupt: Within a second of Ctrl-C. The arguments are unchanged.

    Example:
        >>> scene = Scene.named("ideal")
        >>> shot = simulate(scene, [[-0.5, 0.0], [0.0, 0.0]], [1.0, 0.0], max_time=1.0)
        >>> shot.status, shot.first_hit, shot.velocities.tolist()
        ('max_time', 1, [[0.0, 0.0], [1.0, 0.0]])
    """
    positions = numbers("positions", positions)
    scene = _scene(scene, positions)
    check_engine(engine)
    max_events = integer("max_events", max_events, "max_events")
    flag("record", record)
    if positions.ndim != 2:
        raise ValueError(f"positions has shape {positions.shape}: expected ({scene.n_balls}, 2), one row per ball")
    checked = check_shot(scene, positions, *_motion(velocities, spins), in_play, max_time)
    if isinstance(velocities, Strike):
        strike_frozen(scene, scene_fields(scene), checked.as_batch())
    asked = checked_measures(measures)
    return run_shot(scene, checked._replace(scatter=_scatter(scatter, seed)), engine, record, max_events, asked)


_SEEDS = Range(0, 2**63 - 1)


def _scatter(scatter: Mapping[str, float] | None, seed: Any, m: int | None = None) -> Scatter | None:
    """Returns the scatter of one shot, or of m shots of a batch."""
    deviations = check_scatter(scatter)
    if (seed is None) != (deviations is None):
        expected = "None without scatter" if deviations is None else "a whole number, for the scatter"
        raise ValueError(f"seed = {short(seed)}: expected {expected}")
    if deviations is None:
        return None
    if m is None:
        return Scatter(deviations, np.array([integer("seed", seed, _SEEDS)]))
    seeds = array_of("seed", seed)
    if seeds.ndim == 0:
        drawn = np.random.SeedSequence(integer("seed", seed, _SEEDS)).generate_state(m, np.uint64)
        return Scatter(deviations, (drawn >> np.uint64(1)).astype(np.int64))
    if seeds.shape != (m,) or seeds.dtype.kind not in "iu" or ((seeds < 0) | (seeds > _SEEDS.most)).any():
        raise ValueError(f"seed = {short(seed)}: expected a whole number, or {m} from 0 to 2^63 - 1")
    return Scatter(deviations, seeds.astype(np.int64))


def _scene(scene: Scene | str, positions: NDArray[np.float64]) -> Scene:
    """Returns a scene. A name stands for a named scene with the balls of positions (..., n, 2)."""
    if isinstance(scene, str):
        scene = Scene.named(scene, positions.shape[-2] - 1 if positions.ndim > 1 else None)
    check_scene(scene)
    return scene


def _motion(velocities: ArrayLike | Strike, spins: ArrayLike | None) -> tuple[ArrayLike, ArrayLike | None]:
    """Returns the velocities and spins of `simulate`, those of a `Strike` if there is one."""
    if not isinstance(velocities, Strike):
        return velocities, spins
    if spins is not None:
        raise ValueError(f"spins = {short(spins)} with a Strike: expected None, the strike has a spin")
    return velocities.velocity, velocities.spin


def run_shot(
    scene: Scene,
    shot: ShotInput,
    engine: Engine = PIC,
    record: bool = False,
    max_events: int = MAX_EVENTS,
    measures: tuple[str, ...] = (),
) -> ShotResult:
    """Runs one shot like `simulate`, without checking its input.

    Args:
        scene: Table, balls and physics.
        shot: Valid input, such as the end of another shot.
        engine: The engine.
        record: Whether to record the events and trajectories.
        max_events: Number of events after which the engine ends the shot with the status "event_limit". "pit" also ends
            it after `pit.MAX_STEPS` timesteps, with the status "step_limit".
        measures: The measures that it records.

    Returns:
        The balls at the end of the shot, and what happened.
    """
    n = scene.n_balls
    run_shots = typed_run(scene, engine, shot.scatter is not None, measures)
    arrays = with_scatter(scene_fields(scene, engine), shot.scatter)
    room = 256 if record else 0
    while True:
        flight = scene.physics.flight
        log, shots = empty_log(room, 4 * room, 1, flight), empty_shots(1, n, flight, measures)
        for out, start in zip(start_fields(shots), start_fields(shot), strict=True):
            if out is not None:
                out[0] = start
        run_shots.call(0, 1, arrays, shot.limit, max_events, tuple(shots), tuple(log))
        if not record or (log.used[:2] <= (len(log.events), len(log.segments))).all():
            break
        room = max(4 * room, int(max(log.used[:2])))  # the log was too small: the shot runs again
    recorded = read_log(ShotLog.of(log), scene, (shot, engine, max_events)) if record else {}
    return ShotResult(**outcome_of(_only_row(shots._asdict())), **recorded)


def _only_row(outcome: dict[str, Any]) -> dict[str, Any]:
    """Returns the only row of each array, as a number if the row is one number."""
    return {
        name: array if array is None else array.item() if array.ndim == 1 and name != "measures" else array[0]
        for name, array in outcome.items()
    }


def replay(record: ShotRecord, *, check: bool = True, record_events: bool = False) -> ShotResult:
    """Plays the shot of a record again.

    Args:
        record: The record.
        check: Whether to compare the result with the recorded one, bit for bit.
        record_events: Whether to record the events and trajectories.

    Returns:
        The shot.

    Raises:
        ValueError: If the result differs from the recorded one.
    """
    from billiards_env.shots.records import check_equal, end_of

    options: dict[str, Any] = {name: getattr(record, name) for name in _OPTIONS}
    shot = simulate(record.scene, record.positions, record.velocities, record=record_events, **options)
    if check:
        check_equal(record.end, end_of(shot))
    return shot


_OPTIONS = ("engine", "spins", "in_play", "max_time", "max_events")  # of `simulate` in a record


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class BatchResult:
    """The outcome of m shots: the fields that each `ShotResult` has, with a leading axis.

    `len(batch)` is m. `batch[i]` is the recorded `ShotResult` of shot i, which runs again unless the batch was
    recorded. The arrays share one block of memory. To keep one field and free the others, copy it.

    `ShotResult` describes the fields up to `heights`. Those of balls are (m, n, ...), and the others (m,). `status` is
    an array of str.

    Attributes:
        scene: The scene.
        varied: The numbers of `Physics` that differ from shot to shot by name, (m,) each, and the timestep "dt".
        scatter: The scatter of the cushions with the seeds of the shots; None for no scatter.
        log: The log of the shots; None unless they were recorded.
    """

    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    spins: NDArray[np.float64]
    potted: NDArray[np.bool_]
    time: NDArray[np.float64]
    n_events: NDArray[np.int64]
    status: NDArray[Any]
    first_hit: NDArray[np.int64]
    cushions: NDArray[np.int32]
    cushions_before_hit: NDArray[np.int32]
    n_contact_rule: NDArray[np.int64]
    pockets: NDArray[np.int32]
    pot_order: NDArray[np.int32]
    touched_first: NDArray[np.bool_]
    first_hit_time: NDArray[np.float64]
    cue: NDArray[np.int64]
    heights: NDArray[np.float64] | None
    measures: NDArray[np.void] | None
    scene: Scene
    varied: Varied
    scatter: Scatter | None
    log: ShotLog | None
    _engine: Engine
    _start: Any  # positions, velocities, spins and in_play, (m, ...) each or None
    _limits: tuple[float | None, int]  # max_time and max_events

    @property
    def engine(self) -> str:
        """The engine: "PIC", or "PIT" with its timestep and fix."""
        return str(self._engine)

    def __len__(self) -> int:
        return len(self.status)

    def __iter__(self) -> Iterator[ShotResult]:
        return (self[k] for k in range(len(self)))

    def __getitem__(self, i: int) -> ShotResult:
        if not isinstance(i, (int, np.integer)):
            raise TypeError(f"batch[{short(i)}]: expected one index; its arrays, such as batch.positions, have slices")
        if not -len(self) <= i < len(self):
            raise IndexError(f"batch[{i}]: expected an index from {-len(self)} to {len(self) - 1}")
        k = int(i) % len(self)
        scene, engine = varied_shot(self.scene, self._engine, self.varied, k)
        max_time, max_events = self._limits
        positions, velocities, *others = self._start
        spins, in_play = (None if array is None else array[k] for array in others)
        start = check_shot(scene, positions[k], velocities[k], spins, in_play, max_time)
        if self.scatter is not None:
            start = start._replace(scatter=self.scatter._replace(seeds=self.scatter.seeds[k : k + 1]))
        if self.log is None:
            names = () if self.measures is None else self.measures.dtype.names or ()
            return run_shot(scene, start, engine, True, max_events, names)
        arrays = {name: getattr(self, name) for name in _OUTCOME}
        row = _only_row({name: None if array is None else array[k : k + 1].copy() for name, array in arrays.items()})
        return ShotResult(**row, **read_log(self.log.shots(k, k + 1), scene, (start, engine, max_events)))

    def __repr__(self) -> str:
        m, n = self.potted.shape
        lines = [f"BatchResult: {m} shots of {n} balls"]
        if m > 0:
            counts = [np.count_nonzero(self.status == name) for name in STATUS]
            potted = self.pockets >= 0
            cue_ball, object_balls = potted[:, 0].sum(), potted[:, 1:].any(axis=1).sum()
            driven_off = (~potted & (self.pot_order >= 0)).any(axis=1).sum()
            lines += [
                f"status: {', '.join(f'{name} {k}' for name, k in zip(STATUS, counts, strict=True) if k)}",
                f"time: {_spread_of(self.time)} s",
                f"events: {_spread_of(self.n_events)}",
                f"shots with a potted ball: cue ball {cue_ball}, object balls {object_balls}",
                *[f"shots with a ball driven off the table: {driven_off}"] * bool(driven_off),
            ]
        return "\n  ".join(lines)


_OUTCOME = tuple(field.name for field in dataclasses.fields(BatchResult))[: len(Shots._fields)]


def _spread_of(values: NDArray[Any]) -> str:
    return f"{values.min():.4g} to {values.max():.4g}, median {np.median(values):.4g}"


def simulate_batch(
    scene: Scene | str,
    positions: ArrayLike,
    velocities: ArrayLike | Strike,
    *,
    engine: Engine = PIC,
    physics: Mapping[str, ArrayLike] | None = None,
    spins: ArrayLike | None = None,
    in_play: ArrayLike | None = None,
    max_time: float | None = None,
    record: bool = False,
    max_events: int = MAX_EVENTS,
    threads: int | None = None,
    scatter: Mapping[str, float] | None = None,
    seed: ArrayLike | None = None,
    measures: Sequence[str] = (),
) -> BatchResult:
    """Runs m shots in one scene, each until every ball rests, with the same bits as `simulate`.

    Args:
        scene: Table, balls and physics.
        positions: (m, n, 2) centres of the balls, m; ball 0 is the cue ball.
        velocities: (m, n, 2) m/s, or (m, 2) for the cue balls alone, or a `Strike` of m strikes.
        engine: The engine: exact by default, or one with a timestep, such as `Engine("pit", dt=1 / 60)`.
        physics: Numbers of `Physics` that differ from shot to shot, by name, such as {"mu_roll": ...}, (m,) each. They
            replace the scene's. `max_time` is not one of them. The engine "pit" also accepts the timestep "dt", s.
        spins: (m, n, 3) or (m, 3) angular velocities, rad/s; None for zero, or for a `Strike`.
        in_play: (m, n) or (n,) bool; by default all balls are in play.
        max_time: Time at which a shot ends, s; None for the limit of the scene.
        record: Whether to record the events and trajectories.
        max_events: As in `simulate`, for each shot.
        threads: Number of threads; None for the number of `set_num_threads`.
        scatter: The scatter of the cushions, as in `simulate`.
        seed: The seeds of the scatter, (m,) whole numbers, each as in `simulate`, or one from which they are drawn.
        measures: As in `simulate`.

    Returns:
        The balls at the end of each shot, and what happened.

    Raises:
        ValueError: As in `simulate`; the message names the shot.
        TypeError: As in `simulate`.
        KeyboardInterrupt: As in `simulate`.

    Example:
        >>> scene = Scene.named("ideal")
        >>> batch = simulate_batch(scene, [[[-0.5, 0.0], [0.0, 0.0]]] * 3, [[0.1, 0.0], [0.2, 0.0], [0.0, 0.0]])
        >>> batch.first_hit.tolist()
        [1, 1, -1]
    """
    positions = numbers("positions", positions)
    scene = _scene(scene, positions)
    max_events = integer("max_events", max_events, "max_events")
    check_engine(engine)
    flag("record", record)
    if positions.ndim != 3:
        raise ValueError(f"positions has shape {positions.shape}: expected (m, {scene.n_balls}, 2)")
    if threads is not None:
        integer("threads", threads, "threads")
    m, asked = len(positions), checked_measures(measures)
    varied, scattered = check_varied(scene, physics, engine, m), _scatter(scatter, seed, m)
    shots = empty_shots(m, scene.n_balls, scene.physics.flight, asked)
    # These arrays are copies for `batch[i]`: the caller may change the given arrays, and the engine changes `shots`.
    moving, turning = _motion(velocities, spins)
    moving, turning = numbers("velocities", moving), None if turning is None else numbers("spins", turning)
    limit = check_shot(scene, positions, moving, turning, in_play, max_time, shots, threads).limit
    in_play = None if in_play is None else np.broadcast_to(np.array(in_play), shots.in_play.shape)
    run_shots, plain = typed_run(scene, engine, scattered is not None, asked), tuple(shots)
    arrays = with_scatter(varied_fields(scene, engine, varied, m), scattered)
    if isinstance(velocities, Strike) and strike_frozen(scene, arrays, start_fields(plain), end=m):
        start = ShotInput(*start_fields(shots))
        moving, turning = start.in_space()[1].copy(), shots.spins.copy()

    def run(begin: int, end: int, log: tuple[Any, ...] = NO_LOG) -> None:
        run_shots.call(begin, end, arrays, limit, max_events, plain, log)

    log = None
    if record:
        log = _run_recorded(run, shots, threads)
    else:
        parallel_for(run, m, threads)
    start, limits = (positions, moving, turning, in_play), (max_time, max_events)
    return BatchResult(
        **outcome_of(shots._asdict()),
        scene=scene,
        varied=varied,
        scatter=scattered,
        log=log,
        _engine=engine,
        _start=start,
        _limits=limits,
    )


_FIRST_SHOTS = 64  # shots that are recorded first, to find the room that the others need


def _run_recorded(run: Callable[..., None], shots: Shots, threads: int | None) -> ShotLog:
    """Runs shots with `run(begin, end, log)` and returns their log.

    The length of a log is estimated from the shots so far, with a margin. Shots that do not fit in it run again.
    """
    (m, n), flight = shots.in_play.shape, shots.heights is not None
    fields = [array for array in start_fields(shots) if array is not None]
    start = [array.copy() for array in fields]
    logs: dict[int, ShotLog] = {}  # by their first shots
    events_of_shot = 0.0  # a mean

    def work(begin: int, end: int) -> None:
        nonlocal events_of_shot
        log, done = empty_log(n_shots=end - begin, flight=flight), begin
        while done < end:
            until = end if events_of_shot else min(end, done + _FIRST_SHOTS)
            room = 64 + 32 * n + int(1.5 * events_of_shot * (until - done))
            log = with_room(log, room, 2 * room + n * (until - done))
            run(done, until, tuple(log))
            events_of_shot = max(events_of_shot, float(log.used[N_EVENTS_LOGGED]) / (until - begin), 1.0)
            fits = (ShotLog.of(log).bounds[1:] <= (len(log.events), len(log.segments))).all(axis=1)
            done = begin + int(fits.sum())
            log.used[:] = *ShotLog.of(log).bounds[done - begin], done - begin  # forgets those that do not fit
            for array, initial in zip(fields, start, strict=True):
                array[done:until] = initial[done:until]
        logs[begin] = ShotLog.of(log)

    parallel_for(work, m, threads)
    return joined([logs[begin] for begin in sorted(logs)])
