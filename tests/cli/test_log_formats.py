"""A new format of logs is one reader and one row of the table: the commands then take, name and tell it."""

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli.config.load import load_study
from cpfls_cli.flights.recordings import read_flights
from cpfls_cli.logs import formats

NAMES = ("t", "roll", "pitch", "yaw", "mx", "my", "mz")
MAGIC = b"FAKE\x00"


def contents(path, wanted):
    """Columns one after the other, eight bytes a number."""
    values = np.frombuffer(path.read_bytes()[len(MAGIC) :]).reshape(len(NAMES), -1)
    columns = dict(zip(NAMES, values, strict=True))
    assert set(wanted) == set(columns)
    return formats.LogContents({"": columns}, warnings=("the logger was tired",))


@pytest.fixture
def fake_format(monkeypatch):
    monkeypatch.setitem(sys.modules, "fake_reader", SimpleNamespace(contents=contents))
    row = formats.LogFormat(suffix=".fake", name="Fake", content="fakes", magic=MAGIC, reader="fake_reader")
    monkeypatch.setattr(formats, "LOG_FORMATS", (*formats.LOG_FORMATS, row))


def write(path):
    time = 0.02 * np.arange(200)
    signals = [0.2 * np.sin((2 + place) * time) for place in range(6)]
    path.write_bytes(MAGIC + np.array([time, *signals]).tobytes())
    return path


@pytest.mark.usefixtures("fake_format")
def test_import_takes_a_log_of_a_new_format(cpfls, log_study, tmp_path):
    log = write(tmp_path / "log.FAKE")
    result = cpfls("import", log_study, log, "-o", tmp_path / "flight.h5", "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["samples"] == 200
    assert "cpfls: note: the logger was tired" in result.stderr.splitlines()


@pytest.mark.usefixtures("fake_format")
def test_the_gap_workflow_takes_it_as_well(log_study, tmp_path):
    flights = read_flights([write(tmp_path / "log.fake")], load_study(log_study))
    assert [recording.name for recording in flights.recordings] == ["log.fake"]


@pytest.mark.usefixtures("fake_format")
def test_messages_name_a_new_format(refuse, log_study, tmp_path):
    csv, other = write(tmp_path / "log.csv"), tmp_path / "log.txt"
    words = ("-o", tmp_path / "flight.h5")
    assert refuse("import", log_study, csv, *words) == [
        f"{csv}: seems to hold fakes, not what its name ends in; rename it to end in .fake"
    ]
    assert refuse("import", log_study, other, *words) == [f"{other}: no such file"]
    other.write_text("t\n")
    assert refuse("import", log_study, other, *words) == [
        f"{other}: not a log: its name must end in one of .csv, .csv.gz, .parquet, .ulg, .bin, .bbl, .bfl, .db3, .mcap,"
        " .h5, .hdf5, .mat, .fake, or it must be a blackbox log or a log of a Crazyflie's uSD card"
    ]
    assert formats.suffixes_in_words().endswith(", .h5, .hdf5, .mat or .fake")
    assert formats.formats_in_words().endswith(", MATLAB, Fake")


@pytest.mark.usefixtures("fake_format")
def test_a_package_of_a_new_format_that_is_missing_is_named(refuse, log_study, tmp_path, monkeypatch):
    row = formats.LogFormat(
        suffix=".fake", name="Fake", content="fakes", reader="fake_reader", packages=("no_such.part",), extra="fake"
    )
    monkeypatch.setattr(formats, "LOG_FORMATS", (row,))
    log = write(tmp_path / "log.fake")
    (line,) = refuse("import", log_study, log, "-o", tmp_path / "flight.h5")
    assert line == f'{log}: reading .fake needs the package no_such; pip install "cpfls[fake]"'
