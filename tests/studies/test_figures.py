"""The pictures of the documentation."""

import itertools

import numpy as np
import pytest

pytest.importorskip("PIL.Image")
pytest.importorskip("matplotlib")
pytest.importorskip("pygame")

from PIL.GifImagePlugin import GifImageFile

from billiards_env import Engine, Scene, simulate
from billiards_env.games import members
from studies import figures
from studies.failures import FAILURES


def test_pictures_are_small_and_reproducible(tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "filmed_run_out", lambda _: True)
    monkeypatch.setattr(figures, "write_run_out", lambda *_: None)  # its own test is below
    figures.main(["--folder", str(tmp_path / "one")])
    monkeypatch.setattr(figures, "write_film", lambda *_: None)  # slow
    figures.main(["--folder", str(tmp_path / "two")])
    drawn = sorted(path.name for path in (tmp_path / "one").iterdir())
    names = ["failures.png", "masse.png", "play.png", "shot.gif", "shot.png", "tables.png"]
    assert drawn == names
    for name in drawn:
        content = (tmp_path / "one" / name).read_bytes()
        assert name == "shot.gif" or content == (tmp_path / "two" / name).read_bytes()
        assert len(content) < (1_500_000 if name == "shot.gif" else 200_000)
    with GifImageFile(tmp_path / "one" / "shot.gif") as film:
        assert film.n_frames > 100
        assert np.asarray(film.convert("RGB"))[1, 1].max() < 64  # the front page may be dark


@pytest.mark.parametrize("count", [1, 5, 7])
def test_the_picture_of_the_tables_takes_any_number(count, monkeypatch):
    names = (figures.TABLES * 2)[:count]
    monkeypatch.setattr(figures, "TABLES", names)
    assert sorted(axes.get_title() for axes in figures.tables().axes) == sorted(names)


def test_the_picture_of_a_shot_has_the_combination_of_its_title():
    events = figures.random_shot(Scene.named("pool", 4), **figures.SHOT).events
    assert events is not None
    hits, drops = (events[events["kind"] == kind] for kind in ("ball_ball", "pocket"))
    assert hits[["ball", "other"]].tolist() == [(0, 2), (2, 3)]
    assert drops["ball"].tolist() == [3, 2]


def test_the_window_shows_an_aimed_shot_after_one_stroke():
    model = figures.window()
    assert model.phase == "aiming"
    assert len(model.strokes) == 1
    assert model.preview is not None
    assert model.preview.ball == members(model.game.state.object_balls)[0]  # the ball on of nine ball


def test_the_views_of_the_failures_contain_all_balls_and_contacts():
    assert list(figures.VIEWS) == list(FAILURES)
    for name, (centre, half, (first, last)) in figures.VIEWS.items():
        case = FAILURES[name]
        start = case.scene, case.positions, case.velocities
        for shot in (simulate(*start, engine=Engine("pit", case.dt), record=True), simulate(*start, record=True)):
            assert shot.events is not None
            assert all(first * case.dt < t < last * case.dt for t in shot.events["time"])
            places = np.array([shot.at(k * case.dt) for k in range(first, last + 1)])
            assert (np.abs(places - centre) < np.array([1.8 * half, half]) - 0.03).all()


def test_the_film_of_a_run_out_shows_each_plan_and_ends_with_the_win(tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "FILM", {**figures.FILM, "shots": 300, "width": 160, "frame": 5.0})
    models = next(filter(None, map(figures.filmed_run_out, itertools.count())))
    assert models[-1][0].game.state.winner == 0
    assert all(model.preview is not None for model, _ in models[:-1])
    figures.write_run_out(tmp_path / "film.gif", models)
    with GifImageFile(tmp_path / "film.gif") as film:
        assert film.n_frames >= 2 * len(models) - 1
    assert (figures.IMAGES / "run_out.gif").stat().st_size < 2 * 2**20
