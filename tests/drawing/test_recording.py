import re

import numpy as np
import pytest

from billiards_env import Engine, Scene, simulate
from billiards_env.drawing.recording import frame_times, recording_of


@pytest.mark.parametrize("name", ["shot", "pit", "elsewhere"])
def test_paths_agree_with_the_shot(name, request):
    shot = request.getfixturevalue(name)
    times = [0.0, *np.linspace(0.01, shot.time, 57), *shot.events["time"], shot.time]
    paths = [recording_of(shot).path(i, times) for i in range(shot.scene.n_balls)]
    assert np.abs(np.stack(paths, 1) - [shot.at(t) for t in times]).max() < 1e-14


def test_a_recording_has_the_times_of_potting(shot):
    gone = recording_of(shot).gone
    drops = shot.events[shot.events["kind"] == "pocket"]
    assert drops["ball"].tolist() == [3, 2]
    assert gone[drops["ball"]].tolist() == drops["time"].tolist()
    assert np.isinf(gone[[0, 1, 4]]).all()


def test_the_track_of_a_potted_ball_ends_at_the_edge_of_the_pocket(shot):
    recording, pocket = recording_of(shot), shot.scene.table.pockets[shot.pockets[3]]
    times, path = recording.track(3, [0.0, 0.3, 99.0])
    corners = recording.corners(3)
    assert times.tolist() == sorted({0.0, 0.3, *corners[corners < recording.gone[3]], recording.gone[3]})
    assert np.hypot(*(path[-1] - [pocket.x, pocket.y])) == pytest.approx(pocket.radius)
    assert path[:-1] == pytest.approx(recording.path(3, times[:-1]), abs=1e-12)


def test_balls_not_in_play_are_gone_from_the_start():
    options = {"in_play": [True, False], "record": True}
    recording = recording_of(simulate(Scene.named("pool"), [[0.0, 0.0], [9.0, 9.0]], [1.0, 0.2], **options))
    assert recording.gone.tolist() == [np.inf, 0.0]
    assert recording.moves(0)
    assert not recording.moves(1)


def test_moves_is_true_only_for_moving_balls(shot):
    recording = recording_of(shot)
    assert [i for i in range(5) if recording.moves(i)] == [0, 2, 3]


def test_the_label_names_the_engine(shot, pit, unrecorded):
    assert (shot.engine, pit.engine) == ("PIC", "PIT, dt = 1/60 s")
    assert shot.scene is not None
    assert shot.scene.n_balls == 5
    assert (unrecorded.engine, unrecorded.scene) == ("", None)
    back = simulate(
        Scene.named("pool", 0), [[0.0, 0.0]], [1.0, 0.2], engine=Engine("pit", 0.001, "move_back"), record=True
    )
    assert back.engine == "PIT, dt = 1/1000 s, move_back"


def test_a_film_ends_when_the_shot_does():
    assert frame_times(1.0, 30).tolist() == [k / 30 for k in range(30)] + [1.0]
    assert len(frame_times(100 / 30, 30)) == 101  # 100 / 30 * 30 may be more than 100
    assert len(frame_times(100.5 / 30, 30)) == 102


def test_unrecorded_shots_cannot_be_drawn(unrecorded, tmp_path):
    calls = {
        "plot": unrecorded.plot,
        "to_gif": lambda: unrecorded.to_gif(tmp_path / "a.gif"),
        "to_mp4": lambda: unrecorded.to_mp4(tmp_path / "a.mp4"),
        "to_html": lambda: unrecorded.to_html(tmp_path / "a.html"),
        "recording": lambda: recording_of(unrecorded),
    }
    for name, call in calls.items():
        message = f"shot.{name}: the shot was not recorded, expected simulate(..., record=True)"
        with pytest.raises(ValueError, match=re.escape(message)):
            call()
    assert not list(tmp_path.iterdir())


def test_speeds_are_the_slopes_of_the_path(shot):
    recording = recording_of(shot)
    times = np.array([0.02, 0.1, 0.5, 1.5, shot.time])
    slopes = np.hypot(*((recording.path(0, times + 1e-6) - recording.path(0, times - 1e-6)) / 2e-6).T)
    assert recording.speeds(0, times) == pytest.approx(slopes, abs=1e-5)
    assert recording.speeds(1, times).tolist() == [0.0] * 5


def test_a_hop_has_the_height_of_a_throw(jump):
    recording, speed = recording_of(jump), 0.6 * 4.5  # after the slate
    ((ball, time, height),) = recording.hops()
    end = jump.events["time"][jump.events["kind"] == "off_table"][0]
    fallen = jump.scene.physics.g * end / 2
    assert (ball, time) == (0, end)
    assert height == pytest.approx(end * (speed - fallen))
    assert recording.heights(0, [end / 2, end]) == pytest.approx([end / 2 * (speed - fallen / 2), height])
    assert recording.heights(1, [end / 2]) == [0.0]
    assert recording.gone[0] == end
    assert len(recording.potted(recording.time)) == 0
