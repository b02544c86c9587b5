"""The study of the probability of pots."""

import json

import pytest

from studies import pot_chances


def test_the_errors_are_measured_and_printed(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(pot_chances, "SCENES", ("pool",))
    output = tmp_path / "pot_chances.json"
    pot_chances.main(["--layouts", "5", "--samples", "20", "--output", str(output)])
    found = json.loads(output.read_text())
    assert pot_chances.blocks(found)["errors"] in capsys.readouterr().out
    assert len(found["results"]["pool"]["first_order"]) == len(found["results"]["pool"]["sampled"]) == 5


def test_a_file_that_cannot_be_written_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(pot_chances, "SCENES", ("pool",))
    with pytest.raises(SystemExit, match="error: "):
        pot_chances.main(["--layouts", "1", "--samples", "1", "--output", str(tmp_path)])
