"""Outputs are refused before anything is computed, and never half written."""

import contextlib
import io

import h5py
import numpy as np
import pytest

from cpfls_cli.artifacts.output import (
    EnduringFile,
    check_folder,
    check_output,
    filled_folder,
    locked,
    write_files,
)
from cpfls_cli.errors import OutputError


def test_only_what_was_half_written_of_an_output_is_tidied(tmp_path):
    half = [tmp_path / f".{name}.ab_12xyz.part" for name in ("model.h5", "model.h5.checkpoint", "model.h5.partial")]
    kept = [tmp_path / name for name in (".model.h5.old.ab_12xyz.part", ".other.h5.ab_12xyz.part", "model.h5")]
    for path in (*half, *kept):
        path.write_text("")
    with locked(tmp_path / "model.h5", "identify"):
        assert sorted(tmp_path.iterdir()) == sorted([*kept, tmp_path / ".model.h5.lock"])
    assert sorted(tmp_path.iterdir()) == sorted(kept)


def test_of_several_texts_all_are_written_or_none(tmp_path, monkeypatch):
    sync = iter([None, OSError(28, "No space left on device")])

    def fail_at_the_second(_):
        if error := next(sync):
            raise error

    monkeypatch.setattr("os.fsync", fail_at_the_second)
    with pytest.raises(OutputError, match=r"model\.c: cannot be written: No space left on device"):
        write_files({tmp_path / "model.h": "header", tmp_path / "model.c": "source"})
    assert list(tmp_path.iterdir()) == []


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


def test_what_appears_while_a_command_is_at_work_is_kept(tmp_path):
    output, second = tmp_path / "a.txt", tmp_path / "b.txt"
    for path in (output, second):
        check_output(path, force=False)
    second.write_text("mine")
    with pytest.raises(OutputError, match=r"b\.txt: appeared while the command was running"):
        write_files({output: "new", second: "new"})
    assert [path.name for path in tmp_path.iterdir()] == ["b.txt"]
    assert second.read_text() == "mine"
    check_output(second, force=True)
    write_files({output: "new", second: "new"})
    # A command may write its own output again.
    write_files({output: "newer"})
    assert (output.read_text(), second.read_text()) == ("newer", "new")


def test_what_appears_in_a_folder_is_kept(tmp_path):
    folder = tmp_path / "out"
    check_folder(folder, False, ["a.txt", "b.txt"])
    folder.mkdir()
    (folder / "b.txt").write_text("mine")
    fill(folder)
    assert {path.name: path.read_text() for path in folder.iterdir()} == {"a.txt": "new", "b.txt": "mine"}
    (folder / "a.txt").unlink()
    (folder / "b.txt").unlink()
    check_folder(folder, False, ["a.txt", "b.txt"])
    (folder / "a.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"a\.txt: appeared while the command was running"):
        fill(folder)
    assert (folder / "a.txt").read_text() == "mine"


@pytest.mark.parametrize("room", range(0, 66_000, 2_797))
def test_hdf5_meets_a_full_disk(tmp_path, room):
    """Whatever HDF5 writes last, and however it closes the file, the failure is kept and nothing crashes."""

    class Disk(io.FileIO):
        def write(self, content):
            if self.tell() + len(content) > room:
                raise OSError(28, "No space left on device")
            return super().write(content)

    with Disk(tmp_path / "full.h5", "w+") as raw:
        file = EnduringFile(raw)
        with contextlib.suppress(OSError, RuntimeError), h5py.File(file, "w") as written:
            for name in "abc":
                written.create_dataset(name, (1000, 3), float, chunks=(100, 3), compression="gzip")
                written[name][...] = np.random.default_rng(1).random((1000, 3))
        with pytest.raises(OSError, match="No space left"):
            file.require_written()
