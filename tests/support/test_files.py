import errno
import os
import stat

import pytest

from billiards_env.support.files import check_path, read_text, replacing, write_atomically, write_json


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
    write_atomically(path, b"old")

    def fail(descriptor):
        raise OSError("disk full")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(OSError, match="disk full"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(path.parent) == ["file"]


def test_an_error_names_the_file_and_not_the_temporary_one(tmp_path, monkeypatch):
    with pytest.raises(IsADirectoryError, match=f"path = '{tmp_path}': expected a file, not a folder"):
        write_atomically(tmp_path, b"new")
    long = tmp_path / ("a" * 300)
    with pytest.raises(OSError, match=r"name too long: '.*/a{300}'$"):
        write_atomically(long, b"new")
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
    with pytest.raises(
        ValueError, match=r"path = .*text': expected a file of a text \(it is a file of more than 4 bytes"
    ):
        read_text(path, 4, "a text")
    path.write_bytes(b"\xff")
    with pytest.raises(ValueError, match=r"text': expected .* can't decode"):
        read_text(path, 5, "a text")


def test_nan_is_not_written_as_json(tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "file", float("nan"))
    assert os.listdir(tmp_path) == []


def test_a_link_is_followed_and_stays(tmp_path):
    """It was once replaced by a file, and the file at its end kept the old content."""
    (tmp_path / "folder").mkdir()
    end, link, new = tmp_path / "folder" / "end.json", tmp_path / "link.json", tmp_path / "new.json"
    end.write_text("old")
    end.chmod(0o600)
    link.symlink_to(end)
    new.symlink_to(tmp_path / "folder" / "other.json")
    for path in (link, new):
        write_json(path, 1)
        assert path.is_symlink()
        assert path.resolve().read_text() == "1\n"
    assert stat.S_IMODE(end.stat().st_mode) == 0o600
    assert sorted(os.listdir(tmp_path / "folder")) == ["end.json", "other.json"]


@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to(path)], ids=["pipe", "loop"])
def test_what_is_no_regular_file_is_refused_and_stays(make, tmp_path):
    """As root, writing to /dev/full once replaced the device by a file."""
    path = tmp_path / "there.json"
    make(path)
    before = path.lstat()
    for write in (check_path, lambda path: write_json(path, 1)):
        with pytest.raises(OSError, match=rf"(expected a regular file, this is a device|symbolic links: '{path}')"):
            write(path)
    assert path.lstat() == before


def test_an_error_of_a_full_disk_names_the_file(tmp_path):
    with pytest.raises(OSError, match=rf"No space left on device: '{tmp_path}/file'"), replacing(tmp_path / "file"):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert os.listdir(tmp_path) == []
