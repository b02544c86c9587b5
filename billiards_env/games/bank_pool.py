"""The rules of bank pool, a game for two players.

The numbers are those of the "Complete Bank Pool Rules" of OnePocket.org, a draft of 27 January 2006
(onepocket.org/BankPoolRules.htm), of which the rules 1 to 3.2 were available. The rules for fouls are those of a
secondary source, a copy of the rules of the Billiard Congress of America (mobsea.com/Rules-to-play-Bank-pool, 11).
`Game.left_out` lists the simplifications. The kernels have the arguments of `entry.Game`.
"""

from __future__ import annotations

from billiards_env.games.facts import USUAL, banked
from billiards_env.games.game_state import BEHIND, NO_FOUL, SCRATCH, SHOT, end, verdict
from billiards_env.games.one_pocket import FOULS_OF_PAGE, SHORT_GAME, end_of_rack, owed_balls, penalty_ball
from billiards_env.games.pool import any_ball, called_balls, standard_foul
from billiards_env.jit import inlined


@inlined
def bank_pool(state, facts, call):
    """Judges a shot of bank pool, a game to the target score.

    A bank scores a point, and the shooter continues (1, 3.2). A shot scores one point at most; all other potted balls
    are spotted. Balls that are potted on the break do not score, but the shooter continues (2.1).

    A foul costs a point, for which a ball is spotted. After a scratch the next player has the cue ball in hand behind
    the head string. A player without a point owes a ball: the score falls below 0, and as many of the next balls that
    score are spotted. The third consecutive foul loses (11).

    The target score wins. If no ball is left, the higher score wins; a tie has no winner. Without a target (0), the
    game ends in this way only.
    """
    player, foul = state.player, standard_foul(facts, state.object_balls)
    if foul == SCRATCH:
        state.in_hand = BEHIND
    if foul != NO_FOUL:
        if state.target > 0 and state.fouls[player] >= 2:
            end(state, 1 - player)
        return verdict(foul, -1, spotted=facts.potted | facts.driven_off | penalty_ball(state))
    if state.break_shot:
        return verdict(continues=facts.potted != 0 and call.kind == SHOT, spotted=facts.potted)
    counted = called_balls(state, facts.banked, call)
    counted &= -counted
    points, owed = 1 if counted != 0 else 0, owed_balls(counted, state.scores[player])
    spotted, score, other = (facts.potted & ~counted) | owed, state.scores[player] + points, state.scores[1 - player]
    if 0 < state.target <= score:
        end(state, player)
    else:
        end_of_rack(state, facts, spotted, score, other)
    return verdict(points=points, continues=counted != 0, spotted=spotted)


GAMES = {
    "bank_pool": SHORT_GAME(
        bank_pool,
        won_by="`target` points: balls that hit a cushion before the pot, by default a majority",
        callable=any_ball,
        editions=("2006",),
        scoring=banked,
        sources=("OnePocket.org, a draft of 27 January 2006, and a secondary source for fouls",),
        left_out=(
            ("1", "a potted ball is a bank if the cue ball touched it first, before a cushion, and it hit a cushion"),
            ("1", "contacts with other balls on the way are not checked; a touch of a jaw counts as a cushion"),
            ("2.1", "balls are spotted after each shot, and not at the end of the inning"),
            ("2.2, 2.3", "the break has no requirement"),
            ("3.1", "without `call_shot`, any bank counts; of two banks the ball with the lower number scores"),
            ("11", "the third foul in a row loses without a warning; a ball behind the head string may be hit first"),
        ),
        facts=(*USUAL, banked),
        page=(
            ("to win", "score the target with a point for each bank"),
            ("bank", "the cue ball first touches the ball, off no cushion; the ball hits a cushion before its pot"),
            ("other balls", "all other potted balls are spotted, also on the break"),
            ("turn", "a player continues after a bank, and after a pot on the break"),
            *FOULS_OF_PAGE,
        ),
    ),
}
