"""The rules of the pool games.

"WPA" is the World Pool-Billiard Association's The Rules of Play, effective 15 March 2016 (1 general, 2 nine ball, 3
eight ball, 4 continuous pool, 6 fouls, 8 definitions, 9 ten ball). The edition "2025" has the rules effective 15
September 2025 ("WPA 2025": 1 general, 2 definitions, 3 fouls, 4 eight ball, 5 nine ball, 6 ten ball, 7 continuous
pool). Their text was not available. The sources are secondary: a program's specification that paraphrases them rule by
rule (github.com/SchaeferDesigns/RawBreak, `Docs/specs/rules.md`), and a list of the changes (columbiacueclub.com).
What changes:

* Nine ball: the 9 is racked on the foot spot, and not the 1 (WPA 2.2, WPA 2025 5.2).
* Eight ball: on an open table the eight ball may be touched first, and wins, once a group is potted (WPA 2025
  4.4).
* Ten ball has no safety call (WPA 9.6, WPA 2025 6.5).

`Game.left_out` of the entries lists the simplifications. The kernels have the arguments of `entry.Game`.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

from billiards_env.games.entry import Game, no_target
from billiards_env.games.facts import USUAL, cue_driven, driven, first_potted
from billiards_env.games.game_state import (
    ANYWHERE,
    BEHIND,
    BREAK_AGAIN,
    BREAKING_FOUL,
    DRIVEN_OFF,
    HAND_BACK,
    ILLEGAL_BREAK,
    NO_CUSHION,
    NO_FOUL,
    NO_HIT,
    PUSH_OUT,
    RERACK,
    RERACK_ALL,
    RERACK_REST,
    SCRATCH,
    SHOT,
    WRONG_BALL,
    PlayerOrNone,
    end,
    size,
    verdict,
)
from billiards_env.games.placement import offer_new_rack, rack_again, rack_and_break
from billiards_env.jit import inlined

BREAK_PENALTY, FOULS_PENALTY = 2, 15
"""Points for a breaking foul and for the third consecutive foul in straight pool (WPA 4.10, 4.11)."""

EDITIONS = ("2016", "2025")
IN_2025 = EDITIONS.index("2025")
"""`RulesState.edition` of the rules of 2025."""

SOLIDS, EIGHT, STRIPES = sum(1 << i for i in range(1, 8)), 1 << 8, sum(1 << i for i in range(9, 16))
NINE, TEN = 1 << 9, 1 << 10


class Groups(NamedTuple):
    """The own state of eight ball.

    Attributes:
        solids: The player who has the balls 1 to 7; -1 while the table is open.
    """

    solids: PlayerOrNone = -1


def groups_of(balls: int) -> Groups:
    """Returns the own state of eight ball at the opening, as `Game.state`."""
    return Groups()


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
    while the table is open. If none of them is left, it is the eight ball. In 2025 an open table without the balls of a
    group adds the eight ball (WPA 2025 4.4).
    """
    if state.break_shot:
        return state.object_balls
    left = state.object_balls & group_of(state, player)
    if state.edition == IN_2025 and (left & SOLIDS == 0 or left & STRIPES == 0) and state.solids < 0:
        return left | EIGHT
    return left if left != 0 else EIGHT


@inlined
def group_of(state, player):
    """Returns the group of a player of eight ball; both groups while the table is open."""
    if state.solids < 0:
        return SOLIDS | STRIPES
    return SOLIDS if player == state.solids else STRIPES


@inlined
def standard_foul(facts, legal):
    """Returns the foul committed under WPA 6.1 to 6.3 and 6.5, the first in the order of `FOULS` if there are several.

    If the cue ball touches several balls at the same instant and one of them is legal, the legal one counts as touched
    first (WPA regulations, split hits).
    """
    if facts.scratch or facts.cue_off:
        return SCRATCH
    if facts.first == 0:
        return NO_HIT
    if facts.first & legal == 0:
        return WRONG_BALL
    if facts.driven_off != 0:
        return DRIVEN_OFF  # such a ball, and a potted one, count as driven to a cushion
    return NO_FOUL if facts.cushion_after else NO_CUSHION


@inlined
def called_balls(state, balls, call):
    """Returns the potted balls of `balls` for which the shooter continues.

    In a state with `call_shot` this is only the called ball, if it is in the called pocket and no safety was called
    (WPA 1.6).
    """
    if not state.call_shot:
        return balls
    return balls & (1 << call.ball) if call.kind == SHOT and call.made else 0


@inlined
def straight(state, facts, call):
    """Judges a shot of straight pool (WPA 4), a game to the target score.

    Each ball potted on a shot that pots the called ball scores a point, and the shooter continues (WPA 4.4, 4.7). Other
    potted balls are spotted (4.6). When one object ball is left, the others are racked again without the apex ball
    (4.4); when none is left, all are. A foul costs a point (4.9), and after a scratch the next player has the cue ball
    in hand behind the head string. A break that pots no counted ball must drive the cue ball and two object balls to a
    cushion, or it costs two points (4.3, 4.10), and the next player may have the same player break again. The third
    consecutive foul costs 15 further points, all balls are racked, and the same player breaks (4.11).

    Without a target (0), the game has a single rack: it is over when no object ball is left, and the highest score
    wins; a tie has no winner. There is then no penalty for three consecutive fouls.
    """
    balls, points, player = facts.potted | facts.driven_off, size(facts.potted), state.player
    counted, foul = called_balls(state, balls, call), standard_foul(facts, state.object_balls)
    if foul == SCRATCH:
        state.in_hand = BEHIND
    if state.break_shot and counted == 0:
        needed = min(2, size(state.object_balls))
        if size(facts.driven) < needed or not facts.cue_driven:
            state.choices = 1 << BREAK_AGAIN
            return verdict(BREAKING_FOUL, -BREAK_PENALTY, spotted=balls)
    if foul != NO_FOUL:
        if state.target > 0 and state.fouls[player] >= 2:
            state.in_hand = BEHIND
            return verdict(foul, -1 - FOULS_PENALTY, continues=True, rack=RERACK_ALL)
        return verdict(foul, -1, spotted=balls)
    if counted == 0:
        return verdict(spotted=balls)
    if state.target == 0:
        if balls == state.object_balls:
            end(state, leader(state, points))
    elif state.scores[player] + points >= state.target:
        end(state, player)
    elif size(state.object_balls) - points <= 1:
        return verdict(points=points, continues=True, rack=RERACK_REST)
    return verdict(points=points, continues=True)


@inlined
def leader(state, points):
    """Returns the player with the highest score after `points` for the shooter, -1 after a tie."""
    best, leading = 0, -1
    for player in range(state.n_players):
        score = state.scores[player] + (points if player == state.player else 0)
        if player == 0 or score > best:
            best, leading = score, player
        elif score == best:
            leading = -1
    return leading


@inlined
def nine_ball(state, facts, call):
    """Judges a shot of nine ball (WPA 2), see `rotation`.

    The player who legally pots the nine ball wins, also on the break. The shooter continues after potting any ball on a
    legal shot (WPA 2.5). A nine ball potted with a foul or a push out is spotted; other balls remain potted (WPA 2.6,
    2.7).
    """
    return rotation(state, facts, call, NINE, facts.potted, facts.potted & NINE != 0)


@inlined
def ten_ball(state, facts, call):
    """Judges a shot of ten ball (WPA 9), see `rotation`.

    The player who legally pots the ten ball as the last ball wins. The shooter continues after potting the called ball,
    or on the break any ball; other balls potted with it remain potted (WPA 9.5, 9.8). If other balls are potted without
    it, also on a safety, the next player may make the same player shoot again (WPA 9.6, 9.7). A ten ball that does not
    win is spotted, also on the break (WPA 9.9).
    """
    called = state.call_shot and not state.break_shot
    counted = called_balls(state, facts.potted, call) if called else facts.potted
    judged = rotation(state, facts, call, TEN, counted, counted & TEN != 0 and state.object_balls == TEN)
    if judged.foul == NO_FOUL and counted == 0 and facts.potted != 0:
        state.choices |= 1 << HAND_BACK
    return judged


@inlined
def rotation(state, facts, call, last, counted, wins):
    """Judges a shot of a game in which the lowest ball must be touched first and the ball `last` wins.

    After a foul the next player has the cue ball in hand anywhere. A break that pots no ball and drives fewer than four
    balls to a cushion is a foul (WPA 2.3, 9.3). After a legal break the next shot may be a push out: it need not touch
    a ball or a cushion, the turn passes, and the next player may make the same player shoot again (WPA 2.4, 9.4). The
    other fouls still count.
    With two players, the third consecutive foul loses (WPA 2.8, 6.14, 9.11).

    Args:
        state: As in `entry.Game.judge`, like the next two.
        facts: See there.
        call: See there.
        last: The ball that wins, as a set. It is spotted if it does not win.
        counted: The potted balls for which the shooter continues.
        wins: Whether the shot wins if it is legal.
    """
    spotted, foul = (facts.potted | facts.driven_off) & last, standard_foul(facts, lowest_ball(state, state.player))
    if call.kind == PUSH_OUT and foul != SCRATCH:
        foul = DRIVEN_OFF if facts.driven_off != 0 else NO_FOUL
        if foul == NO_FOUL:
            state.choices = 1 << HAND_BACK
            return verdict(spotted=spotted)
    if foul == NO_FOUL and state.break_shot and facts.potted == 0 and size(facts.driven) < 4:
        foul = ILLEGAL_BREAK
    if foul != NO_FOUL:
        state.in_hand = ANYWHERE
        if state.fouls[state.player] >= 2 and state.n_players == 2:
            end(state, 1 - state.player)
        return verdict(foul, spotted=spotted)
    if wins:
        end(state, state.player)
        return verdict(continues=True)
    if state.break_shot:
        state.choices = 1 << PUSH_OUT
    return verdict(continues=counted != 0, spotted=spotted)


@inlined
def eight_ball(state, facts, call):
    """Judges a shot of eight ball (WPA 3), a game for two players.

    A player pots one group of balls, 1 to 7 or 9 to 15, and then the eight ball. The table is open until a shot after
    the break legally pots a counted ball. Its group becomes the shooter's group (WPA 3.4). The shooter continues after
    legally potting a counted ball of that group (WPA 3.5). In a state with `call_shot`, only the called ball in the
    called pocket counts, and after a safety the turn passes (WPA 3.6). After a foul the next player has the cue ball in
    hand anywhere, and potted balls remain potted. A player who pots the eight ball with a foul, before the last ball of
    the group, or in a pocket that was not called, loses (WPA 3.8).

    On the break any ball may be touched first, nothing is called, and the shooter continues after potting any ball. An
    eight ball potted on the break is spotted. After a scratch, or a break that touches no ball, the next player has the
    cue ball in hand behind the head string. After a break that pots no ball and drives fewer than four balls to a
    cushion, the next player may have the balls racked again, and breaks or has the same player break (WPA 3.3 d). The
    next to shoot after an eight ball potted on the break may have them racked again, and breaks (3.3 e, f).
    """
    player, legal = state.player, group_or_eight(state, state.player)
    eight, foul = (facts.potted | facts.driven_off) & EIGHT, standard_foul(facts, legal)
    if state.break_shot:
        if facts.potted & EIGHT != 0:
            state.choices = 1 << RERACK
        elif facts.potted == 0 and size(facts.driven) < 4:
            state.choices = 1 << RERACK | 1 << BREAK_AGAIN
        if foul in (SCRATCH, NO_HIT, DRIVEN_OFF):
            state.in_hand = BEHIND
            return verdict(foul, spotted=eight)
        return verdict(continues=facts.potted != 0, spotted=eight)
    counted = called_balls(state, facts.potted & legal, call)
    if foul != NO_FOUL:
        state.in_hand = ANYWHERE
    if eight != 0:
        end(state, player if foul == NO_FOUL and counted & EIGHT else 1 - player)
        return verdict(foul)
    if foul != NO_FOUL:
        return verdict(foul)
    if state.solids < 0 and counted != 0:
        state.solids = player if chosen_group(facts, counted) == SOLIDS else 1 - player
    return verdict(continues=counted != 0)


@inlined
def rack_eight_ball(table, positions, state, kind):
    """Racks the balls after a call for a new rack, as `Game.without_shot`. The table is open."""
    rack_and_break(table, positions, state, kind)
    state.solids = -1


@inlined
def chosen_group(facts, counted):
    """Returns the group that a shot on an open table chooses: that of the counted ball that was potted first."""
    both = counted & SOLIDS != 0 and counted & STRIPES != 0
    decisive = facts.first_potted if both else counted
    return SOLIDS if decisive & SOLIDS != 0 else STRIPES


_FOUL = ("foul", "cue ball potted, no ball or a wrong ball hit first, no cushion hit afterwards")
_TURN = ("turn", "a player continues after a legal pot")
_AFTER = ("after a foul", "cue ball anywhere; with two players, three fouls in a row lose")
_BREAK = ("break", "pot a ball, or drive four balls to a cushion")
_BEHIND = ("6.11", "a player who shoots from behind the head string may first touch a ball behind it")
_FROZEN = ("8.4", "a ball frozen to a cushion counts as driven to it if it is hit into it, without leaving it first")
_STALEMATE = ("1.12", "a player calls a stalemate, after six turns of each player without a pot, a point or a foul")
_CALLED = ("1.6", "without `call_shot`, any ball potted on a legal shot counts, in any pocket")
_LEFT_OUT = _BEHIND, _FROZEN, _STALEMATE
_FOULS = ("6.14", "the third foul in a row loses without a warning, but only in a game of two players")
_POOL = functools.partial(
    Game,
    scene="pool",
    layouts=("rack", "tight_rack", "random"),
    editions=EDITIONS,
    sources=(
        "World Pool-Billiard Association (WPA), effective 15 March 2016",
        "WPA, effective 15 September 2025; secondary sources, see `pool`",
    ),
    look=offer_new_rack,
    without_shot=rack_and_break,
    facts=(*USUAL, driven),
)
_ROTATION = functools.partial(
    _POOL, legal=lowest_ball, choices=("push_out", "hand_back", "stalemate"), counts_fouls=True
)
GAMES = {
    "straight": _POOL(
        straight,
        any_ball,
        n_object_balls=(1, 15),
        won_by="`target` points, or without a target most points in one rack",
        target=no_target,
        callable=any_ball,
        choices=("break_again", "stalemate"),
        counts_fouls=True,
        facts=(*USUAL, driven, cue_driven),
        rack=rack_again,
        left_out=(
            *_LEFT_OUT,
            _CALLED,
            ("4.3", "if the next player makes no choice, the breaker does not break again"),
            ("4.4", "without a target the game is one rack"),
            ("4.11", "the third foul in a row costs points without a warning, but only in a game with a target"),
            ("4.12", "no lag after a stalemate: the player who broke breaks again"),
        ),
        page=(
            ("to win", "score the target with a point for each ball; without one, most points in a rack"),
            ("break", "pot a ball, or drive the cue ball and two others to a cushion; else 2 points are lost"),
            _TURN,
            _FOUL,
            ("after a foul", "1 point is lost; after a potted cue ball it is in hand behind the line"),
            ("with a target", "14 balls are racked again; three fouls in a row lose 15 points more"),
        ),
    ),
    "eight_ball": _POOL(
        eight_ball,
        group_or_eight,
        n_object_balls=(15, 15),
        won_by="potting one group of balls, then the eight ball",
        n_players=(2, 2),
        callable=group_or_eight,
        choices=("rerack", "break_again", "stalemate"),
        deciding_ball=8,
        state=groups_of,
        facts=(*USUAL, driven, first_potted),
        without_shot=rack_eight_ball,
        left_out=(
            *_LEFT_OUT,
            _CALLED,
            ("3.3", "if no choice is made, there is no new rack, and an eight ball potted on the break is spotted"),
            ("3.3 h", "after a break that hits no ball the cue ball is in hand, and cannot stay where it lies"),
        ),
        page=(
            ("to win", "pot all balls of your group, then the 8"),
            ("groups", "solids 1 to 7, stripes 9 to 15, or reds and yellows; the first pot after the break decides"),
            _TURN,
            _FOUL,
            ("after a foul", "cue ball anywhere; after a foul on the break behind the line"),
            ("to lose", "pot the 8 too early or on a foul; on the break it is spotted"),
        ),
    ),
    "nine_ball": _ROTATION(
        nine_ball,
        n_object_balls=(9, 9),
        won_by="potting the nine ball",
        deciding_ball=9,
        left_out=(*_LEFT_OUT, _FOULS, ("2025, regulation 16", "no three-ball rule for the break")),
        page=(
            ("to win", "pot the 9 on a legal shot; any ball may be potted"),
            ("on", "the lowest ball must be touched first"),
            _BREAK,
            _TURN,
            _FOUL,
            _AFTER,
        ),
    ),
    "ten_ball": _ROTATION(
        ten_ball,
        n_object_balls=(10, 10),
        won_by="potting the ten ball as the last ball",
        callable=any_ball,
        without_safety=("2025",),
        deciding_ball=10,
        left_out=(*_LEFT_OUT, _CALLED, _FOULS),
        page=(
            ("to win", "pot the 10 as the last ball; before that, and on the break, it is spotted"),
            ("on", "the lowest ball must be touched first; any ball may be potted"),
            _BREAK,
            _TURN,
            _FOUL,
            _AFTER,
        ),
    ),
}
