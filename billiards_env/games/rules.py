"""The rules of the games, as plain functions of the facts of a shot.

`facts_of` computes the facts from the recorded events of a shot. A game's `judge(state, facts)` returns a `Verdict`,
and `next_state(state, facts, verdict)` returns the state for the next shot. `RULES` holds the games by name.

Sources: "WPA" is the World Pool-Billiard Association's The Rules of Play, effective 15 March 2016 (1 general, 2 nine
ball, 3 eight ball, 4 continuous pool, 6 fouls, 8 definitions); "UMB" is the World Rules of Carom Billiard of the Union
Mondiale de Billard (1989). The rules are simplified:

* Shots are not called (WPA 1.6): any ball potted on a legal shot counts, in any pocket.
* There is no push out (WPA 2.4), no safety call (3.6), no three-foul rule (2.8, 4.11) and no stalemate (1.12). A player
  who shoots from behind the head string may first touch a ball behind it (6.11).
* Players have no choice after a break (WPA 3.3): the balls are never racked again. An eight ball potted on the break is
  spotted.
* A ball frozen to a cushion counts as driven to it when it is hit into it. WPA 8.4 requires that it first leaves the
  cushion.
* `straight` is a single rack: the balls are not racked again (WPA 4.4), and the only foul is a scratch.
* Carom games have no equalising inning. When the turn changes, the two cue balls are swapped, so with two players each
  player has one cue ball.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numpy.typing import NDArray

CUE = 0
"""The cue ball's number in the pool games."""

IN_HAND = ("no", "behind", "anywhere")
"""Whether the cue ball is in hand (WPA 1.5): not in hand, behind the head string, or anywhere on the table."""

FOULS = ("", "scratch", "no_hit", "wrong_ball", "no_cushion", "illegal_break")
"""The fouls; "" means no foul."""


class RuleState(NamedTuple):
    """The state of the rules between two shots: everything except the positions of the balls.

    Attributes:
        player: The player to shoot, 0 to n_players - 1.
        scores: The score of each player.
        on_table: The numbers of the balls that are not potted, including the cue balls.
        break_shot: Whether the next shot is the opening break.
        in_hand: One of `IN_HAND`.
        cue_balls: The balls used as cue ball; the first is struck next.
        solids: In eight ball, the player who has the balls 1 to 7; -1 while the table is open.
        target: The score that wins, or 0 if no score does.
        over: Whether the game is over.
        winner: The player who has won, or -1.
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
        """The balls on the table except the one to be struck next."""
        return self.on_table - {self.cue_balls[0]}


class Facts(NamedTuple):
    """The facts of a shot that the rules use.

    Attributes:
        first: The balls that the cue ball touched first: none, one, or several touched at the same instant.
        touched: The balls that the cue ball touched, in order, each with the number of cushion contacts that the cue
            ball had before.
        potted: The potted balls, in order.
        cushion_after: Whether any ball hit a cushion or was potted after the cue ball's first contact with a ball.
        driven: The object balls that hit a cushion or were potted (WPA 8.4).
    """

    first: tuple[int, ...] = ()
    touched: tuple[tuple[int, int], ...] = ()
    potted: tuple[int, ...] = ()
    cushion_after: bool = False
    driven: frozenset[int] = frozenset()


class Verdict(NamedTuple):
    """The judgement of a shot.

    Attributes:
        foul: One of `FOULS`.
        points: Points for the shooter.
        continues: Whether the shooter also plays the next shot.
        in_hand: One of `IN_HAND`, for the next shot.
        spotted: The potted balls that return to the table, in this order.
        solids: As in `RuleState`, for the next shot.
        over: Whether the game is over.
        winner: The player who has won, or -1.
    """

    foul: str = ""
    points: int = 0
    continues: bool = False
    in_hand: str = "no"
    spotted: tuple[int, ...] = ()
    solids: int = -1
    over: bool = False
    winner: int = -1


def facts_of(events: NDArray[Any], cue: int = CUE) -> Facts:
    """Computes the facts of a shot from its events.

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


def next_state(state: RuleState, facts: Facts, verdict: Verdict) -> RuleState:
    """Returns the state for the next shot. A potted cue ball returns to the table.

    Args:
        state: The state before the shot.
        facts: The facts of the shot.
        verdict: The verdict on the shot.

    Returns:
        The state after the shot.
    """
    scores = list(state.scores)
    scores[state.player] += verdict.points
    cue, *others = state.cue_balls
    return state._replace(
        player=state.player if verdict.continues else (state.player + 1) % len(scores),
        scores=tuple(scores),
        on_table=(state.on_table - set(facts.potted)) | set(verdict.spotted) | {cue},
        break_shot=False,
        in_hand=verdict.in_hand,
        cue_balls=state.cue_balls if verdict.continues else (*others, cue),
        solids=verdict.solids,
        over=verdict.over,
        winner=verdict.winner,
    )


def any_ball(state: RuleState, player: int) -> frozenset[int]:
    """Returns the balls that a player may touch first: every object ball."""
    return state.object_balls


def lowest_ball(state: RuleState, player: int) -> frozenset[int]:
    """Returns the ball that a player must touch first in nine ball: the lowest on the table (WPA 2)."""
    return frozenset(sorted(state.object_balls)[:1])


def red_to_open(state: RuleState, player: int) -> frozenset[int]:
    """Returns the balls that a player may touch first in carom: on the opening shot the red ball (1), then any."""
    return frozenset({1}) if state.break_shot else state.object_balls


def group_or_eight(state: RuleState, player: int) -> frozenset[int]:
    """Returns the balls that a player may touch first in eight ball (WPA 3.4).

    On the break these are all object balls. Afterwards they are the balls of the player's group, or of both groups
    while the table is open. If none of them is left, it is the eight ball.
    """
    if state.break_shot:
        return state.object_balls
    groups = state.object_balls - {8}
    if state.solids >= 0:
        groups = frozenset(ball for ball in groups if (ball < 8) == (player == state.solids))
    return groups or frozenset({8})


def standard_foul(facts: Facts, legal: frozenset[int]) -> str:
    """Returns the foul committed under WPA 6.1 to 6.3, or "".

    If the cue ball touches several balls at the same instant and one of them is legal, the legal one counts as touched
    first (WPA regulations, split hits).

    Args:
        facts: The facts of the shot.
        legal: The balls that may be touched first.

    Returns:
        One of `FOULS`; if there are several fouls, the first in the order of `FOULS`.
    """
    if CUE in facts.potted:
        return "scratch"
    if not facts.first:
        return "no_hit"
    if not legal & set(facts.first):
        return "wrong_ball"
    # A potted ball counts as driven to a cushion.
    return "" if facts.cushion_after else "no_cushion"


def straight(state: RuleState, facts: Facts) -> Verdict:
    """Judges a shot of straight pool, played with a single rack (WPA 4).

    Each potted ball scores a point, and the shooter continues after potting a ball. A scratch costs a point: the balls
    potted in that shot are spotted without scoring, and the next player has the cue ball in hand behind the head
    string. The game is over when a player reaches the target score or no object ball is left. In the latter case the
    highest score wins; a tie has no winner.

    Args:
        state: The state before the shot.
        facts: The facts of the shot.

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
    return Verdict(points=len(balls), continues=len(balls) > 0, over=cleared or reached, winner=winner)


def nine_ball(state: RuleState, facts: Facts) -> Verdict:
    """Judges a shot of nine ball (WPA 2).

    The lowest ball must be touched first, and the player who legally pots the nine ball wins. The shooter continues
    after potting any ball on a legal shot (WPA 2.5). After a foul the next player has the cue ball in hand anywhere. A
    nine ball potted with a foul is spotted; other balls remain potted (WPA 2.6, 2.7). A break that pots no ball and
    drives fewer than four balls to a cushion is a foul (WPA 2.3).

    Args:
        state: The state before the shot.
        facts: The facts of the shot.

    Returns:
        The verdict.
    """
    foul = standard_foul(facts, lowest_ball(state, state.player))
    if not foul and state.break_shot and not facts.potted and len(facts.driven) < 4:
        foul = "illegal_break"
    if foul:
        return Verdict(foul, in_hand="anywhere", spotted=(9,) if 9 in facts.potted else ())
    won = 9 in facts.potted
    return Verdict(continues=len(facts.potted) > 0, over=won, winner=state.player if won else -1)


def eight_ball(state: RuleState, facts: Facts) -> Verdict:
    """Judges a shot of eight ball (WPA 3), a game for two players.

    A player pots one group of balls, 1 to 7 or 9 to 15, and then the eight ball. The table is open until a shot after
    the break legally pots a ball. The group of the first ball potted in that shot becomes the shooter's group (WPA
    3.4). The shooter continues after legally potting a ball of that group (WPA 3.5). After a foul the next player has
    the cue ball in hand anywhere, and potted balls remain potted. A player who pots the eight ball with a foul, or
    before the last ball of the group, loses (WPA 3.8).

    On the break any ball may be touched first, and the shooter continues after potting any ball. An eight ball potted
    on the break is spotted. After a scratch, or a break that touches no ball, the next player has the cue ball in hand
    behind the head string (WPA 3.3).

    Args:
        state: The state before the shot.
        facts: The facts of the shot.

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
        # A break that drives too few balls to a cushion is not a foul; the balls are not racked again.
        return Verdict(continues=len(facts.potted) > 0, spotted=spotted)
    if eight:
        winner = other if foul or 8 not in legal else player
        return Verdict(foul, in_hand="anywhere" if foul else "no", solids=state.solids, over=True, winner=winner)
    if foul:
        return Verdict(foul, in_hand="anywhere", solids=state.solids)
    solids = state.solids
    if solids < 0 and facts.potted:
        solids = player if facts.potted[0] < 8 else other
    in_group = [ball for ball in facts.potted if (ball < 8) == (player == solids)]
    return Verdict(continues=len(in_group) > 0, solids=solids)


def carom(state: RuleState, facts: Facts, cushions: int = 0) -> Verdict:
    """Judges a shot of carom (UMB, art. 24 and 61).

    The shooter scores a point and continues if the cue ball touches both other balls. The opening shot must first touch
    the red ball, number 1. The game is over when a player reaches the target score.

    Args:
        state: The state before the shot.
        facts: The facts of the shot.
        cushions: The number of cushion contacts that the cue ball needs before it touches the second ball.

    Returns:
        The verdict.
    """
    scored = len(facts.touched) == 2 and facts.touched[1][1] >= cushions
    scored = scored and bool(red_to_open(state, state.player) & set(facts.first))
    won = scored and 0 < state.target <= state.scores[state.player] + 1
    return Verdict(points=int(scored), continues=scored, over=won, winner=state.player if won else -1)


def three_cushion(state: RuleState, facts: Facts) -> Verdict:
    """Judges a shot of three-cushion carom: `carom` with three cushion contacts before the second ball (UMB, art. 83).

    Args:
        state: The state before the shot.
        facts: The facts of the shot.

    Returns:
        The verdict.
    """
    return carom(state, facts, cushions=3)


class Rules(NamedTuple):
    """The rules of a game.

    Attributes:
        judge: Function `(state, facts)` that returns the verdict.
        legal: Function `(state, player)` that returns the balls that the player may touch first.
        pockets: Whether the table has pockets.
        n_object_balls: The smallest and the largest number of object balls; the largest is the default.
        n_players: The smallest and the largest number of players.
        cue_balls: The balls used as cue ball.
        target: The default score that wins, or 0 if no score does; None for a game that is not won by points.
    """

    judge: Callable[[RuleState, Facts], Verdict]
    legal: Callable[[RuleState, int], frozenset[int]]
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
