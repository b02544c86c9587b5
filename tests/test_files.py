import os
import stat
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from billiards_env.files import read_text, replacing, write_json, write_whole


def test_a_file_is_replaced_completely_or_not_at_all(tmp_path):
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


def test_a_failed_write_keeps_the_old_file_and_leaves_no_other(tmp_path, monkeypatch):
    path = tmp_path / "new" / "file"
    write_whole(path, b"old")

    def fail(descriptor):
        raise OSError("disk full")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="disk full"):
        write_whole(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(path.parent) == ["file"]


def test_an_error_names_the_file_and_not_the_temporary_one(tmp_path, monkeypatch):
    with pytest.raises(IsADirectoryError, match=f"path = '{tmp_path}': expected a file, this is a folder"):
        write_whole(tmp_path, b"new")
    long = tmp_path / ("a" * 300)
    with pytest.raises(OSError, match=r"name too long: '.*/a{300}'$"):
        write_whole(long, b"new")
    assert os.listdir(tmp_path) == []

    def fail(path, *_):
        raise PermissionError(13, "Permission denied", path)

    monkeypatch.setattr(os, "open", fail)
    with pytest.raises(PermissionError, match=r"Permission denied: '.*/file\.json'$"):
        write_json(tmp_path / "file.json", 1)


def test_a_text_is_read_without_its_byte_order_mark(tmp_path):
    path = tmp_path / "text"
    path.write_bytes(b"\xef\xbb\xbf{}")
    assert read_text(path, 5, "a text") == "{}"
    with pytest.raises(ValueError, match="text: a file of more than 4 bytes: expected at most 4"):
        read_text(path, 4, "a text")
    path.write_bytes(b"\xff")
    with pytest.raises(ValueError, match=r"text: .* can't decode"):
        read_text(path, 5, "a text")


def test_nan_is_not_written_as_json(tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "file", float("nan"))
    assert os.listdir(tmp_path) == []


def test_a_link_with_a_guessed_temporary_name_is_not_followed(tmp_path):
    """The name was once predictable, so the target of a link with that name was overwritten."""
    path, victim = tmp_path / "game.json", tmp_path / "victim"
    victim.write_text("precious")
    for name in (f".game.{os.getpid()}.json", f"game.json.{os.getpid()}", ".game.json.tmp"):
        (tmp_path / name).symlink_to(victim)
    write_json(path, 1)
    assert path.read_text() == "1\n"
    assert victim.read_text() == "precious"


def test_threads_that_write_one_path_do_not_interfere(tmp_path):
    """They once shared a temporary file, and 307 of 800 writes failed."""
    path = tmp_path / "file"

    def save(k):
        write_whole(path, bytes([k]) * 1000)

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(save, [1, 2, 3, 4] * 50))
    content = path.read_bytes()
    assert content == content[:1] * 1000
    assert os.listdir(tmp_path) == ["file"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no umask")
@pytest.mark.parametrize("mask", [0o022, 0o027])
def test_file_permissions_follow_the_umask(tmp_path, mask):
    before = os.umask(mask)
    try:
        write_whole(tmp_path / "file", b"new")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == 0o666 & ~mask
