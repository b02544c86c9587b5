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
from billiards_env.play.model import LEAST_SPEED, begin, shoot, tick
from billiards_env.play.preview import make_preview
from billiards_env.scene import Physics
from tests.helpers.shots import simulate

STRAIGHT = [[-0.4, 0.0], [0.4, 0.0], [0.4, 0.5]]
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
    model = make_model("nine_ball")
    assert model.phase == "placing"
    model = after(model, actions.go)
    assert model.phase == "aiming"
    model = after(model, (actions.turn_aim, 2.0), actions.go)
    assert model.phase == "rolling"
    shot = model.shown_shots[0]
    for _ in range(math.ceil(60 * shot.time)):
        assert model.phase == "rolling"
        model = tick(model, 1 / 60)
    assert model.phase in ("aiming", "placing")
    assert model.game.state.player == 1
    stroke = model.strokes[0]
    assert (model.game.positions == play(model.setup, model.games[0], stroke).game.positions).all()


def test_the_first_aim_is_full_on_the_nearest_legal_ball(make_model):
    balls = [[0.0, 0.0], *([-1.0 + 0.1 * i, 0.5] for i in range(9))]
    model = make_model("nine_ball", balls)
    assert model.aim.angle == math.atan2(0.5, -1.0)
    model = make_model("straight", [*balls[:1], [0.4, -0.3], [0.8, 0.0]])
    assert model.aim.angle == math.atan2(-0.3, 0.4)


def test_arrow_keys_change_direction_and_speed(make_model):
    model = after(make_model(positions=STRAIGHT), (actions.turn_aim, 10.0), (actions.change_speed, 0.5))
    assert math.degrees(model.aim.angle) == pytest.approx(10.0)
    assert model.aim.speed == pytest.approx(2.5)
    assert model.stroke.velocity == pytest.approx((2.5 * math.cos(model.aim.angle), 2.5 * math.sin(model.aim.angle)))
    assert after(model, (actions.change_speed, 100.0)).aim.speed == model.max_speed
    assert after(model, (actions.change_speed, -100.0)).aim.speed == LEAST_SPEED
    assert after(model, (actions.look_at, model.cue_position, True)).aim.speed == LEAST_SPEED


def test_inputs_that_do_not_apply_have_no_effect(make_model):
    aiming = make_model(positions=STRAIGHT)
    for inputs in ((actions.move_to, (0.0, 0.0)), actions.place, actions.undo, actions.repeat):
        assert after(aiming, inputs) is aiming
    placing = make_model("nine_ball")
    for inputs in ((actions.turn_aim, 1.0), (actions.change_speed, 1.0), (actions.look_at, (0.0, 0.0))):
        assert after(placing, inputs) is placing
    assert tick(aiming, 1.0) is aiming
    rolling = after(aiming, actions.go)
    assert actions.turn_aim(rolling, 1.0) is rolling


def test_a_cue_ball_in_hand_moves_to_the_nearest_free_point(make_model):
    model = after(make_model("nine_ball"), (actions.move_to, (-0.9, 0.2)))
    assert model.cue_position == (-0.9, 0.2)
    model = after(model, (actions.press_arrow, 1.0, -2.0))
    assert model.cue_position == pytest.approx((-0.89, 0.18))
    model = after(model, (actions.move_to, (0.5, 9.0)))  # limited by the head string and the cushion
    _, x, _, y = placement_area(model.setup.scene, 0, behind=True)
    assert model.cue_position == (x, y)
    model = after(model, actions.go)
    assert after(model, actions.place).phase == "placing"
    assert model.stroke.place == (x, y)
    anywhere = make_model(positions=STRAIGHT, state={"in_hand": "anywhere"})
    placed = np.array(after(anywhere, (actions.move_to, (0.4, 0.01))).cue_position)
    assert np.hypot(*(placed - STRAIGHT[1])) > 2 * anywhere.setup.scene.balls.radius[0]


@pytest.mark.parametrize("engine", [PIC, Engine("pit", 1e-4)])
def test_the_preview_ends_at_the_first_contact_of_the_engine(make_model, engine):
    model = after(make_model(positions=STRAIGHT, engine=engine), (actions.turn_aim, 1.5))
    preview = model.preview
    shot = simulate(model.setup.scene, STRAIGHT, model.stroke.velocity, record=True)
    hit = shot.events[shot.events["kind"] == "ball_ball"][0]
    assert preview.ball == 1
    assert preview.path[0].tolist() == STRAIGHT[0]
    assert preview.path[-1] == pytest.approx([hit["x"], hit["y"]], abs=1e-3)
    line = STRAIGHT[1] - preview.path[-1]
    assert np.hypot(*line) == pytest.approx(2 * model.setup.scene.balls.radius[0], abs=1e-3)
    # The struck ball leaves along the line of centres.
    x, y = preview.struck[1] - preview.struck[0]
    assert math.atan2(y, x) == pytest.approx(math.atan2(line[1], line[0]), abs=0.05)
    # Both paths end at the next contacts of the two balls, or at their rest.
    later = shot.events[(shot.events["time"] > hit["time"]) & np.isin(shot.events["kind"], ["cushion", "pocket"])]
    for ball, path in ((0, preview.cue), (1, preview.struck)):
        contacts = later[later["ball"] == ball]
        end = (contacts["x"][0], contacts["y"][0]) if len(contacts) else shot.positions[ball]
        assert path[0] == pytest.approx(shot.at(hit["time"])[ball], abs=1e-3)
        reach = 0.0
        if len(contacts) and contacts["kind"][0] == "pocket":  # its path ends at the rim of the pocket
            reach = model.setup.scene.table.pockets[contacts["other"][0]].radius
        assert np.hypot(*(path[-1] - end)) == pytest.approx(reach, abs=2e-3)


def test_the_preview_has_the_throw_and_the_spin_of_the_engine(make_model):
    plain = after(make_model(positions=STRAIGHT), (actions.look_at, (0.4, 0.03)))
    turned = after(plain, (actions.set_tip, -0.4, 0.2), (actions.raise_cue, 10.0))
    assert (turned.aim.angle, turned.aim.speed) == (plain.aim.angle, plain.aim.speed)
    assert not np.allclose(turned.preview.path[:50], plain.preview.path[:50], atol=1e-4)
    scene, (side, top) = turned.setup.scene, turned.aim.tip
    speed = turned.aim.speed / strike(scene, 1.0, 0.0).velocity[0]
    made = strike(scene, speed, turned.aim.angle, side, top, math.radians(10))
    shot = simulate(scene, STRAIGHT, made, record=True)
    times = shot.events["time"][shot.events["kind"] == "ball_ball"]
    assert turned.preview.path[-1] == pytest.approx(shot.at(times[0])[0], abs=1e-12)
    assert turned.stroke.velocity == tuple(made.velocity)
    assert turned.stroke.spin == tuple(made.spin)


def test_the_tip_of_the_cue_does_not_slip(make_model):
    model = after(make_model(positions=STRAIGHT), (actions.set_tip, 0.9, -1.2))
    assert math.hypot(*model.aim.tip) == pytest.approx(0.5, rel=2e-3)
    assert model.aim.tip[0] / model.aim.tip[1] == pytest.approx(-0.75)
    assert after(model, (actions.raise_cue, 200.0)).aim.elevation == 90.0
    assert after(model, actions.level).aim.tip == (0.0, 0.0)
    assert after(model, actions.go, actions.go).aim.tip == (0.0, 0.0)  # the next turn begins with a level cue


def test_scenes_without_spin_have_no_english(make_model):
    rolling = Physics(motion="rolling", cushion="restitution")
    model = make_model(positions=STRAIGHT, scene=dataclasses.replace(Scene.named("pool", 2), physics=rolling))
    assert after(model, (actions.set_tip, 0.3, 0.0), (actions.raise_cue, 20.0)) is model
    assert model.stroke.velocity == (2.0, 0.0)


def test_balls_keep_their_orientation_from_shot_to_shot(make_model):
    first = after(make_model(positions=STRAIGHT), (actions.look_at, (0.4, 0.03)), actions.go)
    assert first.first_faces is None
    second = after(first, actions.go)
    assert second.faces.shape == (3, 4)
    assert abs(second.faces[0, 0]) < 1
    assert second.faces[2].tolist() == [1.0, 0.0, 0.0, 0.0]  # has not moved
    assert after(second, actions.go).first_faces is second.faces


def test_a_preview_without_contact_shows_the_whole_path(make_model):
    model = after(make_model(positions=STRAIGHT), (actions.turn_aim, 180.0), (actions.change_speed, -1.9))
    assert model.preview.ball == -1
    shot = simulate(model.setup.scene, STRAIGHT, model.stroke.velocity)
    assert model.preview.path[-1] == pytest.approx(shot.positions[0], abs=1e-12)
    state = make_model(positions=INTO_THE_CORNER).game
    potted = make_preview(model.setup, state, Stroke((0.0, -5.0)))
    assert np.isfinite(potted.path).all()


def test_the_preview_uses_the_cue_ball_of_the_player(make_model):
    balls = [[-0.5, 0.3], [0.5, 0.0], [-0.5, 0.0]]
    model = make_model("carom", balls, {"player": 1, "cue_balls": [2, 0]})
    assert model.cue == 2
    assert model.preview.path[0].tolist() == balls[2]
    assert model.preview.ball == 0


def test_undo_and_the_same_stroke_reproduce_the_bits(make_model):
    model = after(make_model("nine_ball"), actions.go, (actions.turn_aim, 0.3))
    done = after(model, actions.go, actions.go)
    undone = after(done, actions.undo)
    assert undone.strokes == ()
    assert undone.last_shot is None
    assert same(after(undone, actions.go), done)
    two = after(done, actions.go, actions.go)
    back = after(two, actions.undo)
    assert same(back, done)
    assert (back.last_shot.shot.positions == done.last_shot.shot.positions).all()


def test_undo_keeps_the_aim_of_the_shot(make_model):
    steps = (actions.move_to, (-0.8, 0.1)), actions.go, (actions.turn_aim, 0.31), (actions.set_tip, 0.2, -0.3)
    start = after(make_model("nine_ball"), *steps)
    undone = after(start, actions.go, actions.go, actions.undo)
    assert (undone.aim, undone.stroke) == (start.aim, start.stroke)
    loaded = begin(after(start, actions.go).history, start.players, 8.0, 1 / 60)
    assert after(loaded, actions.undo).aim.place == start.aim.place
    assert after(loaded, actions.undo).stroke.velocity == pytest.approx(start.stroke.velocity)


def test_undo_returns_to_the_last_shot_of_a_person(make_model):
    model = make_model(positions=STRAIGHT, players=("human", "random"))
    model = after(model, (actions.turn_aim, 90.0), actions.go, actions.go)
    assert model.phase == "thinking"
    model = after(shoot(model, Stroke((0.1, 0.1))), actions.go)
    assert len(model.strokes) == 2
    assert len(after(model, actions.undo).strokes) == 0
    programs = make_model(positions=STRAIGHT, players=("random", "random"))
    programs = after(shoot(programs, Stroke((0.1, 0.0))), actions.go)
    assert after(programs, actions.undo) is programs


@pytest.mark.parametrize(
    ("engine", "ghost"), [(PIC, Engine("pit", 1 / 60)), (Engine("pit", 1 / 240), PIC)], ids=["pic", "pit"]
)
def test_a_replay_shows_the_shot_of_the_other_engine(make_model, engine, ghost):
    model = after(make_model(positions=STRAIGHT, engine=engine), (actions.turn_aim, 1.0), actions.go, actions.go)
    before = model.aim.angle, model.phase
    model = after(model, actions.repeat)
    shot, comparison = model.shown_shots
    velocity = model.strokes[0].velocity
    expected = simulate(model.setup.scene, STRAIGHT, velocity, engine=ghost)
    assert (comparison.positions == expected.positions).all()
    assert (shot.positions == simulate(model.setup.scene, STRAIGHT, velocity, engine=engine).positions).all()
    assert (shot.positions != comparison.positions).any()
    assert after(model, (actions.toggle, "ghost")).shown_shots[1] is None
    assert tick(model, 1e9).phase == "replaying"  # the end remains visible
    assert tick(model, 1e9).clock == max(shot.time, comparison.time)
    back = after(tick(model, 1e9), actions.go)
    assert (back.aim.angle, back.phase) == before
    assert after(tick(model, 1.0), actions.repeat).clock == 0.0


def test_slower_and_faster_change_the_pace(make_model):
    model = after(make_model(positions=STRAIGHT), (actions.change_pace, slower), actions.go)
    assert tick(model, 1.0).clock == 0.5
    assert after(model, *[(actions.change_pace, slower)] * 20).pace == PACES[0]
    assert after(model, *[(actions.change_pace, faster)] * 20).pace == PACES[-1]


def test_nothing_changes_while_nothing_moves(make_model):
    model = make_model(positions=STRAIGHT)
    assert tick(model, 1.0) is model
    end = tick(after(model, actions.go, actions.go, actions.repeat), 1e9)
    assert end.phase == "replaying"
    assert tick(end, 1.0) is end
    helped = after(model, actions.go, (actions.toggle_page, "keys"))
    assert tick(helped, 1.0) is helped  # the shot is not shown behind the help
    assert tick(after(helped, (actions.toggle_page, "keys")), 0.1).clock == 0.1


def test_a_game_that_is_over_has_no_further_shot(make_model):
    model = make_model(positions=INTO_THE_CORNER, target=1)
    model = after(model, actions.go, actions.go)
    assert model.phase == "over"
    assert model.game.state.winner == 0
    assert after(model, actions.go) is model
    assert after(model, actions.repeat).phase == "replaying"
    assert after(model, actions.repeat, actions.go).phase == "over"
    assert after(model, actions.undo).phase == "aiming"


def test_a_game_is_continued_from_its_history(make_model):
    model = after(make_model("nine_ball"), *[actions.go] * 5)
    again = begin(model.history, model.players, 8.0, 1 / 60)
    assert len(model.strokes) == 2
    assert same(model, again)
    assert again.phase == model.phase
    assert same(after(model, actions.undo), after(again, actions.undo))
    with pytest.raises(ValueError, match="players = human, human, human: expected 2"):
        begin(model.history, ("human",) * 3, 8.0, 1 / 60)


def test_the_aimed_ball_and_pocket_are_called(make_model):
    model = make_model("straight", [[-0.3, 0.0], [0.5, 0.3], [0.5, -0.3]], call_shot=True)
    model, pockets = after(model, (actions.look_at, (0.5, 0.3))), model.setup.scene.table.pockets
    ball, pocket, _ = model.stroke.call
    assert (ball, pockets[pocket].x > 1, pockets[pocket].y > 0.6) == (1, True, True)
    other = after(model, (actions.next_called, "ball"), (actions.next_called, "pocket"))
    assert other.stroke.call == Call(2, (pocket + 1) % 6)
    safety = after(other, actions.next_kind)
    assert safety.stroke.call == Call(kind="safety")
    assert after(safety, (actions.next_called, "ball")) is safety
    assert after(safety, actions.next_kind).call == model.call
    model = after(make_model("straight", STRAIGHT), (actions.next_called, "ball"), (actions.next_called, "pocket"))
    assert after(model, actions.next_kind).call == NO_CALL


def test_a_push_out_is_handed_back(make_model):
    state = {"choices": ["push_out"]}
    model = make_model("nine_ball", NINE, state, choices=True)
    assert make_model("nine_ball", NINE, state).kinds == ("shot",)
    pushed = after(model, (actions.look_at, (0.3, 0.6)), actions.next_kind, actions.go)
    assert (pushed.last_shot.facts.first, pushed.last_shot.verdict.foul) == (0, 0)
    model = after(pushed, actions.go)
    assert (model.game.state.player, model.kinds) == (1, ("shot", "hand_back"))
    back = after(model, actions.next_kind, actions.go, actions.go)
    assert (back.game.state.player, back.phase) == (0, "aiming")
    assert (back.game.positions == model.game.positions).all()
    assert after(back, actions.undo).aim.call == NO_CALL


def test_the_balls_are_racked_again_after_a_bad_break(make_model):  # WPA 3.3 d
    start = make_model("eight_ball", choices=True)
    model = after(start, actions.go, (actions.look_at, (-2.0, 0.0)), actions.go, actions.go)
    assert model.kinds == ("shot", "rerack", "break_again")
    model = after(model, actions.next_kind, actions.next_kind, actions.go, actions.go)
    assert (model.game.state.player, bool(model.game.state.break_shot), model.phase) == (0, True, "placing")


def test_the_balls_are_replaced_after_a_miss(make_model):
    start = after(make_model("snooker", choices=True, miss=True), actions.go, (actions.look_at, (-2.0, 0.0)))
    model = after(start, actions.go, actions.go)
    assert model.kinds == ("shot", "hand_back", "replace")
    model = after(model, actions.next_kind, actions.next_kind, actions.go, actions.go)
    assert model.game.state.player == 0
    assert (model.game.positions[1:] == start.game.positions[1:]).all()


def test_a_colour_is_nominated(make_model):
    opening = make_model("snooker").game.positions.copy()
    opening[0] = [-0.5, 0.3]
    model = after(make_model("snooker", opening, {"colour": True}), *[(actions.next_called, "ball")] * 4)
    assert model.stroke.call == Call(ball=19)
    assert after(make_model("snooker", opening), (actions.next_called, "ball")).call == NO_CALL  # a red is on


def test_the_aim_for_a_stroke_is_that_stroke(make_model):
    scene = Scene.named("pool", 2)
    model = make_model(positions=[[-0.4, 0.0], [0.4, 0.0], [0.4, 0.5]], state={"in_hand": "anywhere"})
    for side, top in ((0.0, 0.0), (0.3, 0.2), (-0.2, -0.4)):
        made = strike(scene, 2.0, 0.7, side, top)
        stroke = Stroke(tuple(made.velocity.tolist()), (-0.5, 0.1), tuple(made.spin.tolist()))
        aimed = actions.aim_like(model, stroke)
        assert (aimed.phase, aimed.aim.place) == ("aiming", (-0.5, 0.1))
        assert aimed.aim.tip == pytest.approx((side, top), abs=1e-9)
        np.testing.assert_allclose(aimed.stroke.velocity, stroke.velocity, atol=1e-9)
        np.testing.assert_allclose(aimed.stroke.spin, stroke.spin, atol=1e-9)
        played = shoot(model, stroke)
        assert (played.phase, played.aim) == ("rolling", aimed.aim)  # the controls show the stroke of a program
        assert after(played, actions.go, actions.repeat).aim == aimed.aim
    assert actions.aim_like(actions.go(aimed), stroke).phase == "rolling"


def test_a_raised_cue_makes_the_ball_hop_in_a_scene_with_flight(make_model):
    model = make_model(positions=STRAIGHT, scene=Scene.named("jump_pool", 2))
    played = after(model, (actions.look_at, (0.4, 0.3)), (actions.raise_cue, 40.0), actions.go)
    assert np.ptp(recording_of(played.last_shot.shot).heights(0, np.linspace(0, 0.1, 50))) > 0.01
    again = begin(played.history, model.players, 8.0, 1 / 60)
    assert same(played, again)
    assert after(played, actions.go, actions.repeat).shown_shots[1].heights is not None
