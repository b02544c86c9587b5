"""The tables of the documentation that need no measurement, such as those of games, scenes and features."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from benchmarks import metres, table
from billiards_env import Engine, Scene, simulate_batch, strike
from billiards_env.engine.overlaps import TREATMENTS
from billiards_env.engine.shots import Shots
from billiards_env.envs.actions import ACTIONS
from billiards_env.envs.episode_arrays import EpisodeArrays, TaskNumbers
from billiards_env.envs.observations import FEATURES
from billiards_env.games import GAMES
from billiards_env.games.facts import jumped
from billiards_env.games.game_state import Called, RulesState, Verdict
from billiards_env.games.referee import FAMILIES
from billiards_env.scene import NAMED, PARAMETERS, SCENES, Physics
from billiards_env.support.checks import RANGES


def blocks(_: Mapping[str, Any]) -> dict[str, str]:
    """Returns the tables by name. They need no measurement."""
    rules = "\n\n".join(f"::: {family.__name__}" for family in FAMILIES)
    made = (games, sources, left_out, judged, scenes, physics, fixes, actions, features, bounces)
    return {"rules": rules, **{function.__name__: function() for function in made}}


def games() -> str:
    """Returns the table of the games."""
    rows = []
    for name, game in GAMES.items():
        calls = [*(["ball and pocket, safety"] if game.callable else []), *(c.replace("_", " ") for c in game.choices)]
        numbers = (" to ".join(map(str, dict.fromkeys(pair))) for pair in (game.n_players, game.n_object_balls))
        jumps = "foul" if jumped in game.facts else "allowed"
        rows.append((f"`{name}`", ", ".join(game.editions), *numbers, game.won_by, ", ".join(calls) or "-", jumps))
    columns = "`rules`", "Edition", "Players", "Object balls", "Won by", "Calls and choices", "Jump shots"
    return table(columns, rows, left=7)


def sources() -> str:
    """Returns the table of the editions of the games and their sources."""
    rows = {name: zip(game.editions, game.sources, strict=True) for name, game in GAMES.items()}
    return _by_row(("Games", "Edition", "Source"), rows)


def left_out() -> str:
    """Returns the table of what the rules of the games leave out or simplify."""
    return _by_row(("Games", "Rule", "In this package"), {name: game.left_out for name, game in GAMES.items()})


def _by_row(columns: tuple[str, ...], rows: Mapping[str, Iterable[tuple[str, str]]]) -> str:
    """Returns a table of the rows of games, by name. Games that share a row are in one line."""
    games_of: dict[tuple[str, str], list[str]] = {}
    for name, of_game in rows.items():
        for row in of_game:
            games_of.setdefault(row, []).append(f"`{name}`")
    return table(columns, [(", ".join(names), *row) for row, names in games_of.items()], left=3)


def physics() -> str:
    """Returns the table of the numbers of `Physics`, whose docstring has their meanings."""
    rows, defaults, meanings = [], Physics(), meanings_of(Physics)
    for name, parameter in PARAMETERS.items():
        within = RANGES[parameter.within]
        values = f"`{getattr(defaults, name)}`", f"{within.least:g} to {within.most:g} {within.unit}".strip()
        rows.append((f"`physics.{name}`", *values, meanings[name], parameter.source))
    return table(("Field", "Default", "Range", "Meaning", "Source"), rows, left=5)


def meanings_of(kind: type) -> dict[str, str]:
    """Returns the meanings of the attributes of a class, from its docstring."""
    described = re.split(r"\n    (\w+): ", (inspect.getdoc(kind) or "").partition("Attributes:")[2])
    return {name: " ".join(text.split()) for name, text in zip(described[1::2], described[2::2], strict=True)}


def judged() -> str:
    """Returns the table of what the kernels of tasks and games read and return."""
    facts = {fact.__name__: inspect.getdoc(fact) or "" for game in GAMES.values() for fact in game.facts}
    of_shots, rows = meanings_of(Shots), []
    for argument, meanings in (
        ("facts", facts),
        ("state", meanings_of(RulesState)),
        ("call", meanings_of(Called)),
        ("verdict", meanings_of(Verdict)),
        ("numbers", meanings_of(TaskNumbers)),
        ("arrays", meanings_of(EpisodeArrays)),
    ):
        for name, text in meanings.items():
            shown = of_shots[name].replace(" out:", ":") if text.startswith("As in") else text
            rows.append((f"`{argument}.{name}`", " ".join(shown.split())))
    return table(("Field", "Meaning"), rows, left=2)


def scenes() -> str:
    """Returns the table of the named scenes of the package."""
    named = ((name, NAMED[name]) for name in SCENES)
    rows = [(f'`"{name}"`', f"{scene.usual} (up to {scene.most})", scene.summary) for name, scene in named]
    return table(("Scene", "Object balls", "Description"), rows, left=3)


def fixes() -> str:
    """Returns the table of the treatments of overlaps. Only those that do not move balls back play flights."""
    rows = [(f'`"{name}"`', fix.summary, "" if fix.goes_back else "yes") for name, fix in TREATMENTS.items()]
    return table(("`fix`", "Effect", "Plays flights"), rows, left=3)


def actions() -> str:
    """Returns the table of the actions."""
    rows = [(f"`{k}`", "()" if k == "plan" else f"({action.size})", action.summary) for k, action in ACTIONS.items()]
    return table(("Action", "Shape", "Meaning"), rows)


def features() -> str:
    """Returns the table of the features of observations."""
    rows = []
    for name, feature in FEATURES.items():
        least, *others = np.atleast_1d(feature.low)
        values = f"{least:g} to {255 if feature.is_image else 1}" + (f", {others[0]:g} to 1" if others else "")
        shape = f"({', '.join(map(str, feature.shape))})"
        rows.append((f"`{name}`", shape, values, feature.summary, feature.needs))
    return table(("Feature", "Shape", "Values", "Meaning", "Needs"), rows, left=5)


def bounces() -> str:
    """Returns the table of the errors of PIT in jump shots. They do not depend on the speed of the machine."""
    scene, m = Scene.named("jump_pool"), 64
    places, k = np.tile([[-0.6, 0.0], [-0.3, 0.05]], (m, 1, 1)), np.arange(m)
    shots = strike(scene, 1.5 + k / 32, 0.1 * (k % 8), elevation=np.radians(10 + 5 * (k // 8)))
    exact, early = (simulate_batch(scene, places, shots, max_time=time) for time in (None, 0.25))
    rows = []
    for steps in (60, 240, 960, 3840, 15360):
        engine = Engine("pit", 1 / steps)
        pit, start = (simulate_batch(scene, places, shots, engine=engine, max_time=time) for time in (None, 0.25))
        errors = [np.hypot(*(a.positions - b.positions)[:, 0].T) for a, b in ((start, early), (pit, exact))]
        other = (pit.potted != exact.potted).any(axis=1) | (pit.first_hit != exact.first_hit)
        rows.append((f"1/{steps} s", *(metres(float(np.median(error))) for error in errors), f"{other.mean():.0%}"))
    return table(("timestep", "error after 0.25 s", "error at the end", "another outcome"), rows)
