"""The state of the rules between two shots, the call of a player, and the verdict on a shot."""

from __future__ import annotations

from typing import NamedTuple

from billiards_env.games.facts import CUE, Facts

IN_HAND = ("no", "behind", "anywhere")
"""Whether the cue ball is in hand (WPA 1.5): not in hand, behind the head string (in snooker in the D), or anywhere on
the table."""

FOULS = ("", "scratch", "no_hit", "wrong_ball", "wrong_pot", "no_cushion", "illegal_break", "breaking_foul")
"""The fouls; "" means no foul. "scratch" is a potted cue ball, "wrong_pot" a potted ball that is not on (snooker),
"breaking_foul" a bad opening break of straight pool."""

CALLS = ("shot", "safety", "push_out", "hand_back", "replace")
"""The kinds of calls.

* "shot": an ordinary shot.
* "safety": the turn passes after the shot, even if it pots a ball (WPA 3.6, 4.5).
* "push_out": the cue ball need not touch a ball or a cushion (WPA 2.4).
* "hand_back": no shot; the previous player plays the next one (WPA 2.4, WPBSA 3.11).
* "replace": no shot; the balls return to their positions before the foul, and the previous player plays again (WPBSA
  3.14).

`RuleState.choices` lists those of the last three that a player has.
"""


class Call(NamedTuple):
    """The announcement of a player before a shot (WPA 1.6).

    Attributes:
        ball: The called ball; in snooker the nominated colour or free ball. -1 for none.
        pocket: The called pocket; -1 for none.
        kind: One of `CALLS`.
    """

    ball: int = -1
    pocket: int = -1
    kind: str = "shot"


NO_CALL = Call()


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
        called: Whether a potted ball counts only if the ball and its pocket were called.
        reds: In snooker, the number of red balls of a full table: the balls 1 to `reds`.
        choices: The choices of the player besides a shot, of `CALLS`.
        fouls: The number of consecutive fouls of each player; empty counts as none.
        colour: In snooker, whether a colour of the player's choice is on.
        free_ball: In snooker, whether the player has a free ball.
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
    called: bool = False
    reds: int = 0
    choices: tuple[str, ...] = ()
    fouls: tuple[int, ...] = ()
    colour: bool = False
    free_ball: bool = False

    @property
    def object_balls(self) -> frozenset[int]:
        """The balls on the table except the one to be struck next."""
        return self.on_table - {self.cue_balls[0]}

    @property
    def consecutive_fouls(self) -> int:
        """The number of consecutive fouls of the player to shoot."""
        return self.fouls[self.player] if self.fouls else 0


class Verdict(NamedTuple):
    """The judgement of a shot.

    Attributes:
        foul: One of `FOULS`.
        points: Points for the shooter.
        continues: Whether the shooter also plays the next shot.
        in_hand: One of `IN_HAND`, for the next shot.
        spotted: The balls that return to the table, in this order.
        solids: As in `RuleState`, for the next shot.
        over: Whether the game is over.
        winner: The player who has won, or -1.
        penalty: Points for the next player.
        rack: "" for no new rack. "all": all object balls are racked and the next shot is a break. "rest": all object
            balls except the last one on the table are racked (WPA 4.4).
        choices: As in `RuleState`, for the next shot.
        colour: As in `RuleState`, for the next shot.
    """

    foul: str = ""
    points: int = 0
    continues: bool = False
    in_hand: str = "no"
    spotted: tuple[int, ...] = ()
    solids: int = -1
    over: bool = False
    winner: int = -1
    penalty: int = 0
    rack: str = ""
    choices: tuple[str, ...] = ()
    colour: bool = False


def next_state(state: RuleState, facts: Facts, verdict: Verdict) -> RuleState:
    """Returns the state for the next shot. A potted cue ball returns to the table.

    Args:
        state: The state before the shot.
        facts: The facts of the shot.
        verdict: The verdict on the shot.

    Returns:
        The state after the shot, without the balls of a new rack and without a free ball, see `game.play`.
    """
    scores, player = list(state.scores), state.player
    following = (player + 1) % len(scores)
    scores[player] += verdict.points
    scores[following] += verdict.penalty
    fouls = list(state.fouls or (0,) * len(scores))
    # A breaking foul is not one of three consecutive fouls (WPA 4.11); the third one clears the count.
    counts = verdict.foul not in ("", "breaking_foul") and verdict.rack != "all"
    fouls[player] = fouls[player] + 1 if counts else 0
    cue, *others = state.cue_balls
    return state._replace(
        player=player if verdict.continues else following,
        scores=tuple(scores),
        on_table=(state.on_table - set(facts.potted)) | set(verdict.spotted) | {cue},
        break_shot=verdict.rack == "all",
        in_hand=verdict.in_hand,
        cue_balls=state.cue_balls if verdict.continues else (*others, cue),
        solids=verdict.solids,
        over=verdict.over,
        winner=verdict.winner,
        choices=verdict.choices,
        fouls=tuple(fouls),
        colour=verdict.colour,
        free_ball=False,
    )


def handed_back(state: RuleState) -> RuleState:
    """Returns the state after the player has handed the next shot back to the previous player."""
    return state._replace(player=(state.player - 1) % len(state.scores), choices=(), free_ball=False)
