"""Pictures of shots with matplotlib, drawn to scale.

The picture of a shot shows the initial positions as faint balls, the paths, the final positions, a ring for each ball
in a contact, and a mark with the time of each event. Each kind of event has a different mark. The colour of a path is
the speed; its edges have the colour of the ball. Ticks show the side spin: they point to the left of the path if the
ball turns counterclockwise. Text outside the table is grey, so it is readable on white and on a dark page.

If balls leave the cloth, there is a side view beside the table at the same scale. It shows the balls at the start, the
paths of the balls that fly, and these balls at the top of each high hop. In the view from above, the path of a ball in
the air is dashed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from billiards_env.support.checks import missing, short

try:
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D
    from matplotlib.patches import Circle, FancyBboxPatch, Polygon, Rectangle
except ModuleNotFoundError as error:
    raise missing("matplotlib", "plot") from error

from billiards_env.drawing import style
from billiards_env.drawing.orientation import VISIBLE, Turning
from billiards_env.drawing.recording import LEAST_HOP, Floats, Recording, check_pair, recordings_of
from billiards_env.drawing.style import CHALK, CLOTH, INK, RAIL, Look, looks, rail_width
from billiards_env.scene import Scene
from billiards_env.scene.table import Table
from billiards_env.shots.result import ShotResult

MARKS = {
    "ball_ball": ("*", 11, "ball hits ball"),
    "cushion": ("s", 4.5, "ball hits cushion"),
    "sliding_rolling": ("o", 3.5, "slides until here, then rolls"),
    "pocket": ("D", 5, "potted"),
    "off_table": ("X", 6, "is driven off"),
}
"""The marker of an event kind, its size in points, and its meaning."""

SAMPLES = 400
"""Number of points of a path, in addition to its corners."""

DASH = 1 / 30
"""s. The time of a dash of a path in the air, and of the gap after it."""

SPEEDS = "plasma"
"""The colours of the speeds."""

TICK_EVERY, TICK, WEAKEST_SPIN = 0.06, 0.045, 0.06
"""m, s and m/s. The distance of the ticks of the side spin along a path, and their length over the speed of the ball's
equator that is due to this spin; slower equators have no tick."""

LEGEND_SPIN = 3 * WEAKEST_SPIN
"""m/s. Up to this speed the line of the path hides the ticks, so the legend does not explain them."""

LETTER = 0.008
"""The width of a letter of a name over the length of the table."""

WEAK = 0.02
"""m/s. Slower contacts have no mark, because balls that come to rest against each other touch about a hundred times."""


def draw_shot(shot: ShotResult, ax: Axes | None, compare: ShotResult | None) -> Axes:
    """Draws a shot in metres and returns the axes, see `ShotResult.plot`. Without `ax` it makes a figure with a legend.

    Another run of the shot, `compare`, is drawn with dashed paths and rings.

    Raises:
        TypeError: If `ax` is not an Axes, or `compare` is not a shot.
        ValueError: If a shot was not recorded, or `compare` has other balls or another table.
    """
    recording, other = recordings_of(shot, compare, "plot")
    if other is not None:
        check_pair(recording, other)
    figure = None
    if ax is None:
        from matplotlib import pyplot

        ratio = recording.scene.table.width / recording.scene.table.length
        figure, ax = pyplot.subplots(figsize=(9, 0.6 + 9 * min(max(ratio, 0.2), 2)), layout="constrained")
    elif not isinstance(ax, Axes):
        raise TypeError(f"ax = {short(ax)}: expected Axes; plot().figure.savefig(path) writes a file")
    scene, look = recording.scene, looks(recording.scene)
    _draw_table(ax, recording, look)
    if hops := [hop for hop in recording.hops() if hop[2] > LEAST_HOP]:
        height = np.ptp(ax.get_ylim())
        _draw_side(ax, recording, look, hops)
        if figure is not None:
            figure.set_figheight(figure.get_figheight() * float(np.ptp(ax.get_ylim()) / height))
    fastest = max((recording.speeds(i, recording.corners(i)).max() for i in _in_play(recording)), default=0.0)
    turns = recording.turning(error=VISIBLE)
    if other is not None:
        for i in _in_play(other):
            _draw_path(ax, other, i, look[i])
            if other.gone[i] == np.inf:
                end = other.path(i, [other.time])[0]
                _disc(ax, end, scene.balls.radius[i], 5, fill=False, edgecolor=look[i].path, linewidth=1.6)
    spins, drawn = False, list[tuple[int, Floats]]()
    for i in _in_play(recording):
        if recording.moves(i):
            spins |= _draw_path(ax, recording, i, look[i], fastest, turns)
            drawn.append((i, recording.path(i, [0.0])[0]))
            draw_ball(ax, scene.balls.radius[i], look[i], drawn[-1][1], ghost=True)
        if recording.gone[i] == np.inf:
            drawn.append((i, recording.path(i, [recording.time])[0]))
            draw_ball(ax, scene.balls.radius[i], look[i], drawn[-1][1], ghost=False)
    _write_names(ax, recording, look, drawn)
    _draw_events(ax, recording, look)
    if fastest > 0.0:
        _draw_speeds(ax, recording.scene, fastest)
    if figure is not None:
        handles = legend_handles(spins, "off_table" in recording.events["kind"], bool(hops))
        place: Any = {"loc": "outside lower center", "ncols": 7 if len(handles) <= 7 else 5, "frameon": False}
        figure.legend(handles=handles, labelcolor=style.TEXT, fontsize=8, **place)
    return ax


def _draw_table(ax: Axes, recording: Recording, look: tuple[Look, ...]) -> None:
    """Draws the empty table and the potted balls under it, in metres."""
    table, strip = recording.scene.table, strip_height(recording.scene.table)
    x, y = draw_empty(ax, table, strip)
    if table.pockets:
        radius, half, places = style.tray(recording.scene.n_balls, 2 * x, strip)
        corner, size = (-half, -y - strip / 2 - 1.35 * radius), (2 * half, 2.7 * radius)
        groove = f"round,pad=0,rounding_size={1.35 * radius}"
        ax.add_patch(FancyBboxPatch(corner, *size, boxstyle=groove, facecolor=RAIL, edgecolor="none", zorder=1))
        ax.text(
            -half - radius,
            -y - strip / 2,
            style.POTTED,
            fontsize=8.5,
            color=style.TEXT,
            ha="right",
            va="center_baseline",
        )
        for ball, place in zip(recording.potted(recording.time).tolist(), places, strict=False):
            draw_ball(ax, radius, look[ball], (place, -y - strip / 2), ghost=False)


def draw_empty(ax: Axes, table: Table, strip: float = 0.0) -> tuple[float, float]:
    """Draws an empty table over a strip of a height, m. Returns the right and the upper end of the picture, m."""
    for corners, colour in style.draw_table(table):
        ax.add_patch(Polygon(corners, facecolor=colour, edgecolor="none", zorder=1))
    x, y = (side / 2 + 1.1 * rail_width(table) for side in (table.length, table.width))
    ax.set(xlim=(-x, x), ylim=(-y - strip, y), aspect="equal")
    ax.axis("off")
    return x, y


def legend_handles(side_spin: bool = True, leaves: bool = False, hops: bool = False) -> list[Line2D]:
    """Returns the legend entries: the balls, marks, ticks of the `side_spin`, balls that leave, and paths of `hops`."""
    marks = [("|", 7, style.TEXT, style.TEXT, "side spin")] if side_spin else []
    marks += [("o", 9, "#63762f", "#e69f00", "start"), ("o", 9, "#e69f00", CHALK, "end")]
    for kind, (marker, size, label) in MARKS.items():
        if kind == "off_table" and not leaves:
            continue
        marks.append((marker, size, CHALK if kind in ("sliding_rolling", "ball_ball") else style.TEXT, INK, label))
    paths = [Line2D([], [], linestyle=(0, (2, 1.5)), color=style.TEXT, label="in the air")] if hops else []
    return paths + [
        Line2D([], [], marker=m, linestyle="none", markersize=s, color=f, markeredgecolor=e, label=text)
        for m, s, f, e, text in marks
    ]


def _in_play(recording: Recording) -> Sequence[int]:
    return np.flatnonzero(recording.gone > 0).tolist()


def _draw_path(
    ax: Axes, shot: Recording, ball: int, look: Look, fastest: float = 0.0, turns: Turning | None = None
) -> bool:
    """Draws a path with speed and side spin, or dashed if there are no `turns`. Returns whether ticks are visible."""
    if not shot.moves(ball):
        return False
    ends = np.arange(0.0, shot.time, DASH) if shot.scene.physics.flight else []
    times, path = shot.track(ball, np.append(np.linspace(0, shot.time, SAMPLES), ends))
    if turns is None:
        ax.plot(*path.T, linestyle=(0, (3, 2)), color=look.path, linewidth=1.6, solid_joinstyle="miter", zorder=4)
        return False
    middles = (times[:-1] + times[1:]) / 2
    seen = (middles // DASH % 2 == 0) | ~shot.flies(ball, middles)
    line = np.insert(path, np.flatnonzero(~seen) + 1, np.nan, axis=0)
    ax.plot(*line.T, linestyle="-", color=look.path, linewidth=3.4, solid_joinstyle="miter", zorder=4)
    steps = LineCollection(
        list(np.stack((path[:-1], path[1:]), 1)[seen]), cmap=SPEEDS, linewidths=1.8, capstyle="round", zorder=4.2
    )
    steps.set_array(shot.speeds(ball, times[:-1])[seen])
    steps.set_clim(0.0, fastest)
    ax.add_collection(steps, autolim=False)
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(path, axis=0).T)))
    at = np.interp(np.arange(0.5 * TICK_EVERY, along[-1], TICK_EVERY), along, times)
    spin = shot.spins(ball, at)[:, 2] * shot.scene.balls.radius[ball]
    at, spin = at[abs(spin) > WEAKEST_SPIN], spin[abs(spin) > WEAKEST_SPIN]
    clear = np.ones(len(at), np.bool_)  # not over a pocket: there a tick looks like a mark on the table
    if len(at):
        begin, ahead = shot.path(ball, at), shot.path(ball, at + 1e-4) - shot.path(ball, at)
        left = np.column_stack((-ahead[:, 1], ahead[:, 0])) / np.maximum(np.hypot(*ahead.T), 1e-12)[:, None]
        ends = begin + TICK * spin[:, None] * left
        for pocket in shot.scene.table.pockets:
            clear &= ~pocket.contains(ends)
        ticks = list(np.stack((begin, ends), 1)[clear])
        ax.add_collection(LineCollection(ticks, colors=CHALK, linewidths=0.9, zorder=4.1))
    return bool((clear & (abs(spin) > LEGEND_SPIN)).any())


def _draw_side(ax: Axes, shot: Recording, look: tuple[Look, ...], hops: Sequence[tuple[int, float, float]]) -> None:
    """Draws the side view above the table, or left of it if the balls fly more along y than along x."""
    table, fliers = shot.scene.table, sorted({ball for ball, _, _ in hops})
    tracks = {ball: shot.track(ball, np.linspace(0, shot.time, SAMPLES)) for ball in fliers}
    heights = {ball: shot.heights(ball, times) for ball, (times, _) in tracks.items()}
    flown = np.vstack([path[heights[ball] > LEAST_HOP] for ball, (_, path) in tracks.items()])
    axis = int(np.ptp(flown, axis=0).argmax())
    rail, nose, half = rail_width(table), table.cushion_height, (table.length / 2, table.width / 2)[axis]
    radius = max(shot.scene.balls.radius)
    high = max(height for *_, height in hops) + 2 * radius + (0.07, 0.18)[axis]  # with room for the label
    base = (table.width, table.length)[axis] / 2 + 1.1 * rail + 0.05  # the cloth

    def turned(along: ArrayLike, up: ArrayLike) -> Floats:
        places = np.column_stack((np.ravel(along), base + np.ravel(up)))
        return places if axis == 0 else places[:, ::-1] * (-1, 1)

    def box(*corners: tuple[float, float], colour: str, zorder: float = 2) -> None:
        ax.add_patch(Polygon(turned(*np.array(corners).T), facecolor=colour, edgecolor="none", zorder=zorder))

    end = half + rail
    box((-end, -0.02), (end, -0.02), (end, high), (-end, high), colour=style.MOUTH)
    box((-end, -0.02), (end, -0.02), (end, 0.0), (-end, 0.0), colour=CLOTH)
    for s in (-1, 1):
        box((s * half, nose), (s * end, nose), (s * end, 0.0), (s * (half + 0.03), 0.0), colour=style.CUSHION)

    def ball_at(ball: int, time: float, zorder: float, **colours: Any) -> None:
        size, up = shot.scene.balls.radius[ball], float(shot.heights(ball, [time])[0])
        (place,) = turned(shot.path(ball, [time])[0, axis], size + up)
        _disc(ax, place, size, zorder, **colours)

    for ball in _in_play(shot):
        ball_at(ball, 0.0, 3, facecolor=look[ball].fill, edgecolor=look[ball].path, linewidth=0.5)
    for ball, (_, path) in tracks.items():
        up = heights[ball]
        flies = np.convolve(up, [1, 1, 1], "same") > LEAST_HOP / 2  # with the points where the ball leaves the cloth
        line = turned(path[:, axis], np.where(flies, shot.scene.balls.radius[ball] + up, np.nan))
        ax.plot(*line.T, color=look[ball].path, linewidth=1.6, zorder=4)
        _, time, height = max((hop for hop in hops if hop[0] == ball), key=lambda hop: hop[2])
        ((x, y),) = turned(shot.path(ball, [time])[0, axis], height + 2.3 * radius).tolist()
        text: dict[str, Any] = {"ha": "center", "va": "bottom"} if axis == 0 else {"ha": "right", "va": "center"}
        if height > radius / 2:
            ax.text(x, y, f"{100 * height:.1f} cm", fontsize=6.5, color=CHALK, zorder=5, **text)
    for ball, time in [(ball, time) for ball, time, height in hops if height > radius / 2]:
        ball_at(ball, time, 4, fill=False, edgecolor=look[ball].path, linewidth=0.9)
    if axis == 0:
        ax.set_ylim(top=base + high)
    else:
        ax.set_xlim(left=-base - high)


def _draw_speeds(ax: Axes, scene: Scene, fastest: float) -> None:
    """Draws the scale of the speeds under the right end of the table."""
    table, rail = scene.table, rail_width(scene.table)
    x, y, strip = table.length / 2 + rail, table.width / 2 + 1.1 * rail, strip_height(table)
    width, height = 0.2 * (2 * x), 0.2 * strip
    scale = ax.inset_axes((x - width, -y - 0.5 * strip, width, height), transform=ax.transData)
    scale.imshow(np.linspace(0.0, 1.0, 200)[None], aspect="auto", cmap=SPEEDS, extent=(0.0, fastest, 0.0, 1.0))
    scale.set_yticks([])
    scale.tick_params(labelsize=6.5, length=2, pad=1, colors=style.TEXT)
    scale.spines[:].set_color(style.TEXT)
    scale.set_title("speed, m/s", fontsize=7, pad=2, color=style.TEXT)


def strip_height(table: Table) -> float:
    """Returns the height of the strip under a plotted table, m: of the tray, or of the scale of the speeds."""
    return style.tray_height(table) or 0.09 * (table.length * table.width / 2) ** 0.5


def _disc(ax: Axes, centre: ArrayLike, radius: float, zorder: float, **colours: Any) -> Circle:
    """Draws a disc of the facecolor, with an edge of the edgecolor, and returns it."""
    x, y = np.asarray(centre).tolist()
    options: Any = {"facecolor": "none", "edgecolor": "none", **colours}
    disc = Circle((x, y), radius, zorder=zorder, **options)
    ax.add_patch(disc)
    return disc


def draw_ball(ax: Axes, radius: float, look: Look, position: ArrayLike, ghost: bool) -> None:
    """Draws a ball at a position (2,), m; faint if it is a `ghost`."""
    x, y = np.asarray(position).tolist()
    if ghost:
        _disc(ax, (x, y), radius, 5, facecolor=CLOTH)
        _disc(ax, (x, y), radius, 5.1, facecolor=look.fill, alpha=0.35)
        _disc(ax, (x, y), radius, 6, edgecolor=look.path, linewidth=1, linestyle=(0, (2, 1.5)))
    else:
        disc = _disc(ax, (x, y), radius, 8, facecolor=CHALK if look.striped else look.fill)
        if look.striped:
            low, size = (x - radius, y - style.STRIPE * radius), (2 * radius, 2 * style.STRIPE * radius)
            band = Rectangle(low, *size, facecolor=look.fill, edgecolor="none", zorder=8.1)
            ax.add_patch(band)
            band.set_clip_path(disc)
        _disc(ax, (x, y), radius, 8.2, edgecolor=CHALK, linewidth=0.8)
    if not look.dots:  # a ball with dots has a name, see `_write_names`
        size, ink = 8 if len(look.number) < 2 else 6.5, CHALK if ghost else look.ink
        ax.text(x, y, look.number, fontsize=size, color=ink, ha="center", va="center_baseline", zorder=9, clip_on=True)


def _write_names(ax: Axes, recording: Recording, look: tuple[Look, ...], drawn: Sequence[tuple[int, Floats]]) -> None:
    """Writes the names of balls under, above or beside them, where they cover nothing; nowhere without such a place."""
    radius, letter = recording.scene.balls.radius, LETTER * recording.scene.table.length
    paths = [recording.track(i, np.linspace(0, recording.time, SAMPLES))[1] for i, _ in drawn if recording.moves(i)]
    hits = [(event["x"], event["y"]) for event in recording.events if event["kind"] == "ball_ball"]
    middles = np.vstack([*(place for _, place in drawn), *paths, *hits])  # of what is drawn, and half of its size
    sizes = np.repeat([max(radius), radius[0] / 3, 5 * letter], [len(drawn), sum(map(len, paths)), len(hits)])
    for ball, place in drawn:
        text = look[ball].number if look[ball].dots else ""
        half = np.array((len(text) / 2, 1.0)) * letter
        for way in ((0, -1), (0, 1), (-1, 0), (1, 0)) if text else ():
            middle = place + way * (half + 1.2 * radius[ball])
            if (abs(middle - middles) >= half + sizes[:, None]).any(axis=1).all():
                x, y = middle.tolist()
                ax.text(x, y, text, fontsize=6.5, color=CHALK, ha="center", va="center", zorder=9, clip_on=True)
                middles, sizes = np.vstack((middles, middle)), np.append(sizes, half[0])
                break


def _draw_events(ax: Axes, recording: Recording, look: tuple[Look, ...]) -> None:
    """Draws the marks of contacts, and their times, where they do not overlap: a break does not hide its rack."""
    scene, labelled, hits = recording.scene, [], []
    room = 0.06 * scene.table.length  # the width of a text, which may be upright
    for event in recording.events:
        kind, ball, other, time = event["kind"], int(event["ball"]), int(event["other"]), float(event["time"])
        if kind not in MARKS or (kind in ("ball_ball", "cushion") and event["speed"] < WEAK):
            continue
        point = np.array([event["x"], event["y"]])
        edge, fill = INK, look[ball].path
        if kind == "ball_ball":
            first, second = (recording.path(k, [time])[0] for k in (ball, other))
            share = scene.balls.radius[ball] / (scene.balls.radius[ball] + scene.balls.radius[other])
            point = first + share * (second - first)
            fill = CHALK
            if any(np.hypot(*(point - hit)) < 2 * scene.balls.radius[ball] for hit in hits):
                continue
            hits.append(point)
            for k, centre in ((ball, first), (other, second)):  # only balls that have moved
                if (centre != recording.path(k, [0.0])[0]).any():
                    _disc(ax, centre, scene.balls.radius[k], 5, fill=False, edgecolor=look[k].path, linewidth=0.8)
        elif kind == "off_table":
            edge = CHALK
        elif kind == "pocket":
            pocket = scene.table.pockets[other]
            point, edge = np.array([pocket.x, pocket.y]), CHALK
        elif kind == "sliding_rolling":
            fill = CHALK
        marker, size, _ = MARKS[kind]
        ax.plot(*point, marker, markersize=size, color=fill, markeredgecolor=edge, markeredgewidth=0.7, zorder=7)
        overlaps = any(np.hypot(*(point - place)) < room for place in labelled)
        if kind != "sliding_rolling" and not overlaps:
            labelled.append(point)
            _label(ax, kind, scene, point, f"{time:.2f} s")


def _label(ax: Axes, kind: str, scene: Scene, point: Floats, text: str) -> None:
    """Writes an event's time on the rail, in the pocket, or next to two balls, towards the centre of the table."""
    x, y = np.where(point > 0, -1, 1).tolist()
    ground, offset, place = style.POCKET, (0, -4), {"ha": "center", "va": "top"}
    if kind == "ball_ball":
        ground, offset = CLOTH, (8 * x, 8 * y)
        place = {"ha": "left" if x > 0 else "right", "va": "bottom" if y > 0 else "top"}
    elif kind in ("cushion", "off_table"):
        across = np.array([scene.table.length, scene.table.width]) / 2 - abs(point)
        x, y = (np.sign(point) * (across == across.min())).astype(int).tolist()
        ground, offset, place = RAIL, (20 * x, 20 * y), {"ha": "center", "va": "center", "rotation": 90 * abs(x)}
    options: dict[str, Any] = {"textcoords": "offset points", "xytext": offset, "fontsize": 6.5, "zorder": 10, **place}
    box = {"facecolor": ground, "edgecolor": "none", "pad": 3.0 if ground == RAIL else 0.6}  # it hides a diamond
    ax.annotate(text, point.tolist(), color=CHALK, bbox=box, **options)
