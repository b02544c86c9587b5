"""The film of a run-out: it shows each plan before its shot, and ends with the win."""

import pytest

image = pytest.importorskip("PIL.Image")
pytest.importorskip("pygame")

from studies import run_out_film  # noqa: E402


def test_the_command_draws_plans_and_shots(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(run_out_film, "FRAME", 5.0)
    monkeypatch.setattr(run_out_film, "WIDTH", 160)
    path = tmp_path / "film.gif"
    run_out_film.main(["--output", str(path), "--shots", "300"])
    words = capsys.readouterr().out.split()
    models = run_out_film.run_out(int(words[1].strip(",")), 300)
    assert models is not None
    assert len(models) - 1 == int(words[2])
    assert models[-1][0].game.state.winner == 0
    assert all(model.preview is not None for model, _ in models[:-1])
    with image.open(path) as film:
        assert film.n_frames >= 2 * len(models) - 1


def test_the_film_in_the_documentation_is_small():
    assert run_out_film.FILE.stat().st_size < 2 * 2**20
