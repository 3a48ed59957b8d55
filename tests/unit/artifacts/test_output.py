"""Outputs are refused before anything is computed, and never half written."""

import os

import pytest

from cpfls_cli.artifacts.output import atomic_path, check_output, filled_folder
from cpfls_cli.errors import InputError


def test_temporary_name_is_hidden_and_in_the_same_folder(tmp_path):
    with atomic_path(tmp_path / "s.h5") as temporary:
        assert temporary.parent == tmp_path
        assert temporary.name.startswith(".s.h5.")
        assert list(tmp_path.iterdir()) == [temporary]
    assert list(tmp_path.iterdir()) == []


def test_check_output_leaves_nothing(tmp_path):
    (tmp_path / "old").write_text("old")
    check_output(tmp_path / "new", force=False)
    check_output(tmp_path / "old", force=True)
    with pytest.raises(InputError, match="--force"):
        check_output(tmp_path / "old", force=False)
    assert [path.name for path in tmp_path.iterdir()] == ["old"]


def test_a_pipe_and_a_folder_are_no_outputs(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for name, kind in (("pipe", "a device or a pipe"), (".", "a folder")):
        with pytest.raises(InputError, match=f"is {kind}"):
            check_output(tmp_path / name, force=True)


def fill(folder, error=None):
    with filled_folder(folder, ["a.txt", "b.txt"]) as temporary:
        (temporary / "a.txt").write_text("new")
        if error is not None:
            raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError()])
def test_an_interrupt_leaves_everything_in_a_folder_as_it_was(tmp_path, error):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "a.txt").write_text("old")
    (folder / "b.txt").write_text("old")
    with pytest.raises(type(error)):
        fill(folder, error)
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"a.txt": "old", "b.txt": "old"}
    assert list(tmp_path.iterdir()) == [folder]


def test_files_in_a_folder_of_an_earlier_run_go(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "b.txt").write_text("old")
    (folder / "mine.txt").write_text("mine")
    fill(folder)
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"a.txt": "new", "mine.txt": "mine"}
    assert list(tmp_path.iterdir()) == [folder]
