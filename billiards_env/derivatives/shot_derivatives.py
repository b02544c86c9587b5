"""The derivatives of recorded shots by name: `jvp`, `vjp`, `jacobian` and others, for one shot or a batch.

Inputs (the names of `by` and of tangents) for a shot of n balls:

* "positions" (n, 2), "velocities" (n, 2) and "spins" (n, 3) at the start,
* "radius" (n,) and "mass" (n,),
* each number of `Physics` that enters the motion, and "cushion_height" of the `Table`, (),
* "strike" (5,): speed, heading, side, top and elevation of the strike of the cue ball.

Outputs (the names of `of` and of cotangents) are "positions", "velocities" and "spins" at a time, and "event_times"
(l,) and "event_positions" (l, 2), and the margins until this time: "ball_margins" (n, n), "pocket_margins" (n, p) and
"cushion_margins" (n, c), see `Margins`. All units are SI units. The derivatives of events after this time are zero. For
a batch all arrays have a leading axis m, and l is the largest number of events of a shot.

A velocity is changed at a constant spin, and a spin at a constant velocity. A radius changes at constant positions,
velocities and spins; the table and its pockets do not change. If a ball at rest gets a small velocity or spin, friction
stops it after a displacement of second order. Derivatives with respect to its velocity and spin are therefore zero,
unless the motion is "ideal".
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.derivatives.error_bounds import bound_errors
from billiards_env.derivatives.lanes import BALL_WIDTH, lane_kernels, strike_jacobians
from billiards_env.derivatives.margin_sweep import push_margins
from billiards_env.derivatives.nonsmooth_events import OVERFLOWS, REASONS, ROUNDING, find_nonsmooth
from billiards_env.derivatives.sweeps import BALL_INPUTS, NUMBER_INPUTS, pull_lanes, push_lanes
from billiards_env.engine.compile import PIC, Varied, physics_of_shots, scene_fields, scene_kernels, varied_fields
from billiards_env.engine.log import BALL_POCKET, KIND, SEGMENT_ROW, TIME, ShotLog
from billiards_env.engine.strikes import checked_strike
from billiards_env.engine.threads import parallel_for
from billiards_env.physics.state import LAW_NUMBERS, UX, UY, VX, VY, WZ, X, Y
from billiards_env.scene import PARAMETERS, Physics, Scene, law_numbers
from billiards_env.shots.result import ShotResult, check_no_scatter
from billiards_env.shots.simulation import BatchResult
from billiards_env.support.checks import integer, numbers, one_of, short

Floats = NDArray[np.float64]

_BALL_INPUTS = {"positions": slice(0, 2), "velocities": slice(2, 4), "spins": slice(4, 7), "radius": 7, "mass": 8}
_BALL_OUTPUTS = {"positions": slice(0, 2), "velocities": slice(2, 4), "spins": slice(4, 7)}
_EVENT_OUTPUTS = {"event_times": 0, "event_positions": slice(1, 3)}
OUTPUTS = (*_BALL_OUTPUTS, *_EVENT_OUTPUTS)
MARGINS = ("ball_margins", "pocket_margins", "cushion_margins")


class Record(NamedTuple):
    """What the derivatives of m shots need.

    Attributes:
        scene: The scene.
        time: (m,) Durations, s.
        log: The log.
        varied: The numbers of `Physics` that differ from shot to shot.
    """

    scene: Scene
    time: Floats
    log: ShotLog
    varied: Varied = MappingProxyType({})


def has_derivatives(scene: Scene) -> bool:
    """Returns whether the shots of a scene have derivatives. Flights have none, see `docs/derivatives.md`."""
    return not scene.physics.flight


def check_derivatives(scene: Scene, what: str, *instead: str) -> None:
    """Raises a ValueError if the shots of a scene have no derivatives.

    Args:
        scene: The scene.
        what: What needs the derivatives, for the message.
        instead: What works in the scene instead.
    """
    if not has_derivatives(scene):
        expected = " or ".join(("False", *instead))
        raise ValueError(f"physics.flight = True with {what}: expected {expected} (flights have no derivatives)")


def record_of(shots: ShotResult | BatchResult) -> Record:
    """Returns the record of recorded shots.

    Raises:
        TypeError: If `shots` is neither a shot nor a batch.
        ValueError: If they were not recorded, or not run by PIC, or have flight or scatter.
    """
    if not isinstance(shots, ShotResult | BatchResult):
        raise TypeError(f"shots = {short(shots)}: expected a ShotResult or a BatchResult")
    if shots.log is None or shots.scene is None:
        raise ValueError("shots.log = None: expected recorded shots, from simulate or simulate_batch with record=True")
    if shots.engine != str(PIC):
        raise ValueError(f"shots.engine = {shots.engine!r}: expected 'PIC', shots by PIT have no derivatives")
    check_derivatives(shots.scene, "derivatives", "differences of shots")
    check_no_scatter(shots.scatter, "derivatives")
    if isinstance(shots, ShotResult):
        return Record(shots.scene, np.array([shots.time]), shots.log)
    return Record(shots.scene, shots.time, shots.log, shots.varied)


def _of_each(shots: ShotResult | BatchResult, result: Any) -> Any:
    """Returns results with a leading axis for a batch; those of its only shot for a single shot."""
    if isinstance(shots, BatchResult):
        return result
    if isinstance(result, dict):
        return {name: array[0] for name, array in result.items()}
    if isinstance(result, tuple):
        return type(result)(*(array[0] if array.ndim > 1 else array[0].item() for array in result))
    return result[0]


class Nonsmooth(NamedTuple):
    """The first event of a shot at which it has no derivative; arrays for a batch.

    Attributes:
        event: Its index; that of the event before if it is between events; -1 for the start of the shot, or if there
            is none.
        reason: "" if there is none, or one of `nonsmooth_events.REASONS`.
    """

    event: Any
    reason: Any


class Certainty(NamedTuple):
    """The certain contacts of a shot: exact arithmetic gives the same first contacts, in the same order.

    A contact is an impact of two balls, an impact on a cushion, or a pot. The order of other events, such as the start
    of rolling, is not certain: those of different balls may change places.

    The fields are arrays for a batch. The result rests on a bound of the errors, which was tested but not proved. The
    bound of a position is `SAFETY` times the unit roundoff times its largest condition so far. The condition is the
    2-norm of the derivatives with respect to the start, each times the size of its input (half the length of the table,
    or the largest speed). The bounds of times have the same form. A contact is certain if, up to it, no bodies miss or
    enter each other by less than the bound, each contact precedes the next one by more than the bound, and no event has
    one of `nonsmooth_events.REASONS`. If two bodies barely miss each other between two events, a contact at the first
    of them does not count either.

    Attributes:
        contacts: The number of certain contacts.
        outcome: Whether all contacts are certain, and no other contact is near. Then the potted balls and the first hit
            are certain too.
    """

    contacts: Any
    outcome: Any


class Margins(NamedTuple):
    """The signed distances of n balls to changes of outcome, m; for a batch with a leading axis.

    The margin of a ball and a body is positive if they touch or the ball enters the pocket, and negative if it misses
    them. It passes through zero as a hit becomes a miss. A miss has minus the least gap. A hit has the depth of the
    ball in the body where the two would be nearest if they did not interact: see `margin_sweep`. The largest of
    several approaches counts. It is minus infinity for balls that are not in play, for a ball and itself, and for a
    cushion of an outline that a ball does not face. It is infinity for a cushion that a ball touches on a path that
    does not turn back.

    Attributes:
        balls: (n, n) float64 of two balls; symmetric.
        pockets: (n, p) float64: how far the centre of the ball enters the circle of the pocket.
        cushions: (n, c) float64, of the cushions by their numbers in the events.
        ball_times: (n, n) float64, s, when the two are nearest.
        pocket_times: (n, p) float64, the same.
        cushion_times: (n, c) float64, the same.
    """

    balls: Floats
    pockets: Floats
    cushions: Floats
    ball_times: Floats
    pocket_times: Floats
    cushion_times: Floats


UNIT_ROUNDOFF = 2.0**-53


class Sensitivity(NamedTuple):
    """The derivative of a shot's positions with respect to its start.

    Attributes:
        jacobian: (n, 2, n, 7) float64: of ball i's position with respect to ball j's initial (x, y, vx, vy, wx, wy,
            wz), in m, m/s and rad/s.
        time: The time of the positions, s.
        smooth: Whether the positions depend smoothly on the start up to that time. They do not if an event up to that
            time has no derivative, see `Nonsmooth`. The jacobian then treats impacts at one instant as successive, and
            neglects the contact-time rule.
        condition: Largest error of a position, m, per unit of relative error of the inputs: the largest 2-norm, over
            the balls, of the jacobian with each column times the size of its input. Times `UNIT_ROUNDOFF` it is the
            error that no double-precision engine can avoid.
    """

    jacobian: Floats
    time: float
    smooth: bool
    condition: float


def physics_inputs(physics: Physics, varied: Varied = MappingProxyType({})) -> dict[str, Floats]:
    """Returns the derivative of the numbers of the engine with respect to each number of a `Physics`, by its name.

    Those that depend on `varied`, numbers (m,) that differ from shot to shot, are (m, NUMBER_INPUTS). The others are
    (NUMBER_INPUTS,).
    """
    return _rates_by(physics_of_shots(physics, varied)) if varied else _constant_rates(physics)


@functools.lru_cache(maxsize=256)
def _constant_rates(physics: Physics) -> dict[str, Floats]:
    return _rates_by(physics_of_shots(physics, {}))


def _rates_by(p: Any) -> dict[str, Floats]:
    """Implements `physics_inputs` for an object with the fields of a `Physics`."""
    derivatives, step = {}, 1e-30j  # the derivatives of products by complex steps are exact
    for name in PARAMETERS:
        if getattr(p, name) is not None and PARAMETERS[name].only != ("flight",):
            moved = SimpleNamespace(**{**vars(p), name: getattr(p, name) + step})
            made = law_numbers(moved, 0.0)
            rates = [np.imag(made[number]) / step.imag for number in LAW_NUMBERS]
            derivatives[name] = np.stack(np.broadcast_arrays(*rates), axis=-1)
    return derivatives


class _Inputs(NamedTuple):
    """The inputs by name of a record.

    Attributes:
        scene: The scene.
        numbers: The result of `physics_inputs`, and the same for "cushion_height".
        strike: (m, 5, 5) derivative of the cue ball's velocity and spin by the strike, or None.
    """

    scene: Scene
    numbers: dict[str, Floats]
    strike: Floats | None

    def shape(self, name: str) -> tuple[int, ...]:
        """Returns the shape of an input of one shot.

        Raises:
            ValueError: If there is no such input.
        """
        one_of("by", name, (*_BALL_INPUTS, *self.numbers, "strike"))
        if name == "strike":
            if self.strike is None:
                raise ValueError(
                    "strike = None with an input 'strike': expected (speed, heading, side, top, elevation)"
                )
            return (5,)
        if name in self.numbers:
            return ()
        column = _BALL_INPUTS[name]
        width = () if isinstance(column, int) else (column.stop - column.start,)
        return (self.scene.n_balls, *width)

    def push(self, name: str, change: Floats, inputs: Floats) -> None:
        """Adds the changes by an input, (m, k, ...), to those of the result of `_zeros`."""
        n = self.scene.n_balls
        balls = inputs[..., : BALL_INPUTS * n].reshape(*inputs.shape[:2], n, BALL_INPUTS)  # a view
        if name == "strike":
            assert self.strike is not None
            balls[:, :, 0, 2:7] += np.einsum("mij,mkj->mki", self.strike, change)
        elif name in self.numbers:
            inputs[..., BALL_INPUTS * n :] += change[..., None] * self.numbers[name][..., None, :]
        else:
            balls[..., _BALL_INPUTS[name]] += change * self.by_mass() if name == "mass" else change

    def pull(self, name: str, adjoint: Floats) -> Floats:
        """Returns the adjoint of an input, (m, k, ...), from those of the engine's inputs, see `_zeros`."""
        n = self.scene.n_balls
        balls = adjoint[..., : BALL_INPUTS * n].reshape(*adjoint.shape[:2], n, BALL_INPUTS)
        if name == "strike":
            assert self.strike is not None
            return np.einsum("mij,mki->mkj", self.strike, balls[:, :, 0, 2:7])
        if name in self.numbers:
            return (adjoint[..., BALL_INPUTS * n :] * self.numbers[name][..., None, :]).sum(-1)
        gradient = balls[..., _BALL_INPUTS[name]]
        return gradient * self.by_mass() if name == "mass" else gradient

    def by_mass(self) -> Floats:
        """Returns the derivative of the inverse masses by the masses, (n,)."""
        return -1.0 / np.square(self.scene.balls.mass)


def _inputs(record: Record, strike: ArrayLike | None) -> _Inputs:
    scene, m = record.scene, len(record.time)
    derivative = None
    if strike is not None:
        parameters = numbers("strike", strike)
        if parameters.shape not in ((5,), (m, 5)):
            raise ValueError(f"strike has shape {parameters.shape}: expected (5,), the parameters of the strike")
        derivative, struck = _strike_derivatives(scene, np.broadcast_to(parameters, (m, 5)))
        begun, radius = start_states(record)[:, 0, 2:], scene.balls.radius[0]
        sizes = np.array([1.0, 1.0, radius, radius, radius])  # to m/s
        off = (np.abs(struck - begun) * sizes).max(axis=1) > 1e-9 * (1.0 + (np.abs(begun) * sizes).max(axis=1))
        if off.any():
            raise ValueError(
                f"strike = {short(parameters.tolist())}: expected the strike of the shot, whose velocity and spin are "
                f"{begun[off][0].tolist()}, not {struck[off][0].tolist()}"
            )
    height = np.array([float(name == "cushion_height") for name in LAW_NUMBERS])
    known = physics_inputs(scene.physics, record.varied) | {"cushion_height": height}
    return _Inputs(scene, known, derivative)


def _strike_derivatives(scene: Scene, parameters: Floats) -> tuple[Floats, Floats]:
    """Returns the derivatives (m, 5, 5) of m strikes, and the velocities and spins (vx, vy, wx, wy, wz), (m, 5).

    Args:
        scene: The scene, with the motion "sliding".
        parameters: (m, 5) speed, heading, side, top and elevation.

    Raises:
        ValueError: If `strike` raises it, a speed is negative or a tip slips. The derivative is not defined at the
            miscue offset and not implemented beyond it.
    """
    cue, checked = checked_strike(scene, *parameters.T)
    v, _, a, b, _ = checked.T
    if (v < 0.0).any():
        raise ValueError(f"speed = {short(float(v[v < 0.0][0]))}: expected a number >= 0 for a derivative")
    offset = np.hypot(a, b)
    slips = offset > cue.miscue
    if slips.any():
        raise ValueError(
            f"offset of the tip = {short(float(offset[slips][0]))}: expected at most {cue.miscue} ball radii, no miscue"
        )
    jacobians, states = np.empty((*checked.shape, 5)), np.empty_like(checked)
    strike_jacobians(tuple(cue), checked, jacobians, states)
    return jacobians, states


def start_states(record: Record) -> Floats:
    """Returns (x, y, vx, vy, wx, wy, wz) of the balls at the start of each shot, (m, n, 7)."""
    n, radius = record.scene.n_balls, np.array(record.scene.balls.radius)
    rows = record.log.segments[record.log.bounds[:-1, 1, None] + np.arange(n), SEGMENT_ROW:]
    states = rows[..., [X, Y, VX, VY, UX, UY, WZ]]
    if record.scene.physics.motion == "sliding":  # u = v + R (-wy, wx)
        states[..., 4] = (rows[..., UY] - rows[..., VY]) / radius
        states[..., 5] = (rows[..., VX] - rows[..., UX]) / radius
    return states


_STATES = frozenset(("positions", "velocities", "spins", "strike"))


def _zeros(record: Record, k: int, by: Iterable[str] = _STATES) -> Floats:
    """Returns zeros for k changes of the inputs of the engine, (m, k, 9 n); + NUMBER_INPUTS if constants change.

    `by` are the names of the inputs that change.
    """
    width = BALL_INPUTS * record.scene.n_balls + (0 if _STATES.issuperset(by) else NUMBER_INPUTS)
    return np.zeros((len(record.time), k, width))


def _unit_starts(record: Record, sizes: Floats) -> Floats:
    """Returns the changes of the 7 numbers of the start of each ball by their sizes (7,), (m, 7 n, 9 n)."""
    n = record.scene.n_balls
    inputs = _zeros(record, 7 * n)
    for i in range(n):
        inputs[:, 7 * i : 7 * i + 7, BALL_INPUTS * i : BALL_INPUTS * i + 7] = np.diag(sizes)
    return inputs


def _times(record: Record, t: ArrayLike | None) -> Floats:
    """Returns the times (m,) of the outputs."""
    if t is None:
        return record.time
    times = numbers("t", t)
    if times.shape not in ((), record.time.shape) or not (np.isfinite(times) & (times >= 0)).all():
        raise ValueError(f"t = {short(t)}: expected a finite number of seconds >= 0")
    return np.minimum(times, record.time)


def _most_events(record: Record, names: Sequence[str]) -> int:
    """Returns the number of events of the outputs, 0 if none is of events."""
    if not set(names) & set(_EVENT_OUTPUTS):
        return 0
    return int(np.diff(record.log.bounds[:, 0]).max(initial=0))


def _output_shape(record: Record, name: str) -> tuple[int, ...]:
    """Returns the shape of an output of one shot."""
    one_of("of", name, (*OUTPUTS, *MARGINS))
    if name in MARGINS:
        columns_of = margin_columns(record.scene)[name]
        return (record.scene.n_balls, columns_of.stop - columns_of.start)
    column = {**_BALL_OUTPUTS, **_EVENT_OUTPUTS}[name]
    width = () if isinstance(column, int) else (column.stop - column.start,)
    return (_most_events(record, (name,)) if name in _EVENT_OUTPUTS else record.scene.n_balls, *width)


def _for_all(record: Record, run: Callable[..., Any], threads: int | None, inputs: Floats | None, *arrays: Any) -> None:
    """Calls `push_lanes` or a similar function on pieces of the shots.

    Args:
        record: The record.
        run: The function.
        threads: Number of threads.
        inputs: Its changes of the inputs, see `_zeros`; None if it has none.
        *arrays: Its arguments after the shots.
    """
    if threads is not None:
        integer("threads", threads, "threads")
    scene = record.scene
    fields, is_sphere = varied_fields(scene, PIC, record.varied, len(record.time)), scene.balls.shape == "sphere"
    constants = inputs is not None and inputs.shape[-1] > BALL_INPUTS * scene.n_balls
    kernels = lane_kernels(scene_kernels(scene), constants)
    shots = record.log.bounds, record.log.events, record.log.segments, fields, is_sphere
    parallel_for(lambda begin, end: run(kernels, begin, end, shots, *arrays), len(record.time), threads)


def _push(record: Record, times: Floats, inputs: Floats, most: int, threads: int | None) -> tuple[Floats, Floats]:
    """Calls `push_lanes`; `times` is (m, q). Returns its outputs."""
    m, k = inputs.shape[:2]
    outputs = np.empty((m, times.shape[1], k, record.scene.n_balls, BALL_WIDTH))
    results = outputs, np.empty((m, k, most, 3))
    _for_all(record, push_lanes, threads, inputs, times, inputs, results)
    return results


def margin_columns(scene: Scene) -> dict[str, slice]:
    """Returns the columns of each kind of margin in the arrays of `push_margins`."""
    outline = scene_fields(scene)[4]
    n, p = scene.n_balls, len(scene.table.pockets)
    c = len(outline[0]) + len(outline[1])
    return dict(zip(MARGINS, (slice(0, n), slice(n, n + p), slice(n + p, n + p + c)), strict=True))


def _selected(scene: Scene, names: Sequence[str]) -> NDArray[np.bool_]:
    """Returns which margins belong to outputs, as an argument of `push_margins`."""
    columns_of = margin_columns(scene)
    selected = np.zeros((scene.n_balls, columns_of["cushion_margins"].stop), np.bool_)
    for name in set(names) & set(MARGINS):
        selected[:, columns_of[name]] = True
    return selected


def _push_margins(
    record: Record, times: Floats, inputs: Floats, selected: NDArray[np.bool_], threads: int | None
) -> tuple[Floats, Floats, Floats]:
    """Calls `push_margins`. Returns its outputs."""
    shape = (len(times), *selected.shape)
    results = np.empty(shape), np.empty(shape), np.empty((*inputs.shape[:2], *selected.shape))
    _for_all(record, push_margins, threads, inputs, times, inputs, selected, results)
    return results


def _forwards(
    record: Record, names: Sequence[str], inputs: Floats, times: Floats, threads: int | None
) -> dict[str, Floats]:
    """Returns the changes of outputs by name, (m, k, ...), for changes of the inputs of the engine."""
    changes: dict[str, Floats] = {}
    if set(names) & set(OUTPUTS):
        outputs, at_events = _push(record, times[:, None], inputs, _most_events(record, names), threads)
        changes |= {name: _chosen(name, outputs[:, 0], at_events) for name in names if name in OUTPUTS}
    if set(names) & set(MARGINS):
        slopes = _push_margins(record, times, inputs, _selected(record.scene, names), threads)[2]
        columns_of = margin_columns(record.scene)
        changes |= {name: slopes[..., columns_of[name]] for name in names if name in MARGINS}
    return changes


def _by_columns(
    record: Record, known: _Inputs, names: Sequence[str], by: str, times: Floats, threads: int | None
) -> dict[str, Floats]:
    """Returns the Jacobians (m, k, ...) of outputs by name, with respect to the k numbers of an input."""
    m, shape = len(record.time), known.shape(by)
    k = math.prod(shape)
    inputs = _zeros(record, k, (by,))
    known.push(by, np.broadcast_to(np.eye(k).reshape(k, *shape), (m, k, *shape)), inputs)
    return _forwards(record, names, inputs, times, threads)


def margins(shots: ShotResult | BatchResult, t: ArrayLike | None = None, threads: int | None = None) -> Margins:
    """Returns the signed distances to changes of outcome: of balls to balls, to pockets and to cushions.

    `jacobian(shot, "pocket_margins", "velocities")` returns their derivatives. "ball_margins" and "cushion_margins" are
    used in the same way.

    Args:
        shots: A recorded shot or batch.
        t: Time until which the shot counts, s, or (m,) times; None for its end.
        threads: Number of threads for a batch; None for that of `set_num_threads`.

    Raises:
        ValueError: As in `record_of`, or if t is negative or not finite.

    Example:
        >>> from billiards_env import Scene, simulate
        >>> scene = Scene.named("ideal")  # balls of 28.575 mm: the cue ball passes at a gap of 3 mm
        >>> shot = simulate(scene, [[-0.5, 0.06015], [0.0, 0.0]], [1.0, 0.0], max_time=0.9, record=True)
        >>> round(float(margins(shot).balls[0, 1]), 6)
        -0.003
    """
    record = record_of(shots)
    selected = _selected(record.scene, MARGINS)
    *arrays, _ = _push_margins(record, _times(record, t), _zeros(record, 0), selected, threads)
    columns_of = margin_columns(record.scene).values()
    return _of_each(shots, Margins(*(array[..., column] for array in arrays for column in columns_of)))


def _cue_ball_inputs(record: Record) -> Floats:
    """Returns unit changes (m, 2, 9 n) of the velocity of the cue ball."""
    inputs = _zeros(record, 2)
    inputs[:, [0, 1], [2, 3]] = 1.0
    return inputs


_LARGEST = 1e12  # m per m/s; the rounding of the velocity then moves a ball by about 1 mm


def _limited(slopes: Floats) -> Floats:
    """Returns derivatives of at most `_LARGEST`, which also replaces those that are not numbers.

    Derivatives grow with each impact, and overflow after thousands of impacts, as in a rack.
    """
    return np.clip(np.where(np.isnan(slopes), _LARGEST, slopes), -_LARGEST, _LARGEST)


def rest_by_cue_ball(batch: BatchResult) -> Floats:
    """Returns the derivatives (m, 2, n, 2) of the positions at the end by the cue ball's velocity, see `_limited`."""
    record = record_of(batch)
    return _limited(_push(record, record.time[:, None], _cue_ball_inputs(record), 0, 1)[0][:, 0, :, :, :2])


def margins_by_cue_ball(batch: BatchResult, selected: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Returns margins (m, n, q) of balls to the balls, pockets and cushions, and their derivatives (m, 2, n, q).

    The derivatives are those by the velocity of the cue ball, see `_limited`. Only the margins `selected` (n, q) are
    computed.
    """
    record = record_of(batch)
    margins, _, slopes = _push_margins(record, record.time, _cue_ball_inputs(record), selected, 1)
    return margins, _limited(slopes)


def _chosen(of: str, outputs: Floats, at_events: Floats) -> Floats:
    """Returns an output by name, (m, k, ...)."""
    if of in _BALL_OUTPUTS:
        return outputs[..., _BALL_OUTPUTS[of]]
    return at_events[..., _EVENT_OUTPUTS[of]]


def _names(argument: str, names: str | Sequence[str]) -> tuple[str, ...]:
    if isinstance(names, str):
        return (names,)
    if not isinstance(names, (list, tuple)) or not names or not all(isinstance(name, str) for name in names):
        raise ValueError(f"{argument} = {short(names)}: expected a name or names")
    return tuple(names)


def _per_shot(argument: str, name: str, value: ArrayLike, m: int, shape: tuple[int, ...]) -> Floats:
    """Returns an argument as an array (m, ...); one that is given without the axis of shots holds for all."""
    array = numbers(f"{argument}[{name!r}]", value)
    if array.shape not in (shape, (m, *shape)):
        raise ValueError(f"{argument}[{name!r}] has shape {array.shape}: expected {shape}")
    return np.broadcast_to(array, (m, *shape))


def jvp(
    shots: ShotResult | BatchResult,
    tangents: Mapping[str, ArrayLike],
    of: str | Sequence[str] = "positions",
    *,
    t: ArrayLike | None = None,
    strike: ArrayLike | None = None,
    threads: int | None = None,
) -> Any:
    """Returns the Jacobian times a vector: the change of outputs that a small change of inputs causes.

    Args:
        shots: A recorded shot or batch. For a batch all results have a leading axis m, and the bits are those of the
            single shots. Inputs then have this axis too, or not if they are the same for all shots.
        tangents: The changes of the inputs by name, such as {"velocities": [[0.1, 0.0], [0.0, 0.0]]}.
            The module lists the inputs and the outputs with their shapes.
        of: An output, or several.
        t: Time of the positions, velocities and spins, s, or (m,) times; None for the end of the shot. The
            derivatives of later events are 0.
        strike: (5,) or (m, 5) speed, heading, side, top and elevation of the strike of the shot, if it is an input.
        threads: Number of threads for a batch; None for that of `set_num_threads`.

    Returns:
        The change of the output, or a dict with those of the outputs by name. There is no derivative at an event
        that `nonsmooth` reports: the result then treats impacts at one instant as successive, and neglects the
        contact-time rule.

    Raises:
        ValueError: As in `record_of`, or if a name is unknown, an array has another shape,
            t is negative or not finite, or `strike` is missing, not that of the shot, a miscue, or at a ball that
            touched another one ahead of it.

    Example:
        >>> from billiards_env import Scene, simulate
        >>> shot = simulate(Scene.named("ideal", 0), [[0.0, 0.0]], [0.5, 0.0], max_time=1.0, record=True)
        >>> jvp(shot, {"velocities": [[0.0, 0.1]]}).tolist()
        [[0.0, 0.1]]
    """
    record = record_of(shots)
    known, m, names = _inputs(record, strike), len(record.time), _names("of", of)
    if not isinstance(tangents, Mapping) or not tangents:
        raise ValueError(f"tangents = {short(tangents)}: expected a mapping from names of inputs to arrays")
    inputs = _zeros(record, 1, tangents)
    for name, value in tangents.items():
        change = _per_shot("tangents", name, value, m, known.shape(name))
        known.push(name, change[:, None], inputs)
    for name in names:
        one_of("of", name, (*OUTPUTS, *MARGINS))
    results = {
        name: change[:, 0] for name, change in _forwards(record, names, inputs, _times(record, t), threads).items()
    }
    return _of_each(shots, results[of] if isinstance(of, str) else results)


def vjp(
    shots: ShotResult | BatchResult,
    cotangents: Mapping[str, ArrayLike],
    by: str | Sequence[str] = "velocities",
    *,
    t: ArrayLike | None = None,
    strike: ArrayLike | None = None,
    threads: int | None = None,
) -> Any:
    """Returns a vector times the Jacobian: the gradient of a function of outputs with respect to inputs.

    Args:
        shots: A recorded shot or batch.
        cotangents: The derivatives of the function with respect to the outputs by name.
        by: An input, or several.
        t: Time of the positions, velocities and spins, s, or (m,) times; None for the end of the shot.
        strike: (5,) or (m, 5) speed, heading, side, top and elevation of the strike of the shot, if it is an input.
        threads: Number of threads for a batch; None for that of `set_num_threads`.

    Returns:
        The gradient, or a dict with the gradients by name; see `jvp`.

    Raises:
        ValueError: As in `jvp`.

    Example:
        >>> from billiards_env import Scene, simulate
        >>> shot = simulate(Scene.named("ideal", 0), [[0.0, 0.0]], [0.5, 0.0], max_time=1.0, record=True)
        >>> vjp(shot, {"positions": [[3.0, 4.0]]}, by=("velocities", "mass"))
        {'velocities': array([[3., 4.]]), 'mass': array([0.])}
    """
    record = record_of(shots)
    known, m, names = _inputs(record, strike), len(record.time), _names("by", by)
    for name in names:
        known.shape(name)
    if not isinstance(cotangents, Mapping) or not cotangents:
        raise ValueError(f"cotangents = {short(cotangents)}: expected a mapping from names of outputs to arrays")
    to_outputs = {
        name: _per_shot("cotangents", name, value, m, _output_shape(record, name))[:, None]
        for name, value in cotangents.items()
    }
    times, to_margins = _times(record, t), {name: to_outputs.pop(name) for name in MARGINS if name in to_outputs}
    inputs = _pull_of(record, to_outputs, times, 1, names, threads)
    results = {name: known.pull(name, inputs)[:, 0] for name in names}
    for name in names if to_margins else ():  # forwards: a margin has a time of its own
        by_columns = _by_columns(record, known, tuple(to_margins), name, times, threads)
        for of, cotangent in to_margins.items():
            results[name] = results[name] + np.einsum("mjk,mijk->mi", cotangent[:, 0], by_columns[of]).reshape(
                m, *known.shape(name)
            )
    return _of_each(shots, results[by] if isinstance(by, str) else results)


def _pull_of(
    record: Record, adjoints: Mapping[str, Floats], times: Floats, k: int, by: Sequence[str], threads: int | None
) -> Floats:
    """Returns the adjoints of the inputs for k adjoints (m, k, ...) of outputs by name."""
    m, n = len(record.time), record.scene.n_balls
    outputs = np.zeros((m, k, n, BALL_WIDTH))
    at_events = np.zeros((m, k, _most_events(record, tuple(adjoints)), 3))
    for name, value in adjoints.items():
        _chosen(name, outputs, at_events)[...] = value
    inputs = _zeros(record, k, by)
    _for_all(record, pull_lanes, threads, inputs, times, outputs, at_events, inputs)
    return inputs


def jacobian(
    shots: ShotResult | BatchResult,
    of: str = "positions",
    by: str = "velocities",
    *,
    t: ArrayLike | None = None,
    strike: ArrayLike | None = None,
    threads: int | None = None,
) -> Floats:
    """Returns the derivative of an output with respect to an input, with the axes of `of` and then those of `by`.

    Args:
        shots: A recorded shot or batch.
        of: An output.
        by: An input.
        t: Time of the positions, velocities and spins, s, or (m,) times; None for the end of the shot.
        strike: (5,) or (m, 5) speed, heading, side, top and elevation of the strike of the shot, if it is an input.
        threads: Number of threads for a batch; None for that of `set_num_threads`.

    Raises:
        ValueError: As in `jvp`.

    Example:
        >>> from billiards_env import Scene, simulate
        >>> shot = simulate(Scene.named("ideal", 0), [[0.0, 0.0]], [0.5, 0.0], max_time=1.0, record=True)
        >>> jacobian(shot)[0, :, 0].tolist()
        [[1.0, 0.0], [0.0, 1.0]]
    """
    record = record_of(shots)
    known, m, times = _inputs(record, strike), len(record.time), _times(record, t)
    left, right = _output_shape(record, of), known.shape(by)
    rows, cols = math.prod(left), math.prod(right)
    if cols <= rows or of in MARGINS:  # by columns or by rows, whichever are fewer
        jacobians = _by_columns(record, known, (of,), by, times, threads)[of]
        jacobians = np.moveaxis(jacobians.reshape(m, cols, rows), 1, 2)
    else:
        unit = np.broadcast_to(np.eye(rows).reshape(rows, *left), (m, rows, *left))
        inputs = _pull_of(record, {of: unit}, times, rows, (by,), threads)
        jacobians = known.pull(by, inputs)
    return _of_each(shots, np.ascontiguousarray(jacobians.reshape(m, *left, *right)))


_HUGE = 1e100  # a derivative that overflows in the next impacts
_FEW = 16  # events, after which no derivative is `_HUGE`: an impact that does not graze multiplies it by less than 1e6


def nonsmooth(shots: ShotResult | BatchResult, t: ArrayLike | None = None, threads: int | None = None) -> Nonsmooth:
    """Returns the first event at which the shot has no derivative, with the reason, see `Nonsmooth`.

    Args:
        shots: A recorded shot or batch.
        t: Time until which the shot counts, s, or (m,) times; None for its end.
        threads: Number of threads for a batch; None for that of `set_num_threads`.

    Raises:
        ValueError: As in `record_of`, or if t is negative or not finite.
    """
    return _of_each(shots, _nonsmooth(record_of(shots), t, threads))


def _nonsmooth(record: Record, t: ArrayLike | None, threads: int | None) -> Nonsmooth:
    """Returns the fields of `Nonsmooth` as arrays (m,)."""
    first_nonsmooth, times = np.empty((len(record.time), 2), np.int64), _times(record, t)
    _for_all(record, find_nonsmooth, threads, None, times, np.array([ROUNDING]), first_nonsmooth)
    most = _most_events(record, ("event_times",))
    if most > _FEW and (first_nonsmooth[:, 1] < 0).any():
        inputs = _zeros(record, 1)
        inputs[:] = np.cos(np.arange(inputs.shape[2]))  # a change without a symmetry
        inputs.reshape(-1, BALL_INPUTS)[:, 7:] = 0.0  # of states alone
        outputs, at_events = _push(record, times[:, None], inputs, most, threads)
        huge = ~(np.abs(at_events[:, 0]).max(axis=2) <= _HUGE)
        ends = ~(np.abs(outputs).max(axis=(1, 2, 3, 4)) <= _HUGE)
        overflows = (first_nonsmooth[:, 1] < 0) & (ends | huge.any(axis=1))
        last = np.count_nonzero(at_events[:, 0].any(axis=2), axis=1) - 1
        event = np.where(huge.any(axis=1), huge.argmax(axis=1), last)
        first_nonsmooth[overflows] = np.stack((event, np.full_like(event, OVERFLOWS)), axis=1)[overflows]
    return Nonsmooth(first_nonsmooth[:, 0], np.array((*REASONS, ""))[first_nonsmooth[:, 1]])


SAFETY = 100.0
"""The ratio of the bounds of `certainty` to the condition times the unit roundoff, see `Certainty`."""


def certainty(shots: ShotResult | BatchResult) -> Certainty:
    """Returns the number of certain contacts and whether the outcome is certain, see `Certainty`.

    Args:
        shots: A recorded shot or batch.

    Raises:
        ValueError: As in `record_of`.

    Example:
        >>> from billiards_env import Scene, simulate
        >>> shot = simulate(Scene.named("pool"), [[-0.5, 0.0], [0.0, 0.01]], [2.0, 0.0], record=True)
        >>> certainty(shot).outcome
        True
    """
    record = record_of(shots)
    m, first_nonsmooth = len(record.time), np.empty((1, 2), np.int64)
    contacts, outcomes = np.empty(m, np.int64), np.empty(m, np.bool_)
    for k in range(m):
        alone = _shots(record, k, k + 1)
        events = alone.log.events
        bounds = _error_bounds(alone, len(events))
        _for_all(alone, find_nonsmooth, 1, None, alone.time, bounds, first_nonsmooth)
        (event, reason), at = first_nonsmooth[0], np.flatnonzero(events[:, KIND] <= BALL_POCKET)
        unordered = np.flatnonzero(np.diff(events[at, TIME]) <= bounds[at[1:], 1])
        contacts[k] = min([len(at) if reason < 0 else np.searchsorted(at, event), *unordered[:1]])
        outcomes[k] = reason < 0 and contacts[k] == len(at)
    return _of_each(shots, Certainty(contacts, outcomes))


def _error_bounds(record: Record, n_events: int) -> Floats:
    """Returns the result of `bound_errors` for a shot, (n_events + 1, 2), at least `ROUNDING`."""
    radius, largest = min(record.scene.balls.radius), max(record.scene.half_extents)
    states, bounds = start_states(record)[0], np.empty((n_events + 1, 2))
    speed = max(np.abs(states[:, 2:4]).max(), radius * np.abs(states[:, 4:]).max())
    inputs = _unit_starts(record, np.array([largest] * 2 + [speed] * 2 + [speed / radius] * 3))
    limits = 2.0 * SAFETY * UNIT_ROUNDOFF, largest
    _for_all(record, bound_errors, 1, inputs, record.time, inputs, limits, bounds)
    return np.maximum(bounds, ROUNDING)


def sensitivity(shot: ShotResult, t: float | None = None) -> Sensitivity:
    """Returns the derivative of the positions at time t with respect to the initial state of the balls.

    Args:
        shot: A recorded shot.
        t: Seconds since the start of the shot; None for its end.

    Raises:
        TypeError, ValueError: As in `record_of`, or if t is negative or not finite.
    """
    return next(sensitivities(shot, [shot.time if t is None else t]))


def sensitivities(shot: ShotResult, times: ArrayLike) -> Iterator[Sensitivity]:
    """Returns the `sensitivity` at each of several ascending times, s, computed in one pass.

    A time after the end of the shot counts as its end. An event exactly at a time counts as past.

    Raises:
        TypeError, ValueError: As in `record_of`, or if a time is negative, not finite or earlier than the one before.
    """
    record = record_of(shot)
    if isinstance(shot, BatchResult):
        raise TypeError("shot = a BatchResult: expected a ShotResult, such as batch[0]")
    array = numbers("times", times)
    if not (array.ndim == 1 and np.isfinite(array).all() and (array >= 0).all() and (np.diff(array) >= 0).all()):
        raise ValueError(f"times = {short(times)}: expected finite numbers of seconds >= 0 in ascending order")
    return _sensitivities(record, np.minimum(array, record.time))


_TIMES = 64  # number of times in one pass, which bounds the memory


def _sensitivities(record: Record, array: Floats) -> Iterator[Sensitivity]:
    n = record.scene.n_balls
    scale, (events, reasons) = np.abs(start_states(record)[0]), _nonsmooth(record, None, 1)
    event = int(events[0])
    last = np.inf if not reasons[0] else record.log.events[event, TIME] if event >= 0 else -1.0
    for block in np.split(array, range(_TIMES, len(array), _TIMES)):
        for time, jacobian in zip(block.tolist(), _ball_jacobians(record, block), strict=True):
            scaled = (jacobian * scale).reshape(n, 2, -1)
            condition = float(np.linalg.norm(scaled, 2, axis=(1, 2)).max())
            yield Sensitivity(jacobian, time, bool(time < last), condition)


def _ball_jacobians(record: Record, times: Floats) -> Floats:
    """Returns the derivatives of the positions of one shot at ascending times (q,) by its start.

    They are (q, n, 2, n, 7) float64, with respect to (x, y, vx, vy, wx, wy, wz).
    """
    n = record.scene.n_balls
    outputs, _ = _push(record, times[None], _unit_starts(record, np.ones(7)), 0, 1)
    return np.moveaxis(outputs[0, ..., :2], 1, 3).reshape(len(times), n, 2, n, 7)


_BLOCK = 2**23  # numbers in the outputs of one call of `push_lanes`


def start_jacobians(batch: BatchResult, times: Floats, ball: int, names: Sequence[str], threads: int | None) -> Floats:
    """Returns the derivatives of the positions of m shots at ascending times (m, q) by their starts and by numbers.

    Args:
        batch: The recorded shots.
        times: s; not later than the ends of the shots.
        ball: The ball with a velocity.
        names: Numbers of `Physics`, see `physics_inputs`.
        threads: Number of threads.

    Returns:
        (m, q, 2 n + 5 + len(names), n, 2) float64: the derivatives with respect to the positions of the n balls, the
        velocity and the spin of the ball, and the numbers.
    """
    record = record_of(batch)
    (m, q), n = times.shape, record.scene.n_balls
    known = physics_inputs(record.scene.physics) if names else {}
    start = [BALL_INPUTS * i + axis for i in range(n) for axis in (0, 1)]
    start += [BALL_INPUTS * ball + k for k in (2, 3, 4, 5, 6)]
    lanes = np.zeros((len(start) + len(names), BALL_INPUTS * n + (NUMBER_INPUTS if names else 0)))
    lanes[np.arange(len(start)), start] = 1.0
    for lane, name in zip(lanes[len(start) :], names, strict=True):
        lane[BALL_INPUTS * n :] = known[name]
    jacobians = np.empty((m, q, len(lanes), n, 2))
    step = max(1, _BLOCK // (q * len(lanes) * n * BALL_WIDTH))
    for begin in range(0, m, step):
        piece = slice(begin, begin + step)
        part = _shots(record, begin, min(begin + step, m))
        inputs = np.repeat(lanes[None], len(part.time), axis=0)  # not read-only: numba would compile `push_lanes` again
        outputs, _ = _push(part, times[piece], inputs, 0, threads)
        jacobians[piece] = outputs[..., :2]
    return jacobians


def _shots(record: Record, begin: int, end: int) -> Record:
    """Returns the record of shots `begin` to `end` - 1."""
    varied = {name: values[begin:end] for name, values in record.varied.items()}
    return Record(record.scene, record.time[begin:end], record.log.shots(begin, end), varied)
