"""A folder is filled whole or not at all."""

import pytest

from cpfls_cli.artifacts.output import filled_folder


def fill(folder, error=None):
    with filled_folder(folder, ["a.txt", "b.txt"]) as temporary:
        (temporary / "a.txt").write_text("new")
        if error is not None:
            raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt(), ValueError()])
def test_an_interrupt_leaves_everything_as_it_was(tmp_path, error):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "a.txt").write_text("old")
    (folder / "b.txt").write_text("old")
    with pytest.raises(type(error)):
        fill(folder, error)
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"a.txt": "old", "b.txt": "old"}
    assert list(tmp_path.iterdir()) == [folder]


def test_files_of_an_earlier_run_go(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "b.txt").write_text("old")
    (folder / "mine.txt").write_text("mine")
    fill(folder)
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"a.txt": "new", "mine.txt": "mine"}
    assert list(tmp_path.iterdir()) == [folder]
