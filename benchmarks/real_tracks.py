"""The physics against tracks of a real table: `python -m benchmarks.real_tracks FIT [--judge JUDGE]`.

It fits the constants of a scene to one file of tracks. With these constants it measures the errors of the shots in
another file. Without a second file it judges each fifth of the shots with the constants of the other four fifths.

With `--picture FILE` it measures nothing. It draws some shots of the first file with the constants in the JSON file.
"""

from __future__ import annotations

import dataclasses
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import ROOT, check_output, machine, parser_of, report, save, table
from billiards_env.calibration import Calibration, Track, calibrate, read_tracks
from billiards_env.calibration.cleaning import clean, noise_of
from billiards_env.calibration.frame import Frame
from billiards_env.calibration.judge import CONTACTS, Judged, judge, together
from billiards_env.calibration.preparation import INSTANT, prepare
from billiards_env.calibration.report import drawn
from billiards_env.calibration.starts import search
from billiards_env.commands import Job, all_jobs, ending
from billiards_env.drawing.tracks import draw_fit
from billiards_env.scene import Scene
from billiards_env.shots.noise import SCATTER
from billiards_env.shots.simulation import simulate

PARTS = 5

FIGURES = {
    "rows_5mm_contact2": ("rows within 5 mm until contact 2", "{:.1%}"),
    "rows_5mm_contact3": ("rows within 5 mm until contact 3", "{:.1%}"),
    "rows_10mm_contact3": ("rows within 10 mm until contact 3", "{:.1%}"),
    "median_mm_contact3": ("median error until contact 3, mm", "{:.3g}"),
    "median_mm_contact4": ("median error until contact 4, mm", "{:.3g}"),
    "predicted_mm_0.5s": ("cue ball 0.5 s after contact 3, mm", "{:.3g}"),
    "predicted_mm_1s": ("cue ball 1 s after contact 3, mm", "{:.3g}"),
    "predicted_mm_2s": ("cue ball 2 s after contact 3, mm", "{:.3g}"),
    "sequence": ("shots with the same contacts until the third cushion", "{:.1%}"),
}
"""The figures of a judgement: their texts and formats."""

GROWTH = {
    "real": "real shots",
    "exact": "simulated, exact cushions",
    "scatter": "simulated, default scatter",
    "estimate": "simulated, estimated scatter",
}
"""The columns and curves of the growth of the errors."""

DRAWN, UNTIL, LATER = 6, 3, 1.0
"""The number of shots in the picture, the contact until which they are fitted, and the time of the prediction, s."""


def fit(scene: Scene, tracks: list[Track]) -> Calibration:
    """Fits the constants and the frame to all tracks."""
    return calibrate(scene, tracks, frame="fit", hold_back=False, progress=_say)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def measure(scene: Scene, tracks: list[Track], others: list[Track] | None, job: Job) -> dict[str, Any]:
    """Fits and judges, and returns the figures. The judgement and the growth of the errors are jobs."""
    start = time.process_time()
    result = fit(scene, tracks)
    own = result.judged.to_dict()
    seconds = time.process_time() - start
    judged, grown = None, {}
    with job("judgement"):
        judged = cross_validated(scene, tracks) if others is None else result.judge(others)
    with job("growth of the errors"):
        grown = growth(result)
    return {
        "machine": machine(),
        "shots": len(tracks),
        "judged_shots": 0 if judged is None else judged.shots,
        "parts": 1 if others is not None else PARTS,
        "seconds": seconds,
        "frame": result.frame._asdict(),
        "scene": result.scene.to_dict(),
        "values": result.values,
        "kept": result.kept,
        "intervals_95": {name: list(ends) for name, ends in result.intervals.items()},
        "fitted": own,
        "judged": {} if judged is None else judged.to_dict(),
        "medians_mm": [] if judged is None else [1e3 * judged.median(k) for k in CONTACTS],
        "scatter": None if result.scatter is None else result.scatter._asdict(),
        "growth": grown,
    }


def cross_validated(scene: Scene, tracks: list[Track]) -> Judged:
    """Returns the judgement of each fifth of the tracks, with the constants of the other four fifths."""
    parts, each = np.arange(len(tracks)) % PARTS, list[Judged]()
    for part in range(PARTS):
        fitted = fit(scene, [tracks[k] for k in np.flatnonzero(parts != part)])
        each.append(fitted.judge([tracks[k] for k in np.flatnonzero(parts == part)]))
    return together(each)


def judge_simulated(result: Calibration, scatter: dict[str, float] | None) -> Judged:
    """Judges simulated shots with the starts, the rows and the noise of the fitted ones."""
    scene, shots = result.scene, []
    error = result.judged.median(1) / 1.1774  # the median distance of Gaussian errors in two coordinates
    for k, (shot, start) in enumerate(zip(result.shots, result.starts, strict=True)):
        velocities, spins = np.zeros((scene.n_balls, 2)), np.zeros((scene.n_balls, 3))
        velocities[shot.cue_ball], spins[shot.cue_ball] = result.velocities[k], result.spins[k]
        ideal = simulate(
            *(scene, result.positions[k], velocities),
            spins=spins,
            in_play=shot.in_play,
            record=True,
            scatter=scatter,
            seed=None if scatter is None else k,
        )
        track = shot.track.rows(~shot.added)
        times = np.maximum(track.times - shot.begin - start[INSTANT], 0.0)
        noise = np.random.default_rng(k).normal(0.0, error, track.positions.shape)
        places = ideal.at(times)[np.arange(len(times)), track.balls] + noise
        shots.append(prepare(scene, track._replace(positions=places), error))
    return judge(scene, shots)


def growth(result: Calibration) -> dict[str, Any]:
    """Returns the figures of the fitted shots, and of simulated ones without and with scatter of the cushions."""
    cases: dict[str, Judged] = {"real": result.judged, "exact": judge_simulated(result, None)}
    cases["scatter"] = judge_simulated(result, SCATTER)
    if result.scatter is not None:
        cases["estimate"] = judge_simulated(result, result.scatter.values)
    figures = {name: judged.to_dict() for name, judged in cases.items()}
    return {
        name: {f"median_mm_contact{k}": 1e3 * cases[name].median(k) for k in CONTACTS} | figures[name] for name in cases
    }


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    rows = []
    for name, (text, form) in FIGURES.items():
        cells = (result["judged"].get(name), result["fitted"][name])
        rows.append((text, *("-" if figure is None else form.format(figure) for figure in cells)))
    numbers = [
        (f"`{name}`", f"{value:.4g}", "{:.4g} to {:.4g}".format(*result["intervals_95"][name]))
        for name, value in result["values"].items()
    ]
    numbers += [(f"`{name}`", "-", why) for name, why in result["kept"].items()]
    grown = {f"median_mm_contact{k}": f"median error until contact {k}, mm" for k in CONTACTS}
    grown |= {name: text for name, (text, _) in FIGURES.items() if name.startswith("predicted")}
    growing = [
        (text, *("-" if (figure := case[name]) is None else f"{figure:.3g}" for case in result["growth"].values()))
        for name, text in grown.items()
    ]
    scattered = [
        (f"`{name}`", f"{value:.3f}", "{:.3f} to {:.3f}".format(*result["scatter"]["intervals"][name]))
        for name, value in (result["scatter"] or {"values": {}})["values"].items()
    ]
    parts, shots = result["parts"], result["shots"]
    each = f", each of {parts} parts with the constants that were fitted to the others" if parts > 1 else ""
    fitted = shots - shots // parts if parts > 1 else shots
    summary: dict[str, str] = {}
    if judged := result["judged"]:
        summary["summary"] = (
            f"Until the second contact of the cue ball, {judged['rows_5mm_contact2']:.0%} of the recorded positions of "
            f"{result['judged_shots']} shots are within 5 mm of the computed path. For each shot the constants of the "
            f"model are fitted to {fitted} other shots. Only the start is fitted to the shot itself."
        )
    return {
        "how": f"{shots} shots were fitted with `{result['scene']['physics']['cushion']}` cushions, in "
        f"{result['seconds']:.0f} s of processor time; {result['judged_shots']} shots were judged{each}.",
        **summary,
        "judged": table(("", "judged shots", "fitted shots"), rows),
        "numbers": table(("constant", "fitted", "95% interval"), numbers + scattered),
        "growth": table(("", *(GROWTH[name] for name in result["growth"])), growing),
    }


def draw(result: dict[str, Any], tracks: list[Track], path: Path) -> None:
    """Draws shots from a small to a large error, the errors of all shots, and their growth.

    Args:
        result: What `measure` returned for these tracks.
        tracks: The tracks.
        path: The file of the picture.
    """
    scene = Scene.from_dict(result["scene"])
    offset, scale, angle = result["frame"].values()
    frame = Frame(tuple(offset), tuple(scale), angle)
    tracks = [frame.apply(track) for track in clean(tracks)[0]]
    noise = noise_of(tracks)
    shots = [prepare(scene, track, noise) for track in tracks]
    judged = [judge(scene, [shot]) for shot in shots]
    order = np.argsort([each.median(UNTIL) for each in judged], kind="stable")
    panels = {}
    for k in order[(2 * np.arange(DRAWN) + 1) * len(order) // (2 * DRAWN)]:
        shot = shots[k]
        for contact in range(1, UNTIL + 1):
            shot = search(scene, shot.wide(contact))
        texts = [f"shot {shot.track.name}: {1e3 * judged[k].median(UNTIL):.1f} mm"]
        texts += [f"{1e3 * error:.0f} mm {LATER:g} s later" for error in judged[k].predicted[LATER]]
        panels[", ".join(texts)] = drawn(scene, shot, LATER)
    growing = {
        GROWTH[name]: {k: case[f"median_mm_contact{k}"] / 1e3 for k in CONTACTS}
        for name, case in result["growth"].items()
    }
    save(draw_fit(panels, together(judged).errors, growing), path)


@ending()
def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m benchmarks.real_tracks --help`."""
    output = ROOT / "benchmarks" / "results" / "real_tracks.json"
    about = "Fit the physics to a real table, and judge it."
    parser = parser_of("benchmarks.real_tracks", about, output=(output, "JSON file"))
    parser.add_argument("fit", type=Path, help="a file of tracks, in any frame")
    parser.add_argument("--judge", type=Path, help="other shots on the same table (default: cross-validation)")
    parser.add_argument("--scene", default="match_carom_2", help="the scene (default: %(default)s)")
    parser.add_argument("--cushion", help="the law of the cushions (default: that of the scene)")
    parser.add_argument("--picture", type=Path, help="draw this file with the constants in the JSON file, and stop")
    args = parser.parse_args(arguments)
    tracks = read_tracks(args.fit)
    if args.picture is not None:
        draw(json.loads(args.output.read_text(encoding="utf-8")), tracks, args.picture)
        return
    scene = Scene.named(args.scene, max(int(track.balls.max()) for track in tracks))
    if args.cushion is not None:
        scene = dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, cushion=args.cushion))
    check_output(args.output)
    others = None if args.judge is None else read_tracks(args.judge)
    with all_jobs() as job:
        report(measure(scene, tracks, others, job), blocks, args.output)


if __name__ == "__main__":
    main()
