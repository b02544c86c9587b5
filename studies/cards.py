"""The cards of the published policies, which `studies.readme` writes as README.md beside each policy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from agents.config import load
from benchmarks import ROOT, table
from billiards_env.bench.frozen import FROZEN, NAMESPACE
from billiards_env.intervals import as_percent, over_seeds, wilson_interval
from studies import learning, read_results, self_play, timestep

_NUMBERS = "9 significant bits, for playing only: no training starts from them"
_LIMITS = "another table, radius of the balls, action or largest speed is refused"


def cards() -> dict[Path, str]:
    """Returns the text of each card by its path."""
    texts = {}
    for name, result in read_results(learning.OUTPUT).items():
        folder = learning.OUTPUT.parent / "policies" / name
        texts[folder / "README.md"] = _card(folder, name, *_of_row(result))
    folder, result = learning.OUTPUT.parent / "policies" / self_play.ROW, read_results(self_play.OUTPUT)
    texts[folder / "README.md"] = _card(folder, self_play.ROW, *_of_games(result))
    study = read_results(timestep.OUTPUT)
    for world in timestep.WORLDS:
        folder = timestep.policy_folder(timestep.OUTPUT, world)
        texts[folder / "README.md"] = _card(folder, f"timestep {world}", *_of_world(study, world))
    return texts


def _card(folder: Path, name: str, seconds: float, where: Mapping[str, str], successes: Mapping[str, str]) -> str:
    config = load(folder / "config.yaml")
    env, place = config.env, folder.relative_to(ROOT).as_posix()
    engine = "exact" if env["mode"] == "pic" else f"PIT with a timestep of 1/{1 / env['dt']:.0f} s"
    policy = "AimPolicy" if config.policy["head"] == "aim" else "MlpPolicy"
    if config.task is None:
        numbers = _NUMBERS
        task = f"Eight ball for {env['n_players']} players on `{env['scene']}`, with the noise of `planner:club`"
        command = f"python -m billiards_env match noisy:club:policy:{place}:16 planner:club --scene {env['scene']}"
    else:
        numbers = f"{_NUMBERS}. The successes are those before rounding"
        task = f"`{NAMESPACE}{config.task}`. {FROZEN[config.task].summary}"
        command = f"python -m billiards_env bench policy:{place} --tasks {config.task}"
    rows = [
        ("Task", task),
        ("Policy", f"`{policy}`, action `{env['action']}`, observes {', '.join(f'`{one}`' for one in env['observe'])}"),
        ("Training", f"{config.timesteps:,} shots in {seconds:.0f} s of processor time, seed {config.seed}"),
        ("Learner", f"`{config.learner}`, engine: {engine}"),
        *((what, text) for what, text in where.items()),
        *((f"Success in {what}", text) for what, text in successes.items()),
        ("Weights", numbers),
        ("Limits", _LIMITS),
        ("License", "MIT, as the package"),
    ]
    return f"# Policy `{name}`\n\n{table(('', ''), rows, left=2)}\n\n```sh\n{command}\n```\n"


def _of_row(result: Mapping[str, Any]) -> tuple[float, dict[str, str], dict[str, str]]:
    """Returns the seconds of the training of the published policy, its machine, and the successes by task."""
    first, successes = learning.runs(result)[0], {}
    for task, played in first["tasks"].items():
        rates = learning.mean_rates(result, task)
        interval, what = played["confidence_interval_95"], f"`{task}`"
        if task.startswith("SumToThree"):
            interval = [end / FROZEN[task].arguments["max_shots"] for end in played["score_interval_95"]]
            what += ", single shots"
        own = as_percent({"mean": rates[0], "interval": interval})
        successes[what] = f"{own} on {played['episodes']:,} new layouts; {_over(rates)}"
    return first["curve"][-1][1], _machine(first), successes


def _of_games(result: Mapping[str, Any]) -> tuple[float, dict[str, str], dict[str, str]]:
    """As `_of_row`, for the policy of `studies.self_play`."""
    shares = {
        f"games against `{self_play.MATCHES[name][1]}`, {name}": f"{self_play.share(games)} of {sum(games)} games"
        for name, games in result["matches"].items()
    }
    return result["curve"][-1][1], _machine(result), shares


def _machine(run: Mapping[str, Any]) -> dict[str, str]:
    versions = ", ".join(f"{name} {run['versions'][name]}" for name in ("python", "torch", "numba"))
    return {"Machine": f"{run['machine']['cpu']}; {versions}"}


def _of_world(study: Mapping[str, Any], world: str) -> tuple[float, dict[str, str], dict[str, str]]:
    """As `_of_row`, for a world of the timestep study."""
    runs, layouts, successes = list(study["runs"][world].values()), study["settings"]["layouts"], {}
    own_world = {} if world == "exact" else {"own": "its own world"}
    for key, what in ({"exact": "exact physics"} | own_world).items():
        count = runs[0][key]
        own = as_percent({"mean": count / layouts, "interval": wilson_interval(count, layouts)})
        successes[what] = f"{own} on {layouts:,} new layouts; {_over([run[key] / layouts for run in runs])}"
    return runs[0]["seconds"], {}, successes


def _over(rates: Sequence[float]) -> str:
    return f"mean of {len(rates)} seeds {as_percent(over_seeds(rates))}"
