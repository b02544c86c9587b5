import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from billiards_env import Scene, strike
from billiards_env.drawing.pace import PACES, faster, slower
from billiards_env.drawing.recording import recording_of
from billiards_env.engine import PIC, Engine
from billiards_env.games import NO_CALL, Call, Stroke, play, to_dict
from billiards_env.games.placement import placement_area
from billiards_env.play import model as actions
from billiards_env.play.model import LEAST_SPEED, begin, go, look_at, shoot, tick, turn_aim, undo
from billiards_env.play.preview import make_preview
from billiards_env.players.planner import Plan
from billiards_env.scene import Physics
from tests.helpers.shots import simulate

BALLS = [[-0.4, 0.0], [0.4, 0.0], [0.4, 0.5]]
NINE = [[0.0, 0.0], *([-1.0 + 0.12 * i, -0.5] for i in range(9))]
INTO_THE_CORNER = [[0.97, 0.335], [1.07, 0.435], [-0.5, 0.0]]


def after(model, *steps) -> Any:
    """Returns the model after actions; one with arguments is a tuple."""
    for step in steps:
        act, *arguments = step if isinstance(step, tuple) else (step,)
        model = act(model, *arguments)
    return model


def same(one, other):
    """Returns whether two games are in the same state, bit for bit."""
    return (
        one.strokes == other.strokes
        and to_dict(one.game.state) == to_dict(other.game.state)
        and (one.game.positions == other.game.positions).all()
    )


def test_a_shot_from_the_cue_ball_in_hand_to_the_next_player(make_model):
    placing = make_model("nine_ball")
    aiming = after(placing, go, (turn_aim, 2.0))
    model = after(aiming, go)
    for _ in range(math.ceil(60 * model.duration)):
        assert (placing.phase, aiming.phase, model.phase) == ("placing", "aiming", "rolling")
        model = tick(model, 1 / 60)
    assert model.phase in ("aiming", "placing")
    assert model.game.state.player == 1
    assert (model.game.positions == play(model.setup, aiming.game, aiming.stroke).game.positions).all()


def test_the_first_aim_is_full_on_the_nearest_legal_ball(make_model):
    balls = [[0.0, 0.0], *([-1.0 + 0.1 * i, 0.5] for i in range(9))]
    assert make_model("nine_ball", balls).aim.angle == math.atan2(0.5, -1.0)
    assert make_model("straight", [[0.0, 0.0], [0.4, -0.3], [0.8, 0.0]]).aim.angle == math.atan2(-0.3, 0.4)


def test_actions_change_direction_and_speed(make_model):
    model = after(make_model(), (actions.press_arrow, -10.0, 0.0), (actions.press_arrow, 0.0, 5.0))
    assert (math.degrees(model.aim.angle), model.aim.speed) == pytest.approx((10.0, 2.5))
    assert model.stroke.velocity == pytest.approx(2.5 * model.aim.along)
    assert after(model, (actions.change_speed, 100.0)).aim.speed == model.max_speed
    assert after(model, (actions.change_speed, -100.0)).aim.speed == LEAST_SPEED
    assert after(model, (look_at, model.cue_position, True)).aim.speed == LEAST_SPEED


def test_inputs_that_do_not_apply_have_no_effect(make_model):
    aiming, placing = make_model(), make_model("nine_ball")
    rolling = after(aiming, go)
    paused = after(rolling, (actions.toggle_page, "keys"))
    rows = [
        (aiming, (actions.move_to, (0.0, 0.0)), actions.place, undo, actions.repeat, (tick, 1.0)),
        (placing, (turn_aim, 1.0), (actions.change_speed, 1.0), (look_at, (0.0, 0.0)), (tick, 1.0)),
        (rolling, (turn_aim, 1.0), (actions.aim_like, aiming.stroke)),
        (paused, (tick, 1.0)),
        (after(rolling, go, actions.repeat, (tick, 1e9)), (tick, 1.0)),
    ]
    for model, *steps in rows:
        assert all(after(model, step) is model for step in steps)
    assert after(paused, go, (tick, 0.1)).clock == 0.1  # the first action only closes the page


def test_a_cue_ball_in_hand_moves_to_the_nearest_free_point(make_model):
    model = after(make_model("nine_ball"), (actions.move_to, (-0.9, 0.2)))
    assert model.cue_position == (-0.9, 0.2)
    model = after(model, (actions.press_arrow, 1.0, -2.0))
    assert model.cue_position == pytest.approx((-0.89, 0.18))
    model = after(model, (actions.move_to, (0.5, 9.0)), go)  # limited by the head string and the cushion
    _, x, _, y = placement_area(model.setup.scene, 0, behind=True)
    assert (model.cue_position, model.stroke.place) == ((x, y), (x, y))
    assert after(model, actions.place).phase == "placing"
    anywhere = make_model(state={"in_hand": "anywhere"})
    placed = np.array(after(anywhere, (actions.move_to, (0.4, 0.01))).cue_position)
    assert np.hypot(*(placed - BALLS[1])) > 2 * anywhere.setup.scene.balls.radius[0]


@pytest.mark.parametrize("engine", [PIC, Engine("pit", 1 / 60)])
def test_the_preview_shows_the_shot_up_to_the_next_contacts(make_model, engine):
    model = after(make_model(engine=engine), (turn_aim, 1.5))
    preview, shot = model.preview, simulate(model.setup.scene, BALLS, model.stroke.velocity, engine=engine, record=True)
    hit, *later = shot.events[np.isin(shot.events["kind"], ("ball_ball", "cushion", "pocket"))]
    assert (preview.ball, preview.path[0].tolist()) == (1, BALLS[0])
    assert preview.path[-1].tolist() == preview.cue[0].tolist()
    for ball, path in ((0, preview.cue), (1, preview.struck)):
        own = [e["time"] for e in later if e["ball"] == ball or (e["kind"] == "ball_ball" and e["other"] == ball)]
        before = np.array((hit["time"], min(own, default=shot.time))) - 1e-9  # then a fix or a pocket moves the ball
        assert path[[0, -1]] == pytest.approx(shot.at(before)[:, ball], abs=1e-6)


def test_a_preview_without_contact_shows_the_whole_path(make_model):
    model = after(make_model(), (turn_aim, 180.0), (actions.change_speed, -1.9))
    shot = simulate(model.setup.scene, BALLS, model.stroke.velocity)
    assert model.preview.ball == -1
    assert model.preview.path[-1] == pytest.approx(shot.positions[0], abs=1e-12)
    potted = make_preview(model.setup, make_model(positions=INTO_THE_CORNER).game, Stroke((0.0, -5.0)))
    assert np.isfinite(potted.path).all()


def test_the_preview_uses_the_cue_ball_of_the_player(make_model):
    model = make_model("carom", [[-0.5, 0.3], [0.5, 0.0], [-0.5, 0.0]], {"player": 1, "cue_balls": [2, 0]})
    assert (model.cue, model.preview.path[0].tolist(), model.preview.ball) == (2, [-0.5, 0.0], 0)


def test_the_tip_of_the_cue_does_not_slip(make_model):
    model = after(make_model(), (actions.set_tip, 0.9, -1.2))
    assert math.hypot(*model.aim.tip) == pytest.approx(0.5, rel=2e-3)
    assert model.aim.tip[0] / model.aim.tip[1] == pytest.approx(-0.75)
    assert after(model, (actions.raise_cue, 200.0)).aim.elevation == 90.0
    assert after(model, actions.level).aim.tip == (0.0, 0.0)
    assert after(model, go, go).aim.tip == (0.0, 0.0)  # the next turn begins with a level cue


def test_scenes_without_spin_have_no_english(make_model):
    rolling = Physics(motion="rolling", cushion="restitution")
    model = make_model(scene=dataclasses.replace(Scene.named("pool", 2), physics=rolling))
    assert after(model, (actions.set_tip, 0.3, 0.0), (actions.raise_cue, 20.0)) is model
    assert model.stroke.velocity == (2.0, 0.0)


def test_balls_keep_their_orientation_from_shot_to_shot(make_model):
    first = after(make_model(), (look_at, (0.4, 0.03)), go)
    second = after(first, go)
    assert first.first_faces is None
    assert abs(second.faces[0, 0]) < 1
    assert second.faces[2].tolist() == [1.0, 0.0, 0.0, 0.0]  # has not moved
    assert after(second, go).first_faces is second.faces


def test_undo_and_a_file_reproduce_the_bits(make_model):
    steps = (actions.move_to, (-0.8, 0.1)), go, (turn_aim, 0.31), (actions.set_tip, 0.2, -0.3)
    start = after(make_model("nine_ball"), *steps)
    done = after(start, go, go)
    undone = after(done, undo)
    assert (undone.strokes, undone.last_shot, undone.aim, undone.stroke) == ((), None, start.aim, start.stroke)
    assert same(after(undone, go, go), done)
    assert same(after(done, go, go, undo), done)
    loaded = begin(done.history, start.players, 8.0, 1 / 60)
    assert same(loaded, done)
    assert loaded.phase == done.phase
    assert after(loaded, undo).aim.place == start.aim.place
    assert after(loaded, undo).stroke.velocity == pytest.approx(start.stroke.velocity)
    with pytest.raises(ValueError, match="players = human, human, human: expected 2"):
        begin(done.history, ("human",) * 3, 8.0, 1 / 60)


def test_undo_returns_to_the_last_shot_of_a_person(make_model):
    model = after(make_model(players=("human", "random")), (turn_aim, 90.0), go, go)
    assert model.phase == "thinking"
    model = after(model, (shoot, Stroke((0.1, 0.1))), go)
    assert (len(model.strokes), len(after(model, undo).strokes)) == (2, 0)
    programs = after(make_model(players=("random", "random")), (shoot, Stroke((0.1, 0.0))), go)
    assert after(programs, undo) is programs


@pytest.mark.parametrize(
    ("engine", "ghost"), [(PIC, Engine("pit", 1 / 60)), (Engine("pit", 1 / 240), PIC)], ids=["pic", "pit"]
)
def test_a_replay_shows_the_shot_of_the_other_engine(make_model, engine, ghost):
    model = after(make_model(engine=engine), (turn_aim, 1.0), go, go)
    replay = after(model, actions.repeat)
    for shot, of in zip(replay.shown_shots, (engine, ghost), strict=True):
        expected = simulate(model.setup.scene, BALLS, model.strokes[0].velocity, engine=of)
        assert (shot.positions == expected.positions).all()
    assert after(replay, (actions.toggle, "ghost")).shown_shots[1] is None
    end = tick(replay, 1e9)  # the end remains visible
    assert (end.phase, end.clock) == ("replaying", max(shot.time for shot in replay.shown_shots))
    assert (after(end, go).aim.angle, after(end, go).phase) == (model.aim.angle, model.phase)
    assert after(tick(replay, 1.0), actions.repeat).clock == 0.0


def test_slower_and_faster_change_the_pace(make_model):
    model = after(make_model(), (actions.change_pace, slower), go)
    assert tick(model, 1.0).clock == 0.5
    for change, limit in ((slower, PACES[0]), (faster, PACES[-1])):
        assert after(model, *[(actions.change_pace, change)] * 20).pace == limit


def test_a_game_that_is_over_has_no_further_shot(make_model):
    model = after(make_model(positions=INTO_THE_CORNER, target=1), go, go)
    assert (model.phase, model.game.state.winner) == ("over", 0)
    assert after(model, go) is model
    assert after(model, actions.repeat).phase == "replaying"
    assert after(model, actions.repeat, go).phase == "over"
    assert after(model, undo).phase == "aiming"


def test_the_aimed_ball_and_pocket_are_called(make_model):
    model = make_model("straight", [[-0.3, 0.0], [0.5, 0.3], [0.5, -0.3]], call_shot=True)
    model, pockets = after(model, (look_at, (0.5, 0.3))), model.setup.scene.table.pockets
    ball, pocket, _ = model.stroke.call
    assert (ball, pockets[pocket].x > 1, pockets[pocket].y > 0.6) == (1, True, True)
    other = after(model, (actions.next_called, "ball"), (actions.next_called, "pocket"))
    assert other.stroke.call == Call(2, (pocket + 1) % 6)
    safety = after(other, actions.next_kind)
    assert safety.stroke.call == Call(kind="safety")
    assert after(safety, (actions.next_called, "ball")) is safety
    assert after(safety, actions.next_kind).call == model.call
    model = after(make_model(), (actions.next_called, "ball"), (actions.next_called, "pocket"))
    assert after(model, actions.next_kind).call == NO_CALL


def test_a_push_out_is_handed_back(make_model):
    state = {"choices": ["push_out"]}
    model = make_model("nine_ball", NINE, state, choices=True)
    assert make_model("nine_ball", NINE, state).kinds == ("shot",)
    pushed = after(model, (look_at, (0.3, 0.6)), actions.next_kind, go)
    assert (pushed.last_shot.facts.first, pushed.last_shot.verdict.foul) == (0, 0)
    model = after(pushed, go)
    assert (model.game.state.player, model.kinds) == (1, ("shot", "hand_back"))
    back = after(model, actions.next_kind, go, go)
    assert (back.game.state.player, back.phase) == (0, "aiming")
    assert (back.game.positions == model.game.positions).all()
    assert after(back, undo).aim.call == NO_CALL


def test_a_colour_is_nominated(make_model):
    opening = make_model("snooker").game.positions.copy()
    opening[0] = [-0.5, 0.3]
    model = after(make_model("snooker", opening, {"colour": True}), *[(actions.next_called, "ball")] * 4)
    assert model.stroke.call == Call(ball=19)
    assert after(make_model("snooker", opening), (actions.next_called, "ball")).call == NO_CALL  # a red is on


def test_the_aim_for_a_stroke_is_that_stroke(make_model):
    model = make_model(state={"in_hand": "anywhere"})
    for side, top in ((0.0, 0.0), (0.3, 0.2), (-0.2, -0.4)):
        made = strike(model.setup.scene, 2.0, 0.7, side, top)
        stroke = Stroke(tuple(made.velocity.tolist()), (-0.5, 0.1), tuple(made.spin.tolist()))
        aimed = actions.aim_like(model, stroke)
        assert (aimed.phase, aimed.aim.place) == ("aiming", (-0.5, 0.1))
        assert aimed.aim.tip == pytest.approx((side, top), abs=1e-9)
        np.testing.assert_allclose(aimed.stroke.velocity, stroke.velocity, atol=1e-9)
        np.testing.assert_allclose(aimed.stroke.spin, stroke.spin, atol=1e-9)
        played = shoot(model, stroke)
        assert (played.phase, played.aim) == ("rolling", aimed.aim)  # the controls show the stroke of a program
        assert after(played, go, actions.repeat).aim == aimed.aim


def test_the_best_considered_shots_are_shown_first(make_model):
    shots = ((0.0, 1), (2.0, 2), (1.0, 2))
    one, two, new = (Plan(Stroke((2.0, y)), 0.31, 0.62, ball, 2, np.zeros((3, 2)), 40) for y, ball in shots)
    model = after(make_model(players=("random", "human")), (actions.consider, (one, two)), (actions.consider, (new,)))
    assert [shot.plan for shot in model.considered] == [new, one]
    assert after(model, (shoot, one.stroke)).considered == ()
    assert actions.consider(make_model(), (one,)).considered == ()


def test_a_raised_cue_makes_the_ball_hop_in_a_scene_with_flight(make_model):
    model = make_model(scene=Scene.named("jump_pool", 2))
    played = after(model, (look_at, (0.4, 0.3)), (actions.raise_cue, 40.0), go)
    assert np.ptp(recording_of(played.last_shot.shot).heights(0, np.linspace(0, 0.1, 50))) > 0.01
    again = begin(played.history, model.players, 8.0, 1 / 60)
    assert same(played, again)
    assert after(played, go, actions.repeat).shown_shots[1].heights is not None
