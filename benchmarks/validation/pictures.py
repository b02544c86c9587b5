"""The pictures of docs/validation.md."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, Patch, Polygon
from matplotlib.ticker import MultipleLocator

from benchmarks.validation import collisions, cushions, pockets
from billiards_env.drawing.style import INK
from billiards_env.outline import polygon
from billiards_env.scene import Physics
from billiards_env.table import INCH, POOL_RADIUS, Table

# Okabe and Ito (2008): distinct with every kind of colour vision
BLUE, ORANGE, GREEN, RED, QUIET = "#0072b2", "#e69f00", "#009e73", "#d55e00", "#666666"
COLOURS = {"slow": BLUE, "medium": GREEN, "fast": RED}
MEASURED: dict[str, Any] = {"linestyle": "none", "color": INK, "markerfacecolor": "white", "markersize": 6, "zorder": 5}
SPEED_TEXT = {name: f"{name}, {speed:.2f} m/s" for name, speed in collisions.SPEEDS.items()}


def panels(rows: int, columns: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """Returns a figure of a size in inches and its axes, in the order of reading."""
    matplotlib.rcParams["font.family"] = "DejaVu Sans"  # part of matplotlib, the same on every machine
    figure = Figure(figsize=size, dpi=120, facecolor="white", layout="constrained")
    return figure, list(np.ravel(figure.subplots(rows, columns)))


def dress(axes: Axes, title: str, xlabel: str, ylabel: str, x: Sequence[float], y: Sequence[float]) -> None:
    """Sets title, labels and limits of a panel, and a light grid."""
    axes.set_title(title, fontsize=10, color=INK, loc="left")
    axes.set_xlabel(xlabel, fontsize=9, color=INK)
    axes.set_ylabel(ylabel, fontsize=9, color=INK)
    axes.set(xlim=(x[0], x[1]), ylim=(y[0], y[1]))
    axes.tick_params(labelsize=8.5, colors=INK)
    axes.grid(color="#e4e4e4", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def label(axes: Axes, x: float, y: float, text: str, colour: str, **style: Any) -> None:
    """Writes a label next to a line."""
    background = {"facecolor": "white", "edgecolor": "none", "pad": 0.8, "alpha": 0.85}
    axes.text(x, y, text, color=colour, fontsize=8.5, bbox=background, **{"va": "center", "zorder": 6, **style})


def throw() -> Figure:
    """Draws the throw against the cut angle and against the sidespin."""
    figure, (stun, roll, straight, half) = panels(2, 2, (9.2, 6.6))
    cuts, sides = np.linspace(0.0, 89.0, 179), np.linspace(-1.25, 1.25, 201)
    for name, speed in collisions.SPEEDS.items():
        line = {"color": COLOURS[name], "linewidth": 1.8}
        stun.plot(cuts, collisions.throw(collisions.FRICTIONAL, speed, cuts), **line)
        roll.plot(cuts, collisions.throw(collisions.FRICTIONAL, speed, cuts, roll=1.0), **line)
        straight.plot(sides[100:], -collisions.throw(collisions.FRICTIONAL, speed, 0.0, sides[100:]), **line)
        half.plot(sides, collisions.throw(collisions.FRICTIONAL, speed, 30.0, sides), **line)
    for (x, y), name in zip(((56, 5.05), (50, 3.0), (48, 1.5)), SPEED_TEXT, strict=True):
        label(stun, x, y, SPEED_TEXT[name], COLOURS[name])
    for (x, y), name in zip(((60, 3.25), (60, 1.28), (60, 0.25)), SPEED_TEXT, strict=True):
        label(roll, x, y, name, COLOURS[name])
    for (x, y), name in zip(((0.8, 5.15), (0.86, 2.85), (0.86, 1.3)), SPEED_TEXT, strict=True):
        label(straight, x, y, name, COLOURS[name])
    for (x, y), name in zip(((-0.75, 5.2), (-0.75, 2.6), (-0.3, 0.45)), SPEED_TEXT, strict=True):
        label(half, x, y, name, COLOURS[name])
    for cut, value, speed, kind in collisions.THROW_POINTS:
        (roll if kind else stun).plot(cut, value, "o", **{**MEASURED, "color": COLOURS[speed] if cut > 10 else INK})
    stun.annotate(
        "measured, every speed", (10, 1.5), (15, 0.55), fontsize=8.5, color=INK, arrowprops={"arrowstyle": "-"}
    )
    stun.annotate(
        "measured, medium",
        (30, 4.1),
        (1.5, 5.1),
        fontsize=8.5,
        color=GREEN,
        arrowprops={"arrowstyle": "-", "color": GREEN},
    )
    roll.annotate(
        "measured, medium",
        (30, 0.9),
        (3, 2.4),
        fontsize=8.5,
        color=GREEN,
        arrowprops={"arrowstyle": "-", "color": GREEN},
    )
    half.plot(0.5, 0.0, "o", **MEASURED)
    half.annotate(
        "gearing: no throw at 40 %\nof the largest spin (TP A.26)",
        (0.5, 0.0),
        (-1.15, -3.4),
        fontsize=8.5,
        color=INK,
        arrowprops={"arrowstyle": "-"},
    )
    dress(stun, "Stun: the cue ball slides without spin", "cut angle (°)", "throw (°)", (0, 90), (0, 6))
    dress(roll, "The cue ball rolls", "cut angle (°)", "throw (°)", (0, 90), (0, 6))
    dress(straight, "Straight shot with side", "sidespin $R\\omega/v$", "throw (°)", (0, 1.25), (0, 6))
    dress(
        half,
        "Half-ball hit, stun, with side",
        "inside   ←   sidespin $R\\omega/v$   →   outside",
        "throw (°)",
        (-1.25, 1.25),
        (-6, 6),
    )
    half.axhline(0.0, color=QUIET, linewidth=0.8)
    for axes in (stun, roll):
        axes.xaxis.set_major_locator(MultipleLocator(15))
    return figure


def paths() -> Figure:
    """Draws the 30-degree rule and the measurements of Domenech."""
    figure, (rule, throws, scatters) = panels(1, 3, (9.6, 3.7))
    cuts = np.linspace(0.5, 80.0, 160)
    rule.axvspan(14.48, 48.59, color="#f1f1f1", linewidth=0, zorder=0)
    rule.axhline(30.0, color=QUIET, linewidth=0.9, linestyle=(0, (4, 3)))
    rule.plot(cuts, collisions.wallace_schroeder(cuts), color=ORANGE, linewidth=1.8)
    rule.plot(cuts, collisions.half_ball_rule(collisions.SNOOKER_PHYSICS, 1.3, cuts), color=BLUE, linewidth=1.8)
    rule.plot([s.cut for s in collisions.SNOOKER], [s.measured[2] for s in collisions.SNOOKER], "o", **MEASURED)
    label(rule, 49, 32.5, "elastic,\nno friction", ORANGE, va="center")
    label(rule, 52, 17.5, "model:\n$e$ = 0.89,\nµ = 0.05", BLUE, ha="right")
    label(rule, 31.5, 2.2, "3/4- to 1/4-ball hit", QUIET, ha="center")
    label(rule, 79, 30, "30°", QUIET, ha="right")
    dress(rule, "30-degree rule", "cut angle (°)", "cue ball, total deflection (°)", (0, 80), (0, 40))
    rule.plot([], [], "o", **MEASURED, label="measured, snooker (2014)")
    rule.legend(loc="lower right", bbox_to_anchor=(1.02, 0.06), fontsize=8, frameon=False, handletextpad=0.1)
    speed = collisions.DOMENECH_SPEED
    for friction, colour in ((None, ORANGE), (collisions.DOMENECH_FRICTION, BLUE)):
        physics = Physics(ball_ball="frictional", mu_ball=friction)
        throws.plot(cuts, collisions.throw(physics, speed, cuts, roll=1.0), color=colour, linewidth=1.8)
        scatters.plot(cuts, collisions.scatter(physics, speed, cuts), color=colour, linewidth=1.8)
    throws.plot(*np.array(collisions.DOMENECH_THROW).T, "o", **MEASURED)
    scatters.plot(*np.array(collisions.DOMENECH_SCATTER).T, "o", **MEASURED)
    label(throws, 12, 5.4, "µ = 0.125", BLUE)
    label(throws, 46, 1.6, "µ of pool balls\n(Marlow)", ORANGE)
    label(scatters, 52, 55, "both µ,\n$e$ = 0.95", BLUE)
    dress(throws, "Domenech: throw", "cut angle (°)", "throw (°)", (0, 80), (0, 8))
    dress(scatters, "Domenech: cue ball", "cut angle (°)", "deflection in the impact (°)", (0, 80), (0, 90))
    for axes in (rule, throws, scatters):
        axes.xaxis.set_major_locator(MultipleLocator(20))
    return figure


def rebounds(result: dict[str, Any]) -> Figure:
    """Draws figure 7a of Mathavan, Jackson and Parkin (2010), rebounds against the angle, and banks."""
    figure, (speeds, kept, banks) = panels(1, 3, (9.6, 3.8))
    v = np.linspace(0.05, 3.6, 100)
    colours = dict(zip(cushions.models(), (ORANGE, BLUE, GREEN), strict=True))
    for name, physics in cushions.models().items():
        speeds.plot(v, cushions.bounce(physics, 90.0, v)[0], color=colours[name], linewidth=1.8)
    speeds.plot(*np.array(cushions.FIGURE_7A).T, "o", **{**MEASURED, "markersize": 4.5})
    label(speeds, 2.35, 3.05, "mathavan2010\n$e$ = 0.98", ORANGE, ha="right")
    label(speeds, 2.62, 1.15, "mathavan2010\n$e(v)$, snooker", BLUE, ha="center")
    speeds.annotate("", (2.9, 2.42), (2.75, 1.5), arrowprops={"arrowstyle": "-", "color": BLUE})
    label(speeds, 2.72, 0.45, "stronge, $e$ = 0.85", GREEN, ha="center")
    speeds.annotate("", (1.6, 1.28), (2.1, 0.6), arrowprops={"arrowstyle": "-", "color": GREEN})
    dress(speeds, "Rolling into the cushion at 90°", "speed before (m/s)", "speed after (m/s)", (0, 3.6), (0, 3.6))
    speeds.plot([], [], "o", **{**MEASURED, "markersize": 4.5}, label="measured (2010)")
    speeds.legend(loc="upper left", fontsize=8, frameon=False, handletextpad=0.1, borderaxespad=0)
    angles = np.linspace(5.0, 90.0, 171)
    mathavan = cushions.bounce(cushions.PAPER, angles)[0]
    kept.plot(angles, mathavan, color=ORANGE, linewidth=1.8)
    kept.plot(angles, cushions.bounce(Physics(cushion="stronge"), angles)[0], color=GREEN, linewidth=1.8)
    lowest = int(mathavan.argmin())
    kept.plot(angles[lowest], mathavan[lowest], "o", color=ORANGE, markersize=5)
    label(kept, 62, 0.93, "mathavan2010", ORANGE, ha="center")
    label(kept, 88, 0.79, f"least at {angles[lowest]:.0f}°;\npaper: near 40°", INK, ha="right")
    label(kept, 40, 0.66, "stronge", GREEN)
    dress(
        kept,
        "Rolling at an angle, $v$ = 1 m/s",
        "angle to the cushion (°)",
        "share of the speed kept",
        (0, 90),
        (0.6, 1.0),
    )
    kept.xaxis.set_major_locator(MultipleLocator(30))
    rows = list(result["banks"])
    for row, name in enumerate(rows):
        for (start, _), off, shade in zip(cushions.BANKS, result["banks"][name], (0.35, 0.65, 1.0), strict=True):
            banks.plot(off, -row, "o", color=BLUE, alpha=shade, markersize=8)
            if row == 0:
                banks.text(off, 0.28, f"{start}", fontsize=8, ha="center", color=INK)
    banks.axvline(0.0, color=INK, linewidth=1.0)
    dress(
        banks,
        "Banks, “twice plus tenths”",
        "long   ←   miss (diamonds)   →   short",
        "",
        (-1.1, 1.1),
        (0.6 - len(rows), 0.8),
    )
    banks.text(0.04, 0.62, "pocket", fontsize=8, color=INK)
    banks.set_yticks([-row for row in range(len(rows))], [name.replace(", ", "\n") for name in rows])
    return figure


def _pocket(axes: Axes, board: Table, pocket: str, angle: float, offset: float) -> None:
    """Draws a pocket with its axis and one path."""
    aim = pockets.target(board, pocket)
    turn = np.radians(90.0 - aim.axis)  # turns the axis upwards
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def place(points: Any) -> Any:
        return (np.asarray(points) - [aim.x, aim.y]) @ rotation.T / INCH

    axes.add_patch(Polygon([(-60, -60), (60, -60), (60, 60), (-60, 60)], facecolor="#c9ab8c", edgecolor="none"))
    axes.add_patch(Polygon(place(polygon(board.outline)), facecolor="#dfe9e2", edgecolor=INK, linewidth=0.9))
    for hole in board.pockets:
        axes.add_patch(
            Circle(tuple(place((hole.x, hole.y))), hole.radius / INCH, facecolor="#3a3a3a", edgecolor="none")
        )
    axes.plot([0, 0], [-60, 0], color=QUIET, linewidth=0.9, linestyle=(0, (5, 2, 1, 2)))
    heading = np.radians(90.0 + angle)
    ahead = np.array([np.cos(heading), np.sin(heading)])
    left = np.array([-ahead[1], ahead[0]])
    start, end = offset * left - 8.5 * ahead, offset * left - 0.2 * ahead
    arrow = {"arrowstyle": "-|>", "color": BLUE, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tuple(end.tolist()), tuple(start.tolist()), arrowprops=arrow)
    axes.add_patch(Circle(tuple(start + 2.4 * ahead), POOL_RADIUS / INCH, facecolor="white", edgecolor=INK, zorder=4))
    axes.plot([0, offset * left[0]], [0, offset * left[1]], color=RED, linewidth=1.8, zorder=5)
    x, y = offset * left / 2
    axes.text(x + 0.25, y + 0.55, "offset", fontsize=8.5, color=RED, ha="left")
    tail = start + 0.2 * ahead
    axes.plot([tail[0]] * 2, [tail[1], tail[1] + 7.5], color=QUIET, linewidth=0.9, linestyle=(0, (5, 2, 1, 2)))
    axes.add_patch(Arc(tuple(tail.tolist()), 11, 11, theta1=90 + angle, theta2=90, color=INK, linewidth=1.0, zorder=5))
    axes.text(tail[0] + 0.15, tail[1] + 4.5, "angle", fontsize=8.5, color=INK, ha="left")
    axes.set(xlim=(-6.5, 6.5), ylim=(-8.5, 5.0), aspect="equal")
    axes.set_axis_off()


def acceptance() -> Figure:
    """Draws which paths end in the pockets of the 9-foot table."""
    figure, axes = panels(2, 3, (9.6, 6.9))
    board = Table.named("pool_9ft")
    shades = ListedColormap(["#eeeeee", "#8cc4e8", "#0b5a91"])
    for row, pocket in enumerate(("side", "corner")):
        _pocket(axes[3 * row], board, pocket, -30.0, 1.6)
        axes[3 * row].set_title(f"{pocket.capitalize()} pocket", fontsize=10, color=INK, loc="left")
        found = pockets.acceptance(board, pocket)
        for column, (name, outcomes) in enumerate(found.outcomes.items(), 1):
            panel = axes[3 * row + column]
            panel.pcolormesh(found.angles, found.offsets, outcomes, cmap=shades, vmin=0, vmax=2, rasterized=True)
            title = f"{name}, {pockets.SPEEDS[name]:.2f} m/s"
            most = found.angles[-1]
            dress(panel, title, "angle (°)", "offset (in)" if column == 1 else "", (-most, most), (-2.5, 2.5))
            panel.grid(visible=False)
            panel.xaxis.set_major_locator(MultipleLocator(30 if pocket == "side" else 15))
    handles = [
        Patch(facecolor=shades(2), label="potted, touches nothing before"),
        Patch(facecolor=shades(1), label="potted off a cushion or a jaw"),
        Patch(facecolor=shades(0), label="missed"),
        Patch(facecolor="white", edgecolor=QUIET, linewidth=0.5, label="no room for the ball"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8.5, frameon=False)
    return figure
