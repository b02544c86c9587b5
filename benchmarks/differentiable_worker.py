"""Runs published tasks in the packages that they come from; `benchmarks.differentiable --python` starts this file.

The argument is a package; the tasks are in the input as JSON. The last line of the output is the result as JSON.
"""
# pyright: reportMissingImports=false

import importlib.metadata
import json
import sys
from typing import Any

import numpy as np


def taichi(tasks: dict[str, Any]) -> list[list[float]]:
    """Minimises the squared distance from the goal as DiffTaichi's `billiards.py` does: 200 steps of gradient descent.

    The steps of time, the treatment of contacts (with the time of impact), single precision and the learning rate are
    those of this program (Hu et al. 2020, github.com/taichi-dev/difftaichi, examples/billiards.py).

    Returns:
        For each task the distance at the start and the least one, m.
    """
    import taichi as ti

    ti.init(arch=ti.cpu, default_fp=ti.f32, log_level=ti.ERROR)
    n, steps, dt, radius, elasticity = 11, 1024, 0.003, 0.03, 0.8
    x, v, shift, impulse = (ti.Vector.field(2, ti.f32, (steps, n), needs_grad=True) for _ in range(4))
    start = ti.Vector.field(2, ti.f32, 2, needs_grad=True)
    loss, goal = ti.field(ti.f32, (), needs_grad=True), ti.Vector.field(2, ti.f32, ())
    rack = [(0.5 + 2 * radius * i, 0.5 + 2 * radius * j - 0.7 * radius * i) for i in range(4) for j in range(i + 1)]

    @ti.kernel
    def place():
        x[0, 0], v[0, 0] = start[0], start[1]

    @ti.kernel
    def collide(t: ti.i32):
        for i, j in ti.ndrange(n, n):
            if i != j:
                gap = (x[t, i] + dt * v[t, i]) - (x[t, j] + dt * v[t, j])
                distance = gap.norm()
                if distance < 2 * radius:
                    normal = gap.normalized(1e-6)
                    speed = normal.dot(v[t, i] - v[t, j])
                    if speed < 0:
                        push = -(1 + elasticity) * 0.5 * speed * normal
                        time = (distance - 2 * radius) / ti.min(-1e-3, speed)
                        impulse[t + 1, i] += push
                        shift[t + 1, i] += ti.min(time - dt, 0) * push

    @ti.kernel
    def advance(t: ti.i32):
        for i in range(n):
            v[t, i] = v[t - 1, i] + impulse[t, i]
            x[t, i] = x[t - 1, i] + dt * v[t, i] + shift[t, i]

    @ti.kernel
    def measure():
        loss[None] = (x[steps - 1, n - 1] - goal[None]).norm_sqr()

    found = []
    for begin, target in zip(tasks["starts"], tasks["goals"], strict=True):
        start.from_numpy(np.array(begin, np.float32).reshape(2, 2))
        goal[None] = target
        losses = []
        for _ in range(200):
            for field in (x, v, shift, impulse):
                field.fill(0)
            for k, point in enumerate(rack):
                x[0, k + 1] = point
            with ti.ad.Tape(loss):
                place()
                for t in range(1, steps):
                    collide(t - 1)
                    advance(t)
                measure()
            losses.append(loss[None])
            start.from_numpy(start.to_numpy() - 0.01 * start.grad.to_numpy())
        found.append([float(np.sqrt(losses[0])), float(np.sqrt(np.nanmin(losses)))])
    return found


def nimblephysics(tasks: dict[str, Any]) -> list[float]:
    """Returns the gradient of the last place of the second of two balls: by their places and by their velocities.

    The scene is that of issue 97 of Nimble: equal elastic balls of radius 0.1 m on a line, without gravity.
    """
    import nimblephysics as nimble
    import torch

    world = nimble.simulation.World()
    world.setGravity([0, 0, 0])
    world.setTimeStep(0.01)
    for _ in range(2):
        ball = nimble.dynamics.Skeleton()
        _, body = ball.createTranslationalJoint2DAndBodyNodePair()
        shape = body.createShapeNode(nimble.dynamics.SphereShape(0.1))
        shape.createCollisionAspect()
        body.setRestitutionCoeff(1.0)
        body.setFrictionCoeff(0.0)
        world.addSkeleton(ball)
    start = torch.tensor([0.0, 0.0, 0.7, 0.0, 1.0, 0.0, 0.0, 0.0], requires_grad=True)
    state = start
    for _ in range(100):
        state = nimble.timestep(world, state, torch.zeros(4))
    state[2].backward()
    assert start.grad is not None
    return start.grad[[0, 2, 4, 6]].tolist()


PUSHED = """<mujoco><option gravity="0 0 0" timestep="0.01" iterations="1" ls_iterations="4"/>
<worldbody>
<body pos="-0.375 0 0"><freejoint/><geom type="{0}" size="0.042 0.042" mass="0.17"/></body>
<body pos="-0.2 0 0"><freejoint/><geom type="sphere" size="0.042" mass="0.17"/></body>
</worldbody></mujoco>"""


def mujoco_mjx(tasks: dict[str, Any]) -> dict[str, float]:
    """Returns the derivative by the push, for two spheres and for a capsule and a sphere (MuJoCo issue 2237)."""
    import jax
    import jax.numpy as jnp
    import mujoco
    from mujoco import mjx

    jax.config.update("jax_enable_x64", True)
    found = {}
    for shape in ("sphere", "capsule"):
        model = mjx.put_model(mujoco.MjModel.from_xml_string(PUSHED.format(shape)))
        data = mjx.make_data(model)

        def squared(control, model=model, data=data):
            push = jnp.zeros(model.nv).at[0].set(4.0).at[1].set(control)

            def step(data, force):
                return mjx.step(model, data.replace(qfrc_applied=force)), None

            forces = jnp.zeros((300, model.nv)).at[0].set(push)
            last, _ = jax.lax.scan(step, data, forces)
            return jnp.sum(last.qpos[7:9] ** 2)

        found[shape] = float(jax.jit(jax.jacrev(squared))(0.5))
    return found


def main() -> None:
    """Runs the tasks of a package."""
    package = sys.argv[1]
    run = {"taichi": taichi, "nimblephysics": nimblephysics, "mujoco-mjx": mujoco_mjx}[package]
    result = run(json.load(sys.stdin))
    print(json.dumps({"version": importlib.metadata.version(package), "result": result}))


if __name__ == "__main__":
    main()
