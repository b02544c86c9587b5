"""Shots of pooltool 0.6.0 with friction between balls, compliant cushions and the jaws of pockets."""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import table
from billiards_env.scene import Scene
from billiards_env.shots.simulation import simulate

SHOTS = Path(__file__).resolve().parents[2] / "tests" / "data" / "pooltool_real_shots.json"
SCENES = {"carom": "pooltool_real_carom", "pool": "pooltool_pool"}
KINDS = ("ball_ball", "cushion", "pocket")


@functools.cache
def recorded_shots() -> list[dict[str, Any]]:
    """Returns the shots of pooltool."""
    return json.loads(SHOTS.read_text(encoding="utf-8"))["shots"]


def compare(shot: dict[str, Any]) -> dict[str, Any]:
    """Runs a shot of pooltool and compares its contacts, its potted balls and its final positions.

    Returns:
        A dict: the scene, the number of balls, the number of contacts, whether they are the same in the same order,
        whether the same balls are potted, and the largest differences of the final positions, m, and of the times, s.
    """
    n = len(shot["positions"])
    spare = max(0, 3 - n)  # balls that are out of play, so that no engine for fewer balls is compiled
    scene_name = SCENES[shot["table"]]
    scene, positions = Scene.named(scene_name, n + spare - 1), shot["positions"] + spare * [[0.0, 0.0]]
    in_play = [k < n for k in range(n + spare)]
    result = simulate(scene, positions, shot["velocity"], spins=shot["spin"], in_play=in_play, record=True)
    assert result.events is not None
    ours = [
        (time, kind, [ball, other] if kind == "ball_ball" else [ball])
        for time, kind, ball, other, *_ in result.events.tolist()
        if kind in KINDS
    ]
    # Some events of pooltool's file lack a ball.
    same = len(ours) == len(shot["events"]) and all(
        mine[1] == theirs[1] and set(theirs[2]) <= set(mine[2])
        for mine, theirs in zip(ours, shot["events"], strict=True)
    )
    final = shot["final"]
    rests = [k for k in range(n) if final[k] is not None]
    off = [np.hypot(*(result.positions[k] - final[k])) for k in rests]
    late = [abs(mine[0] - theirs[0]) for mine, theirs in zip(ours, shot["events"], strict=True)] if same else [np.inf]
    return {
        "scene": scene_name,
        "balls": n,
        "contacts": len(ours),
        "same_contacts": same,
        "same_potted": result.potted[:n].tolist() == [place is None for place in final],
        "potted": int(result.potted[:n].sum()),
        "error_m": float(max(off, default=0.0)),
        "error_s": float(max(late, default=0.0)),
    }


def measure() -> list[dict[str, Any]]:
    """Compares all shots."""
    return [compare(shot) for shot in recorded_shots()]


def blocks(result: list[dict[str, Any]]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    rows = []
    for scene in SCENES.values():
        shots = [shot for shot in result if shot["scene"] == scene]
        errors = [shot["error_m"] for shot in shots]
        rows.append(
            [
                f"`{scene}`",
                f"{len(shots)}",
                f"{sum(shot['contacts'] for shot in shots)}",
                f"{sum(shot['same_contacts'] for shot in shots)} of {len(shots)}",
                f"{sum(shot['potted'] for shot in shots)}",
                f"{sum(shot['same_potted'] for shot in shots)} of {len(shots)}",
                f"{np.median(errors):.0e} m",
                f"{max(errors):.0e} m",
            ]
        )
    head = ["scene", "shots", "contacts", "same contacts", "potted", "same potted", "difference, median", "largest"]
    return {"pooltool": table(head, rows)}
