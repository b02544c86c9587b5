"""Matches of two players, and ratings of several: `billiards match planner:club search:200 --rules nine_ball`."""

from __future__ import annotations

import functools
import itertools
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_env.envs import BilliardsVectorEnv, make_vector_env
from billiards_env.envs.opponents import Policy
from billiards_env.intervals import success_rate
from billiards_env.players.env_player import acting_by_name
from billiards_env.support.checks import Range, integer, short
from billiards_env.support.files import read_text, refusing, write_json

BATCH = 20
"""The number of games that are played together, and after which the results are saved."""

AGAINST = " - "

Results = dict[str, list[int]]
"""The games won by the first player, by the second, and by none, by the names of the players with `AGAINST` between."""


def play_games(
    games: BilliardsVectorEnv, players: Sequence[Policy], seed: int, shot: Callable[[], object] = lambda: None
) -> NDArray[np.int64]:
    """Plays one game in each environment. The players break in turn.

    Args:
        games: Games of two players.
        players: The two players.
        seed: The seed of the racks.
        shot: A function that is called before each shot of all games.

    Returns:
        (num_envs,) the index of the winner in `players`, or -1.
    """
    count = games.num_envs
    observations, infos = games.reset(seed=seed)
    seats, over = np.arange(count) % 2, np.zeros(count, np.bool_)
    winners, turns = np.full(count, -1), infos["next_player"].copy()
    while not over.all():
        shot()
        actions, played = np.zeros(games.action_space.shape or ()), ~over
        for own, player in zip((turns == seats, turns != seats), players, strict=True):
            rows = np.flatnonzero(own & played)
            if len(rows):
                actions[rows] = player(observations[rows], rows)
        observations, _, over, _, infos = games.step_where(played, actions)
        winners[played], turns[played] = infos["winner"][played], infos["next_player"][played]
    return np.where(winners < 0, -1, winners ^ seats)


def play_pairs(
    names: Sequence[str],
    count: int,
    arguments: Mapping[str, Any],
    seed: int = 0,
    out: Path | None = None,
    progress: Callable[[str, int], object] = lambda pair, games: None,
) -> Results:
    """Plays games between each two of some players.

    Args:
        names: The players, see `players.named`.
        count: The number of games of each two.
        arguments: Arguments of `make_vector_env`.
        seed: The seed of the racks and of the players.
        out: A file of the results. If it exists, its games are not played again. None for none.
        progress: A function that is called with the two players and the number of their games so far.

    Raises:
        OSError: If a file or a run cannot be read or written.
        TypeError, ValueError: If an argument is invalid, or the file holds games with other arguments.
    """
    settings = {"arguments": dict(arguments), "seed": seed}
    results: Results = {} if out is None or not out.exists() else _read(out, settings)
    for name in names:  # a wrong name is an error before the first game
        acting_by_name(name, make_vector_env(1, **arguments))
    for pair in itertools.combinations(names, 2):
        text = AGAINST.join(pair)
        won = results.setdefault(text, [0, 0, 0])
        while (done := sum(won)) < count:
            games = make_vector_env(min(BATCH, count - done), **arguments)
            first = seed * count + done
            players = [acting_by_name(name, games, first + k) for k, name in enumerate(pair)]
            for winner in play_games(games, players, first, functools.partial(progress, text, done)).tolist():
                won[winner] += 1
            progress(text, sum(won))
            if out is not None:
                write_json(out, {"settings": settings, "results": results})
    return results


def _read(path: Path, settings: Mapping[str, Any]) -> Results:
    """Returns the results in a file. Raises a ValueError if it holds none, or those of other settings."""
    what = "the results of a match"
    text = read_text(path, 2**20, what)
    with refusing(path, what):
        saved, whole = json.loads(text)["settings"], Range(0, None)
        results = {
            pair: [integer(pair, number, whole) for number in (won, lost, none)]
            for pair, (won, lost, none) in json.loads(text)["results"].items()
        }
    if saved != settings:
        raise ValueError(f"out = {str(path)!r}: expected a match with {short(settings)}, not {short(saved)}")
    return results


def ratings(results: Results) -> dict[str, float]:
    """Returns the Elo ratings of the players, with a mean of 0, the best first.

    They are those of the model of Bradley and Terry (1952) with one more game of each two players that nobody wins, so
    that they are finite. The iteration is that of Hunter (2004), MM algorithms for generalized Bradley-Terry models.
    """
    names = list(dict.fromkeys(itertools.chain(*(pair.split(AGAINST) for pair in results))))
    wins = np.zeros((len(names), len(names)))
    for pair, (first, second, none) in results.items():
        a, b = map(names.index, pair.split(AGAINST))
        wins[a, b] += first + 0.5 * (none + 1)
        wins[b, a] += second + 0.5 * (none + 1)
    strength = np.ones(len(names))
    for _ in range(2000):
        strength = wins.sum(1) / ((wins + wins.T) / (strength[:, None] + strength)).sum(1)
        strength /= np.exp(np.log(strength).mean())
    elo = dict(zip(names, (400.0 * np.log10(strength)).tolist(), strict=True))
    return dict(sorted(elo.items(), key=lambda item: -item[1]))


def table(results: Results) -> Iterable[str]:
    """Yields the lines of a table of the matches and, with more than two players, of the ratings."""
    width = max(6, *(len(name) for pair in results for name in pair.split(AGAINST)))
    yield f"{'player':{width}}  {'against':{width}} {'games':>6} {'won':>5} {'lost':>5} {'none':>5}  share of won games"
    for pair, (won, lost, none) in results.items():
        first, second = pair.split(AGAINST)
        text = success_rate(won, won + lost) if won + lost else "-"
        yield f"{first:{width}}  {second:{width}} {won + lost + none:>6} {won:>5} {lost:>5} {none:>5}  {text}"
    if len(results) > 1:
        yield ""
        yield f"{'player':{width}} {'rating':>7}"
        for name, rating in ratings(results).items():
            yield f"{name:{width}} {rating:>+7.0f}"
