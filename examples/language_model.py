"""A language model, or any other function from text to text, plays a frozen task: `python examples/language_model.py`.

`respond` is a rule of a few lines, so the program needs no network and no key. Put a call of a language model in its
place. The actions are plans: an answer names a ball, a pocket and a speed, and geometry makes the shot of them.
"""

import argparse
import re
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

from billiards_env.bench.evaluation import evaluation_seeds, measure, play_episodes, row_printer
from billiards_env.bench.frozen import FROZEN
from billiards_env.shots.noise import EXECUTION_NOISE

POCKETS = "ABCDEF"
SPEEDS = 5
FORM = "ball 3, pocket B, speed 2 of 5"


def respond(text: str) -> str:
    """Returns the plan with the smallest cut angle among the legal balls. A language model takes the place of this."""
    number = r"(-?[\d.]+)"
    points = {name: np.array([x, y], float) for name, x, y in re.findall(rf"^(.+): {number}, {number}", text, re.M)}
    cue, best = points["cue ball"], (-2.0, "")
    for ball in re.findall(r"^(ball \d+):.*, legal$", text, re.M):
        for name in (name for name in points if name.startswith("pocket")):
            first, second = points[ball] - cue, points[name] - points[ball]
            cosine = first @ second / max(np.linalg.norm(first) * np.linalg.norm(second), 1e-9)
            best = max(best, (cosine, f"{ball}, {name}, speed 3 of 5"))
    return best[1]


def legal_balls(env) -> list[int]:
    """Returns the numbers of the balls on the table that the cue ball may touch first."""
    balls = np.flatnonzero(~env.potted)[1:]
    return [int(ball) for ball in balls if not len(env.legal_balls) or env.legal_balls[ball]]


def describe(env, summary: str, shots_left: int) -> str:
    """Returns a table as text. A diamond is an eighth of its length; the origin is pocket A."""
    table, legal = env.scene.table, legal_balls(env)

    def line(name: str, x: float, y: float, note: str = "") -> str:
        return f"{name}: {8 * (x / table.length + 0.5):.2f}, {4 * (y / table.width + 0.5):.2f}{note}"

    lines = [f"{summary} Shots left: {shots_left}.", "Coordinates x, y in diamonds: x from 0 to 8, y from 0 to 4."]
    lines += [line(f"pocket {name}", p.x, p.y) for name, p in zip(POCKETS, table.pockets, strict=True)]
    for ball in np.flatnonzero(~env.potted).tolist():
        note = "" if ball == 0 else ", legal" if ball in legal else ", not legal"
        lines.append(line(f"ball {ball}" if ball else "cue ball", *env.positions[ball].tolist(), note=note))
    lines.append("The cue ball may touch legal balls first. If the pot is not possible, it hits the nearest one full.")
    return "\n".join([*lines, f"Speed 1 is the slowest, and 5 the fastest. Answer with one line such as: {FORM}"])


def parse(answer: str, legal: list[int]) -> int:
    """Returns the action of an answer: `FORM`, or the numbers of the ball, the pocket and the speed.

    Raises:
        ValueError: If the answer is no plan, or has an unknown or illegal name.
    """
    named = re.search(r"ball\s*(\d+)\W+pocket\s*(\w+)\W+speed\s*(\d+)", answer, re.I)
    found = named or re.fullmatch(r"\s*(\d+)\W+(\d+)\W+(\d+)\s*", answer)
    if found is None:
        raise ValueError(f"answer = {answer!r}: expected a line such as: {FORM}")
    ball, pocket, speed = int(found[1]), found[2].upper(), int(found[3])
    pocket = POCKETS[int(pocket) - 1] if pocket in map(str, range(1, len(POCKETS) + 1)) else pocket
    if ball not in legal:
        raise ValueError(f"ball = {ball}: expected one of the legal balls {', '.join(map(str, legal))}")
    if pocket not in tuple(POCKETS):
        raise ValueError(f"pocket = {found[2]}: expected one of {', '.join(POCKETS)}")
    if not 1 <= speed <= SPEEDS:
        raise ValueError(f"speed = {speed}: expected a number from 1 to {SPEEDS}")
    return ((ball - 1) * len(POCKETS) + POCKETS.index(pocket)) * SPEEDS + speed - 1


def choose(model: Callable[[str], str], text: str, legal: list[int]) -> int:
    """Returns the action of a model. After an error it answers once more; then it plays the first legal ball."""
    asked = text
    for _ in range(2):
        answer = model(asked)
        try:
            return parse(answer, legal)
        except ValueError as error:
            asked = f"{text}\n\nYour answer: {answer}\nError: {error}\nAnswer again:"
    return parse(f"{legal[0]} 1 1", legal)


def run(task: str, episodes: int, model: Callable[[str], str] = respond, players: tuple[str, ...] = ()):
    """Prints and returns the mean scores of the model and of players on the same layouts, by name."""
    frozen, scores = FROZEN[task], {}
    noise = dict(EXECUTION_NOISE) if frozen.noise else None
    env: Any = gym.make("Billiards-v0", **{**frozen.arguments, "noise": noise, "action": "plan"}).unwrapped

    def act(observation) -> Any:
        text = describe(env, frozen.summary, int(env.get_state()["shots_left"]))
        return choose(model, text, legal_balls(env))

    def results():
        yield "text model", play_episodes(env, act, evaluation_seeds(0, episodes))
        for name in players:
            yield name, measure(name, frozen.arguments, frozen.execution_noise, episodes, 0)

    show = row_printer(("text model", *players))
    for name, result in results():
        show(name, result)
        scores[name] = result["mean_score"]
    return scores


if __name__ == "__main__":
    kinds = ("pot", "clear", "nine_ball", "eight_ball")
    parser = argparse.ArgumentParser(description="Compares a function from text to text with other players.")
    tasks = [name for name, frozen in FROZEN.items() if frozen.arguments["task"] in kinds]
    parser.add_argument("--task", choices=tasks, default="Pot3-v0")
    parser.add_argument("--episodes", type=int, default=20)
    options = parser.parse_args()
    run(options.task, options.episodes, players=("random", "geometric", "planner:300"))
