"""The benchmark of real tracks fits one file and judges another, or each fifth of the first, and draws shots."""

import json
import re

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from benchmarks import real_tracks
from billiards_env.calibration import calibrate, starts, write_tracks
from billiards_env.drawing.tracks import draw_fit
from tests.helpers.tracks import FRAME, SCENE, raw_tracks


def test_figures_are_printed_and_written(tmp_path, monkeypatch, capsys):
    source, path, tracks = tmp_path / "tracks.csv", tmp_path / "real_tracks.json", raw_tracks()[:3]
    write_tracks(source, tracks)
    result = calibrate(SCENE, tracks, ("mu_slide", "e_cushion"), frame=FRAME, contacts=2)
    fitted = []

    def fit(scene, tracks):
        fitted.append(len(tracks))
        return result

    monkeypatch.setattr(real_tracks, "fit", fit)
    monkeypatch.setattr(real_tracks, "PARTS", 3)
    monkeypatch.setattr(starts, "SIDES", (0.02,))
    for judge in ([], ["--judge", str(source)]):
        real_tracks.main([str(source), *judge, "--scene", "carom", "--output", str(path)])
        written = json.loads(path.read_text())
        assert list(written["judged"]) == list(real_tracks.FIGURES)
        assert written["judged"]["rows_5mm_contact2"] > 0.9
        assert written["judged_shots"] == written["shots"] == 3
        assert np.isfinite(written["values"]["mu_slide"])
        assert "rows within 5 mm until contact 2" in capsys.readouterr().out
    assert fitted == [3, 2, 2, 2, 3]

    def fail(*_):
        raise OSError("the disk is full")

    partial = tmp_path / "partial.json"
    with monkeypatch.context() as patch:
        patch.setattr(real_tracks, "cross_validated", fail)
        patch.setattr(real_tracks, "growth", fail)
        with pytest.raises(SystemExit, match=r"^error: judgement, growth of the errors: the disk is full$"):
            real_tracks.main([str(source), "--scene", "carom", "--output", str(partial)])
    assert json.loads(partial.read_text())["values"] == written["values"]
    assert re.search(r"rows within 5 mm until contact 2 +\| +- \| ", capsys.readouterr().out)
    fitted.pop()

    panels, curves = {}, {}

    def record(shots, errors, growth):
        panels.update(shots)
        curves.update(growth)
        return draw_fit(shots, errors, growth)

    monkeypatch.setattr(real_tracks, "DRAWN", 2)
    monkeypatch.setattr(real_tracks, "UNTIL", 1)
    monkeypatch.setattr(real_tracks, "LATER", 0.5)
    monkeypatch.setattr(real_tracks, "draw_fit", record)
    picture = tmp_path / "fit.png"
    real_tracks.main([str(source), "--output", str(path), "--picture", str(picture)])
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert fitted == [3, 2, 2, 2, 3]  # the picture needs no fit of the constants
    for title, (track, used, recording) in panels.items():
        assert float(re.findall(r": (.*?) mm", title)[0]) < 2.0
        end = track.times[used].max()
        assert used[track.times <= end].all()  # all rows until the contact
        assert 0.1 < track.times.max() - end < 0.51
        before = recording.events["time"] < end
        assert np.isin(recording.events["kind"][before], ("ball_ball", "cushion")).sum() <= 1
    assert list(curves)[:3] == ["real shots", "simulated, exact cushions", "simulated, default scatter"]
    assert all(list(curve) == [1, 2, 3, 4] for curve in curves.values())
    assert curves["real shots"][2] == pytest.approx(written["growth"]["real"]["median_mm_contact2"] / 1e3)
