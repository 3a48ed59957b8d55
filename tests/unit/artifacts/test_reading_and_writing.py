"""Artifacts are written whole or not at all, and refused where they are not known."""

import io
import os
import stat
from typing import ClassVar

import h5py
import numpy as np
import pytest

from cpfls_cli.artifacts.flight import FlightRecord
from cpfls_cli.artifacts.formats import record_of_format
from cpfls_cli.artifacts.output import write_text
from cpfls_cli.artifacts.spec import SCHEMA_VERSION, Format, Header, InputFile, Record, dataset, group, record
from cpfls_cli.artifacts.store import Artifact, format_name, read_artifact, read_header, write_artifact
from cpfls_cli.errors import ComputationError, InputError
from cpfls_cli.files import text_sha256

HEADER = Header("1.2.3", 4, "seed: 4\n", {"flight": InputFile("f.h5", "ab" * 32, "cpfls/flight")})


@record
class TraceGroup:
    """What is reached on the way."""

    condition_number: np.ndarray = dataset("after each", "selected", gaps=True)
    singular_value_min: np.ndarray = dataset("after each", "selected")
    singular_value_max: np.ndarray = dataset("after each", "selected")


@record
class SelectionRecord(Record):
    """Some samples."""

    FORMAT: ClassVar = Format("cpfls/selection", "samples", "reduce", ("flight",))

    indices: np.ndarray = dataset("in order", "selected")
    trace: TraceGroup = group()
    rank: int = dataset("rank")
    rank_full: int = dataset("rank of all")
    condition_number: float = dataset("of the selection")
    condition_number_full: float = dataset("of all")
    candidates: int = dataset("how many")
    criterion: str = dataset("the rule")
    stop_reason: str = dataset("why it ended")
    random_condition_number: np.ndarray = dataset("random", "draw", path="random/condition_number", gaps=True)


@pytest.fixture(autouse=True)
def known(monkeypatch):
    """Know this record beside all others."""
    for room in ("check", "store"):
        one = lambda name, kind="": SelectionRecord if name == "cpfls/selection" else record_of_format(name, kind)  # noqa: E731
        monkeypatch.setattr(f"cpfls_cli.artifacts.{room}.record_of_format", one)


def selection(**changes):
    data = {
        "indices": np.array([4, 2]),
        "trace/condition_number": np.array([np.inf, 3.0]),
        "trace/singular_value_min": np.ones(2),
        "trace/singular_value_max": np.ones(2),
        "rank": 2,
        "rank_full": 2,
        "condition_number": 3.0,
        "condition_number_full": 4.0,
        "candidates": 9,
        "criterion": np.array("sigma_min"),
        "stop_reason": np.array("size reached: 2 of 9, \u03bc"),
        "random/condition_number": np.array([5.0, np.nan]),
    }
    return Artifact(SelectionRecord.spec(), HEADER, data | changes)


def test_reading_gives_what_was_written(tmp_path):
    path = tmp_path / "s.h5"
    write_artifact(path, selection())
    artifact = read_artifact(path, SelectionRecord.spec())
    assert artifact.spec is SelectionRecord.spec()
    assert artifact.header == HEADER
    assert artifact.text("stop_reason") == "size reached: 2 of 9, \u03bc"
    assert artifact.number("rank") == 2.0
    np.testing.assert_array_equal(artifact.array("trace/condition_number"), [np.inf, 3.0])
    np.testing.assert_array_equal(artifact.array("random/condition_number"), [5.0, np.nan])
    assert artifact.data["indices"].dtype == np.int64
    assert format_name(path) == "cpfls/selection"


def test_what_was_read_is_the_reader_s_own_and_a_changed_file_is_read_again(tmp_path):
    path = tmp_path / "s.h5"
    write_artifact(path, selection())
    first = read_artifact(path)
    first.data["indices"][:] = 0
    assert read_artifact(path).data["indices"].tolist() == [4, 2]
    assert (format_name(path), read_header(path)) == ("cpfls/selection", HEADER)
    write_artifact(path, selection(rank=1))
    assert read_artifact(path).number("rank") == 1.0
    path.write_bytes(path.read_bytes()[:-1])
    assert format_name(path) is None
    for read in (read_artifact, read_header):
        with pytest.raises(InputError, match="does not end in the checksum"):
            read(path)


def test_a_file_is_what_the_plain_calls_of_h5py_write(tmp_path):
    """Datasets and their descriptions are written by the library below, in half of the time and to the same bytes."""
    path, plain, artifact = tmp_path / "s.h5", io.BytesIO(), selection()
    write_artifact(path, artifact)
    with h5py.File(plain, "w") as file:
        file.attrs["format"] = artifact.spec.name
        file.attrs["schema_version"] = SCHEMA_VERSION
        file.attrs["cpfls_version"] = HEADER.version
        file.attrs["seed"] = HEADER.seed
        file.attrs["config_sha256"] = text_sha256(HEADER.config)
        file.create_dataset("config", data=np.bytes_(HEADER.config.encode()))
        group = file.create_group("inputs/flight")
        for key in ("name", "sha256", "format"):
            group.attrs[key] = getattr(HEADER.inputs["flight"], key)
        for spec in (each for each in artifact.spec.datasets if each.path in artifact.data):
            values = np.asarray(artifact.data[spec.path])
            text = values.dtype.kind == "U"
            dataset = file.create_dataset(spec.path, data=np.char.encode(values, "utf-8") if text else values)
            for name in ("units", "frame", "description"):
                dataset.attrs[name] = getattr(spec, name)
            for axis, label in enumerate(spec.dimensions):
                dataset.dims[axis].label = label
    assert path.read_bytes().startswith(plain.getvalue())
    assert len(path.read_bytes()) - len(plain.getvalue()) < 100


def test_equal_content_is_an_equal_file(tmp_path):
    changes = {"a.h5": {}, "a much longer name.h5": {}, "other.h5": {"rank": 1}}
    for name, change in changes.items():
        write_artifact(tmp_path / name, selection(**change))
    first, second, other = ((tmp_path / name).read_bytes() for name in changes)
    assert first == second
    assert first != other


@pytest.mark.parametrize("old", [None, b"precious"])
@pytest.mark.parametrize("failing", [{"unknown": 1}, {"indices": np.array([object()])}], ids=["unknown", "object"])
def test_failure_in_the_middle_leaves_the_old_file_and_nothing_else(tmp_path, old, failing):
    path = tmp_path / "s.h5"
    if old is not None:
        path.write_bytes(old)
    with pytest.raises((KeyError, ComputationError)):
        write_artifact(path, selection(**failing))
    assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == ([] if old is None else [("s.h5", old)])


def test_interrupt_while_writing_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    path = tmp_path / "s.h5"
    write_artifact(path, selection())
    before = path.read_bytes()
    monkeypatch.setattr("os.replace", interrupt)
    for write in (lambda: write_artifact(path, selection(rank=1)), lambda: write_text(path, "page")):
        with pytest.raises(KeyboardInterrupt):
            write()
        assert [(p.name, p.read_bytes()) for p in tmp_path.iterdir()] == [("s.h5", before)]


def test_files_get_the_permissions_of_any_new_file(tmp_path):
    previous = os.umask(0o027)
    try:
        write_artifact(tmp_path / "s.h5", selection())
        write_text(tmp_path / "page.html", "page")
    finally:
        os.umask(previous)
    assert {stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()} == {0o640}


def test_wrong_format_names_both(tmp_path):
    write_artifact(tmp_path / "s.h5", selection())
    with pytest.raises(InputError, match=r"is a cpfls/selection; .* needs a cpfls/flight"):
        read_artifact(tmp_path / "s.h5", FlightRecord.spec())


def test_pipe_is_not_waited_for(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="is a device or a pipe"):
        read_artifact(pipe)


def test_format_name_of_what_is_no_artifact(tmp_path):
    (tmp_path / "log.csv").write_text("t\n0\n")
    assert format_name(tmp_path / "log.csv") is None
    assert format_name(tmp_path / "none") is None
