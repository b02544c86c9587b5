import os

import pytest

from billiards_env.files import replacing, write_json, write_whole


def test_the_content_replaces_that_of_an_older_file(tmp_path):
    path = tmp_path / "new" / "file"
    write_whole(path, b"old")
    write_whole(path, b"new")
    assert path.read_bytes() == b"new"
    assert os.listdir(path.parent) == ["file"]


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path):
    target = tmp_path / "a.gif"
    target.write_text("old")

    def write(fails):
        with replacing(target) as temporary:
            temporary.write_text("new")
            assert temporary.suffix == ".gif"
            if fails:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write(True)
    assert target.read_text() == "old"
    write(False)
    assert target.read_text() == "new"
    assert os.listdir(tmp_path) == ["a.gif"]


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "file"
    write_whole(path, b"old")

    def fail(descriptor):
        raise OSError("disk full")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="disk full"):
        write_whole(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["file"]


def test_json_knows_no_nan(tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "file", float("nan"))
    assert os.listdir(tmp_path) == []
