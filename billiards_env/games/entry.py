"""The entry of a game: its rules as kernels, its settings and its texts."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from billiards_env.games.facts import USUAL, facts_type, jumped, jumped_in_flight, potted, recorder
from billiards_env.games.game_state import FIELDS, MOST_PLAYERS, NOT_IN_HAND, NoState, RulesState, hints_of, row_type
from billiards_env.games.placement import spot_at_foot
from billiards_env.jit import inlined
from billiards_env.physics.state import CUE_BALL
from billiards_env.scene import Scene

Kernel = Callable[..., Any]
Page = tuple[tuple[str, str], ...]


def no_target(balls: int) -> int:
    """Returns 0: by default no score wins the game (`Game.target`)."""
    return 0


@inlined
def no_spots(table, positions, balls, others, cue):
    """Returns -1: no ball returns to the table (`Game.spot`)."""
    return -1


@inlined
def no_rack(table, positions, others, cue):
    """Returns `NOT_IN_HAND`: the game has a single rack (`Game.rack`)."""
    return NOT_IN_HAND


@inlined
def no_look(table, positions, state):
    """Leaves the state: the balls at rest add nothing to it (`Game.look`)."""


@inlined
def no_see(table, positions, state, facts, call):
    """Leaves the facts: the judge needs no positions (`Game.see`)."""


@inlined
def no_settle(table, positions, state, verdict):
    """Leaves the state: the verdict and the balls at rest add nothing to it (`Game.settle`)."""


@inlined
def no_rerack(table, positions, state, kind):
    """Leaves the balls: no call sets them up again (`Game.without_shot`)."""


@inlined
def keep_scores(state, before):
    """Keeps the scores and the fouls of a state that is replaced by the one before the shot (`Game.replace`)."""
    for i in range(MOST_PLAYERS):
        before.scores[i], before.fouls[i] = state.scores[i], state.fouls[i]


def no_state(balls: int) -> NoState:
    """Returns the own state of a game without own state (`Game.state`)."""
    return NoState()


def no_check(state: Any) -> str:
    """Returns "": all balls of a custom opening are possible (`Game.check`)."""
    return ""


class Rules(NamedTuple):
    """The kernels of a game, an argument of the kernels of a turn. `Game` describes them."""

    legal: Kernel
    record: Kernel
    see: Kernel
    judge: Kernel
    spot: Kernel
    rack: Kernel
    settle: Kernel
    look: Kernel
    without_shot: Kernel
    replace: Kernel


class Game(NamedTuple):
    """A game.

    Attributes:
        judge: Kernel `(state, facts, call)`, see `turn.judged`. Returns the `Verdict` of a shot, and updates the
            state for the next shot, except the turn, the scores and the balls on the table.
        legal: Kernel `(state, player)`. Returns the balls that the player may touch first.
        scene: The name of the usual scene.
        layouts: The opening layouts; the first is the default. "random" has no break.
        n_object_balls: The smallest and the largest number of object balls; the largest is the default.
        won_by: How the game is won, for the table in the documentation.
        page: The rules for players: rows of two texts; none by default.
        n_players: The smallest and the largest number of players.
        cue_balls: The balls used as cue ball.
        target: Function of the number of object balls. Returns the default score that wins, or 0 if no score does; None
            for a game that is not won by points.
        callable: Kernel `(state, player)`. Returns the balls that the player may call; None for a game without called
            shots and safeties.
        editions: The names of the editions of the rules, the default first; `RulesState.edition` is the index.
        sources: The source of each edition, for the table in the documentation.
        left_out: What this game leaves out or simplifies: rows with the number of a rule and a text, for the
            documentation.
        without_safety: The editions that have called shots but no safeties.
        choices: The choices that a player may have besides a shot, of `CALLS`.
        counts_fouls: Whether consecutive fouls are penalised.
        deciding_ball: The ball that stays on the table until the end of the game, -1 for the last; None for none.
        has_spots: Whether each colour returns to its own spot, as in snooker: its place in the first layout. Otherwise
            balls return to the foot spot.
        pockets: Whether the table has pockets.
        foot_corners: Whether the rules name the pockets 2 and 3, which must then be in the foot corners.
        cushions: The cushion contacts that the cue ball needs before the last ball of a carom.
        scoring: The fact with the balls that may score, such as the potted or the banked balls.
        most_points: Function of the number of object balls. Returns the most points of a rack.
        state: Function of the number of object balls. Returns the own state at the opening, a NamedTuple whose fields
            have the types of `game_state`, such as `Count`. `Game.state_type` is the type of the whole state.
        facts: The facts of a shot that the game uses, see `games.facts`. Games with `jumped` penalise jump shots.
        measures: The measures that the engine records for these facts, see `engine.measures`.
        check: Function of a state of a custom opening. Returns what is expected of the balls on the table, or "".
        see: Kernel `(table, positions, state, facts, call)`. Writes the facts of a shot that need the positions after
            it.
        spot: Kernel `(table, positions, balls, others, cue)`, see `placement.spot_at_foot`.
        rack: Kernel `(table, positions, others, cue)`, see `placement.rack_again`.
        settle: Kernel `(table, positions, state, verdict)`. Sets what the verdict and the balls at rest add to the
            state after a shot, such as a free ball.
        look: Kernel `(table, positions, state)`. Sets what the balls at rest add to the state before each shot, such as
            the touching balls.
        without_shot: Kernel `(table, positions, state, kind)`. Changes the balls and the own state after a call without
            a shot, except "replace"; `kind` is the index in `CALLS`.
        replace: Kernel `(state, before)`. Writes to the state before a shot what remains of the state after it, after
            the call "replace".
    """

    judge: Kernel
    legal: Kernel
    scene: str
    layouts: tuple[str, ...]
    n_object_balls: tuple[int, int]
    won_by: str
    page: Page = ()
    n_players: tuple[int, int] = (2, MOST_PLAYERS)
    cue_balls: tuple[int, ...] = (CUE_BALL,)
    target: Callable[[int], int] | None = None
    callable: Kernel | None = None
    editions: tuple[str, ...] = ("",)
    sources: tuple[str, ...] = ()
    left_out: Page = ()
    without_safety: tuple[str, ...] = ()
    choices: tuple[str, ...] = ()
    counts_fouls: bool = False
    deciding_ball: int | None = None
    has_spots: bool = False
    pockets: bool = True
    foot_corners: bool = False
    cushions: int = 0
    scoring: Kernel = potted
    most_points: Callable[[int], int] = int
    state: Callable[[int], Any] = no_state
    facts: tuple[Kernel, ...] = USUAL
    measures: tuple[str, ...] = ()
    check: Callable[[Any], str] = no_check
    see: Kernel = no_see
    spot: Kernel = spot_at_foot
    rack: Kernel = no_rack
    settle: Kernel = no_settle
    look: Kernel = no_look
    without_shot: Kernel = no_rerack
    replace: Kernel = keep_scores

    def in_scene(self, scene: Scene) -> Game:
        """Returns the game as it is played in a scene. Shots record jump shots only in scenes with flight."""
        if not scene.physics.flight or jumped not in self.facts:
            return self
        facts = tuple(jumped_in_flight if fact is jumped else fact for fact in self.facts)
        return self._replace(facts=facts, measures=(*self.measures, "times_over"))

    @property
    def record(self) -> Kernel:
        """The kernel that records the facts."""
        return recorder(self.facts)

    @property
    def facts_type(self) -> np.dtype[Any]:
        """The type of the facts of a shot."""
        return facts_type(self.facts)

    @property
    def given(self) -> tuple[str, ...]:
        """The fields of the state that a custom opening may set, and that a file has, in the form of `to_dict`."""
        names = [name for name in self.state_names if FIELDS[name].given]
        return tuple("on_table" if name == "object_balls" else name for name in names)

    @property
    def state_names(self) -> tuple[str, ...]:
        """The names of the fields of a state."""
        return (self.state_type.names or ())[:-1]

    @property
    def state_type(self) -> np.dtype[Any]:
        """The type of a state."""
        return _state_type(type(self.state(self.n_object_balls[1])))

    @property
    def kernels(self) -> Rules:
        """The kernels."""
        return Rules(*(getattr(self, name) for name in Rules._fields))


@functools.cache
def _state_type(own: type) -> np.dtype[Any]:
    return row_type(hints_of(RulesState, own))
