"""Compares the bits of this machine with those of other processors and compilers: `python -m benchmarks.machines`.

Modules:
    work: The work whose results are compared.
    record: Records calls of compiled functions, and compiles the functions for another processor.
    replay: Runs recorded calls on another processor, with `replay.c`.
    __main__: The parts of the comparison and the command.
"""

from __future__ import annotations

from typing import Any

from benchmarks import rows_table

LEFT_OUT = {
    "derivatives.lanes.strike_jacobians": "the derivative of a strike, a closed formula",
    "engine.shot_input._are_free": "a test of places between the noses, which changes nothing",
    "envs.actions._aimed": "actions from velocities, which only players need",
    "envs.actions._perturbed": "the noise that players expect",
    "envs.goal_observations.write_achieved": "copies places and a condition, whose kernels the frozen ids run",
    "envs.goal_observations.write_desired": "copies goals",
    "envs.observations.write_choices": "copies the choices of a game",
    "envs.observations.write_measure": "one division, of a measure",
    "envs.observations.write_turn": "compares the numbers of two players",
    "envs.turns.write_legal": "the legal balls of another player, by kernels that the frozen ids run",
    "games.referee._judge_shots": "verdicts without a shot, by kernels that the frozen ids run",
    "players.batch._see_shots": "facts of shots that players try in some games",
    "games.placement.limits": "the region of a cue ball in hand, for players",
    "games.turn.look_at_games": "states that users make",
}
"""Functions that Python calls and that no work calls, with the reason."""


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name: `rows`, and `left out`, the functions that no work calls."""
    columns = {"machine": "{machine}", "compared": "{compared}", "other bits": "{other:,}"}
    left = "\n".join(f"- `{name}`: {LEFT_OUT.get(name, 'no work calls it')}" for name in result["left_out"])
    return {"rows": rows_table(columns, result["rows"], left=2), "left out": left or "Nothing."}
