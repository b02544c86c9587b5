"""Shots as functions of JAX arrays. Needs JAX, which is in the extra `jax`.

`simulate` is a differentiable function of the start of shots. It works under `jit`, `vmap` and `scan`. It calls NumPy
on the host (`jax.pure_callback`).

Example:
    >>> import jax
    >>> from billiards_env import Scene
    >>> scene, position = Scene.named("ideal", 0), jax.numpy.zeros((1, 2))
    >>> loss = lambda velocities: simulate(scene, position, velocities, max_time=2.0).sum()
    >>> jax.jit(jax.grad(loss))(jax.numpy.array([[0.5, 0.0]])).tolist()
    [[2.0, 2.0]]
"""

# Without JAX the type checker takes this module for it.
# pyright: reportMissingImports=false, reportAttributeAccessIssue=false

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from billiards_env.derivatives.functions import ShotFunction, checked_physics
from billiards_env.derivatives.shot_derivatives import MARGINS, margin_columns
from billiards_env.scene import Scene
from billiards_env.support.checks import missing

try:
    import jax
    import jax.numpy as jnp
except ModuleNotFoundError as error:
    raise missing(error.name or "jax", "jax") from error


def simulate(
    scene: Scene,
    positions: Any,
    velocities: Any,
    spins: Any = None,
    *,
    of: str | Sequence[str] = "positions",
    physics: Mapping[str, Any] | None = None,
    in_play: Any = None,
    max_time: float | None = None,
    threads: int | None = None,
) -> Any:
    """Runs shots with `billiards_env.simulate_batch`, as a function of JAX arrays.

    Gradients (`jax.grad`, `jax.vjp`) equal those of `BatchResult.vjp`, bit for bit in double precision
    (`jax_enable_x64`). Derivatives in forward mode and second derivatives do not exist. `vmap` runs all shots in one
    batch.

    Args:
        scene: Table, balls and physics.
        positions: (..., n, 2) m.
        velocities: (..., n, 2) m/s.
        spins: (..., n, 3) rad/s; None for zero.
        of: An output, or several: "positions", "velocities", "spins", "ball_margins", "pocket_margins" and
            "cushion_margins" (see `shot_derivatives.Margins`).
        physics: Numbers of `Physics` by name, (...) each, with derivatives. The others come from the scene.
        in_play: (n,) bool, the balls on the table. None for all.
        max_time: Time of the outputs, s; None for the limit of the scene.
        threads: Number of threads; None for the number of `set_num_threads`.

    Returns:
        The output at the end of the shots, or a dict with the outputs by name, with the axes (...) of all inputs
        together and the type of the positions and velocities.

    Raises:
        ValueError: As in `simulate_batch`, if a name is unknown, or if an array is complex. Errors in the values of
            arrays end the computation as errors of JAX.
        TypeError: As there, or for a derivative in forward mode.
        NotImplementedError: For a second derivative.
    """
    numbers = checked_physics(scene, physics)
    names, n = (of,) if isinstance(of, str) else tuple(of), scene.n_balls
    starts = {"positions": (n, 2), "velocities": (n, 2), "spins": (n, 3)}
    given = {"positions": positions, "velocities": velocities, "spins": spins, **numbers}
    named = {name: jnp.asarray(array) for name, array in given.items() if array is not None}
    own = {name: starts.get(name, ()) for name in named}  # the axes of one shot
    for name, array in named.items():
        if jnp.iscomplexobj(array):
            raise ValueError(f"{name} has type {array.dtype}: expected real numbers")
        if array.shape[array.ndim - len(own[name]) :] != own[name]:
            axes = ", ".join(map(str, own[name]))
            raise ValueError(f"{name} has shape {array.shape}: expected (..., {axes})")
    inexact = (named[name] for name in ("positions", "velocities") if jnp.issubdtype(named[name].dtype, jnp.inexact))
    kind = jnp.result_type(float, *inexact)
    arrays = {name: array.astype(kind) for name, array in named.items()}
    lead = jnp.broadcast_shapes(*(array.shape[: array.ndim - len(own[name])] for name, array in arrays.items()))
    arrays = {name: jnp.broadcast_to(array, lead + own[name]) for name, array in arrays.items()}
    shots = ShotFunction(scene, tuple(arrays), names, {"in_play": in_play, "max_time": max_time, "threads": threads})
    shots.run([np.empty((0, *own[name])) for name in arrays], False)  # checks the options
    sizes = starts | {name: (n, columns.stop - columns.start) for name, columns in margin_columns(scene).items()}

    def on_host(work: Callable[[list[Any]], list[Any]]) -> Callable[..., Any]:
        def call(*values: Any) -> tuple[Any, ...]:
            axes = np.ndim(values[0]) - 2
            flat = [np.asarray(x, np.float64).reshape(-1, *np.shape(x)[axes:]) for x in values]
            return tuple(y.reshape((*np.shape(values[0])[:axes], *y.shape[1:])).astype(kind) for y in work(flat))

        return call

    k, record = len(arrays), bool(set(names) & set(MARGINS))
    pull = _callback(
        on_host(lambda flat: shots.vjp(shots.run(flat[:k], True), flat[k:])),
        tuple(jax.ShapeDtypeStruct(lead + own[name], kind) for name in arrays),
        _refuse,
    )
    push = _callback(
        on_host(lambda flat: shots.values(shots.run(flat, record))),
        tuple(jax.ShapeDtypeStruct(lead + sizes[name], kind) for name in names),
        lambda inputs, cotangents: pull(*inputs, *cotangents),
    )
    outputs = dict(zip(names, push(*arrays.values()), strict=True))
    return outputs[of] if isinstance(of, str) else outputs


def _refuse(*_: Any) -> Any:
    raise NotImplementedError("second derivatives of shots: expected first derivatives")


def _callback(function: Callable[..., Any], shapes: Any, pull: Callable[..., Any]) -> Any:
    """Returns a function of JAX arrays that calls one of NumPy arrays. `pull` returns its gradients."""
    called = jax.custom_vjp(lambda *arrays: jax.pure_callback(function, shapes, *arrays, vmap_method="broadcast_all"))
    called.defvjp(lambda *arrays: (called(*arrays), arrays), pull)
    return called
