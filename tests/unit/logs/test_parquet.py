"""Logs in Parquet: columns of every type of number, stamps that know their unit, and files that are none."""

import datetime
import decimal
import gzip
import sys

import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from cpfls_cli.errors import InputError
from cpfls_cli.logs.formats import log_contents

TIME = 0.02 * np.arange(200)
ROLL = 0.2 * np.sin(2 * TIME)


@pytest.fixture
def write(tmp_path):
    def call(columns, name="log.parquet", **options):
        parquet.write_table(pyarrow.table(columns), tmp_path / name, **options)
        return tmp_path / name

    return call


@pytest.fixture
def refused():
    def call(path, wanted=None, content=None):
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(InputError) as caught:
            log_contents(path, wanted)
        said = str(caught.value)
        assert said.startswith(f"{path}: ")
        return said.removeprefix(f"{path}: ")

    return call


def test_numbers_of_every_type_are_read(write):
    columns = {
        "single": ROLL.astype(np.float32),
        "decimal": pyarrow.array([decimal.Decimal(f"{value:.6f}") for value in ROLL], pyarrow.decimal128(12, 6)),
        "whole": (1e3 * ROLL).astype(np.int16),
        "flag": ROLL > 0,
        "listed": pyarrow.array(np.round(ROLL, 1)).dictionary_encode(),
    }
    text = {"note": ["text that nobody asked for"] * len(TIME)}
    read = log_contents(write(columns | text, row_group_size=64), list(columns)).topics[""]
    expected = [ROLL, ROLL, np.trunc(1e3 * ROLL), ROLL > 0, np.round(ROLL, 1)]
    np.testing.assert_allclose([read[name] for name in columns], expected, atol=1e-6)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_stamps_that_state_their_unit_are_in_seconds(write, unit):
    begin = datetime.datetime(2024, 5, 1, tzinfo=datetime.UTC)
    moments = [begin + datetime.timedelta(milliseconds=20 * row) for row in range(len(TIME))]
    moments[9] = None
    contents = log_contents(write({"t": pyarrow.array(moments, pyarrow.timestamp(unit, "UTC"))}))
    assert contents.units == {"t": "s"}
    np.testing.assert_allclose(contents.topics[""]["t"], np.where(np.arange(200) == 9, np.nan, TIME), atol=1e-9)


def test_whole_numbers_state_no_unit_and_nulls_are_absent(write):
    stamps = (1e6 * TIME).round().astype(np.int64)
    roll = pyarrow.array([None if row in (70, 71) else value for row, value in enumerate(ROLL)])
    contents = log_contents(write({"t": stamps, "a.roll": roll, "roll": ROLL, "mode": ["hover"] * len(TIME)}))
    assert contents.topics[""].keys() == {"t", "a.roll", "roll"}
    assert contents.warnings == ("columns that hold no numbers are left out: mode",)
    assert contents.units == {}
    np.testing.assert_array_equal(contents.topics[""]["t"], stamps)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(contents.topics[""]["a.roll"])), [70, 71])


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (
            ["up"] * 3,
            "column 'pitch' holds string, not numbers; map another column in import.signals, or write this one as "
            "numbers",
        ),
        ([[1.0]] * 3, "column 'pitch' holds list<"),
    ],
)
def test_columns_that_hold_no_numbers_are_named(refused, write, values, said):
    assert refused(write({"t": TIME[:3], "pitch": values}), ["t", "pitch"]).startswith(said)


@pytest.mark.parametrize("content", [b"hello", b"PAR1" + bytes(100) + b"PAR1"])
def test_what_is_no_parquet(refused, tmp_path, content):
    assert refused(tmp_path / "log.parquet", content=content).startswith("cannot be read as Parquet: ")


def test_a_column_whose_name_is_no_text_and_a_broken_page(refused, write):
    log = write({"t": TIME, "roll": ROLL})
    good = log.read_bytes()
    said = refused(log, content=good.replace(b"roll", b"\xf9oll"))
    assert said.startswith("cannot be read as Parquet: 'utf-8' codec can't decode byte 0xf9")
    assert refused(log, content=good[:4] + bytes(1996) + good[2000:]).startswith("cannot be read as Parquet: ")


@pytest.mark.parametrize(
    ("name", "held", "called", "ending"),
    [
        ("log.parquet", b"t,roll\n0,1\n", "CSV", ".csv"),
        ("log.ulg", b"t;roll\r\n0;1\r\n", "CSV", ".csv"),
        ("log.csv.gz", b"t\troll\n0\t1\n", "CSV", ".csv"),
        ("log.csv", gzip.compress(b"t,roll\n0,1\n", mtime=0), "gzip-compressed data", ".csv.gz"),
    ],
)
def test_another_kind_than_the_name_says_is_named(refused, tmp_path, name, held, called, ending):
    said = f"seems to hold {called}, unlike the ending of its name; rename it to end in {ending}"
    assert refused(tmp_path / name, content=held) == said


@pytest.mark.parametrize("name", ["log.parquet", "log.csv"])
def test_a_binary_log_is_said_by_its_content(refused, tmp_path, name):
    assert refused(tmp_path / name, content=b"ULog\x01\x12\x35\x01").startswith("a broken ULog file: ")


@pytest.mark.parametrize("name", ["log.csv", "log.ulg"])
def test_parquet_is_read_whatever_its_name_ends_in(write, name):
    np.testing.assert_array_equal(log_contents(write({"t": TIME}, name)).topics[""]["t"], TIME)


def test_a_csv_whose_first_column_is_called_as_parquet_begins(tmp_path):
    (tmp_path / "log.csv").write_text("PAR1,roll\n0,1\n")
    assert log_contents(tmp_path / "log.csv").topics[""].keys() == {"PAR1", "roll"}


def test_without_the_package(refused, write, monkeypatch):
    log = write({"t": TIME})
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert refused(log) == 'reading .parquet needs the package pyarrow; pip install "cpfls[parquet]"'
