"""The figures of the four failures in the paper of Warkari and Jamsandekar."""

import re

import numpy as np
import pytest

from billiards_env.failures import FAILURES

pytest.importorskip("matplotlib")

from benchmarks import paper_figures


def times(case):
    """Returns the times of the events of the exact shot, s."""
    events = paper_figures.run(case)[1].events
    assert events is not None
    return events["time"]


def test_the_figures_are_drawn_from_these_scenes(tmp_path, capsys):
    paper_figures.main(["--folder", str(tmp_path)])
    drawn = (tmp_path / "failures.png").read_bytes()
    assert drawn.startswith(b"\x89PNG")
    assert len(drawn) < 200_000
    assert str(tmp_path / "failures.png") in capsys.readouterr().out
    assert list(paper_figures.VIEWS) == list(FAILURES)
    assert sorted(number for view in paper_figures.VIEWS.values() for number in view.numbers) == list(range(1, 9))


def test_the_captions_contain_the_numbers_of_the_runs():
    texts = [text for name in FAILURES for text in paper_figures.captions(name, *paper_figures.run(FAILURES[name]))]
    numbers = [re.findall(r"\d+\.\d+", text) for text in texts]
    exact = [[f"{t:.3f}" for t in times(case)] for case in FAILURES.values()]
    assert numbers == [
        [],
        exact[0],
        ["0.200", "16.5", "30.5"],
        ["0.1835"],
        ["0.240"],
        exact[2],
        ["0.200", "16.5", "61.0"],
        ["0.1835"],
    ]


@pytest.mark.parametrize("name", FAILURES)
def test_the_figures_contain_all_balls_and_events(name):
    view, (pit, pic) = paper_figures.VIEWS[name], paper_figures.run(FAILURES[name])
    dt, radius = FAILURES[name].dt, 0.03
    half = np.array([view.height * paper_figures.PANEL[0] / paper_figures.PANEL[1], view.height]) / 2
    for shot in (pit, pic):
        assert shot.events is not None
        assert all(view.frames[0] * dt < t < view.frames[1] * dt for t in shot.events["time"])
        for k in range(view.frames[0], view.frames[1] + 1):
            assert (np.abs(shot.at(k * dt) - [view.x, view.y]) < half - radius).all()
