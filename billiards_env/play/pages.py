"""The pages that cover the table: the keys, the rules of the games, and the question before the window closes.

A page is rows of two texts.
"""

from __future__ import annotations

from billiards_env.games import Setup
from billiards_env.games.entry import Page

KEYS: Page = (
    ("drag from the cue ball", "aim; the arrow's length is the speed"),
    ("drag on the table", "aim at a point with the same speed"),
    ("left, right", "turn the aim by 1 degree; with shift 0.1"),
    ("comma, period", "turn the aim by 0.01 degrees; with shift 0.001"),
    ("F", "enlarge the object ball; the wheel then turns the aim by 0.01 degrees"),
    ("A", "aim to pot the ball under the mouse, or the aimed ball into the pocket under it"),
    ("Shift A", "aim for the best shot that the planner finds"),
    ("up, down, wheel", "speed by 0.1 m/s; with shift 0.01"),
    ("the white ball below", "drag the tip of the cue: english, follow and draw"),
    ("ctrl + arrows", "move the tip of the cue; with shift by less"),
    ("double click on it, C", "level cue at the centre of the ball"),
    ("page up, page down", "raise and lower the cue by 5 degrees"),
    ("space, the button", "shoot; place the cue ball; continue"),
    ("mouse, arrows", "move a cue ball in hand by 1 cm; with shift 1 mm"),
    ("P", "move the cue ball in hand again"),
    ("B, K", "call the next ball, the next pocket"),
    ("X", "the next choice: safety, push out, hand back, replace"),
    ("U or Z", "undo a person's shot; the aim of the shot is kept"),
    ("R, G", "replay the last shot; with or without the other engine as rings"),
    ("-, +", "show shots slower, faster"),
    ("S, N, Q", "save the game; a new game when one is over; quit"),
    ("H, F1", "these keys; the rules of the game"),
)
"""Keys and mouse actions with their effects."""

UNSAVED: Page = (
    ("The game is not saved.", ""),
    ("S", "save and quit"),
    ("Q", "quit without saving"),
    ("any other key", "continue"),
)
"""The question before the window closes."""

_CALLS = ("calls", "only the called ball in the called pocket counts; a safety ends the turn")
_CHOICES = {
    "push_out": ("push out", "after the break: hit any ball or none; the next player may hand it back"),
    "replace": ("choice", "after a foul the next player may hand the shot back"),
}
_MISS = ("miss", "if the ball on was not hit first, the balls may be replaced")


def rules_page(setup: Setup, choices: bool) -> Page:
    """Returns the rules of a game, with or without its choices other than a shot."""
    title = (setup.rules.replace("_", " ").capitalize(), f"to {setup.target} points" if setup.target else "")
    rows = (title, *setup.game_rules.page, *((_CALLS,) if setup.call_shot else ()))
    if choices:
        rows += tuple(_CHOICES[choice] for choice in setup.game_rules.choices if choice in _CHOICES)
    return rows + ((_MISS,) if setup.miss else ())
