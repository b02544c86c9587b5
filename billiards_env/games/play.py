"""A game as plain data: `opening` sets the table, `play` takes it from one shot to the next, `replay` does so again.

It draws from a generator only to rack the balls; everything else follows from the strokes, bit for bit.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_env import layouts
from billiards_env.checks import Range, choose, real, whole
from billiards_env.engine import ShotInput, ShotResult, check_mode, run_checked
from billiards_env.games.places import Point, cue_place, spot_place
from billiards_env.games.rules import IN_HAND, RULES, Facts, Rules, State, Verdict, after, facts_of
from billiards_env.scene import Scene, check_positions

LAYOUTS = ("rack", "tight_rack", "random")
"""The layouts that a game of pockets may open with; a carom game opens with its own."""

_DECIDES = {"eight_ball": (8,), "nine_ball": (9,)}

SCORES = 1_000_000
"""No score is larger, nor smaller than minus that."""


@dataclasses.dataclass(frozen=True, slots=True)
class Setup:
    """What stays the same from shot to shot of a game.

    Attributes:
        rules: One of `RULES`.
        scene: Table, balls and physics.
        n_players: Number of players.
        target: The score that wins, 0 for none; None for the game's usual one, and in a game not won by points.
        mode: The engine, as in `simulate`.
        dt: As in `simulate`.
        fix: As in `simulate`.
    """

    rules: str
    scene: Scene
    n_players: int = 2
    target: int | None = None
    mode: str = "pic"
    dt: float | None = None
    fix: str | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.rules, str):
            raise ValueError(f"rules = {self.rules!r}: expected a name")
        choose("rules", self.rules, tuple(RULES))
        rules = self.game
        low, high = rules.n_object_balls
        if not low <= self.scene.n_balls - 1 <= high:
            wanted = str(low) if low == high else f"{low} to {high}"
            raise ValueError(
                f"rules = {self.rules!r} with a scene of {self.scene.n_balls - 1} object balls: expected {wanted}"
            )
        if rules.pockets != bool(self.scene.table.pockets):
            wanted = "a table with pockets" if rules.pockets else "a table without pockets"
            raise ValueError(
                f"rules = {self.rules!r} with a table of {len(self.scene.table.pockets)} pockets: expected {wanted}"
            )
        for i, mass in enumerate(self.scene.balls.mass):
            if math.isinf(mass):
                raise ValueError(f"rules = {self.rules!r} with ball {i} of infinite mass: expected balls that can move")
        object.__setattr__(self, "n_players", whole("n_players", self.n_players, Range(*rules.n_players)))
        if rules.target is None:
            if self.target is not None:
                raise ValueError(
                    f"target = {self.target!r} with rules {self.rules!r}: expected None, no points are kept"
                )
        else:
            target = rules.target if self.target is None else self.target
            object.__setattr__(self, "target", whole("target", target, Range(0, SCORES)))
        check_mode(self.mode, self.dt, self.fix)
        if self.dt is not None:
            object.__setattr__(self, "dt", float(self.dt))

    @property
    def game(self) -> Rules:
        """The entry of `RULES`."""
        return RULES[self.rules]


class Table(NamedTuple):
    """A game between two shots.

    Attributes:
        positions: (n, 2) float64, m; a potted ball's is that of its pocket, a cue ball's in hand where it was last.
        state: All that the rules know.
    """

    positions: NDArray[np.float64]
    state: State


class Stroke(NamedTuple):
    """What a player does.

    Attributes:
        velocity: x and y of the cue ball's velocity, m/s.
        place: x and y of where a cue ball in hand is to be put, m; None if it is not in hand.
    """

    velocity: Point
    place: Point | None = None


class Played(NamedTuple):
    """A shot of a game.

    Attributes:
        table: The table after it.
        given: What the engine was given.
        shot: The recorded shot.
        facts: What happened, as the rules see it.
        verdict: What it was worth.
    """

    table: Table
    given: ShotInput
    shot: ShotResult
    facts: Facts
    verdict: Verdict


class History(NamedTuple):
    """A game, or the part of it that has been played.

    Attributes:
        setup: What stays the same.
        opening: The table before the first stroke.
        strokes: The strokes, in order.
    """

    setup: Setup
    opening: Table
    strokes: tuple[Stroke, ...]


def opening_state(setup: Setup) -> State:
    """The state in which a game opens: player 0 to break, with the cue ball in hand in a game of pockets."""
    return State(
        player=0,
        scores=(0,) * setup.n_players,
        on_table=frozenset(range(setup.scene.n_balls)),
        in_hand="behind" if setup.game.pockets else "no",
        cue_balls=setup.game.cue_balls,
        target=setup.target or 0,
    )


def _shuffled(balls: Iterable[int], rng: np.random.Generator) -> list[int]:
    """Fisher and Yates, by `Generator.random`, which gives the same draws everywhere."""
    rest, drawn = list(balls), []
    while rest:
        drawn.append(rest.pop(int(rng.random() * len(rest))))
    return drawn


def rack_order(rules: str, n_object_balls: int, rng: np.random.Generator) -> list[int]:
    """Which ball lies at which place of the rack.

    Nine ball has the 1 at the apex and the 9 in the middle (WPA 2.2); eight ball has the 8 in the middle of the third
    row and a ball of each group at the lower corners (WPA 3.2). The other balls lie at random; in other games by
    number.

    Args:
        rules: One of `RULES`.
        n_object_balls: Number of object balls.
        rng: Where the draws come from.

    Returns:
        The balls' numbers in the order of `the "rack" layout`, from the apex row by row.
    """
    if rules == "nine_ball":
        a, b, c, *rest = _shuffled(range(2, 9), rng)
        return [1, a, b, c, 9, *rest]
    if rules == "eight_ball":
        solid, *solids = _shuffled(range(1, 8), rng)
        stripe, *stripes = _shuffled(range(9, 16), rng)
        left, right = _shuffled((solid, stripe), rng)
        rest = _shuffled((*solids, *stripes), rng)
        return [*rest[:4], 8, *rest[4:9], left, *rest[9:], right]
    return list(range(1, n_object_balls + 1))


def opening(setup: Setup, rng: np.random.Generator, layout: str | None = None) -> Table:
    """The table before the first shot.

    Args:
        setup: The game.
        rng: Where the draws come from.
        layout: One of `LAYOUTS` in a game of pockets, "rack" by default. After "random", with the balls all over the
            table, the first shot is no break and the cue ball not in hand. A carom game has its opening position, or
            "random".

    Returns:
        The table.

    Raises:
        ValueError: If the layout is unknown or does not suit the game, or the balls do not fit.

    Example:
        >>> table = opening(Setup("nine_ball", Scene.named("pool", 9)), np.random.default_rng(0))
        >>> table.positions[9, 1].round(2), table.state.in_hand
        (np.float64(0.0), 'behind')
    """
    names = LAYOUTS if setup.game.pockets else ("carom_opening", "random")
    layout = names[0] if layout is None else layout
    if layout not in names:
        raise ValueError(
            f"layout = {layout!r} with rules {setup.rules!r}: expected one of {', '.join(map(repr, names))}"
        )
    drawn = layouts.draw(layout, setup.scene, rng)
    state = opening_state(setup)
    if layout == "random":
        return Table(drawn, state._replace(break_shot=False, in_hand="no"))
    positions = drawn.copy()
    if setup.game.pockets:
        for place, ball in enumerate(rack_order(setup.rules, setup.scene.n_balls - 1, rng), start=1):
            positions[ball] = drawn[place]
    return Table(positions, state)


def set_table(setup: Setup, positions: ArrayLike, state: Mapping[str, Any] | None = None) -> Table:
    """A table set by hand.

    Args:
        setup: The game.
        positions: (n, 2) m.
        state: Fields of `State` that differ from a first shot that is no break, with all balls on the table and none in
            hand; the target and whether the game is over follow from the setup and cannot be given.

    Returns:
        The table.

    Raises:
        ValueError: If a field is unknown or impossible, or the balls cannot lie so.
    """
    fields = {"player", "scores", "on_table", "break_shot", "in_hand", "cue_balls", "solids"}
    start = opening_state(setup)._replace(break_shot=False, in_hand="no")
    given = {} if state is None else state
    if not isinstance(given, Mapping):
        raise ValueError(f"state = {state!r}: expected a mapping")
    for key in given:
        choose("key of state", key, tuple(sorted(fields)))
    values: dict[str, Any] = {name: given.get(name, getattr(start, name)) for name in fields}
    n, players = setup.scene.n_balls, setup.n_players
    whole("state.player", values["player"], Range(0, players - 1))
    whole("state.solids", values["solids"], Range(-1, players - 1 if setup.rules == "eight_ball" else -1))
    for name, kind in (
        ("scores", (list, tuple)),
        ("on_table", (list, tuple, set, frozenset)),
        ("cue_balls", (list, tuple)),
    ):
        if not isinstance(values[name], kind):
            raise ValueError(f"state.{name} = {values[name]!r}: expected a list of whole numbers")
        for i, value in enumerate(values[name]):
            limits = (-SCORES, SCORES) if name == "scores" else (0, n - 1)
            whole(f"state.{name}[{i}]", value, Range(*limits))
    if len(values["scores"]) != players:
        raise ValueError(f"state.scores = {values['scores']!r}: expected {players}, one a player")
    if setup.target and max(values["scores"]) >= setup.target:
        raise ValueError(f"state.scores = {values['scores']!r}: expected less than the target, {setup.target}")
    on_table = frozenset(values["on_table"])
    if len(on_table) != len(values["on_table"]):
        raise ValueError(f"state.on_table = {values['on_table']!r}: expected each ball once")
    if sorted(values["cue_balls"]) != sorted(setup.game.cue_balls):
        raise ValueError(f"state.cue_balls = {values['cue_balls']!r}: expected {setup.game.cue_balls} in some order")
    # Neither a cue ball nor the ball that decides the game can have left the table.
    needed = {*setup.game.cue_balls, *_DECIDES.get(setup.rules, ())} if setup.game.pockets else set(range(n))
    if not needed <= on_table or len(on_table) < 2:
        raise ValueError(
            f"state.on_table = {sorted(on_table)}: expected the balls {sorted(needed)} and an object ball among them"
        )
    if not isinstance(values["break_shot"], bool):
        raise ValueError(f"state.break_shot = {values['break_shot']!r}: expected True or False")
    if not isinstance(values["in_hand"], str):
        raise ValueError(f"state.in_hand = {values['in_hand']!r}: expected a name")
    choose("state.in_hand", values["in_hand"], IN_HAND if setup.game.pockets else IN_HAND[:1])
    values.update(scores=tuple(map(int, values["scores"])), on_table=on_table, cue_balls=tuple(values["cue_balls"]))
    made = start._replace(**values)
    placed = np.asarray(positions, dtype=np.float64)
    if placed.shape != (n, 2):
        raise ValueError(f"positions has shape {placed.shape}: expected ({n}, 2), a row a ball")
    lying = np.isin(np.arange(n), sorted(made.on_table if made.in_hand == "no" else made.object_balls))
    return Table(check_positions(setup.scene, placed, in_play=lying), made)


def play(setup: Setup, table: Table, stroke: Stroke) -> Played:
    """Plays a shot.

    Args:
        setup: The game.
        table: The table before it.
        stroke: What the player does. A cue ball in hand is put at the free place nearest to `stroke.place`, see
            `places.nearest_place`.

    Returns:
        The table after it, and what happened.

    Raises:
        ValueError: If the game is over, a number is outside its range (see `checks.RANGES`), or a place is missing or
            is not asked for.
    """
    state = table.state
    if state.over:
        raise ValueError("the game is over: expected no further shot")
    if (stroke.place is None) != (state.in_hand == "no"):
        wanted = "None, the cue ball is not in hand" if state.in_hand == "no" else "a place, the cue ball is in hand"
        raise ValueError(f"stroke.place = {stroke.place!r}: expected {wanted}")
    for name, pair, within in zip(stroke._fields, stroke, ("speed", "coordinate"), strict=True):
        if pair is not None:
            if len(pair) != 2:
                raise ValueError(f"stroke.{name} = {pair!r}: expected two numbers")
            for i, value in enumerate(pair):
                real(f"stroke.{name}[{i}]", value, within)
    scene, cue, n = setup.scene, state.cue_balls[0], setup.scene.n_balls
    positions = table.positions.copy()
    if stroke.place is not None:
        positions[cue] = cue_place(scene, positions, state.object_balls, cue, stroke.place, state.in_hand == "behind")
    velocities = np.zeros((n, 2))
    velocities[cue] = stroke.velocity
    in_play = np.isin(np.arange(n), sorted(state.on_table))
    given = ShotInput(positions, velocities, np.zeros((n, 3)), in_play, scene.physics.max_time or math.inf)
    shot = run_checked(scene, given, setup.mode, setup.dt, setup.fix, record=True)
    assert shot.events is not None
    facts = facts_of(shot.events, cue)
    verdict = setup.game.judge(state, facts)
    state = after(state, facts, verdict)
    positions = shot.positions.copy()
    lying = state.on_table - set(verdict.spotted)
    if state.in_hand != "no":  # a cue ball in hand is in nobody's way
        lying -= {cue}
    for ball in verdict.spotted:
        positions[ball] = spot_place(scene, positions, lying, ball)
        lying |= {ball}
    return Played(Table(positions, state), given, shot, facts, verdict)


def replay(history: History) -> Iterator[Played]:
    """Plays a game again.

    Args:
        history: The game.

    Yields:
        Each of its shots.
    """
    table = history.opening
    for stroke in history.strokes:
        played = play(history.setup, table, stroke)
        yield played
        table = played.table
