"""The rules of the pool games.

"WPA" is the World Pool-Billiard Association's The Rules of Play, effective 15 March 2016 (1 general, 2 nine ball, 3
eight ball, 4 continuous pool, 6 fouls, 8 definitions). The rules are simplified:

* In eight ball and straight pool, shots are called (WPA 1.6) only in a state with `call_shot`. Otherwise any ball
  potted on a legal shot counts, in any pocket.
* There is no stalemate (1.12). A player who shoots from behind the head string may first touch a ball behind it (6.11).
* Players have no choice after a break (3.3, 4.3): the next player accepts the balls as they lie. An eight ball potted
  on the break is spotted.
* A ball frozen to a cushion counts as driven to it when it is hit into it. WPA 8.4 requires that it first leaves the
  cushion.
* Three consecutive fouls are penalised without a warning after the second one (6.14). In nine ball this needs two
  players, in straight pool a target.

The kernels have the arguments of `rules.games.Game`: `legal` is the set of balls that may be touched first.
"""

from __future__ import annotations

from billiards_env.jit import inlined
from billiards_env.rules.arrays import (
    ANYWHERE,
    BEHIND,
    BREAKING_FOUL,
    HAND_BACK,
    ILLEGAL_BREAK,
    NO_CUSHION,
    NO_FOUL,
    NO_HIT,
    NO_RERACK,
    NOT_IN_HAND,
    PUSH_OUT,
    RERACK_ALL,
    RERACK_REST,
    SCRATCH,
    SHOT,
    WRONG_BALL,
    game_over,
    next_shot,
    size,
    verdict,
)

BREAK_PENALTY, FOULS_PENALTY = 2, 15
"""Points for a breaking foul and for the third consecutive foul in straight pool (WPA 4.10, 4.11)."""

SOLIDS, EIGHT, STRIPES = sum(1 << i for i in range(1, 8)), 1 << 8, sum(1 << i for i in range(9, 16))
NINE = 1 << 9


@inlined
def any_ball(state, player):
    """Returns every object ball on the table."""
    return state.object_balls


@inlined
def lowest_ball(state, player):
    """Returns the lowest ball on the table, as a set."""
    return state.object_balls & -state.object_balls


@inlined
def group_or_eight(state, player):
    """Returns the balls that a player may touch first in eight ball (WPA 3.4).

    On the break these are all object balls. Afterwards they are the balls of the player's group, or of both groups
    while the table is open. If none of them is left, it is the eight ball.
    """
    if state.break_shot:
        return state.object_balls
    group = SOLIDS | STRIPES
    if state.solids >= 0:
        group = SOLIDS if player == state.solids else STRIPES
    return group_left(state.object_balls, group)


@inlined
def group_left(object_balls, group):
    """Returns the balls of a group that are on the table, or the eight ball if none is left (WPA 3)."""
    left = object_balls & group
    return left if left != 0 else EIGHT


@inlined
def standard_foul(facts, legal):
    """Returns the foul committed under WPA 6.1 to 6.3, the first in the order of `FOULS` if there are several.

    If the cue ball touches several balls at the same instant and one of them is legal, the legal one counts as touched
    first (WPA regulations, split hits).
    """
    if facts.scratch:
        return SCRATCH
    if facts.first == 0:
        return NO_HIT
    if facts.first & legal == 0:
        return WRONG_BALL
    return NO_FOUL if facts.cushion_after else NO_CUSHION  # a potted ball counts as driven to a cushion


@inlined
def counted_balls(state, legal, facts, call):
    """Returns the potted balls for which the shooter continues: the legal ones.

    In a state with `call_shot` this is only the called ball, if it is in the called pocket and no safety was called
    (WPA 1.6).
    """
    balls = facts.potted & legal
    if not state.call_shot:
        return balls
    return balls & (1 << call.ball) if call.kind == SHOT and call.made else 0


@inlined
def straight(state, legal, facts, call):
    """Judges a shot of straight pool (WPA 4), a game to the target score.

    Each ball potted on a shot that pots the called ball scores a point, and the shooter continues (WPA 4.4, 4.7). Other
    potted balls are spotted (4.6). When one object ball is left, the others are racked again without the apex ball
    (4.4); when none is left, all are. A foul costs a point (4.9), and after a scratch the next player has the cue ball
    in hand behind the head string. A break that pots no counted ball must drive the cue ball and two object balls to a
    cushion, or it costs two points (4.3, 4.10). The third consecutive foul costs 15 further points, all balls are
    racked, and the same player breaks (4.11).

    Without a target (0), the game has a single rack: it is over when no object ball is left, and the highest score
    wins; a tie has no winner. There is then no penalty for three consecutive fouls.
    """
    balls, points = facts.potted, size(facts.potted)
    counted, foul = counted_balls(state, legal, facts, call), standard_foul(facts, legal)
    following = next_shot(BEHIND if foul == SCRATCH else NOT_IN_HAND)
    if state.break_shot and counted == 0:
        needed = min(2, size(state.object_balls))
        if size(facts.driven) < needed or not facts.cue_driven:
            return verdict(BREAKING_FOUL, -BREAK_PENALTY, spotted=balls, next_shot=following)
    if foul != NO_FOUL:
        if state.target > 0 and state.fouls == 2:
            following = next_shot(BEHIND, rack=RERACK_ALL)
            return verdict(foul, -1 - FOULS_PENALTY, continues=True, next_shot=following)
        return verdict(foul, -1, spotted=balls, next_shot=following)
    if counted == 0:
        return verdict(spotted=balls)
    scored = verdict(points=points, continues=True)
    if state.target == 0:
        return game_over(scored, leader(state, points)) if balls == state.object_balls else scored
    if state.scores[state.player] + points >= state.target:
        return game_over(scored, state.player)
    rack = RERACK_REST if size(state.object_balls) - points <= 1 else NO_RERACK
    return verdict(points=points, continues=True, next_shot=next_shot(rack=rack))


@inlined
def leader(state, points):
    """Returns the player with the highest score after `points` for the shooter, -1 after a tie."""
    best, found = 0, -1
    for player in range(state.n_players):
        score = state.scores[player] + (points if player == state.player else 0)
        if player == 0 or score > best:
            best, found = score, player
        elif score == best:
            found = -1
    return found


@inlined
def nine_ball(state, legal, facts, call):
    """Judges a shot of nine ball (WPA 2).

    The lowest ball must be touched first, and the player who legally pots the nine ball wins. The shooter continues
    after potting any ball on a legal shot (WPA 2.5). After a foul the next player has the cue ball in hand anywhere. A
    nine ball potted with a foul or a push out is spotted; other balls remain potted (WPA 2.6, 2.7). A break that pots
    no ball and drives fewer than four balls to a cushion is a foul (WPA 2.3). After a legal break the next shot may be
    a push out: it need not touch a ball or a cushion, the turn passes, and the next player may make the same player
    shoot again (WPA 2.4). With two players, the third consecutive foul loses (WPA 2.8, 6.14).
    """
    nine, foul = facts.potted & NINE, standard_foul(facts, legal)
    if call.kind == PUSH_OUT and foul != SCRATCH:
        return verdict(spotted=nine, next_shot=next_shot(choices=1 << HAND_BACK))
    if foul == NO_FOUL and state.break_shot and facts.potted == 0 and size(facts.driven) < 4:
        foul = ILLEGAL_BREAK
    if foul != NO_FOUL:
        fouled = verdict(foul, spotted=nine, next_shot=next_shot(ANYWHERE))
        return game_over(fouled, 1 - state.player) if state.fouls == 2 and state.n_players == 2 else fouled
    if nine != 0:
        return game_over(verdict(continues=True), state.player)
    choices = 1 << PUSH_OUT if state.break_shot else 0
    return verdict(continues=facts.potted != 0, next_shot=next_shot(choices=choices))


@inlined
def eight_ball(state, legal, facts, call):
    """Judges a shot of eight ball (WPA 3), a game for two players.

    A player pots one group of balls, 1 to 7 or 9 to 15, and then the eight ball. The table is open until a shot after
    the break legally pots a counted ball. Its group becomes the shooter's group (WPA 3.4). The shooter continues after
    legally potting a counted ball of that group (WPA 3.5). In a state with `call_shot`, only the called ball in the
    called pocket counts, and after a safety the turn passes (WPA 3.6). After a foul the next player has the cue ball in
    hand anywhere, and potted balls remain potted. A player who pots the eight ball with a foul, before the last ball of
    the group, or in a pocket that was not called, loses (WPA 3.8).

    On the break any ball may be touched first, nothing is called, and the shooter continues after potting any ball. An
    eight ball potted on the break is spotted. After a scratch, or a break that touches no ball, the next player has the
    cue ball in hand behind the head string (WPA 3.3).
    """
    player, other, solids = state.player, 1 - state.player, state.solids
    eight, foul = facts.potted & EIGHT, standard_foul(facts, legal)
    if state.break_shot:
        if foul in (SCRATCH, NO_HIT):
            return verdict(foul, spotted=eight, next_shot=next_shot(BEHIND))
        # A break that drives too few balls to a cushion is not a foul; the balls are not racked again.
        return verdict(continues=facts.potted != 0, spotted=eight)
    counted = counted_balls(state, legal, facts, call)
    following = next_shot(NOT_IN_HAND if foul == NO_FOUL else ANYWHERE, solids=solids)
    if eight != 0:
        return game_over(verdict(foul, next_shot=following), player if foul == NO_FOUL and counted & EIGHT else other)
    if foul != NO_FOUL:
        return verdict(foul, next_shot=following)
    if solids < 0 and counted != 0:
        solids = player if chosen_group(facts, counted) == SOLIDS else other
    return verdict(continues=counted != 0, next_shot=next_shot(solids=solids))


@inlined
def chosen_group(facts, counted):
    """Returns the group that a shot on an open table chooses: that of the counted ball that was potted first.

    If the order is not known and balls of both groups were potted, it is the group of the ball that was touched first.
    """
    if counted & STRIPES == 0 or counted & SOLIDS == 0:
        return SOLIDS if counted & SOLIDS != 0 else STRIPES
    decisive = facts.first_potted if facts.first_potted != 0 else facts.first
    return SOLIDS if decisive & SOLIDS != 0 else STRIPES
