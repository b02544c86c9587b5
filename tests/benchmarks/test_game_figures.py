import pytest

image = pytest.importorskip("PIL.Image")
pytest.importorskip("pygame")

from benchmarks.game_figures import main, window  # noqa: E402


def test_the_window_shows_an_aimed_shot_after_one_stroke():
    shown = window()
    model = shown.model
    shown.close()
    assert model.phase == "aiming"
    assert len(model.strokes) == 1
    assert model.preview is not None
    assert model.preview.ball == min(model.game.state.object_balls)  # the ball on of nine ball


def test_pictures_are_small_and_reproducible(tmp_path):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        main(["--folder", str(tmp_path / name)])
    for name, most in (("play.png", 150_000), ("shot.gif", 1_500_000)):
        content = (tmp_path / "one" / name).read_bytes()
        assert content == (tmp_path / "two" / name).read_bytes()
        assert len(content) < most
    with image.open(tmp_path / "one" / "shot.gif") as film:
        assert film.n_frames > 100
