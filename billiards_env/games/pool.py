"""The rules of the pool games.

"WPA" is the World Pool-Billiard Association's The Rules of Play, effective 15 March 2016 (1 general, 2 nine ball, 3
eight ball, 4 continuous pool, 6 fouls, 8 definitions). The rules are simplified:

* In eight ball and straight pool, shots are called (WPA 1.6) only in a state with `called`. Otherwise any ball potted
  on a legal shot counts, in any pocket.
* There is no stalemate (1.12). A player who shoots from behind the head string may first touch a ball behind it (6.11).
* Players have no choice after a break (3.3, 4.3): the next player accepts the balls as they lie. An eight ball potted
  on the break is spotted.
* A ball frozen to a cushion counts as driven to it when it is hit into it. WPA 8.4 requires that it first leaves the
  cushion.
* Three consecutive fouls are penalised without a warning after the second one (6.14). In nine ball this needs two
  players, in straight pool a target.
"""

from __future__ import annotations

from billiards_env.games.facts import CUE, Facts
from billiards_env.games.state import NO_CALL, Call, RuleState, Verdict

BREAK_PENALTY, FOULS_PENALTY = 2, 15
"""Points for a breaking foul and for the third consecutive foul in straight pool (WPA 4.10, 4.11)."""


def any_ball(state: RuleState, player: int) -> frozenset[int]:
    """Returns the balls that a player may touch first in straight pool: every object ball."""
    return state.object_balls


def lowest_ball(state: RuleState, player: int) -> frozenset[int]:
    """Returns the ball that a player must touch first in nine ball: the lowest on the table (WPA 2)."""
    return frozenset(sorted(state.object_balls)[:1])


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


def counted_balls(state: RuleState, facts: Facts, call: Call, legal: frozenset[int]) -> tuple[int, ...]:
    """Returns the potted balls for which the shooter continues.

    Args:
        state: The state before the shot.
        facts: The facts of the shot.
        call: The call of the player.
        legal: The balls that may be called.

    Returns:
        The legal balls among the potted ones. In a state with `called` this is only the called ball, if it is in the
        called pocket and no safety was called (WPA 1.6).
    """
    balls = tuple(ball for ball in facts.potted if ball in legal)
    if not state.called:
        return balls
    made = call.kind == "shot" and (call.ball, call.pocket) in zip(facts.potted, facts.pockets, strict=True)
    return (call.ball,) if made and call.ball in balls else ()


def straight(state: RuleState, facts: Facts, call: Call = NO_CALL) -> Verdict:
    """Judges a shot of straight pool (WPA 4), a game to the target score.

    Each ball potted on a shot that pots the called ball scores a point, and the shooter continues (WPA 4.4, 4.7). Other
    potted balls are spotted (4.6). When one object ball is left, the others are racked again without the apex ball
    (4.4); when none is left, all are. A foul costs a point (4.9), and after a scratch the next player has the cue ball
    in hand behind the head string. A break that pots no counted ball must drive the cue ball and two object balls to a
    cushion, or it costs two points (4.3, 4.10). The third consecutive foul costs 15 further points, all balls are
    racked, and the same player breaks (4.11).

    Without a target (0), the game has a single rack: it is over when no object ball is left, and the highest score
    wins; a tie has no winner. There is then no penalty for three consecutive fouls.

    Args:
        state: The state before the shot.
        facts: The facts of the shot.
        call: The call of the player.

    Returns:
        The verdict.
    """
    balls = tuple(sorted(set(facts.potted) - {CUE}))
    counted = counted_balls(state, facts, call, state.object_balls)
    foul = standard_foul(facts, state.object_balls)
    if state.break_shot:
        driven = len(facts.driven) >= min(2, len(state.object_balls)) and facts.cue_driven
        if not driven and not counted:
            in_hand = "behind" if foul == "scratch" else "no"
            return Verdict("breaking_foul", points=-BREAK_PENALTY, in_hand=in_hand, spotted=balls)
    if foul:
        if state.target and state.consecutive_fouls == 2:
            return Verdict(foul, points=-1 - FOULS_PENALTY, continues=True, in_hand="behind", rack="all")
        return Verdict(foul, points=-1, in_hand="behind" if foul == "scratch" else "no", spotted=balls)
    if not counted:
        return Verdict(spotted=balls)
    scores = list(state.scores)
    scores[state.player] += len(balls)
    if state.target:
        won = scores[state.player] >= state.target
        rack = "rest" if len(state.object_balls) - len(balls) <= 1 and not won else ""
        return Verdict(points=len(balls), continues=True, over=won, winner=state.player if won else -1, rack=rack)
    cleared, best = state.object_balls == set(balls), max(scores)
    leader = scores.index(best) if cleared and scores.count(best) == 1 else -1
    return Verdict(points=len(balls), continues=True, over=cleared, winner=leader)


def nine_ball(state: RuleState, facts: Facts, call: Call = NO_CALL) -> Verdict:
    """Judges a shot of nine ball (WPA 2).

    The lowest ball must be touched first, and the player who legally pots the nine ball wins. The shooter continues
    after potting any ball on a legal shot (WPA 2.5). After a foul the next player has the cue ball in hand anywhere. A
    nine ball potted with a foul or a push out is spotted; other balls remain potted (WPA 2.6, 2.7). A break that pots
    no ball and drives fewer than four balls to a cushion is a foul (WPA 2.3). After a legal break the next shot may be
    a push out: it need not touch a ball or a cushion, the turn passes, and the next player may hand the shot back (WPA
    2.4). With two players, the third consecutive foul loses (WPA 2.8, 6.14).

    Args:
        state: The state before the shot.
        facts: The facts of the shot.
        call: The call of the player.

    Returns:
        The verdict.
    """
    nine = (9,) if 9 in facts.potted else ()
    foul = standard_foul(facts, lowest_ball(state, state.player))
    if call.kind == "push_out" and foul != "scratch":
        return Verdict(spotted=nine, choices=("hand_back",))
    if not foul and state.break_shot and not facts.potted and len(facts.driven) < 4:
        foul = "illegal_break"
    if foul:
        lost = state.consecutive_fouls == 2 and len(state.scores) == 2
        return Verdict(foul, in_hand="anywhere", spotted=nine, over=lost, winner=1 - state.player if lost else -1)
    choices = ("push_out",) if state.break_shot and not nine else ()
    winner = state.player if nine else -1
    return Verdict(continues=len(facts.potted) > 0, over=len(nine) > 0, winner=winner, choices=choices)


def eight_ball(state: RuleState, facts: Facts, call: Call = NO_CALL) -> Verdict:
    """Judges a shot of eight ball (WPA 3), a game for two players.

    A player pots one group of balls, 1 to 7 or 9 to 15, and then the eight ball. The table is open until a shot after
    the break legally pots a counted ball. Its group becomes the shooter's group (WPA 3.4). The shooter continues after
    legally potting a counted ball of that group (WPA 3.5). In a state with `called`, only the called ball in the called
    pocket counts, and after a safety the turn passes (WPA 3.6). After a foul the next player has the cue ball in hand
    anywhere, and potted balls remain potted. A player who pots the eight ball with a foul, before the last ball of the
    group, or in a pocket that was not called, loses (WPA 3.8).

    On the break any ball may be touched first, nothing is called, and the shooter continues after potting any ball. An
    eight ball potted on the break is spotted. After a scratch, or a break that touches no ball, the next player has the
    cue ball in hand behind the head string (WPA 3.3).

    Args:
        state: The state before the shot.
        facts: The facts of the shot.
        call: The call of the player.

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
    counted = counted_balls(state, facts, call, legal)
    if eight:
        winner = player if not foul and 8 in counted else other
        return Verdict(foul, in_hand="anywhere" if foul else "no", solids=state.solids, over=True, winner=winner)
    if foul:
        return Verdict(foul, in_hand="anywhere", solids=state.solids)
    solids = state.solids
    if solids < 0 and counted:
        solids = player if counted[0] < 8 else other
    return Verdict(continues=len(counted) > 0, solids=solids)
