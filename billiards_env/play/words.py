"""What the window says of a game."""

from __future__ import annotations

import math

from billiards_env.play.model import HUMAN, Model

KEYS = (
    ("drag from the cue ball", "aim; the arrow's length is the speed"),
    ("left, right", "turn the aim by 1 degree; with shift 0.1"),
    ("up, down, wheel", "speed by 0.1 m/s; with shift 0.01"),
    ("space, click", "shoot; put the cue ball down; go on"),
    ("mouse, arrows", "move a cue ball in hand by 1 cm; with shift 1 mm"),
    ("P", "take the cue ball in hand up again"),
    ("R", "replay the last shot"),
    ("G", "ghost in replays: the same shot by the other engine"),
    ("-, +", "show shots slower, faster"),
    ("U", "undo, back to a person's last shot"),
    ("S", "save the game"),
    ("H", "this help"),
    ("Q", "quit"),
)
"""What the mouse and the keys do."""

_HINTS = {
    "placing": "move: mouse, arrows   put down: click, space   undo: U   save: S   quit: Q   help: H",
    "aiming": "aim: drag from the cue ball, arrows   shoot: click, space   undo: U   replay: R   save: S   help: H",
    "thinking": "quit: Q   help: H",
    "rolling": "skip: click, space   slower, faster: - +   undo: U   quit: Q   help: H",
    "replaying": "go on: space   again: R   ghost: G   slower, faster: - +   help: H",
    "over": "undo: U   replay: R   save: S   quit: Q   help: H",
}


def hint(model: Model) -> str:
    """What the keys do in the model's phase, and in a replay how the shots were run."""
    if model.phase != "replaying":
        return _HINTS[model.phase]
    shot, rival = model.shown
    runs = f"balls: {shot.engine}" + ("" if rival is None else f"   rings: {rival.engine}")
    return f"{runs}   {_HINTS[model.phase]}"


def name(model: Model, player: int) -> str:
    """What a player is called."""
    kind = model.players[player]
    if kind == HUMAN:
        return f"Player {player + 1}"
    module, _, function = kind.partition(":")
    return f"Player {player + 1} ({function.partition(':')[0] if '.' in module else module})"


def doing(model: Model) -> str:
    """Whose turn it is, and what they are doing."""
    state = model.game.state
    if model.phase in ("rolling", "replaying"):
        shooter = name(model, model.games[-2].state.player)
        return shooter if model.pace == 1 else f"{shooter}   {model.pace:g} x"
    if state.over:
        return "Nobody wins" if state.winner < 0 else f"{name(model, state.winner)} wins"
    who = name(model, state.player)
    if model.phase == "thinking":
        return f"{who} thinks"
    if model.phase == "placing":
        return f"{who}: cue ball in hand" + (", behind the line" if state.in_hand == "behind" else "")
    degrees = round(math.degrees(model.angle), 1) + 0.0  # which makes 0 of -0
    said = [f"{who}: {model.speed:.2f} m/s, {degrees}°", wanted(model)]
    return "   ".join(filter(None, said))


def wanted(model: Model) -> str:
    """Which balls the player may touch first."""
    state = model.game.state
    legal = model.setup.game_rules.legal(state, state.player)
    if legal == state.object_balls:
        return ""
    if len(legal) == 1:
        return f"first ball {min(legal)}"
    if 8 not in legal and state.solids >= 0:
        return "solids" if min(legal) < 8 else "stripes"
    return f"not ball {', '.join(map(str, sorted(state.object_balls - legal)))}"


def result(model: Model) -> str:
    """The score, and what the last shot was worth."""
    said = []
    if model.last is not None:
        foul, potted = model.last.verdict.foul, [ball for ball in model.last.facts.potted if ball != model.cue]
        if foul:
            said.append(f"foul: {foul.replace('_', ' ')}")
        elif potted:
            said.append(f"potted {', '.join(map(str, potted))}")
    if model.setup.target is not None:
        said.append(" : ".join(map(str, model.game.state.scores)))
    return "   ".join(said)
