from billiards_env.play import labels
from billiards_env.play.model import go, replay, toggle_ghost, turn_aim

EIGHT = [[0.0, 0.0], *([-1.0 + 0.12 * i, 0.5 if i % 2 else -0.5] for i in range(15))]


def test_the_hint_names_the_legal_balls(make_model):
    for state, hint in (
        ({"break_shot": True}, ""),
        ({}, "not ball 8"),
        ({"solids": 0}, "solids"),
        ({"solids": 1}, "stripes"),
        ({"solids": 0, "on_table": [0, 8, 9, 10]}, "first ball 8"),
    ):
        assert labels.first_ball_hint(make_model("eight_ball", EIGHT, state)) == hint
    assert labels.first_ball_hint(make_model("nine_ball", EIGHT[:10], {"on_table": [0, 4, 7, 9]})) == "first ball 4"


def test_the_result_of_a_shot(make_model):
    model = make_model(positions=[[0.97, 0.335], [1.07, 0.435], [-0.5, 0.0]], target=3)
    assert labels.result(model) == "0 : 0"
    potted = go(go(model))
    assert labels.result(potted) == "potted 1   1 : 0"
    missed = go(go(turn_aim(potted, 90.0)))
    assert labels.result(missed) == "foul: no hit   0 : 0"
    foul = go(go(turn_aim(make_model("nine_ball", EIGHT[:10]), 180.0)))
    assert labels.result(foul).startswith("foul: ")


def test_each_player_has_a_label(make_model):
    model = make_model(positions=EIGHT[:3], players=("human", "search:500", "mine.players:geometric"))
    assert [labels.player_name(model, i) for i in range(3)] == ["Player 1", "Player 2 (search)", "Player 3 (geometric)"]
    assert labels.status(model).startswith("Player 1: 2.00 m/s")


def test_a_replay_shows_the_engines(make_model):
    model = replay(go(make_model(positions=EIGHT[:3])))
    assert labels.key_hint(model).startswith("balls: PIC   rings: PIT, dt = 16.67 ms")
    assert labels.key_hint(toggle_ghost(model)).startswith("balls: PIC   continue")


def test_minus_zero_is_not_shown(make_model):
    model = make_model(positions=[*EIGHT[:1], [0.5, -1e-9]])
    assert "   0.0°" in labels.status(model).replace("m/s, ", "   ")
