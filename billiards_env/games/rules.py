"""The rules of the games, as plain functions of what happened in a shot.

`facts_of` reads the recorded events of a shot; a game's `judge(state, facts)` says what the shot was worth, a
`Verdict`; `after(state, facts, verdict)` is the state for the next shot. `RULES` holds the games by name.

Sources: "WPA" is the World Pool-Billiard Association's The Rules of Play, effective 15 March 2016 (1 general, 2 nine
ball, 3 eight ball, 4 continuous pool, 6 fouls, 8 definitions); "UMB" the World Rules of Carom Billiard of the Union
Mondiale de Billard (1989). What is simplified:

* No shot is called (WPA 1.6): any ball that drops on a legal shot counts, in any pocket.
* There is no push out (WPA 2.4), no safety call (3.6), no three-foul rule (2.8, 4.11) and no stalemate (1.12); a player
  who shoots from behind the head string may touch a ball behind it first (6.11).
* Where the rules let a player choose after a break (WPA 3.3), the balls are accepted as they lie, never racked again;
  the eight ball potted on the break is spotted.
* A ball that lay against a cushion counts as driven to it when it is hit into it (WPA 8.4 asks it to leave first).
* `straight` is one rack: the balls are not racked again (WPA 4.4), and the only foul is a scratch.
* A carom game has no equalising inning, and the incoming player takes the cue ball that the last one did not, which
  between two players is each player's own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numpy.typing import NDArray

CUE = 0
"""The cue ball's number in the pool games."""

IN_HAND = ("no", "behind", "anywhere")
"""Whether the cue ball is in hand (WPA 1.5): not, behind the head string, or anywhere on the table."""

FOULS = ("", "scratch", "no_hit", "wrong_ball", "no_cushion", "illegal_break")
"""What a verdict calls a foul; "" is none."""


class State(NamedTuple):
    """A game between two shots, but for the places of the balls.

    Attributes:
        player: Whose turn it is, 0 to n_players - 1.
        scores: Each player's points.
        on_table: The balls that are not potted, by number, the cue ball or balls among them.
        break_shot: Whether the next shot is the opening break.
        in_hand: One of `IN_HAND`.
        cue_balls: The balls that serve as cue ball, the one to strike next first.
        solids: Eight ball: the player who has the balls 1 to 7; -1 while the table is open.
        target: The score that wins at once, 0 for none.
        over: Whether the game is decided.
        winner: The player who has won, -1 for none.
    """

    player: int
    scores: tuple[int, ...]
    on_table: frozenset[int]
    break_shot: bool = True
    in_hand: str = "behind"
    cue_balls: tuple[int, ...] = (CUE,)
    solids: int = -1
    target: int = 0
    over: bool = False
    winner: int = -1

    @property
    def object_balls(self) -> frozenset[int]:
        """The balls on the table, but for the one to strike next."""
        return self.on_table - {self.cue_balls[0]}


class Facts(NamedTuple):
    """What happened in a shot, as far as rules ask.

    Attributes:
        first: The balls that the cue ball touched first: one, none, or several where it did so at one instant.
        touched: The balls that it touched, in order, each with the cue ball's number of cushion contacts before.
        potted: The balls that dropped, in order.
        cushion_after: Whether any ball met a cushion, or dropped, after the cue ball's first contact.
        driven: The object balls that met a cushion or dropped (WPA 8.4).
    """

    first: tuple[int, ...] = ()
    touched: tuple[tuple[int, int], ...] = ()
    potted: tuple[int, ...] = ()
    cushion_after: bool = False
    driven: frozenset[int] = frozenset()


class Verdict(NamedTuple):
    """What a shot was worth.

    Attributes:
        foul: One of `FOULS`.
        points: Points for the shooter.
        goes_on: Whether the shooter stays at the table.
        in_hand: One of `IN_HAND`, for the next shot.
        spotted: The potted balls that come back, in the order in which they are spotted.
        solids: As in `State`, from now on.
        over: Whether the game is decided.
        winner: The player who has won, -1 for none.
    """

    foul: str = ""
    points: int = 0
    goes_on: bool = False
    in_hand: str = "no"
    spotted: tuple[int, ...] = ()
    solids: int = -1
    over: bool = False
    winner: int = -1


def facts_of(events: NDArray[Any], cue: int = CUE) -> Facts:
    """Reads what rules ask for out of a shot's event log.

    Args:
        events: `ShotResult.events` of a recorded shot.
        cue: The ball that was struck.

    Returns:
        The facts.
    """
    first: list[int] = []
    first_time = None
    touched: dict[int, int] = {}
    potted: list[int] = []
    driven: set[int] = set()
    cushions, cushion_after = 0, False
    columns = (events[name].tolist() for name in ("time", "kind", "ball", "other"))
    for time, kind, ball, other in zip(*columns, strict=True):
        if kind == "ball_ball" and cue in (ball, other):
            hit = other if ball == cue else ball
            touched.setdefault(hit, cushions)
            first_time = time if first_time is None else first_time
            if time == first_time and hit not in first:
                first.append(hit)
        elif kind in ("cushion", "pocket"):
            cushion_after = cushion_after or first_time is not None
            if ball != cue:
                driven.add(ball)
            elif kind == "cushion":
                cushions += 1
            if kind == "pocket":
                potted.append(ball)
    return Facts(tuple(first), tuple(touched.items()), tuple(potted), cushion_after, frozenset(driven))


def after(state: State, facts: Facts, verdict: Verdict) -> State:
    """The state for the next shot; the cue ball is always on the table, or in hand.

    Args:
        state: The state before the shot.
        facts: What happened in it.
        verdict: What the game's judge said.

    Returns:
        The state after it.
    """
    scores = list(state.scores)
    scores[state.player] += verdict.points
    cue, *others = state.cue_balls
    return state._replace(
        player=state.player if verdict.goes_on else (state.player + 1) % len(scores),
        scores=tuple(scores),
        on_table=(state.on_table - set(facts.potted)) | set(verdict.spotted) | {cue},
        break_shot=False,
        in_hand=verdict.in_hand,
        cue_balls=state.cue_balls if verdict.goes_on else (*others, cue),
        solids=verdict.solids,
        over=verdict.over,
        winner=verdict.winner,
    )


def any_ball(state: State, player: int) -> frozenset[int]:
    """The balls that a player may touch first: every object ball."""
    return state.object_balls


def lowest_ball(state: State, player: int) -> frozenset[int]:
    """The ball that a player has to touch first in nine ball, the lowest on the table (WPA 2)."""
    return frozenset(sorted(state.object_balls)[:1])


def red_to_open(state: State, player: int) -> frozenset[int]:
    """The balls that a player may touch first in carom: on the opening shot the red ball, number 1, then any."""
    return frozenset({1}) if state.break_shot else state.object_balls


def group_or_eight(state: State, player: int) -> frozenset[int]:
    """The balls that a player may touch first in eight ball (WPA 3.4).

    On the break any; then those of the player's group, of both while the table is open; the eight ball once there are
    none left.
    """
    if state.break_shot:
        return state.object_balls
    groups = state.object_balls - {8}
    if state.solids >= 0:
        groups = frozenset(ball for ball in groups if (ball < 8) == (player == state.solids))
    return groups or frozenset({8})


def standard_foul(facts: Facts, legal: frozenset[int]) -> str:
    """The foul that was committed under WPA 6.1 to 6.3, "" for none.

    Balls touched at one instant count as the legal one's having been touched first (WPA regulations, split hits).

    Args:
        facts: What happened.
        legal: The balls that may be touched first.

    Returns:
        One of `FOULS`; of several, the first in their order.
    """
    if CUE in facts.potted:
        return "scratch"
    if not facts.first:
        return "no_hit"
    if not legal & set(facts.first):
        return "wrong_ball"
    # Whatever drops counts as driven to a cushion.
    return "" if facts.cushion_after else "no_cushion"


def straight(state: State, facts: Facts) -> Verdict:
    """Straight pool: a point for each ball potted, and the shooter goes on after one (WPA 4, one rack).

    A scratch costs a point; what dropped in that shot is spotted and does not count, and the next player has the cue
    ball in hand behind the head string. The game is over when a player has reached the target score, or no ball is
    left: then the highest score wins, and nobody does if two have it.

    Args:
        state: The state before the shot.
        facts: What happened in it.

    Returns:
        The verdict.
    """
    balls = tuple(sorted(set(facts.potted) - {CUE}))
    if CUE in facts.potted:
        return Verdict("scratch", points=-1, in_hand="behind", spotted=balls)
    scores = list(state.scores)
    scores[state.player] += len(balls)
    cleared = state.object_balls == set(balls)
    reached = 0 < state.target <= scores[state.player]
    best = max(scores)
    leader = scores.index(best) if scores.count(best) == 1 else -1
    winner = state.player if reached else leader if cleared else -1
    return Verdict(points=len(balls), goes_on=len(balls) > 0, over=cleared or reached, winner=winner)


def nine_ball(state: State, facts: Facts) -> Verdict:
    """Nine ball: the lowest ball is to be touched first, and whoever legally pots the nine ball wins (WPA 2).

    Any ball potted on a legal shot lets the shooter go on (WPA 2.5). After a foul the next player has the cue ball in
    hand anywhere; a nine ball that dropped is spotted, other balls stay down (WPA 2.6, 2.7). A break that pots nothing
    and drives fewer than four balls to a cushion is a foul (WPA 2.3).

    Args:
        state: The state before the shot.
        facts: What happened in it.

    Returns:
        The verdict.
    """
    foul = standard_foul(facts, lowest_ball(state, state.player))
    if not foul and state.break_shot and not facts.potted and len(facts.driven) < 4:
        foul = "illegal_break"
    if foul:
        return Verdict(foul, in_hand="anywhere", spotted=(9,) if 9 in facts.potted else ())
    won = 9 in facts.potted
    return Verdict(goes_on=len(facts.potted) > 0, over=won, winner=state.player if won else -1)


def eight_ball(state: State, facts: Facts) -> Verdict:
    """Eight ball: pot your group, 1 to 7 or 9 to 15, then the eight ball (WPA 3), between two players.

    The table is open until a shot after the break legally pots a ball: its group, that of the first to drop, becomes
    the shooter's (WPA 3.4). A shot that legally pots a ball of the shooter's group lets the shooter go on (WPA 3.5).
    After a foul the next player has the cue ball in hand anywhere; what dropped stays down. Whoever pots the eight ball
    with a foul, or while balls of the own group are left, loses (WPA 3.8).

    On the break any ball may be touched first, and any ball potted lets the shooter go on; the eight ball is spotted if
    it drops; after a scratch, or no contact at all, the next player has the cue ball in hand behind the head string
    (WPA 3.3).

    Args:
        state: The state before the shot.
        facts: What happened in it.

    Returns:
        The verdict.
    """
    player, other = state.player, 1 - state.player
    eight = 8 in facts.potted
    legal = group_or_eight(state, player)
    foul = standard_foul(facts, legal)
    if state.break_shot:
        spotted = (8,) if eight else ()
        if foul in ("scratch", "no_hit"):
            return Verdict(foul, in_hand="behind", spotted=spotted)
        # A break that drives too few balls to a cushion is no foul; the next player takes the balls as they lie.
        return Verdict(goes_on=len(facts.potted) > 0, spotted=spotted)
    if eight:
        winner = other if foul or 8 not in legal else player
        return Verdict(foul, in_hand="anywhere" if foul else "no", solids=state.solids, over=True, winner=winner)
    if foul:
        return Verdict(foul, in_hand="anywhere", solids=state.solids)
    solids = state.solids
    if solids < 0 and facts.potted:
        solids = player if facts.potted[0] < 8 else other
    own = [ball for ball in facts.potted if (ball < 8) == (player == solids)]
    return Verdict(goes_on=len(own) > 0, solids=solids)


def carom(state: State, facts: Facts, cushions: int = 0) -> Verdict:
    """Carom: a point, and another shot, for touching both other balls with the cue ball (UMB, art. 24 and 61).

    The opening shot has to touch the red ball, number 1, first.

    Args:
        state: The state before the shot.
        facts: What happened in it.
        cushions: How many cushion contacts the cue ball must have made before it touches the second of them.

    Returns:
        The verdict; the game is over when a player has reached the target score.
    """
    scored = len(facts.touched) == 2 and facts.touched[1][1] >= cushions
    scored = scored and bool(red_to_open(state, state.player) & set(facts.first))
    won = scored and 0 < state.target <= state.scores[state.player] + 1
    return Verdict(points=int(scored), goes_on=scored, over=won, winner=state.player if won else -1)


def three_cushion(state: State, facts: Facts) -> Verdict:
    """Three-cushion carom: `carom` with three cushion contacts before the second ball (UMB, art. 83).

    Args:
        state: The state before the shot.
        facts: What happened in it.

    Returns:
        The verdict.
    """
    return carom(state, facts, cushions=3)


class Rules(NamedTuple):
    """A game.

    Attributes:
        judge: `(state, facts) -> verdict`.
        legal: `(state, player) -> the balls that the player may touch first`.
        pockets: Whether the game is one of pockets.
        n_object_balls: The fewest and the most object balls, the most being usual.
        n_players: The fewest and the most players.
        cue_balls: The balls that serve as cue ball.
        target: The usual score to win at, 0 for none; None for a game that is not won by points.
    """

    judge: Callable[[State, Facts], Verdict]
    legal: Callable[[State, int], frozenset[int]]
    pockets: bool
    n_object_balls: tuple[int, int]
    n_players: tuple[int, int] = (2, 4)
    cue_balls: tuple[int, ...] = (CUE,)
    target: int | None = None


RULES: dict[str, Rules] = {
    "straight": Rules(straight, any_ball, True, (1, 15), target=0),
    "eight_ball": Rules(eight_ball, group_or_eight, True, (15, 15), n_players=(2, 2)),
    "nine_ball": Rules(nine_ball, lowest_ball, True, (9, 9)),
    "carom": Rules(carom, red_to_open, False, (2, 2), cue_balls=(0, 2), target=10),
    "three_cushion": Rules(three_cushion, red_to_open, False, (2, 2), cue_balls=(0, 2), target=10),
}
