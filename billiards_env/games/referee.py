"""The referee: judges arrays of shots of any game, and returns the states before the next shots.

No other code computes the next state: the tasks, the PettingZoo environment, the players and the window use
`judge_shots` or the kernels of `games.turn`. `judge_shots` does not use the positions of the balls.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.engine.measures import checked_measures
from billiards_env.games import bank_pool, blackball, carom, one_pocket, pool, snooker
from billiards_env.games.entry import Game
from billiards_env.games.facts import Records, driven_off, name_of, potted, return_type
from billiards_env.games.game_state import (
    BEHIND,
    BREAKING_FOUL,
    CALLS,
    MOST_BALLS,
    MOST_PLAYERS,
    NO_FOUL,
    NO_RERACK,
    NOT_IN_HAND,
    PUSH_OUT,
    RERACK_ALL,
    VERDICT,
    Called,
    RulesState,
    Verdict,
    check_indices,
    check_type,
    hints_of,
    row,
    set_of,
    write_verdict,
)
from billiards_env.jit import check_kernel, entry_point, inlined, kernels_of
from billiards_env.support.checks import (
    Range,
    add_entry,
    check_attributes,
    check_call,
    entry_of,
    one_of,
    result_of,
    sequence,
    short,
)

FAMILIES = pool, one_pocket, bank_pool, blackball, snooker, carom
"""The modules with the rules of the games."""

ARGUMENTS = {
    **dict.fromkeys(("target", "most_points", "state"), ("balls",)),
    **dict.fromkeys(("legal", "callable"), ("state", "player")),
    "check": ("state",),
    "judge": ("state", "facts", "call"),
    "scoring": ("shots", "k", "bits"),
    "see": ("table", "positions", "state", "facts", "call"),
    "spot": ("table", "positions", "balls", "others", "cue"),
    "rack": ("table", "positions", "others", "cue"),
    "settle": ("table", "positions", "state", "verdict"),
    "look": ("table", "positions", "state"),
    "without_shot": ("table", "positions", "state", "kind"),
    "replace": ("state", "before"),
}
"""The arguments of each function of a `Game`."""

_RANGES = {
    "n_object_balls": Range(1, MOST_BALLS - 1),
    "n_players": Range(2, MOST_PLAYERS),
    "cue_balls": Range(0, MOST_BALLS - 1),
    "deciding_ball": Range(-1, MOST_BALLS - 1),
    "cushions": Range(0, None),
}
"""The ranges of the numbers of a `Game`."""

_COUNTS = {name: len(arguments) for name, arguments in ARGUMENTS.items()}

GAMES: dict[str, Game] = {name: game for family in FAMILIES for name, game in family.GAMES.items()}
"""The games by name."""


def register_game(name: str, game: Game) -> None:
    """Adds a game of another package to `GAMES`. The errors are those of `checks.add_entry`.

    Raises:
        TypeError: Also if the judge is not a kernel, or the own state or the facts have other types than those that
            `Game` describes.
        ValueError: Also if the game lacks a fact that the referee uses, or a kernel uses a field that the state, the
            facts, the call or the verdict does not have.
    """
    if isinstance(game, Game):
        check_kernel(f"judge of game {name!r} = {short(game.judge)}", game.judge)
        for attribute in ("layouts", "cue_balls", "editions"):
            if getattr(game, attribute) == ():
                raise ValueError(f"{attribute} of game {name!r} = (): expected at least one")
        for attribute, names in (("choices", CALLS[PUSH_OUT:]), ("without_safety", game.editions)):
            for one in sequence(f"{attribute} of game {name!r}", getattr(game, attribute)):
                one_of(f"{attribute} of game {name!r}", one, names)
        checked_measures(game.measures)
    add_entry("game", name, game, dict(GAMES), Game, _RANGES, **_COUNTS)  # checks the types
    _check_state(f"state of game {name!r}", game)
    _check_facts(f"facts of game {name!r}", game)
    _check_kernels(name, game)
    GAMES[name] = game


def _check_state(what: str, game: Game) -> None:
    own = result_of(what, object, game.state, game.n_object_balls[1])
    if not hasattr(own, "_fields"):
        raise TypeError(f"{what} = {short(own)}: expected a function that returns a NamedTuple")
    for field, hint in hints_of(RulesState, type(own)).items():
        check_type(f"field {field!r} of the {what}", hint)


def _check_facts(what: str, game: Game) -> None:
    for fact in game.facts:
        check_call(f"{what} = {short(fact)}", fact, 3)
        check_type(f"{name_of(fact)!r} of the {what}", return_type(fact))
    for fact in (potted, driven_off, game.scoring):
        if fact not in game.facts:
            raise ValueError(f"{what} = {[*map(name_of, game.facts)]}: expected {name_of(fact)!r} among them")


def _check_kernels(name: str, game: Game) -> None:
    fields = {
        **dict.fromkeys(("state", "before"), game.state_names),
        "facts": tuple(map(name_of, game.facts)),
        "call": Called._fields,
        "verdict": Verdict._fields,
        "shots": Records._fields,
    }
    kernels = [(f"{attribute} of game {name!r}", getattr(game, attribute), attribute) for attribute in ARGUMENTS]
    kernels += [(f"fact {name_of(fact)!r} of game {name!r}", fact, "scoring") for fact in game.facts]
    for what, function, kind in kernels:
        if function is not None:
            check_attributes(what, function, *(fields.get(argument, ()) for argument in ARGUMENTS[kind]))


def judge_shots(
    game: str, states: NDArray[Any], facts: NDArray[Any], calls: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Judges m shots of one game: candidates from one position, or shots from different states.

    Args:
        game: One of `GAMES`.
        states: (m,) `Game.state_type`, the state before each shot.
        facts: (m,) `Game.facts_type`, the facts of each shot.
        calls: (m,) `CALL`, the call of each shot.

    Returns:
        (m,) `Game.state_type` before the next shots, and (m,) `VERDICT`.

    Raises:
        ValueError: If the game is unknown, the arrays have different lengths, or a player does not exist.

    Example:
        >>> from billiards_env.games import CALL, FOULS
        >>> game = GAMES["nine_ball"]
        >>> states, facts, calls = (np.zeros(3, kind) for kind in (game.state_type, game.facts_type, CALL))
        >>> states["n_players"], states["object_balls"], facts["first"] = 2, 1 << 4 | 1 << 9, [0, 1 << 4, 1 << 9]
        >>> states, verdicts = judge_shots("nine_ball", states, facts, calls)
        >>> [FOULS[foul] for foul in verdicts["foul"]], states["player"].tolist()
        (['no_hit', 'no_cushion', 'wrong_ball'], [1, 1, 1])
    """
    kernel = entry_of("game", game, GAMES).judge
    lengths = len(states), len(facts), len(calls)
    if len(set(lengths)) > 1:
        raise ValueError(f"states, facts and calls of lengths {lengths}: expected one length")
    check_indices(states)
    following, verdicts = states.copy(), np.zeros(len(states), VERDICT)
    with kernels_of(f"game = {game!r}"):
        _judge_shots(kernel, following, facts, calls, verdicts)
    return following, verdicts


def first_state(game: str, n_balls: int, **fields: Any) -> Any:
    """Returns the state at the opening of a game, a row of `Game.state_type`: player 0 breaks.

    In games with pockets the cue ball is in hand. `fields` are other fields of its state.
    """
    entry = entry_of("game", game, GAMES)
    first, second = entry.cue_balls[0], entry.cue_balls[-1]
    usual = RulesState(
        balls=set_of(range(1, n_balls)),
        object_balls=set_of(ball for ball in range(n_balls) if ball != first),
        cue_balls=(first, second),
        break_shot=True,
        in_hand=BEHIND if entry.pockets else NOT_IN_HAND,
    )
    return row({**usual._asdict(), **entry.state(n_balls - 1)._asdict(), **fields}, entry.state_type)


def legal_balls(game: str, states: NDArray[Any], players: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the balls that players may touch first.

    Args:
        game: One of `GAMES`.
        states: (m,) `Game.state_type`.
        players: (m,) the players.

    Returns:
        (m,) sets of balls.

    Raises:
        ValueError: If the game is unknown.
    """
    return _balls(game, entry_of("game", game, GAMES).legal, states, players)


def callable_balls(game: str, states: NDArray[Any], players: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the balls that players may call; the arguments are as in `legal_balls`.

    Raises:
        ValueError: If the game is unknown or has no called shots.
    """
    kernel = entry_of("game", game, GAMES).callable
    if kernel is None:
        raise ValueError(f"game = {game!r}: expected a game with called shots")
    return _balls(game, kernel, states, players)


@inlined
def judged(judge, state, facts, call):
    """Judges a shot and changes the state to the one before the next shot. A potted cue ball returns to the table.

    Args:
        judge: The kernel `Game.judge` of the game.
        state: A row of `Game.state_type`, which changes.
        facts: A row of `Game.facts_type`.
        call: A row of `CALL`, or `Called`.

    Returns:
        The `Verdict`.
    """
    state.in_hand, state.choices = NOT_IN_HAND, 0
    verdict = judge(state, facts, call)
    if state.break_shot:
        state.breaker = state.player
    state.idle = 0 if verdict.foul != NO_FOUL or verdict.points != 0 or facts.potted != 0 else state.idle + 1
    player, following = state.player, (state.player + 1) % state.n_players
    state.scores[player] += verdict.points | 0  # does not compile for a float, which NumPy would round
    state.scores[following] += verdict.penalty | 0
    # A breaking foul is not one of three consecutive fouls (WPA 4.11); the third one clears the count.
    fouled = verdict.foul != NO_FOUL and verdict.foul != BREAKING_FOUL and verdict.rack != RERACK_ALL
    state.fouls[player] = state.fouls[player] + 1 if fouled else 0
    state.object_balls = (state.object_balls & ~(facts.potted | facts.driven_off)) | verdict.spotted
    if verdict.rack != NO_RERACK:
        state.object_balls = state.balls
    state.break_shot = verdict.rack == RERACK_ALL
    if not verdict.continues:
        state.player = following
        struck, other = state.cue_balls[0], state.cue_balls[1]
        state.cue_balls[0], state.cue_balls[1] = other, struck
        state.object_balls = (state.object_balls | 1 << struck) & ~(1 << other)
    return verdict


@entry_point
def _judge_shots(judge, states, facts, calls, verdicts):  # out: states, verdicts
    for k in range(len(states)):
        write_verdict(judged(judge, states[k], facts[k], calls[k]), verdicts[k])


@entry_point
def _write_balls(kernel, states, players, balls):  # out: balls
    for k in range(len(states)):
        balls[k] = kernel(states[k], players[k])


def _balls(
    game: str, kernel: Callable[..., Any], states: NDArray[Any], players: NDArray[np.int64]
) -> NDArray[np.int64]:
    balls = np.empty(len(states), np.int64)
    with kernels_of(f"game = {game!r}"):
        _write_balls(kernel, states, players, balls)
    return balls
