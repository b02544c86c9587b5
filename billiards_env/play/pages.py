"""The pages that cover the table: the keys, the rules of the games, and the question before the window closes.

A page is rows of two texts.
"""

from __future__ import annotations

from billiards_env.games import Setup

Page = tuple[tuple[str, str], ...]

KEYS: Page = (
    ("drag from the cue ball", "aim; the arrow's length is the speed"),
    ("drag on the table", "aim at a point with the same speed"),
    ("left, right", "turn the aim by 1 degree; with shift 0.1"),
    ("comma, period", "turn the aim by 0.01 degrees; with shift 0.001"),
    ("F", "enlarge the object ball; the wheel then turns the aim by 0.01 degrees"),
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
    ("U or Z, Y", "undo and redo a person's shot; the aim of the shot is kept"),
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

_POOL_FOULS = "cue ball potted, no ball or a wrong ball hit first, no cushion hit afterwards"
_CAROM: Page = (
    ("the cue ball", "player 1 has the white one, player 2 the yellow one"),
    ("a point", "the cue ball touches both object balls; the player continues"),
    ("a miss", "the turn passes"),
)
_RULES: dict[str, Page] = {
    "eight_ball": (
        ("to win", "pot all balls of your group, then the 8"),
        ("groups", "solids are 1 to 7, stripes are 9 to 15; or reds and yellows"),
        ("open table", "the first ball potted after the break decides the groups"),
        ("turn", "a player continues after potting a ball of the own group"),
        ("foul", _POOL_FOULS),
        ("after a foul", "cue ball anywhere; after a foul on the break behind the line"),
        ("to lose", "pot the 8 too early or on a foul; on the break it is spotted"),
    ),
    "nine_ball": (
        ("to win", "pot the 9 on a legal shot"),
        ("on", "the lowest ball must be touched first; any ball may be potted"),
        ("break", "pot a ball, or drive four balls to a cushion"),
        ("turn", "a player continues after potting a ball"),
        ("foul", _POOL_FOULS),
        ("after a foul", "cue ball in hand anywhere; a potted 9 is spotted"),
        ("three fouls", "of one of two players in a row lose the game"),
    ),
    "straight": (
        ("to win", "score the target; without one, have most points in one rack"),
        ("a point", "for each ball; any ball is on; a player continues after potting one"),
        ("break", "pot a ball, or drive the cue ball and two others to a cushion; else -2"),
        ("foul", _POOL_FOULS),
        ("after a foul", "1 point is lost; the balls potted on it are spotted"),
        ("cue ball potted", "cue ball in hand behind the line"),
        ("with a target", "14 balls are racked again; three fouls in a row lose 15 points more"),
    ),
    "snooker": (
        ("to win", "have most points when the black is potted last"),
        ("order", "a red, then a colour, in turns; at the end the colours by value"),
        ("values", "red 1, yellow 2, green 3, brown 4, blue 5, pink 6, black 7"),
        ("colours", "return to their spots while there are reds"),
        ("foul", "cue ball potted, no ball or a wrong ball hit first, wrong ball potted"),
        ("after a foul", "the other player scores 4 to 7 points, by the balls concerned"),
        ("free ball", "who is snookered after a foul may play any ball as the ball on"),
        ("cue ball potted", "cue ball in hand in the D"),
    ),
    "carom": (("to win", "score the target"), *_CAROM),
    "three_cushion": (
        ("to win", "score the target"),
        *_CAROM,
        ("cushions", "the cue ball hits three or more before it touches the second ball"),
    ),
}
_OPTIONS: dict[str, Page] = {
    "called": (("calls", "only the called ball in the called pocket counts; a safety ends the turn"),),
    "nine_ball": (("push out", "after the break: hit any ball or none; the next player may hand it back"),),
    "snooker": (("choice", "after a foul the next player may hand the shot back"),),
    "miss": (("miss", "if the ball on was not hit first, the balls may be replaced"),),
}


def rules_page(setup: Setup, choices: bool) -> Page:
    """Returns the rules of a game, with or without its choices besides a shot."""
    used = {"called": setup.called, setup.rules: choices, "miss": setup.miss}
    rows = tuple(row for name, on in used.items() if on for row in _OPTIONS.get(name, ()))
    title = (setup.rules.replace("_", " ").capitalize(), f"to {setup.target} points" if setup.target else "")
    return (title, *_RULES.get(setup.rules, ()), *rows)
