"""The checks of the JavaScript module, in Node without engines: wrong input has the errors of Python."""

import dataclasses
import json
import math
import shutil
import subprocess

import pytest

from billiards_env import Engine, Scene, simulate, strike
from billiards_env.engine.compile import scene_fields
from docs.web import build

NAN = math.nan
PLACES = [[-0.6, 0.0], [0.6, 0.02]]

SCRIPT = """
const [data, calls] = JSON.parse(require("fs").readFileSync(0, "utf8"));
const exports_ = new Proxy({}, { get: (_, name) => { throw new Error(`reached ${name}`); } });
const engine = new Engine(exports_, data), places = [[-0.6, 0], [0.6, 0.02]];
const results = calls.map(call => { try { return eval(call); } catch (error) { return error.message; } });
console.log(JSON.stringify(results));
"""


def shot(**arguments):
    return lambda: simulate(Scene.named("pool"), PLACES, **{"velocities": [2.0, 0.0], **arguments})


def engine(*arguments):
    return lambda: Engine(*arguments)


def physics(scene="pool", **changes):
    return lambda: dataclasses.replace(Scene.named(scene).physics, **changes)


def cue(speed, heading, *others, scene="pool"):
    return lambda: strike(Scene.named(scene), speed, heading, *others)


SAME = [
    ("{maxTime: NaN}", shot(max_time=NAN)),
    ("{maxEvents: 1.5}", shot(max_events=1.5)),
    ("{mode: 'pci'}", engine("pci")),
    ("{mode: 'pit'}", engine("pit")),
    ("{mode: 'pit', dt: 1e-12}", engine("pit", 1e-12)),
    ("{mode: 'pit', dt: 0.1, fix: 'x'}", engine("pit", 0.1, "x")),
    ("{dt: 0.1}", engine("pic", 0.1)),
    ("{fix: 'none'}", engine("pic", None, "none")),
    ("{physics: {e_ball: 2}}", physics(e_ball=2)),
    ("{physics: {g: 5000.5}}", physics(g=5000.5)),
    ("{physics: {e_cushion: 0.1, e_cushion_floor: 0.5}}", physics(e_cushion=0.1, e_cushion_floor=0.5)),
    ("'real_pool', {physics: {e_cushion: 0.3}}", physics("real_pool", e_cushion=0.3)),
    (
        "'real_carom', {physics: {e_cushion_loss: 0.1, e_cushion_floor: 0.2}}",
        physics("real_carom", e_cushion_loss=0.1, e_cushion_floor=0.2),
    ),
    ("places, [2000.5, 0.5]", shot(velocities=[2000.5, 0.5])),
    ("{spins: [0.5, 2000000.5, 0.5]}", shot(spins=[0.5, 2000000.5, 0.5])),
    ("strike {speed: 1, heading: 11.5}", cue(1.0, 11.5)),
    ("strike {speed: 1, heading: 0, side: 1.5}", cue(1.0, 0.0, 1.5)),
    ("strike {speed: 1, heading: 0, side: 0.75, top: -0.75}", cue(1.0, 0.0, 0.75, -0.75)),
    ("strike 'ideal', {speed: 1, heading: 0}", cue(1.0, 0.0, scene="ideal")),
]
"""Wrong arguments in JavaScript, and the call of Python with the same values."""

OTHER = [
    ("'pol', {}", "scene = 'pol': expected one of 'pool', 'carom', "),
    ("5", "options = 5: expected an object"),
    ("{maxtime: 1}", "key of options = 'maxtime': expected one of 'mode', "),
    ("{physics: 5}", "physics = 5: expected an object"),
    ("{physics: {slide: 0}}", "key of physics = 'slide': expected one of 'g', 'mu_slide', "),
    ("{physics: {e_ball: undefined}}", "physics.e_ball = undefined: expected a number from 0 to 1"),
    ("{physics: {e_ball: '1'}}", "physics.e_ball = '1': expected a number from 0 to 1"),
    ("{inPlay: ['no', true]}", "inPlay = ['no', true]: expected true or false"),
    ("{spins: [0, 0]}", "spins = [0, 0]: expected 3 finite numbers for each of 2 balls"),
    ("'ideal', {spins: [0, 0, 1]}", "spins = [0, 0, 1] with physics.motion = 'ideal': expected null"),
    (
        "places, {velocity: [1, 0], spin: [0, 0, 0]}, {spins: [0, 0, 1]}",
        "spins = [0, 0, 1] with a strike: expected null",
    ),
    ("places, null", "velocities = null: expected 2 finite numbers"),
    ("[[0, 0], [0.5, NaN]], [1, 0]", "positions = [[0, 0], [0.5, NaN]]: expected 2 finite numbers for each of 2 balls"),
    ("undefined, [1, 0]", "positions = undefined: expected 2 finite numbers"),
    ("Array.from({length: 17}, () => [0, 0]), [1, 0]", "positions has 17 balls: expected at most 16"),
    ("strike {heading: 0}", "speed = undefined: expected numbers from -1000 to 1000 m/s"),
    ("strike {speed: 1, heading: 0, elevaton: 1}", "key of strike = 'elevaton': expected one of 'speed', "),
]
"""Wrong arguments in JavaScript, and the beginning of the error."""


def call_of(wrong):
    """Returns the call: `wrong` holds all arguments, or only some of them from the last one on."""
    method = "strike" if wrong.startswith("strike") else "simulate"
    wrong = wrong.removeprefix("strike ")
    scene = "" if wrong.startswith("'") else "'pool', "
    if method == "simulate" and wrong.startswith("'"):
        wrong = wrong.replace(", ", ", places, [2, 0], ", 1)
    elif method == "simulate" and not wrong.startswith(("places", "[", "undefined", "Array")):
        wrong = f"places, [2, 0], {wrong}"
    return f"engine.{method}({scene}{wrong})"


@pytest.fixture(scope="module")
def run():
    """Returns a function that evaluates expressions in Node. Those that reach an engine have the result "reached"."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not on the PATH")
    data = build.data()

    def evaluate(calls):
        program = build.module().replace("export ", "") + SCRIPT
        sent = json.dumps([data, calls])
        done = subprocess.run([node, "-e", program], input=sent, capture_output=True, text=True, check=True)
        return json.loads(done.stdout)

    return evaluate


def test_wrong_input_has_the_errors_of_python(run):
    names = {"maxTime": "max_time", "maxEvents": "max_events", "NaN": "nan", "null": "None", "undefined": "None"}
    for (wrong, python), message in zip(SAME, run([call_of(wrong) for wrong, _ in SAME]), strict=True):
        for name, other in names.items():
            message = message.replace(name, other)
        with pytest.raises((TypeError, ValueError)) as error:
            python()
        assert ": expected " in message
        assert str(error.value).startswith(message), wrong


def test_other_wrong_input_is_refused(run):
    for (wrong, expected), message in zip(OTHER, run([call_of(wrong) for wrong, _ in OTHER]), strict=True):
        assert message.startswith(expected), wrong
    valid = run(["engine.isValid('pool', places, [1, 0], {inplay: []})", "engine.simulate('pool', places, [1, 0])"])
    assert valid == ["key of options = 'inplay': expected one of 'spins', 'inPlay'", "reached reset"]


def test_the_numbers_of_the_engine_are_those_of_python(run):
    changes = {"g": 9.7, "mu_slide": 0.21, "mu_roll": 0.011, "e_ball": 0.9, "mu_ball_factor": 1.5, "e_cushion": 0.8}
    scenes = build.scenes()
    for given in ({}, changes):
        of = [f"checkedNumbers(engine.scene({name!r}), {json.dumps(given)}, engine.data.ranges)" for name in scenes]
        for scene, numbers in zip(scenes.values(), run(of), strict=True):
            changed = dataclasses.replace(scene, physics=dataclasses.replace(scene.physics, **given))
            record = scene_fields(changed)[0][0]
            assert numbers == {name: record[name].item() for name in numbers}
            assert set(numbers) >= {"slide", "roll", "mu_limit", "e_cushion"}
            assert ("weak_speed" in numbers) == (scene.physics.motion != "ideal")
