"""A game as plain data: `opening` makes the first state, `play` plays a stroke, `replay` repeats a recorded game.

A random generator is used only to rack the balls. The strokes determine everything else, bit for bit.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env.engine.compile import PIC, Engine, check_engine, scene_fields
from billiards_env.engine.frozen_strike import strike_frozen
from billiards_env.engine.measures import checked_measures
from billiards_env.engine.shot_input import ShotInput
from billiards_env.engine.shots import RISING
from billiards_env.games.entry import Game, no_look
from billiards_env.games.facts import facts_of
from billiards_env.games.game_state import (
    CALL,
    CALLS,
    FIELDS,
    FOOT_LEFT,
    FOOT_RIGHT,
    IN_HAND,
    MAX_SCORE,
    MOST_PLAYERS,
    NO_SHOT,
    NOT_IN_HAND,
    REPLACE,
    changed,
    in_play,
    is_in,
    members,
    on_table,
    row,
    set_of,
    to_dict,
)
from billiards_env.games.placement import cue_ball_point
from billiards_env.games.referee import GAMES, callable_balls, first_state, legal_balls
from billiards_env.games.turn import look_at_games, next_games, table_of
from billiards_env.jit import kernels_of
from billiards_env.scene import Scene, check_ends_on_cloth, check_positions, check_scene, layouts
from billiards_env.scene.outline import Point
from billiards_env.shots.result import ShotResult
from billiards_env.shots.simulation import run_shot
from billiards_env.support.checks import (
    Range,
    entry_of,
    flag,
    integer,
    one_of,
    real,
    result_of,
    shaped,
    short,
    short_name,
)


class Call(NamedTuple):
    """The announcement of a player before a shot (WPA 1.6).

    Attributes:
        ball: The called ball; in snooker the nominated colour or free ball. -1 for none.
        pocket: The called pocket; -1 for none.
        kind: One of `CALLS`.
    """

    ball: int = -1
    pocket: int = -1
    kind: str = "shot"


NO_CALL = Call()


@dataclasses.dataclass(frozen=True, slots=True)
class Setup:
    """The settings of a game, which stay the same from shot to shot.

    Attributes:
        rules: One of `GAMES`.
        scene: Table, balls and physics.
        n_players: Number of players.
        target: The score that wins, or 0 if no score does. None selects the default of the game; it remains None in a
            game that is not won by points.
        engine: The engine.
        call_shot: Whether shots are called, in a game whose rules require it, such as the WPA's (1.6).
            By default any ball potted on a legal shot counts, and a player need not call.
        miss: Whether snooker is played with the miss rule.
        edition: The edition of the rules, one of `Game.editions`; None for the first of them.
        innings: In carom, the number of innings of each player, or 0 for no limit. With a limit all players have the
            same number of innings: after the target score the others play to the end of the inning.
    """

    rules: str
    scene: Scene
    n_players: int = 2
    target: int | None = None
    engine: Engine = PIC
    call_shot: bool = False
    miss: bool = False
    edition: str | None = None
    innings: int = 0

    def __post_init__(self) -> None:
        check_scene(self.scene)
        check_ends_on_cloth(self.scene)
        rules, table, balls = self.game_rules, self.scene.table, self.scene.n_balls - 1
        name, (low, high), pockets = f"rules = {self.rules!r} with", rules.n_object_balls, len(table.pockets)
        numbers = str(low) if low == high else f"{low} to {high}"
        _expect(low <= balls <= high, f"{name} a scene of {balls} object ball{'s' * (balls != 1)}", numbers)
        for ball in rules.cue_balls:
            integer(f"cue_balls of game {self.rules!r}", ball, Range(0, balls))
        expected = "a table with pockets" if rules.pockets else "a table without pockets"
        _expect(rules.pockets == (pockets > 0), f"{name} a table of {pockets} pockets", expected)
        corners = [(p.x > 0.0, p.y > 0.0) for p in table.pockets[FOOT_RIGHT : FOOT_LEFT + 1]]
        in_order = not rules.foot_corners or corners == [(True, False), (True, True)]
        _expect(in_order, f"{name} a table of other pockets 2 and 3", "these pockets in the foot corners, y < 0 first")
        what = f"{name} a table whose cushions reach into its rectangle"
        _expect(table.is_rectangular, what, "a playing surface that is a rectangle")
        for i, mass in enumerate(self.scene.balls.mass):
            _expect(math.isfinite(mass), f"{name} ball {i} of infinite mass", "finite masses")
        players = integer("n_players", self.n_players, Range(*rules.n_players, f"for rules {self.rules!r}"))
        object.__setattr__(self, "n_players", players)
        edition = rules.editions[0] if self.edition is None else self.edition
        one_of("edition", edition, rules.editions)
        object.__setattr__(self, "edition", edition)
        most = MAX_SCORE if "innings" in rules.state_names else 0
        innings = integer("innings", self.innings, Range(0, most, f"for rules {self.rules!r}"))
        object.__setattr__(self, "innings", innings)
        if rules.target is None:
            what = f"target = {short(self.target)} with rules {self.rules!r}"
            _expect(self.target is None, what, "None, the game has no points")
        else:
            what, target = "target", self.target
            if target is None:
                what = f"target of game {self.rules!r}"
                target = result_of(what, object, rules.target, balls)
            object.__setattr__(self, "target", integer(what, target, Range(0, MAX_SCORE)))
        _ = self.placement_table  # raises if the scene has no spots or no rack
        for name, possible in (("call_shot", rules.callable is not None), ("miss", "miss" in rules.state_names)):
            what = f"{name} = True with rules {self.rules!r}"
            _expect(not flag(name, getattr(self, name)) or possible, what, "False, the game has no such rule")
        check_engine(self.engine)

    @property
    def game_rules(self) -> Game:
        """The entry of the game, as it is played in the scene."""
        return entry_of("rules", self.rules, GAMES).in_scene(self.scene)

    @property
    def placement_table(self) -> tuple[Any, ...]:
        """The argument `table` of the kernels that place balls, see `turn.table_of`."""
        return table_of(self.game_rules, self.scene, self.target or 0, self.rack)

    @property
    def state_fields(self) -> dict[str, Any]:
        """The fields of the state that stay the same in a game."""
        names = {"n_players", "call_shot", "miss", "innings"} & set(self.game_rules.state_names)
        same = {name: getattr(self, name) for name in names}
        return {**same, "target": self.target or 0, "edition": self.game_rules.editions.index(self.edition or "")}

    @property
    def rack(self) -> str:
        """The argument `game` of `layouts.layout_plan`: the game, or its edition if that has a rack of its own."""
        own = f"{self.rules}_{self.edition}"
        return own if own in layouts.RACKS else self.rules

    def kinds(self, state: Any) -> tuple[str, ...]:
        """Returns the kinds of calls that the player to shoot has, of `CALLS`."""
        return ("shot", *(("safety",) if self.has_safety else ()), *choices(state))

    @property
    def has_safety(self) -> bool:
        """Whether a player may call a safety."""
        return self.call_shot and self.edition not in self.game_rules.without_safety

    def legal(self, state: Any, player: int | None = None) -> tuple[int, ...]:
        """Returns the balls that a player, by default the one to shoot, may touch first."""
        return members(legal_balls(self.rules, *_asked(state, player))[0])

    def callable(self, state: Any, player: int | None = None) -> tuple[int, ...]:
        """Returns the balls that a player, by default the one to shoot, may call."""
        return members(callable_balls(self.rules, *_asked(state, player))[0])


def _expect(condition: Any, value: str, expected: str) -> None:
    """Raises unless a condition holds; `value` is the text "name = value"."""
    if not condition:
        raise ValueError(f"{value}: expected {expected}")


def _asked(state: Any, player: int | None) -> tuple[NDArray[Any], NDArray[np.int64]]:
    return np.array([state]), np.array([state.player if player is None else player])


def choices(state: Any) -> tuple[str, ...]:
    """Returns the choices of the player besides a shot, of `CALLS`."""
    return tuple(CALLS[i] for i in members(state.choices))


class GameState(NamedTuple):
    """The state of a game between two shots.

    Attributes:
        positions: (n, 2) float64, m. A potted ball is at the centre of its pocket. A cue ball in hand is at its last
            position.
        state: The state of the rules, a row of `Game.state_type`.
        before: The state before the last shot, if the player may make the opponent play that shot again (the call
            "replace").
    """

    positions: NDArray[np.float64]
    state: Any
    before: GameState | None = None


class Stroke(NamedTuple):
    """The stroke of a player.

    If the cue ball touches a ball ahead of it, the cue drives both, see `engine.frozen_strike`. The velocity and the
    spin are then those of a free cue ball.

    Attributes:
        velocity: x and y of the cue ball's initial velocity, m/s; x, y and z are possible in scenes with flight.
        place: x and y of the point at which to place the cue ball in hand, m; None if it is not in hand.
        spin: x, y and z of the cue ball's initial angular velocity, rad/s.
        call: The call.
    """

    velocity: Any
    place: Point | None = None
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    call: Call = NO_CALL


class PlayedShot(NamedTuple):
    """A shot of a game.

    Attributes:
        game: The state after the shot.
        shot_input: The arguments of the engine.
        shot: The recorded shot.
        facts: The facts that the rules use, a row of `Game.facts_type`.
        verdict: The verdict on the shot, a row of `VERDICT`.
    """

    game: GameState
    shot_input: ShotInput
    shot: ShotResult
    facts: Any
    verdict: Any

    @property
    def pots(self) -> tuple[tuple[int, int], ...]:
        """The potted balls with their pockets, in order."""
        return self.shot.pots


class History(NamedTuple):
    """A game up to its last stroke.

    Attributes:
        setup: The settings.
        opening: The state before the first stroke.
        strokes: The strokes, in order.
    """

    setup: Setup
    opening: GameState
    strokes: tuple[Stroke, ...]


def opening_state(setup: Setup) -> Any:
    """Returns the state of the rules at the opening: player 0 breaks; in games with pockets the cue ball is in hand."""
    return first_state(setup.rules, setup.scene.n_balls, **setup.state_fields)


def opening(setup: Setup, rng: np.random.Generator, layout: str | None = None) -> GameState:
    """Returns the state before the first shot.

    Args:
        setup: The settings of the game.
        rng: The generator to draw from.
        layout: One of `Game.layouts`; None for the first of them. With "random" the first shot is not a break and the
            cue ball is not in hand.

    Returns:
        The state.

    Raises:
        ValueError: If the layout is unknown or does not suit the game, or the balls do not fit.

    Example:
        >>> game = opening(Setup("nine_ball", Scene.named("pool", 9)), np.random.default_rng(0))
        >>> float(game.positions[9, 1].round(2)), IN_HAND[game.state.in_hand]
        (0.0, 'behind')
    """
    names = setup.game_rules.layouts
    layout = names[0] if layout is None else layout
    what = f"layout = {short(layout)} with rules {setup.rules!r}"
    _expect(isinstance(layout, str) and short_name(layout) in names, what, f"one of {', '.join(map(repr, names))}")
    positions, state = layouts.draw(layout, setup.scene, rng, setup.rack), opening_state(setup)
    return GameState(
        positions, changed(state, break_shot=False, in_hand=NOT_IN_HAND) if short_name(layout) == "random" else state
    )


def custom_opening(setup: Setup, positions: ArrayLike, state: Mapping[str, Any] | None = None) -> GameState:
    """Returns a state with given positions and a given state of the rules.

    Args:
        setup: The settings of the game.
        positions: (n, 2) m.
        state: The fields of `Game.given` to set, in the form of `state.to_dict`. By default player 0 is to shoot,
            all balls are on the table, the shot is not a break and the cue ball is not in hand.

    Returns:
        The state.

    Raises:
        ValueError: If a field is unknown or invalid, or the positions are invalid.
    """
    rules, n, players = setup.game_rules, setup.scene.n_balls, setup.n_players
    names, default = rules.given, to_dict(opening_state(setup)) | {"break_shot": False, "in_hand": "no"}
    changes = {} if state is None else state
    _expect(isinstance(changes, Mapping), f"state = {short(state)}", "a mapping")
    for key in changes:
        one_of("key of state", key, tuple(sorted(names)))
    values: dict[str, Any] = {name: changes.get(name, default[name]) for name in names}
    shown = {name: f"state.{name} = {short(value)}" for name, value in values.items()}
    for name, value in values.items():
        _check_field(name, value, default[name], n, players)
    for name in ("scores", "fouls"):
        _expect(len(values[name]) == players, shown[name], f"{players} {name}, one per player")
    below = not setup.target or setup.innings or max(values["scores"]) < setup.target  # innings end later
    _expect(below, shown["scores"], f"scores below the target, {setup.target}")
    balls, cues = set(values.pop("on_table")), values["cue_balls"]
    _expect(sorted(cues) == sorted(rules.cue_balls), shown["cue_balls"], f"{rules.cue_balls} in some order")
    # Cue balls and the ball that decides the game are on the table until the end.
    required = set(range(n))
    if rules.pockets:
        deciding = rules.deciding_ball
        required = {*rules.cue_balls, *(() if deciding is None else (deciding % n,))}
    enough = required <= balls and len(balls) > 1
    _expect(enough, shown["on_table"], f"the balls {sorted(required)} and at least one object ball")
    for i, choice in enumerate(values["choices"]):  # "replace" needs the state before the shot
        one_of(f"state.choices[{i}]", choice, tuple(name for name in rules.choices if name != "replace"))
    one_of("state.in_hand", values["in_hand"], IN_HAND if rules.pockets else IN_HAND[:1])
    spare = (0,) * (MOST_PLAYERS - players)
    values |= {
        "object_balls": set_of(balls - {cues[0]}),
        "cue_balls": (cues[0], cues[-1]),
        "in_hand": IN_HAND.index(values["in_hand"]),
        "choices": set_of(map(CALLS.index, values["choices"])),
        **{name: (*values[name], *spare) for name in ("scores", "fouls")},
    }
    rule_state = changed(opening_state(setup), **values)
    expected = rules.check(rule_state)
    _expect(not expected, shown["on_table"], expected)
    array = check_positions(setup.scene, shaped("positions", positions, (n, 2)), in_play=is_in(in_play(rule_state), n))
    return GameState(array, _looked_at(setup, array, rule_state))


def _check_field(name: str, value: Any, usual: Any, n_balls: int, n_players: int) -> None:
    """Raises unless a field of a custom opening has the type of the usual value and numbers in its range."""
    shown, field = f"state.{name}", FIELDS[{"on_table": "object_balls"}.get(name, name)]
    most = n_balls - 1 if field.is_set or name == "cue_balls" else n_players - 1 if field.most is None else field.most
    if isinstance(usual, bool):
        flag(shown, value)
    elif isinstance(usual, tuple):
        kinds = (list, tuple, *((set, frozenset) if field.is_set else ()))
        _expect(isinstance(value, kinds), f"{shown} = {short(value)}", "a list")
        for i, one in enumerate(value if not field.names else ()):
            integer(f"{shown}[{i}]", one, Range(field.least, most))
        once = field.names or not field.is_set or len(set(value)) == len(value)
        _expect(once, f"{shown} = {short(value)}", "each ball once")
    elif not field.names:
        integer(shown, value, Range(field.least, most))


def _looked_at(setup: Setup, positions: NDArray[np.float64], state: Any) -> Any:
    """Returns a state after `Game.look` at the balls at rest."""
    states = np.array([state])
    if setup.game_rules.look is not no_look:
        with kernels_of(f"rules = {setup.rules!r}"):
            look_at_games(setup.game_rules.kernels, setup.placement_table, positions[None], states)
    return states[0]


def play(setup: Setup, game: GameState, stroke: Stroke) -> PlayedShot:
    """Plays a shot.

    Args:
        setup: The settings of the game.
        game: The state before the shot.
        stroke: The stroke. A cue ball in hand is placed at the free point nearest to `stroke.place`, see
            `placement.nearest_free_point`. With a call of `NO_SHOT` the velocity and the spin must be zero and the
            place None; no ball is struck.

    Returns:
        The shot, with the state after it.

    Raises:
        TypeError: If a part of the stroke has another type.
        ValueError: If the game is over, a number is outside its range (see `checks.RANGES`), `stroke.place` is missing
            with the cue ball in hand or given without it, or the call is not possible.
    """
    state = game.state
    if state.over:
        raise ValueError("the game is over: expected no further shot")
    check_stroke(setup.scene, stroke)
    _check_rules(setup, state, stroke)
    scene, cue, n = setup.scene, int(state.cue_balls[0]), setup.scene.n_balls
    positions = game.positions.copy()
    if stroke.place is not None:
        positions[cue] = cue_ball_point(scene, positions, state, stroke.place)
    velocities, spins = np.zeros((n, 2)), np.zeros((n, 3))
    velocities[cue], spins[cue] = stroke.velocity[:2], stroke.spin
    no_shot = stroke.call.kind in NO_SHOT
    balls = is_in(in_play(state) if no_shot else on_table(state), n)
    heights = np.zeros((n, 2)) if scene.physics.flight else None
    if heights is not None and len(stroke.velocity) == 3:
        heights[cue, RISING] = stroke.velocity[2]
    shot_input = ShotInput(positions, velocities, spins, balls, cue, heights, scene.physics.max_time or math.inf)
    strike_frozen(scene, scene_fields(scene), shot_input.as_batch())
    rules, call, last = setup.game_rules, stroke.call, game.before or game
    shot = run_shot(scene, shot_input, setup.engine, record=True, measures=checked_measures(rules.measures))
    calls = np.array([row({**call._asdict(), "kind": CALLS.index(call.kind)}, CALL)])
    before = last.positions[None], np.array([last.state])
    with kernels_of(f"rules = {setup.rules!r}"):
        facts, end = facts_of(rules.facts, shot, calls), game.positions if no_shot else shot.positions
        (positions,), (following,), (verdict,) = next_games(
            rules, scene, end[None], np.array([state]), facts, calls, before, setup.rack
        )
    replaceable = game._replace(before=None) if following.choices >> REPLACE & 1 and not no_shot else None
    return PlayedShot(GameState(positions, following, replaceable), shot_input, shot, facts[0], verdict)


def check_stroke(scene: Scene, stroke: Stroke, of: str = "", name: str = "stroke") -> None:
    """Raises a TypeError or a ValueError unless a stroke has numbers within their ranges, see `checks.RANGES`.

    `name` is the name of the stroke in messages. `of` follows each name, such as " of player 'mine'".
    """
    call = getattr(stroke, "call", None)
    for part, value, kind in ((f"{name}{of}", stroke, Stroke), (f"{name}.call{of}", call, Call)):
        if not isinstance(value, kind):
            raise TypeError(f"{part} = {short(value)}: expected the type {kind.__name__}, not {type(value).__name__}")
    axes = (2, 3) if scene.physics.flight else (2,)
    for part, counts, within in (("velocity", axes, "speed"), ("place", (2,), "coordinate"), ("spin", (3,), "spin")):
        values = getattr(stroke, part)
        if part == "place" and values is None:
            continue
        right = isinstance(values, (list, tuple, np.ndarray)) and len(values) in counts
        _expect(right, f"{name}.{part}{of} = {short(values)}", f"{('two', 'three')[counts[0] - 2]} numbers")
        for i, value in enumerate(values):
            real(f"{name}.{part}[{i}]{of}", value, within)
    one_of(f"{name}.call.kind{of}", stroke.call.kind, CALLS)
    integer(f"{name}.call.ball{of}", stroke.call.ball, Range(-1, scene.n_balls - 1))
    integer(f"{name}.call.pocket{of}", stroke.call.pocket, Range(-1, len(scene.table.pockets) - 1))


def _check_rules(setup: Setup, state: Any, stroke: Stroke) -> None:
    """Raises a ValueError if the rules or the physics do not allow a stroke, see `play`."""
    call = stroke.call
    one_of("stroke.call.kind", call.kind, setup.kinds(state))
    if call.kind in NO_SHOT:
        still = not any(stroke.velocity) and not any(stroke.spin) and stroke.place is None
        _expect(still, f"stroke = {short(stroke)}", f"no motion and no place, the call is {call.kind!r}")
        return
    expected = "a point, the cue ball is in hand" if state.in_hand else "None, the cue ball is not in hand"
    _expect((stroke.place is not None) == (state.in_hand > 0), f"stroke.place = {short(stroke.place)}", expected)
    motion = setup.scene.physics.motion
    spinless = motion == "sliding" or not any(stroke.spin)
    _expect(spinless, f"stroke.spin = {short(stroke.spin)} with physics.motion = {motion!r}", "no spin")


def replay(history: History) -> Iterator[PlayedShot]:
    """Plays a recorded game again, and yields its shots in order."""
    game = history.opening
    for stroke in history.strokes:
        played = play(history.setup, game, stroke)
        yield played
        game = played.game
