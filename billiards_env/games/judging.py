"""Single shots of games as Python objects: the state of the rules, the facts of a shot, the call and the verdict.

`RULES[name].judge(state, facts, call)` judges a shot: `facts_of` computes the facts from its recorded events, `judge`
returns a `Verdict`, and `next_state(state, facts, verdict)` returns the state for the next shot. The rules are those of
`billiards_env.rules`, which judges arrays of shots.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_env.physics.state import CUE_BALL
from billiards_env.rules import (
    CALL,
    CALLS,
    FACTS,
    FOULS,
    GAMES,
    IN_HAND,
    RERACKS,
    STATE,
    callable_balls,
    judge_shots,
    legal_balls,
)
from billiards_env.rules.arrays import MOST_PLAYERS, CallNumbers, FactNumbers, StateNumbers
from billiards_env.rules.games import Game


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
        on_table: The balls on the table, including the cue balls; a cue ball in hand counts.
        break_shot: Whether the next shot is the opening break.
        in_hand: One of `IN_HAND`.
        cue_balls: The balls used as cue ball; the first is struck next.
        solids: In eight ball, the player who has the balls 1 to 7; -1 while the table is open.
        target: The score that wins, or 0 if no score does.
        over: Whether the game is over.
        winner: The player who has won, or -1.
        call_shot: Whether shots are called: a potted ball counts only if the ball and its pocket were called (WPA 1.6).
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
    cue_balls: tuple[int, ...] = (CUE_BALL,)
    solids: int = -1
    target: int = 0
    over: bool = False
    winner: int = -1
    call_shot: bool = False
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


class Facts(NamedTuple):
    """The facts of a shot that the rules use.

    Attributes:
        first: The balls that the cue ball touched first: none, one, or several touched at the same instant.
        touched: The balls that the cue ball touched, in order, each with the number of cushion contacts that the cue
            ball had before.
        potted: The potted balls, in order.
        cushion_after: Whether any ball hit a cushion or was potted after the cue ball's first contact with a ball.
        driven: The object balls that hit a cushion or were potted (WPA 8.4).
        pockets: The pockets of the potted balls, in the same order.
        cue_driven: Whether the cue ball hit a cushion or was potted (WPA 8.4).
    """

    first: tuple[int, ...] = ()
    touched: tuple[tuple[int, int], ...] = ()
    potted: tuple[int, ...] = ()
    cushion_after: bool = False
    driven: frozenset[int] = frozenset()
    pockets: tuple[int, ...] = ()
    cue_driven: bool = False


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


def facts_of(events: NDArray[Any], cue: int = CUE_BALL) -> Facts:
    """Returns the facts of a recorded shot of the ball `cue` from its `ShotResult.events`."""
    first: list[int] = []
    first_time = None
    touched: dict[int, int] = {}
    potted: dict[int, int] = {}
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
                potted[ball] = other
    return Facts(
        tuple(first),
        tuple(touched.items()),
        tuple(potted),
        cushion_after,
        frozenset(driven),
        tuple(potted.values()),
        cushions > 0 or cue in potted,
    )


def next_state(state: RuleState, facts: Facts, verdict: Verdict) -> RuleState:
    """Returns the state after a shot. A potted cue ball returns to the table.

    `game.play` adds the balls of a new rack and a free ball.
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
    """Returns the state after the player to shoot has made the previous player shoot again."""
    return state._replace(player=(state.player - 1) % len(state.scores), choices=(), free_ball=False)


def ball_set(balls: Iterable[int]) -> int:
    """Returns balls as a bit mask."""
    return sum(1 << ball for ball in set(balls))


def balls_of(mask: int) -> tuple[int, ...]:
    """Returns the balls of a bit mask, in order."""
    return tuple(ball for ball in range(mask.bit_length()) if mask >> ball & 1)


def state_array(states: Iterable[RuleState]) -> NDArray[Any]:
    """Returns states as an array of `rules.STATE`."""
    rows = [
        StateNumbers(
            player=state.player,
            n_players=len(state.scores),
            scores=(*state.scores, *(0,) * (MOST_PLAYERS - len(state.scores))),  # pyright: ignore[reportArgumentType]
            object_balls=ball_set(state.object_balls),
            break_shot=state.break_shot,
            solids=state.solids,
            target=state.target,
            call_shot=state.call_shot,
            reds=state.reds,
            fouls=state.consecutive_fouls,
            colour=state.colour,
            free_ball=state.free_ball,
        )
        for state in states
    ]
    return np.array(rows, STATE)


def fact_array(facts: Iterable[Facts]) -> NDArray[Any]:
    """Returns facts as an array of `rules.FACTS`."""
    rows = [
        FactNumbers(
            first=ball_set(shot.first),
            touched=len(shot.touched),
            cushions_before_last=shot.touched[-1][1] if shot.touched else 0,
            potted=ball_set(shot.potted) & ~ball_set({CUE_BALL}),
            first_potted=ball_set([ball for ball in shot.potted if ball != CUE_BALL][:1]),
            scratch=CUE_BALL in shot.potted,
            cushion_after=shot.cushion_after,
            driven=ball_set(shot.driven),
            cue_driven=shot.cue_driven,
        )
        for shot in facts
    ]
    return np.array(rows, FACTS)


def call_array(calls: Iterable[Call], facts: Iterable[Facts]) -> NDArray[Any]:
    """Returns the calls of shots with known facts as an array of `rules.CALL`."""
    rows = [
        CallNumbers(
            ball=call.ball,
            kind=CALLS.index(call.kind),
            made=(call.ball, call.pocket) in zip(shot.potted, shot.pockets, strict=True),
        )
        for call, shot in zip(calls, facts, strict=True)
    ]
    return np.array(rows, CALL)


def verdict_of(row: Any, highest_first: bool = False) -> Verdict:
    """Returns the verdict of a row of `rules.VERDICT`, with the order in which balls are spotted."""
    fields = dict(zip(row.dtype.names, row.item(), strict=True))
    spotted = balls_of(fields["spotted"])
    return Verdict(
        **fields
        | {
            "foul": FOULS[fields["foul"]],
            "in_hand": IN_HAND[fields["in_hand"]],
            "spotted": spotted[::-1] if highest_first else spotted,
            "rack": RERACKS[fields["rack"]],
            "choices": tuple(CALLS[i] for i in balls_of(fields["choices"])),
        }
    )


class Rules(Game):
    """The rules of a game for single shots; `rules.games.Game` describes the attributes."""

    def judge(self, state: RuleState, facts: Facts, call: Call = NO_CALL) -> Verdict:
        """Returns the verdict on a shot."""
        verdicts = judge_shots(self.name, state_array([state]), fact_array([facts]), call_array([call], [facts]))
        return verdict_of(verdicts[0], highest_first=self.has_spots)

    def legal(self, state: RuleState, player: int) -> frozenset[int]:
        """Returns the balls that a player may touch first."""
        return frozenset(balls_of(int(legal_balls(self.name, state_array([state]), np.array([player]))[0])))

    def callable(self, state: RuleState, player: int) -> frozenset[int]:
        """Returns the balls that a player may call."""
        return frozenset(balls_of(int(callable_balls(self.name, state_array([state]), np.array([player]))[0])))


RULES = {name: Rules(*game) for name, game in GAMES.items()}
