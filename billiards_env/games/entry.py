"""The entry of a game: its rules as kernels, its settings and its texts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from billiards_env.games.game_state import MOST_PLAYERS, NOT_IN_HAND
from billiards_env.games.placement import spot_at_foot
from billiards_env.jit import inlined
from billiards_env.physics.state import CUE_BALL

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
def no_free_ball(table, positions, state, on):
    """Returns False: the game has no free balls and no free shots (`Game.free_ball`)."""
    return False


@inlined
def no_look(table, positions, state):
    """Leaves the state: the balls at rest add nothing to it (`Game.look`)."""


@inlined
def no_see(table, positions, state, facts, call):
    """Returns the facts: the judge needs no positions (`Game.see`)."""
    return facts


@inlined
def no_rerack(table, positions, state):
    """Leaves the balls: no call sets them up again (`Game.rerack`)."""


class Rules(NamedTuple):
    """The kernels of a game, an argument of the kernels of a turn. `Game` describes them."""

    judge: Kernel
    legal: Kernel
    spot: Kernel
    rack: Kernel
    free_ball: Kernel
    see: Kernel
    look: Kernel
    rerack: Kernel


class Game(NamedTuple):
    """A game.

    Attributes:
        judge: Kernel `(state, facts, call)`, see `referee.judged`. Returns the `Verdict` of a shot, and updates the
            state for the next shot, except the turn, the scores and the balls on the table.
        legal: Kernel `(state, player)`. Returns the balls that the player may touch first.
        scene: The name of the usual scene.
        layouts: The opening layouts; the first is the default. "random" has no break.
        n_object_balls: The smallest and the largest number of object balls; the largest is the default.
        won_by: How the game is won, for the table in the documentation.
        page: The rules for players: rows of two texts.
        n_players: The smallest and the largest number of players.
        cue_balls: The balls used as cue ball.
        target: Function of the number of object balls. Returns the default score that wins, or 0 if no score does; None
            for a game that is not won by points.
        callable: Kernel `(state, player)`. Returns the balls that the player may call; None for a game without called
            shots and safeties.
        editions: The names of the editions of the rules, the default first; `RulesState.edition` is the index.
        without_safety: The editions that have called shots but no safeties.
        choices: The choices that a player may have besides a shot, of `CALLS`.
        counts_fouls: Whether consecutive fouls are penalised.
        deciding_ball: The ball that stays on the table until the end of the game, -1 for the last; None for none.
        has_spots: Whether each colour returns to its own spot, as in snooker: its place in the first layout. Otherwise
            balls return to the foot spot.
        pockets: Whether the table has pockets.
        foot_corners: Whether the rules name the pockets 2 and 3, which must then be in the foot corners.
        groups: Whether each player has a group of seven balls and then the eight ball.
        pots_any: Whether a legal shot may pot any ball, and not only those that may be touched first.
        cushions: The cushion contacts that the cue ball needs before the last ball of a carom.
        banks: For players: whether a ball scores only after it hits a cushion.
        sure_pot: For players: the expected points of a turn with a sure pot, in a game that is won by points.
        most_points: Function of the number of object balls. Returns the most points of a rack.
        spot: Kernel `(table, positions, balls, others, cue)`, see `placement.spot_at_foot`.
        rack: Kernel `(table, positions, others, cue)`, see `placement.rack_again`.
        free_ball: Kernel `(table, positions, state, on)`, see `snooker.is_snookered`. Returns whether a foul gives the
            next player a free ball or a free shot.
        see: Kernel `(table, positions, state, facts, call)`. Returns the facts of a shot, with those that need the
            positions after it.
        look: Kernel `(table, positions, state)`. Sets what the balls at rest add to the state of the next shot, such as
            the touching balls.
        rerack: Kernel `(table, positions, state)`. Sets up the balls again after the call "rerack", and changes the
            state, except the player.
        has_innings: Whether `Setup.innings` may limit the innings.
    """

    judge: Kernel
    legal: Kernel
    scene: str
    layouts: tuple[str, ...]
    n_object_balls: tuple[int, int]
    won_by: str
    page: Page
    n_players: tuple[int, int] = (2, MOST_PLAYERS)
    cue_balls: tuple[int, ...] = (CUE_BALL,)
    target: Callable[[int], int] | None = None
    callable: Kernel | None = None
    editions: tuple[str, ...] = ("",)
    without_safety: tuple[str, ...] = ()
    choices: tuple[str, ...] = ()
    counts_fouls: bool = False
    deciding_ball: int | None = None
    has_spots: bool = False
    pockets: bool = True
    foot_corners: bool = False
    groups: bool = False
    pots_any: bool = False
    cushions: int = 0
    banks: bool = False
    sure_pot: float = 1.0
    most_points: Callable[[int], int] = int
    spot: Kernel = spot_at_foot
    rack: Kernel = no_rack
    free_ball: Kernel = no_free_ball
    see: Kernel = no_see
    look: Kernel = no_look
    rerack: Kernel = no_rerack
    has_innings: bool = False

    @property
    def kernels(self) -> Rules:
        """The kernels."""
        return Rules(*(getattr(self, name) for name in Rules._fields))
