"""Shots as differentiable functions of PyTorch tensors. Needs PyTorch, which is in the extra `train`.

Example:
    >>> import torch
    >>> from billiards_env import Scene
    >>> velocities = torch.tensor([[0.5, 0.0]], requires_grad=True)
    >>> positions = simulate(Scene.named("ideal", 0), torch.zeros(1, 2), velocities, max_time=2.0)
    >>> positions.sum().backward()
    >>> positions.tolist(), velocities.grad.tolist()
    ([[1.0, 0.0]], [[2.0, 2.0]])
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from billiards_env.derivatives.functions import OF_BALLS, ShotFunction, checked_physics
from billiards_env.derivatives.shot_derivatives import MARGINS
from billiards_env.engine import PIC
from billiards_env.scene import Scene
from billiards_env.shots.simulation import BatchResult
from billiards_env.support.checks import missing, short

try:
    import torch
    from torch import Tensor
    from torch.autograd import Function
except ModuleNotFoundError as error:
    raise missing(error.name or "torch", "train") from error


_Call = TypeVar("_Call", bound=Callable[..., Any])


def _untraced(function: _Call) -> _Call:
    """Returns the function, which `torch.compile` then calls and does not trace."""
    return cast(_Call, torch.compiler.disable(function))


@_untraced
def simulate(
    scene: Scene,
    positions: Tensor,
    velocities: Tensor,
    spins: Tensor | None = None,
    *,
    of: str | Sequence[str] = "positions",
    radius: Tensor | None = None,
    mass: Tensor | None = None,
    physics: Mapping[str, Tensor] | None = None,
    varied: Mapping[str, Any] | None = None,
    in_play: Any = None,
    max_time: float | None = None,
    threads: int | None = None,
) -> Any:
    """Runs m shots with `billiards_env.simulate_batch`, as a differentiable function of tensors.

    Gradients (`backward`, `torch.autograd.grad`) come from `derivatives.vjp`, and derivatives in forward mode
    (`torch.func.jvp`, `torch.func.jacfwd`) from `derivatives.jvp`. `torch.func.vmap` runs all shots in one batch; it
    cannot map over inputs that all shots share: radii, masses and numbers of shape (). Second derivatives do not
    exist. `torch.compile` compiles the code before and after a call and does not trace the call, which is one graph
    break.

    Args:
        scene: Table, balls and physics.
        positions: (m, n, 2) m, or (n, 2) for one shot.
        velocities: (m, n, 2) m/s, or (m, 2) for the cue balls alone; (n, 2) or (2,) for one shot.
        spins: (m, n, 3) rad/s, or (m, 3) for the cue balls alone; (n, 3) or (3,) for one shot. None for zero.
        of: An output, or several: "positions", "velocities", "spins", and the signed distances to changes of outcome
            "ball_margins", "pocket_margins" and "cushion_margins" (see `shot_derivatives.Margins`).
        radius: (n,) radii of the balls, m; None for the scene's.
        mass: (n,) masses of the balls, kg; None for the scene's.
        physics: Numbers of `Physics` by name, () for all shots or (m,). The others come from the scene.
        varied: Numbers of `Physics` that differ from shot to shot, (m,) each, without derivatives: `physics` of
            `simulate_batch`.
        in_play: (m, n) or (n,) bool; by default all balls are in play.
        max_time: Time of the outputs, s; None for the limit of the scene. A shot that ends earlier has the outputs of
            its end.
        threads: Number of threads; None for the number of `set_num_threads`.

    Returns:
        The output at the end of the shots, or a dict with the outputs by name. They have the device of `velocities` and
        its type, or the default type of PyTorch if it has whole numbers. The simulation runs in double precision on the
        CPU.

    Raises:
        ValueError: As in `simulate_batch`, or if a name is unknown, or in `physics` and in `varied`.
        TypeError: As there, or if an input is not a tensor.
        NotImplementedError: If a second derivative is computed, or `vmap` maps over an input that all shots share.
    """
    names = (of,) if isinstance(of, str) else tuple(of)
    numbers = checked_physics(scene, physics)
    if varied and not numbers.keys().isdisjoint(varied):
        raise ValueError(f"varied = {short(varied)}: expected numbers that physics does not have")
    starts = {"positions": positions, "velocities": velocities, "spins": spins}
    balls = {"radius": radius, "mass": mass}
    for name, tensor in {**starts, **balls, **numbers}.items():
        if tensor is None and name in ("spins", *OF_BALLS):
            continue
        if not isinstance(tensor, Tensor):
            raise TypeError(f"{name} = {short(tensor)}: expected a tensor")
        if tensor.is_complex():
            raise ValueError(f"{name} has type {tensor.dtype}: expected real numbers")
    if not velocities.is_floating_point():
        starts["velocities"] = velocities.to(torch.get_default_dtype())
    tensors = {name: tensor for name, tensor in starts.items() if tensor is not None}
    single = positions.ndim == 2
    if single:
        tensors = {name: tensor.unsqueeze(0) for name, tensor in tensors.items()}
    for name in tensors:
        if name != "positions" and tensors[name].ndim == 2:  # those of the cue balls
            tensors[name] = torch.nn.functional.pad(tensors[name].unsqueeze(1), (0, 0, 0, scene.n_balls - 1))
    tensors |= {name: tensor for name, tensor in {**balls, **numbers}.items() if tensor is not None}
    options = {"physics": varied, "in_play": in_play, "max_time": max_time, "threads": threads}
    shared = (*OF_BALLS, *(name for name, number in numbers.items() if not number.ndim))
    shots = _TensorShots(scene, tuple(tensors), names, options, shared)
    shots.record = torch.is_grad_enabled() and any(tensor.requires_grad for tensor in tensors.values())
    results = cast(tuple[Tensor, ...], _Simulate.apply(shots, *tensors.values()))
    outputs = {name: output[0] if single else output for name, output in zip(names, results, strict=True)}
    return outputs[of] if isinstance(of, str) else outputs


@_untraced
def pot_margins(
    env: Any, positions: Tensor, actions: Tensor, in_play: Any = None, threads: int | None = None
) -> Tensor:
    """Returns how far the shots of actions are from potting each ball in each pocket, with derivatives.

    A reward of `Billiards-v0` is a step function of the action. This function increases towards the step: it is
    positive exactly if the ball enters the pocket. While no ball touches the ball, the gap between it and the cue ball
    is subtracted from the margin of the resting ball. If a chain of other balls leads from the cue ball to the ball
    with smaller gaps in total, these are subtracted. So the function is continuous where a ball begins to move.

    Args:
        env: The environment `Billiards-v0` with `action="velocity"`, or a vector environment with the same arguments.
            With `randomize` the shots have the physics of its present episodes.
        positions: (m, n, 2) positions of the balls, m, such as `env.positions`. With `randomize` m is the number of
            environments, or any number with a single one.
        actions: (m, 2) actions. One that is longer than 1 is scaled to length 1.
        threads: Number of threads; None for the number of `set_num_threads`.
        in_play: As there, such as `~env.potted`.

    Returns:
        (m, n - 1, p) margins of the object balls to the pockets, m: the "pocket_margins" of `simulate`.

    Raises:
        ValueError: If the actions are strikes, the engine is "pit", or as in `simulate`.
    """
    from billiards_env.envs.actions import action_named

    base = env.unwrapped
    single = getattr(base, "single_env", base)
    if action_named(single.action).has_cue or action_named(single.action).converter:
        raise ValueError(f"env.action = {single.action!r}: expected 'velocity'")
    if single.engine != PIC:
        raise ValueError(f"env.engine = {single.engine}: expected PIC, shots by PIT have no derivatives")
    if positions.ndim != 3 or actions.shape != (len(positions), 2):
        raise ValueError(
            f"actions has shape {tuple(actions.shape)}: expected (m, 2) for positions (m, n, 2), which has shape "
            f"{tuple(positions.shape)}"
        )
    shots = len(positions) if base is single else 1
    varied = {name: values.repeat(shots) for name, values in base._episodes.state.varied.items()}
    exact, of = actions.double(), ("ball_margins", "pocket_margins")  # the velocities have the same bits as in `step`
    velocities = exact * (single.max_speed / exact.norm(dim=-1, keepdim=True).clamp(min=1.0))
    margins = simulate(single.scene, positions, velocities, of=of, varied=varied, in_play=in_play, threads=threads)
    gaps = -margins["ball_margins"].clamp(max=0.0)
    apart = gaps[:, 0]
    for _ in range(single.scene.n_balls - 2):  # one more ball in the chains (Bellman-Ford)
        apart = torch.minimum(apart, (apart[:, :, None] + gaps).amin(1))
    return (margins["pocket_margins"] - apart[..., None])[:, 1:].to(actions.dtype)


@dataclasses.dataclass
class _TensorShots(ShotFunction):
    """Shots as a function of tensors.

    Attributes:
        shared: The names of the inputs that all shots share. The others have an axis of shots.
        record: Whether to keep the batch for the derivatives.
        batch: This batch, recorded. Without it, derivatives run the shots again.
    """

    shared: tuple[str, ...] = OF_BALLS
    record: bool = False
    batch: BatchResult | None = None

    def recorded(self, tensors: Sequence[Tensor]) -> BatchResult:
        """Returns the recorded batch."""
        return self.batch or self.run(list(map(_array, tensors)), True)

    def folded(self, size: int, dims: Sequence[int | None], tensors: Sequence[Tensor]) -> tuple[Any, ...]:
        """Returns the shots and tensors of `size` batches as one batch. `dims` has their axes, None for none."""
        out = []
        for k, (dim, tensor) in enumerate(zip(dims, tensors, strict=True)):
            if k >= len(self.inputs) or self.inputs[k] not in self.shared:
                batched = tensor.expand(size, *tensor.shape) if dim is None else tensor.movedim(dim, 0)
                tensor = batched.flatten(0, 1)
            elif dim is not None:
                raise NotImplementedError(f"vmap over {self.inputs[k]!r}: expected the same scene for all shots")
            out.append(tensor)
        in_play = self.options["in_play"]
        if np.ndim(in_play) == 2:
            in_play = np.tile(in_play, (size, 1))
        varied = {name: np.tile(values, size) for name, values in (self.options["physics"] or {}).items()}
        options = {**self.options, "physics": varied, "in_play": in_play}
        return _TensorShots(self.scene, self.inputs, self.outputs, options, self.shared), *out


def _array(tensor: Tensor) -> NDArray[np.float64]:
    return tensor.detach().to("cpu", torch.float64).numpy()


def _tensors(arrays: Sequence[Any], like: Tensor) -> tuple[Tensor, ...]:
    return tuple(torch.as_tensor(array, dtype=like.dtype, device=like.device) for array in arrays)


class _OfShots(Function):
    """A function whose first argument is a `_TensorShots`. The other arguments and the results are tensors.

    All tensors but those that the shots share have an axis of shots, so `vmap` runs its batches as one batch.
    """

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Tensor, ...]) -> None:
        ctx.shots = inputs[0]
        ctx.save_for_backward(*inputs[1:])
        ctx.save_for_forward(*inputs[1:])

    @classmethod
    def vmap(  # pyright: ignore[reportIncompatibleMethodOverride]
        cls, info: Any, in_dims: Sequence[int | None], *arguments: Any
    ) -> Any:
        shots, *tensors = arguments
        results = cls.apply(*shots.folded(info.batch_size, in_dims[1:], tensors))
        outputs = tuple(output.unflatten(0, (info.batch_size, -1)) for output in results)
        return outputs, (0,) * len(outputs)

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Tensor) -> Any:
        raise NotImplementedError("second derivatives of shots: expected first derivatives")

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> Any:
        raise NotImplementedError("second derivatives of shots: expected first derivatives")


class _Simulate(_OfShots):
    """Inputs to outputs."""

    @staticmethod
    def forward(shots: _TensorShots, *inputs: Tensor) -> tuple[Tensor, ...]:
        has_margins = bool(set(shots.outputs) & set(MARGINS))
        batch = shots.run(list(map(_array, inputs)), shots.record or has_margins)
        shots.batch = batch if shots.record else None
        return _tensors(shots.values(batch), inputs[1])

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Tensor) -> tuple[Tensor | None, ...]:
        gradients = _Vjp.apply(ctx.shots, *ctx.saved_tensors, *grad_outputs)
        sums = (
            x.sum(0) if name in ctx.shots.shared else x for name, x in zip(ctx.shots.inputs, gradients, strict=True)
        )
        return None, *sums

    @staticmethod
    def jvp(ctx: Any, *tangents: Tensor | None) -> tuple[Tensor, ...]:
        inputs, changes = ctx.saved_tensors, []
        for name, x, change in zip(ctx.shots.inputs, inputs, tangents[1:], strict=True):
            change = torch.zeros_like(x) if change is None else change
            changes.append(change.expand(len(inputs[0]), *x.shape) if name in ctx.shots.shared else change)
        return _Jvp.apply(ctx.shots, *inputs, *changes)


class _Vjp(_OfShots):
    """Inputs, and cotangents of the outputs, to cotangents of the inputs of each shot."""

    @staticmethod
    def forward(shots: _TensorShots, *tensors: Tensor) -> tuple[Tensor, ...]:
        k = len(shots.inputs)
        return _tensors(shots.vjp(shots.recorded(tensors[:k]), list(map(_array, tensors[k:]))), tensors[1])


class _Jvp(_OfShots):
    """Inputs, and tangents of the inputs of each shot, to tangents of the outputs."""

    @staticmethod
    def forward(shots: _TensorShots, *tensors: Tensor) -> tuple[Tensor, ...]:
        k = len(shots.inputs)
        return _tensors(shots.jvp(shots.recorded(tensors[:k]), list(map(_array, tensors[k:]))), tensors[1])
