"""The texts of the game window."""

from __future__ import annotations

import math

from billiards_env.play.model import HUMAN, Model

KEYS = (
    ("drag from the cue ball", "aim; the arrow's length is the speed"),
    ("drag on the table", "aim at a point with the same speed"),
    ("the white ball below", "drag the tip of the cue: english, follow and draw"),
    ("double click on it, C", "level cue at the centre of the ball"),
    ("ctrl + arrows", "move the tip of the cue; with shift by less"),
    ("page up, page down", "raise and lower the cue by 5 degrees"),
    ("left, right", "turn the aim by 1 degree; with shift 0.1"),
    ("up, down, wheel", "speed by 0.1 m/s; with shift 0.01"),
    ("space, the button", "shoot; place the cue ball; continue"),
    ("mouse, arrows", "move a cue ball in hand by 1 cm; with shift 1 mm"),
    ("P", "move the cue ball in hand again"),
    ("R", "replay the last shot"),
    ("G", "ghost in replays: the same shot by the other engine"),
    ("-, +", "show shots slower, faster"),
    ("U or Z, Y", "undo, redo a person's shot"),
    ("S", "save the game"),
    ("N", "a new game, when one is over"),
    ("H", "this help"),
    ("Q, escape", "quit"),
)
"""Keys and mouse actions with their effects."""

UNSAVED = (
    ("The game is not saved.", ""),
    ("S", "save and quit"),
    ("Q", "quit without saving"),
    ("any other key", "continue"),
)
"""The question before the window closes, as rows like those of `KEYS`."""

BUTTONS = {"placing": "Place", "aiming": "Shoot", "rolling": "Skip", "replaying": "Continue", "over": "New game"}
"""The text of the button in each phase; it is empty while a program thinks."""

END = "N: new game   R: replay   U: undo   S: save"
"""The keys after the end of a game."""

_HINTS = {
    "placing": "move: mouse, arrows   place: click, space   undo, redo: U Y   help: H",
    "aiming": "aim: drag, arrows   english: drag on the white ball   shoot: space   undo, redo: U Y   help: H",
    "thinking": "undo: U   save: S   quit: Q   help: H",
    "rolling": "skip: click, space   slower, faster: - +   undo: U   quit: Q   help: H",
    "replaying": "continue: space   again: R   ghost: G   slower, faster: - +   help: H",
    "over": "new game: N   undo, redo: U Y   replay: R   save: S   quit: Q   help: H",
}


def key_hint(model: Model) -> str:
    """Returns the keys of the model's phase, and in a replay the engines of the shown shots."""
    if model.phase != "replaying":
        return _HINTS[model.phase]
    shot, comparison = model.shown_shots
    runs = f"balls: {shot.engine}" + ("" if comparison is None else f"   rings: {comparison.engine}")
    return f"{runs}   {_HINTS[model.phase]}"


def player_name(model: Model, player: int) -> str:
    """Returns the label of a player."""
    kind = model.players[player]
    if kind == HUMAN:
        return f"Player {player + 1}"
    module, _, function = kind.partition(":")
    return f"Player {player + 1} ({function.partition(':')[0] if '.' in module else module})"


def status(model: Model) -> str:
    """Returns the player whose turn it is and the present action."""
    state = model.game.state
    if model.phase in ("rolling", "replaying"):
        shooter = player_name(model, model.games[-2].state.player)
        return shooter if model.pace == 1 else f"{shooter}   {model.pace:g} x"
    if state.over:
        return "Nobody wins" if state.winner < 0 else f"{player_name(model, state.winner)} wins"
    player = player_name(model, state.player)
    if model.phase == "thinking":
        return f"{player} thinks" + (f"   {model.clock:.0f} s" if model.clock >= 1 else "")
    if model.phase == "placing":
        return f"{player}: cue ball in hand" + (", behind the line" if state.in_hand == "behind" else "")
    degrees = round(math.degrees(model.angle), 1) + 0.0  # converts -0 to 0
    parts = [f"{player}: {model.speed:.2f} m/s, {degrees}°", first_ball_hint(model)]
    return "   ".join(filter(None, parts))


def aim(model: Model) -> str:
    """Returns the speed of the aim and the offset of the cue's tip."""
    parts, (side, top) = [f"{model.speed:.2f} m/s"], model.tip
    parts += [f"{abs(side):.2f} R {'left' if side > 0 else 'right'}"] if round(side, 2) else []
    parts += [f"{abs(top):.2f} R {'follow' if top > 0 else 'draw'}"] if round(top, 2) else []
    return "   ".join(parts)


def score(model: Model) -> str:
    """Returns the scores of a game with points."""
    return " : ".join(map(str, model.game.state.scores)) if model.setup.target is not None else ""


def first_ball_hint(model: Model) -> str:
    """Returns which balls the player may touch first; empty if all object balls are legal."""
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
    """Returns the result of the last shot and the scores."""
    parts = []
    if model.last_shot is not None:
        foul = model.last_shot.verdict.foul
        potted = [ball for ball in model.last_shot.facts.potted if ball != model.cue]
        if foul:
            parts.append(f"foul: {foul.replace('_', ' ')}")
        elif potted:
            parts.append(f"potted {', '.join(map(str, potted))}")
    return "   ".join(filter(None, [*parts, score(model)]))
