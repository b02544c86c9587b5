"""Shots as functions of arrays, for the libraries that differentiate functions: `billiards_env.torch` and `.jax`."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.derivatives.shot_derivatives import MARGINS, check_derivatives, jvp, margins, physics_inputs, vjp
from billiards_env.scene import Scene, check_scene
from billiards_env.shots.simulation import BatchResult, simulate_batch
from billiards_env.support.checks import one_of, shaped, short

Floats = NDArray[np.float64]

STARTS, OF_BALLS = ("positions", "velocities", "spins"), ("radius", "mass")


def checked_physics(scene: Scene, physics: Mapping[str, Any] | None) -> dict[str, Any]:
    """Returns the numbers of `Physics` that are inputs, by name, after a check of the names and of the scene.

    Raises:
        TypeError: If `physics` is not a mapping, or `scene` not a Scene.
        ValueError: If a name is unknown, or the shots of the scene have no derivatives.
    """
    check_scene(scene)
    check_derivatives(scene, "differentiable shots", "simulate_batch")
    if not isinstance(physics, Mapping | None):
        raise TypeError(f"physics = {short(physics)}: expected a mapping from names of numbers of Physics to arrays")
    for name in physics or {}:
        one_of("physics", name, tuple(physics_inputs(scene.physics)))
    return dict(physics or {})


@dataclasses.dataclass
class ShotFunction:
    """m shots as a function of arrays.

    Attributes:
        scene: The scene.
        inputs: The names of the inputs: some of `STARTS`, of `OF_BALLS`, (n,) each, and numbers of `Physics`, () for
            all shots or (m,).
        outputs: The names of the outputs: some of `STARTS` and `MARGINS`.
        options: Further arguments of `simulate_batch`.
    """

    scene: Scene
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    options: dict[str, Any]

    def __post_init__(self) -> None:
        for name in self.outputs:
            one_of("of", name, (*STARTS, *MARGINS))

    def run(self, inputs: Sequence[Floats], record: bool) -> BatchResult:
        """Runs the shots."""
        by_name = dict(zip(self.inputs, inputs, strict=True))
        start = {name: by_name.pop(name) for name in STARTS if name in by_name}
        of_balls = [name for name in OF_BALLS if name in by_name]
        balls = {name: tuple(shaped(name, by_name.pop(name), (self.scene.n_balls,)).tolist()) for name in of_balls}
        varied = {name: values for name, values in by_name.items() if values.ndim}
        numbers = {name: value.item() for name, value in by_name.items() if not value.ndim}
        scene = dataclasses.replace(
            self.scene,
            balls=dataclasses.replace(self.scene.balls, **balls),
            physics=dataclasses.replace(self.scene.physics, **numbers),
        )
        options = {**self.options, "physics": {**(self.options.get("physics") or {}), **varied}}
        return simulate_batch(scene, **start, **options, record=record)

    def values(self, batch: BatchResult) -> list[Floats]:
        """Returns the outputs of shots, which are recorded if an output is a margin."""
        by_name = {name: getattr(batch, name) for name in STARTS}
        if set(self.outputs) & set(MARGINS):
            by_name |= zip(MARGINS, margins(batch, threads=self.options.get("threads")), strict=False)
        return [by_name[name] for name in self.outputs]

    def vjp(self, batch: BatchResult, cotangents: Sequence[Floats]) -> list[Floats]:
        """Returns the gradients of recorded shots with respect to the inputs of each shot."""
        of = dict(zip(self.outputs, cotangents, strict=True))
        by_name = vjp(batch, of, self.inputs, threads=self.options.get("threads"))
        return [by_name[name] for name in self.inputs]

    def jvp(self, batch: BatchResult, tangents: Sequence[Floats]) -> list[Floats]:
        """Returns the derivatives of the outputs of recorded shots, for tangents of the inputs of each shot."""
        by = dict(zip(self.inputs, tangents, strict=True))
        by_name = jvp(batch, by, self.outputs, threads=self.options.get("threads"))
        return [by_name[name] for name in self.outputs]
