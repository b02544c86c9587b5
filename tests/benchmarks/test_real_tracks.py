"""The benchmark of real tracks fits one file and judges another, or each fifth of the first."""

import json

import numpy as np

from benchmarks import real_tracks
from billiards_env.calibration import calibrate, starts, write_tracks
from tests.helpers.tracks import FRAME, SCENE, raw_tracks


def test_figures_are_printed_and_written(tmp_path, monkeypatch, capsys):
    source, path, tracks = tmp_path / "tracks.csv", tmp_path / "real_tracks.json", raw_tracks()[:3]
    write_tracks(source, tracks)
    result = calibrate(SCENE, tracks, ("mu_slide", "e_cushion"), frame=FRAME, contacts=2)
    fitted = []

    def fit(scene, tracks, laws=()):
        fitted.append(len(tracks))
        return result

    monkeypatch.setattr(real_tracks, "fit", fit)
    monkeypatch.setattr(real_tracks, "PARTS", 3)
    monkeypatch.setattr(starts, "SIDES", (0.02,))
    for judge in ([], ["--judge", str(source)]):
        real_tracks.main([str(source), *judge, "--scene", "carom", "--output", str(path)])
        written = json.loads(path.read_text())
        assert list(written["judged"]) == list(real_tracks.TARGETS)
        assert written["judged"]["rows_5mm_contact2"] > 0.9
        assert written["judged_shots"] == written["shots"] == 3
        assert np.isfinite(written["values"]["mu_slide"])
        assert "rows within 5 mm until contact 2" in capsys.readouterr().out
    assert fitted == [3, 2, 2, 2, 3]
