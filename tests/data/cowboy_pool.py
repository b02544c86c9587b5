"""Cowboy pool: points for pots and caroms, the last one by a called shot."""

from typing import NamedTuple

from billiards_env import register_game
from billiards_env.games.entry import Game
from billiards_env.games.facts import USUAL, touched
from billiards_env.games.game_state import BEHIND, NO_FOUL, SCRATCH, Count, end, verdict
from billiards_env.games.pool import any_ball, standard_foul
from billiards_env.jit import inlined


class Cowboy(NamedTuple):
    """The own state: the points of the inning, which a foul takes away."""

    inning_points: Count = 0


@inlined
def caroms(shots, k, bits) -> int:
    """The points for caroms: 1 if the cue ball touches two balls, 2 if it touches three."""
    return max(touched(shots, k, bits) - 1, 0)


@inlined
def cowboy(state, facts, call):
    """Ball 1 scores 1 point, ball 2 scores 3 and ball 3 scores 5. The shot with the last point pots the called ball."""
    foul, points, before = standard_foul(facts, state.object_balls), facts.caroms, state.inning_points
    if foul == SCRATCH:
        state.in_hand = BEHIND
    if foul != NO_FOUL:
        state.inning_points = 0
        return verdict(foul, -before, spotted=facts.potted | facts.driven_off)
    for ball in range(1, 4):
        points += 2 * ball - 1 if facts.potted >> ball & 1 else 0
    needed = state.target - state.scores[state.player]
    if points >= needed > 0 and call.made:
        end(state, state.player)
    elif points >= needed > 0:
        points = needed - 1
    state.inning_points = before + points if points > 0 else 0
    return verdict(points=points, continues=points > 0, spotted=facts.potted)


register_game(
    "cowboy",
    Game(
        cowboy,
        any_ball,
        scene="pool",
        layouts=("rack", "random"),
        n_object_balls=(3, 3),
        won_by="`target` points, the last one by a called shot",
        page=(("to win", "score the target with pots and caroms; pot a called ball for the last point"),),
        target=lambda balls: 101,
        callable=any_ball,
        state=lambda balls: Cowboy(),
        facts=(*USUAL, caroms),
    ),
)
