"""The texts of the game window."""

from __future__ import annotations

import numpy as np

from billiards_env.drawing.recording import recording_of
from billiards_env.drawing.style import colour_names
from billiards_env.games import FOULS, Setup, choices
from billiards_env.games.entry import Page
from billiards_env.games.game_state import BEHIND, FOOT_LEFT, FOOT_RIGHT
from billiards_env.play.model import HUMAN, WindowModel
from billiards_env.play.preview import contacts
from billiards_env.players.levels import LEVELS
from billiards_env.players.planner import Plan
from billiards_env.scene import Scene

BUTTONS = {"placing": "Place", "aiming": "Shoot", "rolling": "Skip", "replaying": "Continue", "over": "New game"}
"""The text of the button in each phase; it is empty while a program chooses its shot."""

END = "N: new game   R: replay   U: undo   S: save"
"""The keys after the end of a game."""

_PAGES = "   keys: H   rules: F1"
_HINTS = {
    "placing": "place: click, space   move: mouse, arrows   undo: U" + _PAGES,
    "aiming": "aim: drag, arrows   fine: comma, period   pot: A   zoom: F   shoot: space   undo: U" + _PAGES,
    "thinking": "undo: U   save: S   quit: Q" + _PAGES,
    "rolling": "skip: click, space   slower, faster: - +   undo: U   quit: Q   keys: H",
    "replaying": "continue: space   again: R   ghost: G   slower, faster: - +   keys: H",
    "over": "new game: N   undo: U   replay: R   save: S   quit: Q   keys: H",
}


_CALLS = ("calls", "only the called ball in the called pocket counts; a safety ends the turn")
_MISS = ("miss", "if the ball on was not hit first, the balls may be replaced")
_CHOICES = {
    "push_out": ("push out", "after the break: hit any ball or none; the next player may hand it back"),
    "replace": ("choice", "after a foul the next player may hand the shot back"),
    "break_again": ("choice", "after a bad break the balls may be racked again"),
    "stalemate": ("stalemate", "after six turns of each player without a pot, the game may begin again"),
}


def rules_page(setup: Setup, choices: bool) -> Page:
    """Returns the rules of a game, with or without its choices other than a shot, as rows of two texts."""
    title = (_spaced(setup.rules).capitalize(), f"to {setup.target} points" if setup.target else "")
    offered = tuple(_CHOICES[one] for one in setup.game_rules.choices if choices and one in _CHOICES)
    return (title, *setup.game_rules.page, *(_CALLS,) * setup.call_shot, *offered, *(_MISS,) * setup.miss)


def _spaced(name: str) -> str:
    return name.replace("_", " ")


def key_hint(model: WindowModel) -> str:
    """Returns the keys of the model's phase, and in a replay the engines of the shown shots."""
    if model.page:
        return "" if model.page == "unsaved" else "close: space, escape"
    if model.considered:
        return considered(model)
    if model.phase != "replaying":
        return _HINTS[model.phase]
    shot, comparison = model.shown_shots
    runs = f"balls: {shot.engine}" + ("" if comparison is None else f"   rings: {comparison.engine}")
    return f"{runs}   {_HINTS[model.phase]}"


def button(model: WindowModel) -> str:
    """Returns the text of the button, which names the action of space."""
    named = model.phase == "aiming" and model.aim.call.kind != "shot"
    return _spaced(model.aim.call.kind.capitalize()) if named else BUTTONS.get(model.phase, "")


def choice(model: WindowModel) -> str:
    """Returns the key of the next kind of call, if there are several."""
    several = len(model.kinds) > 1 and model.phase == "aiming"
    return f"X: {_spaced(model.following_kind)}" if several else ""


def player_name(model: WindowModel, player: int) -> str:
    """Returns the label of a player."""
    if (kind := model.players[player]) == HUMAN:
        return f"Player {player + 1}"
    name, *rest = kind.split(":")  # a program: NAME[:ARGUMENT] or module:function[:ARGUMENT]
    return f"Player {player + 1} ({rest[0] if rest and (rest[0] in LEVELS or '.' in name) else name})"


def ball_name(scene: Scene, ball: int) -> str:
    """Returns the colour of a ball, or its number if it shows one."""
    numbered = scene.balls.colours == "pool" and scene.table.pockets
    return str(ball) if numbered else colour_names(scene)[ball]


def pocket_name(scene: Scene, pocket: int) -> str:
    """Returns the place of a pocket in the window."""
    x, y = scene.table.pockets[pocket].x, scene.table.pockets[pocket].y
    side = "middle" if abs(x) < scene.table.length / 4 else "left" if x < 0 else "right"
    return f"{'upper' if y > 0 else 'lower'} {side} pocket"


def status(model: WindowModel) -> str:
    """Returns the player whose turn it is and the present action."""
    state, setup, scene = model.game.state, model.setup, model.setup.scene
    if model.phase in ("rolling", "replaying"):
        pace = "" if model.pace == 1 else f"{model.pace:g} x"
        return _joined(player_name(model, model.games[-2].state.player), cushions(model, model.clock), pace)
    if state.over:
        return "Nobody wins" if state.winner < 0 else f"{player_name(model, state.winner)} wins"
    player = player_name(model, state.player)
    if model.phase == "thinking":
        return f"{player} thinks" + (f"   {model.clock:.0f} s" if model.clock >= 1 else "")
    if model.phase == "placing":
        behind = "in the D" if scene.table.d_radius else "behind the line"
        return f"{player}: cue ball {behind if state.in_hand == BEHIND else 'anywhere'}"
    kinds = {
        "safety": f"safety, {on(model)}",
        "push_out": "push out, any ball or none",
        "hand_back": f"{player_name(model, (state.player - 1) % setup.n_players)} plays again",
        "replace": "replace the balls",
        "rerack": "break again" if setup.game_rules.pockets else "set up the balls again",
        "break_again": f"{player_name(model, (state.player - 1) % setup.n_players)} breaks again",
        "stalemate": "stalemate, the game begins again",
    }
    return f"{player}: {kinds.get(model.aim.call.kind) or on(model)}"


def on(model: WindowModel) -> str:
    """Returns which balls the player may touch first."""
    setup, state = model.setup, model.game.state
    scene, legal, free = setup.scene, setup.legal(state), getattr(state, "free_ball", False)
    first = ball_name(scene, legal[0])
    if not setup.game_rules.pockets:
        needed = setup.game_rules.cushions
        balls = " and ".join(ball_name(scene, ball) for ball in legal) + " first" * (len(legal) == 1)
        return f"{ball_name(scene, model.cue)} cue ball, {balls}{f', {needed} cushions' * (needed > 0)}"
    if setup.game_rules.has_spots:
        chosen = f": {ball_name(scene, model.call.ball)}" if model.call.ball >= 0 else ""
        if free:
            return f"free ball{chosen or ', any ball'}"
        return f"on: a colour{chosen}" if state.colour else f"on: {first}"
    if free:
        return "free shot, any ball"
    if state.break_shot:
        return "break"
    if len(legal) == 1:
        return f"on: the {first}"
    if setup.game_rules.foot_corners:
        return f"any ball into the {pocket_name(scene, (FOOT_RIGHT, FOOT_LEFT)[state.player])}"
    if not hasattr(state, "solids"):
        return "any ball"
    if state.solids < 0:
        return f"open table: any ball but the {ball_name(scene, 8)}"
    groups = ("solids", "stripes") if first.isdigit() else ("reds", "yellows")
    return groups[legal[0] > 8]


def cushions(model: WindowModel, time: float = np.inf) -> str:
    """Returns how often the cue ball hits cushions before the second ball in three cushion, up to a time, s."""
    if not model.setup.game_rules.cushions or model.last_shot is None:
        return ""
    shot = recording_of(model.last_shot.shot)
    own = contacts(shot, shot.cue)
    own = own[own["time"] <= time]
    touched = np.where(own["kind"] == "ball_ball", own["ball"] + own["other"], -1)
    second = np.isin(touched, (-1, *touched[touched >= 0][:1]), invert=True)
    count = int(np.sum((own["kind"] == "cushion") & ~np.logical_or.accumulate(second)))
    return f"{count} cushion{'s' * (count != 1)}"


def advice(model: WindowModel, plan: Plan) -> str:
    """Returns what a planned shot does, and how often it keeps the turn with the noise of a player."""
    what = _effect(model, plan)
    if what == "a safety":
        return f"{what}: no shot is likely to pot a ball"
    return f"{what}, {plan.probability:.0%} with the noise of a good player"


def _effect(model: WindowModel, plan: Plan) -> str:
    scene = model.setup.scene
    if plan.ball >= 0:
        return f"ball {ball_name(scene, plan.ball)} into the {pocket_name(scene, plan.pocket)}"
    return "a safety" if plan.probability < 0.1 and model.setup.game_rules.pockets else "keeps the turn"


def value(plan: Plan) -> str:
    """Returns how often a shot that a program considers keeps the turn, and its value."""
    return f"{plan.probability:.0%}  {plan.value:+.2f}"


def considered(model: WindowModel) -> str:
    """Returns the best shot that a program considers, with its value."""
    plan = model.considered[0].plan
    strokes = f"{plan.samples:,} stroke{'s' * (plan.samples != 1)} with noise"
    return f"best: {_effect(model, plan)}, {plan.probability:.0%}, value {plan.value:+.2f} in {strokes}"


def aim_text(model: WindowModel) -> str:
    """Returns the speed and the direction of the aim, and the offset of the cue's tip."""
    (side, top), degrees = model.aim.tip, round(np.degrees(model.aim.angle), 2) + 0.0  # converts -0 to 0
    across = f"{abs(side):.2f} R {'left' if side > 0 else 'right'}" if round(side, 2) else ""
    along = f"{abs(top):.2f} R {'follow' if top > 0 else 'draw'}" if round(top, 2) else ""
    return _joined(f"{model.aim.speed:.2f} m/s", f"{degrees:.2f}°", across, along)


def score_text(model: WindowModel) -> str:
    """Returns the scores of a game with points."""
    setup = model.setup
    return " : ".join(map(str, model.game.state.scores[: setup.n_players])) if setup.target is not None else ""


def result(model: WindowModel) -> str:
    """Returns the result of the last shot and the scores."""
    if model.last_shot is None:
        return score_text(model)
    verdict, kind, what = model.last_shot.verdict, model.turns[-1].stroke.call.kind, cushions(model)
    potted = [ball_name(model.setup.scene, ball) for ball, _ in model.last_shot.pots if ball != model.cue]
    if verdict.foul:
        miss = " and a miss" * ("replace" in choices(model.game.state))
        points = f", {verdict.penalty} points" * bool(verdict.penalty)
        what = f"foul{miss}: {_spaced(FOULS[verdict.foul])}{points}"
    elif potted:
        what = f"potted {', '.join(potted)}"
    elif kind != "shot":
        what = _spaced(kind)
    return _joined(what, score_text(model))


def _joined(*parts: str) -> str:
    return "   ".join(filter(None, parts))
