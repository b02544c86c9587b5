"""Compiles a scene to the arrays that the engines read, and chooses the engine."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine import pic, pit
from billiards_env.engine.contact_rule import CONTACT_TIME, longest_run, weak_speed
from billiards_env.engine.measures import MEASURES, Measure, recorder
from billiards_env.engine.overlaps import FIXES, TREATMENTS, Fix
from billiards_env.engine.space import space_of
from billiards_env.jit import Typed
from billiards_env.physics.geometry.noses import nose_arrays
from billiards_env.physics.geometry.outline_walls import OUTLINE, outline_arrays
from billiards_env.physics.geometry.rectangle import RECTANGLE, rectangle_arrays
from billiards_env.physics.laws.tables import BALL_LAWS, CUSHIONS, laws_of
from billiards_env.physics.scatter import Scatter
from billiards_env.physics.state import (
    IDEAL,
    NUMBERS,
    ROLLING_ONLY,
    SLIDING_AND_ROLLING,
    Numbers,
    SceneArrays,
    SceneKernels,
)
from billiards_env.scene import CUSHION_NAMES, PARAMETERS, Physics, Scene, law_numbers
from billiards_env.support.checks import RANGES, fits, one_of, short

MODES = ("pic", "pit")
"""The modes of an `Engine`."""

MOTIONS = {"ideal": IDEAL, "rolling": ROLLING_ONLY, "sliding": SLIDING_AND_ROLLING}
"""`Numbers.motion` for each motion of a scene."""

MANY_BALLS = 160
"""From this number of balls on PIC uses `engine.cell_grid`.

The grid is faster from this number on in a thin gas, and from about 110 balls on in a dense gas. In a rack, which fills
only a few cells, it is not faster with up to 400 balls.
"""

MAX_EVENTS = 10_000_000
"""Default number of events after which the engine ends a shot.

A break has hundreds of events, at most thousands; a heap of balls pressed into a corner by extreme spins has millions.
"""


Varied = Mapping[str, NDArray[np.float64]]
"""The values that differ from shot to shot, (m,), by name: numbers of `Physics`, and the timestep "dt"."""


@dataclasses.dataclass(frozen=True, slots=True)
class Engine:
    """The engine that runs a shot, and its settings.

    Attributes:
        mode: "pic" (event-driven, exact) or "pit" (fixed timestep, see `engine.pit`).
        dt: Timestep of "pit", s. "pic" requires None.
        fix: How "pit" treats overlaps: a name in `engine.overlaps.TREATMENTS`. None means the first one. "pic"
            requires None.

    Raises:
        ValueError: If `mode` is not an engine, or `dt` or `fix` is not valid for it.
    """

    mode: str = "pic"
    dt: float | None = None
    fix: str | None = None

    def __post_init__(self) -> None:
        mode, dt, fix = self.mode, self.dt, self.fix
        one_of("mode", mode, MODES)
        if mode == "pic":
            for name, value, what in (("dt", dt, "timestep (mode='pit' has one)"), ("fix", fix, "overlaps to fix")):
                if value is not None:
                    raise ValueError(f"{name} = {short(value)} with mode='pic': expected None, PIC has no {what}")
            return
        if dt is None or not fits(dt, "dt"):
            least, most, unit, _ = RANGES["dt"]
            raise ValueError(
                f"dt = {short(dt)} with mode='pit': expected the timestep, a number from {least:g} to {most:g} {unit}, "
                f"such as 1/60{', not str' if isinstance(dt, str) else ''}"
            )
        if fix is not None:
            one_of("fix", fix, FIXES)
        object.__setattr__(self, "dt", float(dt))

    @property
    def treatment(self) -> Fix:
        """The entry of `TREATMENTS` for `fix`."""
        return TREATMENTS[self.fix or FIXES[0]]

    def __str__(self) -> str:
        steps = 0 if self.dt is None else round(1.0 / self.dt)
        dt = f"1/{steps}" if steps > 1 and 1.0 / steps == self.dt else self.dt
        return self.mode.upper() + (f", dt = {dt} s" if dt else "") + (f", {self.fix}" if self.fix else "")


PIC = Engine()


def check_engine(engine: Any) -> None:
    """Raises a TypeError unless `engine` is an `Engine`."""
    if not isinstance(engine, Engine):
        raise TypeError(f"engine = {short(engine)}: expected an Engine, such as Engine('pit', dt=1/60)")


def check_varied_name(what: str, name: Any, engine: Engine) -> None:
    """Raises a ValueError unless a number may differ between the shots of an engine, see `Varied`."""
    one_of(f"key of {what}", name, (*PARAMETERS, "dt"))
    if name == "dt" and engine.mode == "pic":
        raise ValueError(f"{what}['dt'] with mode='pic': expected mode='pit', PIC has no timestep")


_KEPT = 256  # results of `cached_by_scene`


def cached_by_scene(function: Callable[..., Any]) -> Callable[..., Any]:
    """Returns a function that keeps the last results of a function of a scene and of other arguments.

    A scene that is the same object is found without its hash, which takes up to 0.1 ms for a table with an outline.
    """
    by_value, kept = functools.lru_cache(maxsize=_KEPT)(function), {}

    @functools.wraps(function)
    def call(scene: Scene, *arguments: Any) -> Any:
        key = id(scene), *arguments
        cached = kept.get(key)
        if cached is None:
            if len(kept) >= _KEPT:
                kept.clear()
            cached = kept[key] = scene, by_value(scene, *arguments)  # the scene stays alive: no other one gets its id
        return cached[1]

    return call


@cached_by_scene
def run_shots_of(scene: Scene, engine: Engine) -> tuple[Callable[..., None], Any]:
    """Returns the function that runs the shots of a scene by an engine, and its argument `kernels`."""
    if engine.mode == "pit":
        return pit.run_shots, pit.PitKernels(scene_kernels(scene), engine.treatment.kernels)
    n = scene.n_balls
    queue = pic.ONE_PAIR if n <= 2 else pic.ALL_PAIRS if n < MANY_BALLS else pic.CELL_GRID
    return pic.run_shots, pic.PicKernels(scene_kernels(scene), queue)


def typed_run(scene: Scene, engine: Engine, has_scatter: bool = False, measures: tuple[str, ...] = ()) -> Typed:
    """Returns the function that runs the shots of a scene by an engine, without its argument `kernels`.

    The types of its arrays must be those of `empty_shots`.
    """
    return _typed_run(scene, engine, has_scatter, tuple(MEASURES[name] for name in measures))


@cached_by_scene
def _typed_run(scene: Scene, engine: Engine, has_scatter: bool, measures: tuple[Measure, ...]) -> Typed:
    run_shots, kernels = run_shots_of(scene, engine)
    return Typed(run_shots, kernels._replace(record=recorder(measures)))


def scene_fields(scene: Scene, engine: Engine = PIC) -> tuple[Any, ...]:
    """Returns a scene and the settings of an engine as the argument `scene` of an entry point, see `SceneArrays`.

    The same arguments return the same tuple.
    """
    return _compiled(scene, engine)[1]


def scene_kernels(scene: Scene) -> SceneKernels:
    """Returns the kernels of a scene: the argument `kernels` of an entry point."""
    return _compiled(scene, PIC)[0]


def scene_arrays(scene: Scene) -> SceneArrays:
    """Returns the arrays and the kernels of a scene."""
    numbers, *arrays = scene_fields(scene)
    return SceneArrays(Numbers(*numbers[0]), *arrays, *scene_kernels(scene))  # pyright: ignore[reportCallIssue]


def with_scatter(fields: tuple[Any, ...], scatter: Scatter | None) -> tuple[Any, ...]:
    """Returns `scene_fields` with the scatter of the cushions, or without scatter if it is None."""
    return *fields[:-1], None if scatter is None else tuple(scatter)


def varied_fields(scene: Scene, engine: Engine, varied: Varied, m: int) -> tuple[Any, ...]:
    """Returns `scene_fields` with the numbers of each of m shots. Without any that vary they are those of all shots."""
    fields = scene_fields(scene, engine)
    if not varied:
        return fields
    records = np.repeat(fields[0], max(m, 1))
    vary(records[:m], slice(None), scene, engine, varied)
    return (records, *fields[1:])


def vary(records: NDArray[Any], rows: Any, scene: Scene, engine: Engine, varied: Varied) -> None:
    """Writes the numbers of shots to rows of an array of records of `NUMBERS`; `varied` has a value for each row."""
    for name, values in _numbers(scene, engine, varied)._asdict().items():
        records[name][rows] = values


def varied_shot(scene: Scene, engine: Engine, varied: Varied, k: int) -> tuple[Scene, Engine]:
    """Returns the scene and the engine of shot k."""
    if not varied:
        return scene, engine
    numbers = {name: values[k].item() for name, values in varied.items()}
    engine = dataclasses.replace(engine, dt=numbers.pop("dt", engine.dt))
    return dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, **numbers)), engine


def physics_of_shots(physics: Physics, varied: Varied) -> Any:
    """Returns an object with the fields of a `Physics`, of which those that vary are arrays (m,)."""
    constants = {field.name: getattr(physics, field.name) for field in dataclasses.fields(physics)}
    return SimpleNamespace(**constants | dict(varied))


@cached_by_scene
def _compiled(scene: Scene, engine: Engine) -> tuple[SceneKernels, tuple[Any, ...]]:
    """Returns `scene_kernels` and `scene_fields`."""
    p, table = scene.physics, scene.table
    for name, laws in (("motion", MOTIONS), ("cushion", CUSHIONS), ("ball_ball", BALL_LAWS)):
        one_of(f"physics.{name}", getattr(p, name), tuple(laws))  # `scene` may have names that have no law
    if p.flight and engine.treatment.goes_back:
        allowed = " or ".join(repr(name) for name, fix in TREATMENTS.items() if not fix.goes_back)
        raise ValueError(f"fix = {engine.fix!r} with physics.flight = True: expected {allowed}")
    numbers = _numbers(scene, engine, {})
    half, places = (numbers.half_length, numbers.half_width), table.pocket_places.tolist()
    outline = outline_arrays(table.outline, *half, places) if table.outline else rectangle_arrays(*half, len(places))
    arrays = SceneArrays(
        numbers=numbers,
        radius=np.array(scene.balls.radius),
        inv_mass=1.0 / np.array(scene.balls.mass),
        pockets=table.pocket_rows,
        outline=outline,
        noses=nose_arrays(outline, scene.balls.radius, numbers, table.pocket_rows.tolist()) if p.flight else None,
    )
    walls = OUTLINE if table.outline else RECTANGLE
    kernels = SceneKernels(laws_of(p.ball_ball, p.cushion), walls, space_of(scene))
    return kernels, (np.array([numbers], NUMBERS), *arrays[1 : -len(kernels)])


def _numbers(scene: Scene, engine: Engine, varied: Varied) -> Any:
    """Returns the `Numbers` of a scene and an engine. Those that depend on what varies are arrays (m,)."""
    p = physics_of_shots(scene.physics, varied)
    motion, table = MOTIONS[p.motion], scene.table
    known = law_numbers(p, table.cushion_height)
    return Numbers(
        **known,
        motion=motion,
        cushion_rubs=CUSHION_NAMES[p.cushion],
        cushion_work=CUSHIONS[p.cushion].work,
        half_length=table.length / 2,
        half_width=table.width / 2,
        tau=CONTACT_TIME,
        weak_speed=weak_speed(motion, known["slide"], known["roll"]),
        longest_run=longest_run(scene.balls.mass),
        dt=varied.get("dt", engine.dt or 0.0),
    )
