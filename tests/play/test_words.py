from billiards_env.play import words
from billiards_env.play.model import Do, Turn, update

EIGHT = [[0.0, 0.0], *([-1.0 + 0.12 * i, 0.5 if i % 2 else -0.5] for i in range(15))]


def test_what_is_asked_of_a_player(make_model):
    for state, said in (
        ({"break_shot": True}, ""),
        ({}, "not ball 8"),
        ({"solids": 0}, "solids"),
        ({"solids": 1}, "stripes"),
        ({"solids": 0, "on_table": [0, 8, 9, 10]}, "first ball 8"),
    ):
        assert words.wanted(make_model("eight_ball", EIGHT, state)) == said
    assert words.wanted(make_model("nine_ball", EIGHT[:10], {"on_table": [0, 4, 7, 9]})) == "first ball 4"


def test_what_a_shot_was_worth(make_model):
    model = make_model(positions=[[0.97, 0.335], [1.07, 0.435], [-0.5, 0.0]], target=3)
    assert words.result(model) == "0 : 0"
    potted = update(update(model, Do("go")), Do("go"))
    assert words.result(potted) == "potted 1   1 : 0"
    missed = update(update(update(potted, Turn(90.0)), Do("go")), Do("go"))
    assert words.result(missed).endswith("1 : 0")
    foul = update(update(update(make_model("nine_ball", EIGHT[:10]), Turn(180.0)), Do("go")), Do("go"))
    assert words.result(foul).startswith("foul: ")


def test_players_are_told_apart(make_model):
    model = make_model(positions=EIGHT[:3], players=("human", "search:500", "agents.opponents:geometric"))
    assert [words.name(model, i) for i in range(3)] == ["Player 1", "Player 2 (search)", "Player 3 (geometric)"]
    assert words.doing(model).startswith("Player 1: 2.00 m/s")


def test_a_replay_says_how_the_shots_were_run(make_model):
    model = update(update(make_model(positions=EIGHT[:3]), Do("go")), Do("replay"))
    assert words.hint(model).startswith("balls: PIC   rings: PIT, dt = 16.67 ms")
    assert words.hint(update(model, Do("ghost"))).startswith("balls: PIC   go on")


def test_minus_zero_is_not_shown(make_model):
    model = make_model(positions=[*EIGHT[:1], [0.5, -1e-9]])
    assert "   0.0°" in words.doing(model).replace("m/s, ", "   ")
