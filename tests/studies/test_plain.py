"""The measurement of Stable-Baselines3 with its defaults."""

import json

import pytest

from studies import plain
from studies.plain import blocks, main


@pytest.fixture
def small(tmp_path, monkeypatch):
    """Returns the output of a tiny study."""
    monkeypatch.setattr(plain, "SHOTS", {"PPO": (1, 2049), "SAC": (150,)})
    monkeypatch.setattr(plain, "SEEDS", (3,))
    monkeypatch.setattr(plain, "EPISODES", 4)
    return tmp_path / "plain.json"


def test_both_algorithms_train_and_the_command_continues(small, monkeypatch, capsys):
    trained = []
    train = plain.train

    def spy(algorithm, *arguments):
        trained.append(algorithm)
        if trained == ["PPO", "SAC"]:
            raise KeyboardInterrupt
        return train(algorithm, *arguments)

    monkeypatch.setattr(plain, "train", spy)
    with pytest.raises(SystemExit):
        main(["--output", str(small)])
    main(["--output", str(small)])
    assert trained == ["PPO", "SAC", "SAC"]
    found = json.loads(small.read_text())
    rates = [*found["results"]["PPO"]["3"], *found["results"]["SAC"]["3"]]
    assert len(rates) == 3
    assert set(rates) <= {0.0, 0.25, 0.5, 0.75, 1.0}
    table = blocks(found)["table"]
    assert table in capsys.readouterr().out
    assert len(table.splitlines()) == 2 + 3
