"""A folder is locked by one process at a time, and neither the lock nor an empty folder stays behind."""

import errno
import logging
import sys

import pytest
from tools.refusals import refuses

from evfem.common.storage import alone_in, check_ending
from evfem.errors import StorageError


def test_a_folder_is_locked_once_and_open_again_afterwards(tmp_path):
    folder = tmp_path / "here"
    folder.mkdir()
    with alone_in(folder):
        with (
            pytest.raises(StorageError, match=r"cannot use .*here: another run is at work in it"),
            alone_in(folder),
        ):
            pass
        assert list(folder.iterdir()) == []
        with alone_in(tmp_path / "elsewhere"):
            pass
    with alone_in(folder):
        pass
    assert folder.exists()


def test_a_folder_made_for_nothing_goes_away_with_those_above_it(tmp_path):
    with alone_in(tmp_path / "a" / "b"):
        assert (tmp_path / "a" / "b").is_dir()
    assert list(tmp_path.iterdir()) == []
    with alone_in(tmp_path / "a" / "b"):
        (tmp_path / "a" / "notes").write_text("mine")
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["notes"]


def test_a_file_where_a_folder_was_to_be_is_told_to_be_one(tmp_path):
    (tmp_path / "notes").write_text("mine")
    told = "cannot use .*notes: it is a file, not a folder"
    with pytest.raises(StorageError, match=told), alone_in(tmp_path / "notes"):
        pass


def test_an_archive_is_not_written_under_a_name_that_promises_a_table():
    for name in ("a.xlsx", "a.parquet", "a.CSV"):
        refuses("allowed: a name that ends in .npz", check_ending, name, ".npz")
    check_ending("a.kept", ".npz")


@pytest.mark.parametrize("where", ["system", "disk"])
def test_without_locks_a_notice_says_so(tmp_path, monkeypatch, caplog, where):
    if where == "system":
        monkeypatch.setitem(sys.modules, "fcntl", None)
    else:

        def refuse(*arguments):
            raise OSError(errno.ENOLCK, "No locks available")

        monkeypatch.setattr("fcntl.flock", refuse)
    with caplog.at_level(logging.INFO, "evfem"), alone_in(tmp_path):
        pass
    assert caplog.text.count("start no second run into") == 1
    assert str(tmp_path) in caplog.text
