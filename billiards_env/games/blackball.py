"""The rules of blackball, a game for two players with the balls of UK pool.

The numbers are those of the "World Pool Association Blackball Rules 2005". The sources are the definitions at the
beginning of this text (vdocuments.us) and secondary ones: the visual guide of Blackball International
(blackballinternational.org/blackball-pool-rules/visual-guide), and for the numbers a program whose tests cite them. The
balls 1 to 7 and 9 to 15 are the two groups, and the 8 is black. `Game.left_out` lists the
simplifications. The kernels have the arguments of `entry.Game`.
"""

from __future__ import annotations

from typing import NamedTuple

from billiards_env.games.entry import Game
from billiards_env.games.facts import USUAL, driven
from billiards_env.games.game_state import BEHIND, ILLEGAL_BREAK, NO_FOUL, WRONG_POT, PlayerOrNone, end, size, verdict
from billiards_env.games.pool import EIGHT, SOLIDS, STRIPES, group_of, group_or_eight, standard_foul
from billiards_env.jit import inlined


class Blackball(NamedTuple):
    """The own state of blackball.

    Attributes:
        solids: The player who has the balls 1 to 7; -1 while the table is open.
        free_ball: Whether the player has a free shot.
    """

    solids: PlayerOrNone = -1
    free_ball: bool = False


@inlined
def settle(table, positions, state, verdict):
    """Gives the next player a free shot after a foul, as `Game.settle` (6a)."""
    state.free_ball = verdict.foul != NO_FOUL and not state.over


@inlined
def balls_on(state, player):
    """Returns the balls that a player may touch first: any ball in a free shot (6b), else as in eight ball."""
    if state.free_ball and player == state.player:
        return state.object_balls
    return group_or_eight(state, player)


@inlined
def blackball(state, facts, call):
    """Judges a shot of blackball.

    A player pots one group, and then the black ball. The table is open until a shot, which is neither the break nor a
    free shot, pots balls of one group alone: this is then the group of the shooter (4e, 4f). The shooter continues
    after potting a ball of the group, also together with balls of the other group; on an open table after potting any
    ball. To pot only balls of the other group is a foul.

    After a foul the next player has a free shot and then the visit (6a). In the free shot any ball may be touched first
    and potted (6b), and the shooter continues with the visit, whether the shot pots a ball or not. After a scratch the
    cue ball is in hand behind the baulk line. Potted balls remain potted.

    A player who pots the black ball with a foul, or before the last ball of the group, loses (7b).
    """
    player, free, group = state.player, state.free_ball, group_of(state, state.player)
    foul, own = standard_foul(facts, balls_on(state, player)), facts.potted & group
    black, state.free_ball = (facts.potted | facts.driven_off) & EIGHT, False
    if facts.scratch or facts.cue_off:
        state.in_hand = BEHIND
    if state.break_shot:
        if facts.potted & EIGHT != 0:
            return verdict(continues=True, spotted=EIGHT | facts.driven_off)
        if foul == NO_FOUL and facts.potted == 0 and size(facts.driven) < 2:
            foul = ILLEGAL_BREAK
        return verdict(foul, continues=foul == NO_FOUL and facts.potted != 0, spotted=facts.driven_off)
    if black != 0:
        cleared = state.object_balls & group == 0
        end(state, player if foul == NO_FOUL and cleared else 1 - player)
        return verdict(foul)
    if foul == NO_FOUL and facts.potted != 0 and own == 0 and not free:
        foul = WRONG_POT
    if foul != NO_FOUL:
        return verdict(foul, spotted=facts.driven_off)
    if state.solids < 0 and own != 0 and not free:
        if own & STRIPES == 0:
            state.solids = player
        elif own & SOLIDS == 0:
            state.solids = 1 - player
    return verdict(continues=own != 0 or free)


GAMES = {
    "blackball": Game(
        blackball,
        balls_on,
        scene="uk_pool",
        layouts=("eight_ball", "random"),
        n_object_balls=(15, 15),
        won_by="potting one group of balls, then the black ball",
        n_players=(2, 2),
        editions=("2005",),
        deciding_ball=8,
        state=lambda balls: Blackball(),
        facts=(*USUAL, driven),
        settle=settle,
        sources=("WPA Blackball Rules 2005; in parts secondary sources",),
        left_out=(
            ("4b", "a break without a pot must drive two balls to a cushion, not over the middle line; no new rack"),
            ("4d", "a black potted on the break is spotted, and the same player continues, without a new break"),
            ("5g", "a snookered player also has to pot a ball or to drive one to a cushion"),
            ("6c", "after a foul the cue ball stays where it lies, except after a scratch"),
            ("7b", "a black potted together with the last ball of the group loses"),
            ("-", "no rules for touching balls, jump shots, stalemate and deliberate fouls"),
        ),
        page=(
            ("to win", "pot all balls of your group, then the black"),
            ("groups", "reds and yellows; a shot that pots balls of one group decides, but no break and no free shot"),
            ("turn", "a player continues after potting a ball of the group"),
            ("foul", "white potted, no ball or a wrong ball hit first, no cushion hit afterwards, wrong ball potted"),
            ("after a foul", "a free shot at any ball, then the usual visit; a potted white is behind the line"),
            ("break", "pot a ball, or drive two balls to a cushion; the black is spotted"),
            ("to lose", "pot the black too early or on a foul"),
        ),
    ),
}
