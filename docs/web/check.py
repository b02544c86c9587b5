"""Compares shots in a browser with shots in Python, bit for bit: `python -m docs.web.check`.

The shots are random shots, breaks and shots with a timestep in each scene. The command counts the shots with the same
bits (positions, velocities, spins, times, events and positions between the events), measures the time of a shot, and
writes both to `docs/web/results/check.json`. It needs `engine.wasm` of `make page`, the extra `web`, and Chromium or
Chrome.
"""

from __future__ import annotations

import base64
import contextlib
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks import machine, ratio, rows_table, run_command
from billiards_env.engine.compile import Engine
from billiards_env.engine.log import KINDS
from billiards_env.engine.overlaps import FIXES
from billiards_env.engine.shots import STATUS
from billiards_env.scene import Scene, layouts
from billiards_env.shots.simulation import simulate
from docs.web import build

SCENES = "pool", "carom", "ideal", "blocked_pool", "real_pool", "real_carom"
CASES = {"random": 3, "break": 9, "timestep": 3}
"""The number of object balls of each kind of shot."""
BATCH, REPEATS = 50, 20
"""The shots in a batch, and its repeats. The time of a shot comes from the fastest repeat."""
BROWSERS = "chromium", "chromium-browser", "google-chrome"
TIMES = 0.1, 0.7, 1.9  # s; positions between the events are compared there

Floats = NDArray[np.float64]

SCRIPT = """
window.bitsOf = async (bytes, shots, times) => {
  const engine = window.engine ??= await load(Uint8Array.from(atob(bytes), letter => letter.charCodeAt(0)));
  const { kinds, status } = engine.data, begun = performance.now();
  const results = shots.map(({ scene, positions, velocities, ...options }) =>
    engine.simulate(scene, positions, velocities, options));
  const spent = performance.now() - begun;
  const all = results.map(shot => [
    shot.time, shot.nEvents, status.indexOf(shot.status), shot.firstHit, shot.firstHitTime, ...shot.cushions,
    ...shot.potted.map(Number), ...shot.pockets, ...shot.potOrder, ...shot.touchedFirst.map(Number),
    ...shot.positions.flat(), ...shot.velocities.flat(), ...shot.spins.flat(),
    ...shot.events.flatMap(e => [e.time, kinds.indexOf(e.kind), e.ball, e.other, e.x, e.y, e.speed, Number(e.rule)]),
    ...times.flatMap(time => shot.at(time).flat()),
  ]);
  const letters = row => Array.from(new Uint8Array(Float64Array.from(row).buffer), byte => String.fromCharCode(byte));
  return [spent / 1000, all.map(row => btoa(letters(row).join("")))];
};
"""


def random_shots(name: str, case: str, count: int, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Returns `count` shots of a scene as arguments of `simulate` of JavaScript."""
    scene, shots = Scene.named(name, CASES[case]), []
    for _ in range(count):
        positions = layouts.draw("rack" if case == "break" else "random", scene, rng)
        velocity = (
            np.array([rng.uniform(6.0, 9.0), rng.uniform(-1.0, 1.0)]) if case == "break" else rng.uniform(-3, 3, 2)
        )
        shot = {"scene": name, "positions": positions.tolist(), "velocities": velocity.tolist()}
        if scene.physics.motion == "sliding":
            shot["spins"] = rng.uniform(-60, 60, 3).tolist()
        if case == "timestep":
            shot |= {"mode": "pit", "dt": 1 / float(rng.choice([15, 30, 60, 240, 960])), "fix": str(rng.choice(FIXES))}
        shots.append(shot)
    return shots


def python_bits(shot: dict[str, Any]) -> Floats:
    """Runs a shot in Python and returns its result as numbers, in the order of `SCRIPT`."""
    name, positions, velocities, options = _parts(shot)
    result = simulate(Scene.named(name, len(positions) - 1), positions, velocities, record=True, **options)
    assert result.events is not None
    events = [
        number
        for e in result.events
        for number in (e["time"], KINDS.index(e["kind"]), *(e[k] for k in ("ball", "other", "x", "y", "speed", "rule")))
    ]
    counts = result.time, result.n_events, STATUS.index(result.status), result.first_hit, result.first_hit_time
    ends = result.positions, result.velocities, result.spins
    records = result.cushions, result.potted, result.pockets, result.pot_order, result.touched_first
    parts = counts, *records, *ends, events, result.at(TIMES)
    return np.concatenate([np.ravel(part) for part in parts]).astype(np.float64)


def _parts(shot: dict[str, Any]) -> tuple[str, list[Any], list[float], dict[str, Any]]:
    engine = Engine(shot.get("mode", "pic"), shot.get("dt"), shot.get("fix"))
    return shot["scene"], shot["positions"], shot["velocities"], {"engine": engine, "spins": shot.get("spins")}


@contextlib.contextmanager
def browser_page() -> Iterator[Any]:
    """Opens a page with the module in Chromium."""
    from playwright.sync_api import sync_playwright

    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        page = browser.new_page()
        page.goto((build.HERE / "engine.js").as_uri())  # a page without an address cannot compute hashes
        page.set_content(f'<script type="module">{build.module()}{SCRIPT}</script>')
        page.wait_for_function("() => window.bitsOf !== undefined")
        yield page
        browser.close()


def browser_bits(page: Any, engine: bytes, shots: list[dict[str, Any]]) -> tuple[float, list[Floats]]:
    """Runs shots in a page of `browser_page`. Returns the time in s and the numbers of each shot."""
    text = base64.b64encode(engine).decode()
    spent, rows = page.evaluate("([bytes, shots, times]) => bitsOf(bytes, shots, times)", [text, shots, TIMES])
    return spent, [np.frombuffer(base64.b64decode(row)) for row in rows]


def python_time(shots: list[dict[str, Any]]) -> float:
    """Returns the time of recorded shots in Python, s."""
    scenes = [Scene.named(shot["scene"], len(shot["positions"]) - 1) for shot in shots]
    parts = [_parts(shot) for shot in shots]
    begun = perf_counter()
    for scene, (_, positions, velocities, options) in zip(scenes, parts, strict=True):
        simulate(scene, positions, velocities, record=True, **options)
    return perf_counter() - begun


def same(one: Floats, two: Floats) -> bool:
    """Returns whether two arrays have the same bits."""
    return one.tobytes() == two.tobytes()


def measure(shots: int, engine: Path) -> dict[str, Any]:
    """Compares `shots` of each kind and scene, and a tenth as many breaks, with the file `engine.wasm`.

    Returns:
        `rows`: a list with one entry for each scene and kind of shot, with the number of equal shots and the times of
        a recorded shot, s.
    """
    wasm = engine.read_bytes()
    rng, on, rows = np.random.default_rng(0), machine(), []
    with browser_page() as page:
        for name in SCENES:
            for case in CASES:
                drawn = random_shots(name, case, shots // (10 if case == "break" else 1), rng)
                _, bits = browser_bits(page, wasm, drawn)
                timed = drawn[:BATCH]
                rows.append(
                    {
                        "scene": name,
                        "case": case,
                        "shots": len(drawn),
                        "browser": sum(same(row, python_bits(shot)) for row, shot in zip(bits, drawn, strict=True)),
                        "python_seconds": min(python_time(timed) for _ in range(REPEATS)) / max(1, len(timed)),
                        "browser_seconds": min(browser_bits(page, wasm, timed)[0] for _ in range(REPEATS))
                        / max(1, len(timed)),
                    }
                )
                print(f"{name}, {case}: {rows[-1]['browser']} of {len(drawn)} shots have the same bits", flush=True)
    return {"machine": on, "engine_bytes": len(wasm), "rows": rows}


def blocks(result: dict[str, Any]) -> dict[str, str]:
    """Returns the results as Markdown, by name."""
    columns = {
        "scene": "`{scene}`",
        "shots": "{case}",
        "number": "{shots:,}",
        "same bits in Chromium": "{browser:,}",
        "Python": "{python:.0f} us",
        "Chromium": "{chromium:.0f} us",
        "ratio": "{ratio}",
    }
    rows = []
    for row in result["rows"]:
        python, chromium = 1e6 * row["python_seconds"], 1e6 * row["browser_seconds"]
        rows.append({**row, "python": python, "chromium": chromium, "ratio": ratio(chromium / python)})
    return {
        "size": f"`engine.wasm` has {result['engine_bytes'] / 1000:.0f} kB.",
        "bits": rows_table(columns, rows, left=2),
    }


def main(arguments: list[str] | None = None) -> None:
    """Runs the command line; see `python -m docs.web.check --help`."""
    options = {
        "shots": (1000, "shots of each kind and scene; a tenth of it breaks"),
        "engine": (build.ROOT / "site" / "engine.wasm", "the file to check"),
    }
    about = "Compare shots in a browser with those of Python."
    result = run_command("docs.web.check", about, arguments, measure, blocks, options)
    if failed := sum(row["shots"] - row["browser"] for row in result["rows"]):
        sys.exit(f"{failed} shots have other bits")


if __name__ == "__main__":
    main()
