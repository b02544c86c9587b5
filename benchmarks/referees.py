"""Games judged by a second referee, written from the texts of the rules alone: `python -m benchmarks.referees`.

`billiards_env.games` and the referees of this file judge random games. The referees share no code with the games: they
read the events of a shot, its call and the positions of the balls. After each turn the command compares both records.
The first difference ends a game. The texts are those that `docs/games.md` cites, with the simplifications that it
lists.
"""

from __future__ import annotations

import collections
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks import rows_table, run_command
from billiards_env.commands import Job
from billiards_env.games import GAMES, Call, Setup, Stroke, choices, opening, play, to_dict
from billiards_env.games.game_state import NO_SHOT
from billiards_env.games.placement import cue_ball_point
from billiards_env.games.playing import GameState, PlayedShot
from billiards_env.scene import Scene

MOST_TURNS = 50
"""The number of turns after which a game ends without a result."""

SOLIDS, STRIPES = set(range(1, 8)), set(range(9, 16))


class Seen(NamedTuple):
    """What a referee at the table sees of a shot.

    Attributes:
        call: The call.
        hits: The balls that the cue ball touches, in order, each with the number of cushions that it hit before.
        pots: The potted object balls, with their pockets.
        driven: The balls that touch a cushion or are potted after the first contact (WPA 8.4).
        scratch: Whether the cue ball is potted.
        after: The positions of the balls before the next shot, m.
    """

    call: Call
    hits: dict[int, int]
    pots: dict[int, int]
    driven: set[int]
    scratch: bool
    after: NDArray[np.float64]

    @property
    def first(self) -> int:
        """The first ball that the cue ball touches, or -1."""
        return next(iter(self.hits), -1)

    @property
    def made(self) -> bool:
        """Whether the called ball is in the called pocket."""
        return self.call.kind == "shot" and self.pots.get(self.call.ball, -2) == self.call.pocket


def watch(played: PlayedShot, call: Call, cue: int) -> Seen:
    """Returns what a referee sees of a shot."""
    hits, pots, driven, cushions = {}, {}, set(), 0
    for event in [] if played.shot.events is None else played.shot.events:
        kind, ball, other = str(event["kind"]), int(event["ball"]), int(event["other"])
        cushions += kind == "cushion" and ball == cue
        if kind == "ball_ball" and cue in (ball, other):
            hits.setdefault(ball + other - cue, cushions)
        elif kind == "pocket":
            pots[ball] = other
        if kind in ("cushion", "pocket") and hits:
            driven.add(ball)
    scratch = pots.pop(cue, None) is not None
    return Seen(call, hits, pots, driven, scratch, played.game.positions)


class Referee:
    """The record of a game of two players. A subclass has its rules."""

    compared = "player", "over", "winner", "in_hand", "break_shot", "scores", "choices", "object_balls"

    def __init__(self, setup: Setup) -> None:
        self.setup, self.noted = setup, collections.Counter()
        self.called, self.rules = setup.call_shot, setup.rules
        self.all = set(range(1, setup.scene.n_balls))
        self.player = self.breaker = self.quiet = 0
        self.scores, self.fouls, self.over, self.winner = [0, 0], [0, 0], False, -1
        self.rack()

    def rack(self) -> None:
        """Racks all balls for an opening break."""
        self.object_balls, self.in_hand, self.choices, self.break_shot = set(self.all), "behind", set(), True

    def turn(self, seen: Seen, is_shot: bool) -> None:
        """Notes a shot, or a call without one."""
        if not is_shot:
            self.noted[seen.call.kind] += 1
            self.without_shot(seen.call.kind)
            return
        before, was_break = list(self.scores), self.break_shot
        self.breaker = self.player if was_break else self.breaker
        self.choices, self.in_hand, self.break_shot = set(), "no", False
        foul = self.judge(seen, was_break)
        self.quiet = 0 if foul or seen.pots or self.scores != before else self.quiet + 1
        if "stalemate" in GAMES[self.rules].choices and self.quiet >= 12 and not self.break_shot:
            self.choices.add("stalemate")

    def without_shot(self, kind: str) -> None:
        """Notes a call without a shot: WPA 1.12, 2.4, 4.3, 6.14."""
        if kind == "hand_back":
            self.player, self.choices = 1 - self.player, self.choices & {"stalemate"}
            return
        self.player, self.quiet = self.breaker if kind == "stalemate" else 1 - self.player, 0
        self.fouls = [0, 0] if kind == "stalemate" else self.fouls
        self.rack()

    def judge(self, seen: Seen, was_break: bool) -> bool:
        """Notes a shot and returns whether it is a foul."""
        raise NotImplementedError

    def wins(self, player: int) -> None:
        """Ends the game."""
        self.over, self.winner = True, player

    def third_foul(self, foul: bool) -> bool:
        """Counts a foul or a legal shot, and returns whether it is the third foul in a row (WPA 6.14)."""
        self.fouls[self.player] = self.fouls[self.player] + 1 if foul else 0
        self.noted["third foul"] += self.fouls[self.player] == 3
        return self.fouls[self.player] == 3


class Rotation(Referee):
    """Nine ball and ten ball: WPA 2, 9, 6.1 to 6.3 and 6.14."""

    def judge(self, seen: Seen, was_break: bool) -> bool:
        """Notes a shot."""
        last, push, pots = max(self.all), seen.call.kind == "push_out", set(seen.pots)
        foul = seen.scratch or (not push and (seen.first != min(self.object_balls) or not seen.driven))
        foul |= was_break and not pots and len(seen.driven - {0}) < 4
        legal, ten = not foul and not push, self.rules == "ten_ball"
        counts = legal and bool(pots) and (seen.made or was_break or not self.called or not ten)
        won = counts and (pots >= self.object_balls == {10} and not was_break if ten else last in pots)
        self.object_balls = self.object_balls - pots | ({last} if last in pots and not won else set())
        self.in_hand = "anywhere" if foul else "no"
        self.choices |= {"push_out"} if was_break and legal else set()
        self.choices |= {"hand_back"} if not foul and (push or (pots and not counts)) else set()
        self.noted["push_out"] += push
        if self.third_foul(foul) or won:
            self.wins(self.player if won else 1 - self.player)
        self.player = self.player if counts else 1 - self.player
        return foul


class Straight(Referee):
    """Straight pool: WPA 4. Whether a new rack moves the cue ball is not compared."""

    def judge(self, seen: Seen, was_break: bool) -> bool:
        """Notes a shot."""
        pots = set(seen.pots)
        counts = bool(pots) and seen.call.kind == "shot" and (seen.made or not self.called)
        breaking = was_break and not counts and not (0 in seen.driven and len(seen.driven - {0}) >= 2)
        foul = breaking or seen.scratch or not seen.driven
        self.in_hand = "behind" if seen.scratch else "no"
        self.scores[self.player] -= 2 if breaking else int(foul)
        if breaking:  # it is not one of three consecutive fouls (4.11)
            self.choices, self.fouls[self.player] = {"break_again"}, 0
        elif self.third_foul(foul):
            self.scores[self.player] -= 15
            self.fouls[self.player] = 0
            self.rack()
            return True
        elif counts and not foul:
            self.scores[self.player] += len(pots)
            self.object_balls -= pots
            if self.scores[self.player] >= (self.setup.target or 0):
                self.wins(self.player)
            elif len(self.object_balls) < 2:
                self.object_balls, self.in_hand = set(self.all), "any"
            return False
        self.player = 1 - self.player
        return foul


class Blackball(Referee):
    """Blackball: WPA 2005, with the simplifications that `billiards_env/games/blackball.py` lists."""

    compared = *Referee.compared, "free_ball", "solids"
    free_ball, solids = False, -1

    def judge(self, seen: Seen, was_break: bool) -> bool:
        """Notes a shot."""
        pots, free = set(seen.pots), self.free_ball
        own = (SOLIDS if self.solids == self.player else STRIPES) if self.solids >= 0 else set()
        left = (own or SOLIDS | STRIPES) & self.object_balls
        foul = seen.scratch or not seen.driven or not (free or was_break or seen.first in (left or {8}))
        foul |= bool(pots and own and not free and not pots & (own | {8}))
        foul |= was_break and not pots and len(seen.driven - {0}) < 2
        replay = was_break and 8 in pots
        self.object_balls -= pots - {8} if was_break else pots
        if 8 in pots and not was_break:
            self.wins(1 - self.player if foul or left else self.player)
        if not (own or foul or free or was_break) and bool(pots & SOLIDS) != bool(pots & STRIPES):
            self.solids = self.player if pots & SOLIDS else 1 - self.player
        self.free_ball, self.in_hand = foul and not replay, "behind" if seen.scratch else "no"
        self.noted["free shot"] += self.free_ball
        self.player = self.player if replay or (not foul and (pots or free)) else 1 - self.player
        return foul


class Snooker(Referee):
    """Snooker: WPBSA 2014, section 3, without the miss rule."""

    compared = *Referee.compared, "free_ball", "colour"
    free_ball = colour = False

    def __init__(self, setup: Setup) -> None:
        super().__init__(setup)
        self.colours = sorted(self.all)[-6:]

    def without_shot(self, kind: str) -> None:
        """Notes a call. A free ball becomes void (3.12 f), and a stalemate begins the frame again (3.16)."""
        super().without_shot(kind)
        self.free_ball = False
        if kind == "stalemate":
            self.scores, self.colour = [0, 0], False

    def on(self) -> set[int]:
        """Returns the balls on, without a free ball."""
        reds = self.object_balls - set(self.colours)
        return set(self.colours) if self.colour else reds or {min(self.object_balls)}

    def judge(self, seen: Seen, was_break: bool) -> bool:
        """Notes a shot."""
        pots, on, only_black = set(seen.pots), self.on(), self.object_balls == {max(self.all)}
        named = seen.call.ball if seen.call.ball >= 0 else seen.first
        worth, chosen, following = self.value(min(on)), set(), 1 - self.player
        if self.colour:
            on, worth = ({named}, self.value(named)) if named in on else (on, 7)  # 3.10 d: no colour is nominated
        elif self.free_ball and named in self.object_balls - on:
            chosen = {named}
        wrong = ({seen.first} - (chosen or on) - {-1}) | (pots - on - chosen)
        foul = seen.scratch or seen.first < 0 or bool(wrong)
        if chosen and not foul and not pots and len(self.object_balls) > 2 and self.hides(seen, on, named):
            foul, self.noted["snookered by the free ball"] = True, self.noted["snookered by the free ball"] + 1
        self.object_balls -= pots - set(self.colours) if foul or self.colour else pots - chosen
        self.colour = worth == 1 and bool(pots) and not foul
        self.in_hand, self.free_ball = "behind" if seen.scratch else "no", False
        if foul:
            self.scores[following] += max(4, worth, *map(self.value, wrong))
            self.choices.add("hand_back")
        else:
            self.scores[self.player] += len(pots) if worth == 1 else worth * bool(pots)
        if foul or not pots or only_black:
            self.player = following
        if only_black and (foul or pots):  # 3.4
            self.object_balls, self.in_hand, self.choices = {max(self.all)}, "behind", {"hand_back"}
            if self.scores[0] != self.scores[1]:
                self.wins(int(self.scores[1] > self.scores[0]))
        elif foul:
            self.free_ball = self.snookered(seen, self.on(), self.object_balls - self.on())
            self.noted["free ball"] += self.free_ball
        return foul

    def value(self, ball: int) -> int:
        """Returns the points of a ball."""
        return self.colours.index(ball) + 2 if ball in self.colours else 1

    def hides(self, seen: Seen, on: set[int], ball: int) -> bool:
        """Returns whether a ball is the nearest one that hides all balls on (2.17)."""
        distance = np.hypot(*(seen.after - seen.after[0]).T)
        hiding = [one for one in self.object_balls - on if self.snookered(seen, on, {one})]
        return ball in hiding and distance[ball] == distance[hiding].min()

    def snookered(self, seen: Seen, on: set[int], others: set[int]) -> bool:
        """Returns whether other balls obstruct each ball on (2.17); in hand, from each place of a grid in the D."""
        table, radius = self.setup.scene.table, self.setup.scene.balls.radius[0]
        starts = seen.after[:1]
        if seen.scratch:
            x, y = np.mgrid[-1:0:21j, -1:1:41j].reshape(2, -1) * table.d_radius
            starts = np.column_stack((x + table.head_x, y))[np.hypot(x, y) <= table.d_radius]
            balls = seen.after[sorted(self.object_balls)]
            starts = starts[(np.hypot(*(starts[:, None] - balls).T) >= 2.0 * radius).all(axis=0)]
        ends, blocks = ([seen.after[ball] for ball in balls] for balls in (on, others))
        pairs = ((start, end) for start in starts for end in ends)
        return not any(all(clear(*pair, side, blocks, radius) for side in (-1, 1)) for pair in pairs)


def clear(start: Any, end: Any, side: int, blocks: list[Any], radius: float) -> bool:
    """Returns whether a ball can touch an extreme edge of another one in a straight line."""
    distance = np.hypot(*(end - start))
    angle = np.arctan2(*(end - start)[::-1]) + side * np.arcsin(min(1.0, 2.0 * radius / distance))
    length, ray = np.sqrt(max(0.0, distance**2 - 4.0 * radius**2)), np.array([np.cos(angle), np.sin(angle)])
    nearest = [start + min(max((block - start) @ ray, 0.0), length) * ray - block for block in blocks]
    return all(np.hypot(*gap) >= 2.0 * radius - 1e-9 for gap in nearest)


class Carom(Referee):
    """Carom and three cushion: UMB 1989, art. 23 to 29; with innings, the second player has the equalising inning."""

    compared = "player", "over", "winner", "break_shot", "scores"
    innings = 0

    def without_shot(self, kind: str) -> None:
        """Notes the call "rerack"."""

    def judge(self, seen: Seen, was_break: bool) -> bool:
        """Notes a shot."""
        player, limit, cushions = self.player, self.setup.innings, list(seen.hits.values())
        point = len(cushions) == 2 and (self.rules == "carom" or cushions[1] >= 3)
        point &= not (was_break and (seen.first != 1 or cushions[0] > 0))
        self.scores[player] += point
        done = self.scores[player] == self.setup.target
        if done or not point:
            self.innings += player
            first, second = self.scores
            if (done and not limit) or (
                player and limit and (self.setup.target in self.scores or self.innings == limit)
            ):
                self.wins(-1 if first == second else int(second > first))
            self.player = 1 - player
            if done and limit and not player:
                self.noted["equalising inning"] += 1
                self.rack()
        return False


CASES: dict[str, tuple[type[Referee], int, dict[str, Any]]] = {
    "nine_ball": (Rotation, 9, {}),
    "nine_ball, 2025": (Rotation, 9, {"edition": "2025"}),
    "ten_ball": (Rotation, 10, {}),
    "ten_ball, called": (Rotation, 10, {"call_shot": True}),
    "straight": (Straight, 15, {"target": 8}),
    "straight, called": (Straight, 4, {"target": 8, "call_shot": True}),
    "blackball": (Blackball, 15, {}),
    "snooker": (Snooker, 21, {}),
    "snooker, 3 reds": (Snooker, 9, {}),
    "snooker, no reds": (Snooker, 6, {}),
    "carom": (Carom, 2, {"target": 3}),
    "carom, innings": (Carom, 2, {"target": 3, "innings": 8}),
    "three_cushion, innings": (Carom, 2, {"target": 1, "innings": 8}),
}
"""The referees, the numbers of object balls and the settings of the games."""


def stroke_of(setup: Setup, game: GameState, rng: np.random.Generator) -> Stroke:
    """Returns a random stroke, most often towards a pot and with the call of a ball that it pots, or a choice."""
    scene, state = setup.scene, game.state
    kinds = [*choices(state), *(("safety",) if setup.has_safety else ())]
    kind = str(rng.choice(kinds)) if kinds and rng.random() < 0.3 else "shot"
    if kind in NO_SHOT:
        return Stroke((0.0, 0.0), call=Call(kind=kind))
    corner = np.array([scene.table.length, scene.table.width]) / 2.0
    place = tuple(rng.uniform(-corner, corner).tolist()) if state.in_hand else None
    start = cue_ball_point(scene, game.positions, state, place) if place else game.positions[state.cue_balls[0]]
    ball = int(rng.choice(setup.legal(state)))
    end = game.positions[ball] + rng.normal(0.0, 0.01, 2) if rng.random() < 0.9 else rng.uniform(-corner, corner)
    if setup.game_rules.pockets and rng.random() < 0.7:
        pocket = scene.table.pockets[rng.integers(6)]
        away = end - (pocket.x, pocket.y)
        end = end + 2.0 * scene.balls.radius[0] * away / np.hypot(*away)
    velocity = (end - start) / np.hypot(*(end - start)) * (8.0 if state.break_shot else rng.uniform(0.3, 5.0))
    nominates = setup.rules == "snooker" and rng.random() < 0.3
    stroke = Stroke(tuple(velocity.tolist()), place, call=Call(ball if nominates else -1, kind=kind))
    if setup.call_shot and kind != "push_out":
        pots = [pot for pot in play(setup, game, stroke).pots if pot[0]] or [(ball, 0)]
        stroke = stroke._replace(call=Call(*pots[0], kind))
    return stroke


def compare(name: str, seed: int) -> tuple[int, dict[str, int], str]:
    """Plays a random game. Returns the numbers of turns and of uses of special rules, and the first difference."""
    kind, balls, options = CASES[name]
    rules, rng = name.split(",")[0], np.random.default_rng(seed)
    setup = Setup(rules, Scene.named(GAMES[rules].scene, balls), **options)
    game, referee, turns, difference = opening(setup, rng), kind(setup), 0, ""
    while not (referee.over or difference or turns == MOST_TURNS):
        stroke, cue = stroke_of(setup, game, rng), int(game.state.cue_balls[0])
        played = play(setup, game, stroke)
        referee.turn(watch(played, stroke.call, cue), stroke.call.kind not in NO_SHOT)
        game, turns = played.game, turns + 1
        ours = to_dict(game.state)
        for field in ("over", "winner") if referee.over else referee.compared:
            value = getattr(referee, field)
            value = value if isinstance(value, (int, str)) else sorted(value) if isinstance(value, set) else list(value)
            if value not in ("any", list(ours[field]) if isinstance(ours[field], tuple) else ours[field]):
                difference += f"{name}, seed {seed}, turn {turns}: {field} {ours[field]}, second referee {value}. "
    return turns, dict(referee.noted), difference


def measure(games: int, job: Job) -> dict[str, Any]:
    """Returns the number of games and turns of each case, and the differences."""
    rows, differences = [], []
    for name in CASES:
        with job(name):
            turns, noted, wrong = zip(*(compare(name, seed) for seed in range(games)), strict=True)
            special: collections.Counter[str] = sum(map(collections.Counter, noted), collections.Counter())
            shown = ", ".join(f"{rule.replace('_', ' ')} {count:,}" for rule, count in sorted(special.items()))
            differences += filter(None, wrong)
            rows.append({"game": name.replace("_", " "), "turns": sum(turns), "special": shown or "-"})
            rows[-1] |= {"games": games, "differences": sum(map(bool, wrong))}
    return {"rows": rows, "differences": differences}


def blocks(result: Any) -> dict[str, str]:
    """Returns the Markdown block "referees"."""
    columns = {"Game": "{game}", "Games": "{games:,}", "Turns": "{turns:,}", "Special rules": "{special}"}
    return {"referees": rows_table(columns | {"Games with a difference": "{differences}"}, result["rows"], left=1)}


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.referees --help`."""
    about, games = "Compare the verdicts of games with those of a second referee.", (1_000, "games of each kind")
    run_command("benchmarks.referees", about, arguments, measure, blocks, {"games": games}, jobs=True)


if __name__ == "__main__":
    main()
