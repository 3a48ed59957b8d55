"""Files of results are written whole or not at all, and refused where they are not known."""

import os
import stat

import numpy as np
import pytest

from cpfls_cli import store
from cpfls_cli.artifacts.gate import InputFile
from cpfls_cli.artifacts.output import write_text
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.reduction.selection import Selection
from tests.builders.results import drawn

ORIGIN = store.Origin(
    stage="reduce", seed=4, config="seed: 4\n", inputs={"flight": InputFile("f.h5", "ab" * 32, "cpfls/flight")}
)


def write(path, seed=1, **changes):
    given = drawn(Selection, np.random.default_rng(seed))
    for name, value in changes.items():
        object.__setattr__(given, name, value)
    store.write(path, given, ORIGIN)


def test_a_changed_file_is_read_again(tmp_path):
    path = tmp_path / "s.h5"
    write(path)
    assert (store.format_name(path), store.read_origin(path)) == ("cpfls/selection", ORIGIN)
    before = path.read_bytes()
    write(path, seed=2)
    assert before != path.read_bytes()
    path.write_bytes(path.read_bytes()[:-1])
    assert store.format_name(path) is None
    for read in (store.read_origin, lambda path: store.read(path, Selection)):
        with pytest.raises(InputError, match="does not end in the checksum"):
            read(path)


@pytest.mark.parametrize("old", [None, b"precious"])
def test_failure_in_the_middle_leaves_the_old_file_and_nothing_else(tmp_path, old):
    path = tmp_path / "s.h5"
    if old is not None:
        path.write_bytes(old)
    with pytest.raises(ComputationError, match="indices: holds"):
        write(path, indices=np.array([0.5, 1.5]))
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == ([] if old is None else [("s.h5", old)])


def test_interrupt_while_writing_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    path = tmp_path / "s.h5"
    write(path)
    before = path.read_bytes()
    monkeypatch.setattr("os.replace", interrupt)
    for act in (lambda: write(path, seed=2), lambda: write_text(path, "page")):
        with pytest.raises(KeyboardInterrupt):
            act()
        assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [("s.h5", before)]


def test_files_get_the_permissions_of_any_new_file(tmp_path):
    previous = os.umask(0o027)
    try:
        write(tmp_path / "s.h5")
        write_text(tmp_path / "page.html", "page")
    finally:
        os.umask(previous)
    assert {stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()} == {0o640}


def test_pipe_is_not_waited_for(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="is a device or a pipe"):
        store.read_origin(pipe)


def test_format_name_of_what_is_no_artifact(tmp_path):
    (tmp_path / "log.csv").write_text("t\n0\n")
    assert store.format_name(tmp_path / "log.csv") is None
    assert store.format_name(tmp_path / "none") is None
