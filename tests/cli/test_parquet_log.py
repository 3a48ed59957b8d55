"""Logs in Parquet: columns of every type of number, stamps that know their unit, and files that are none."""

import datetime
import decimal
import gzip
import json
import sys

import h5py
import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

TIME = 0.02 * np.arange(200)
COLUMNS = {
    name: 0.2 * np.sin((2 + place) * TIME) for place, name in enumerate(["roll", "pitch", "yaw", "mx", "my", "mz"])
}


def decimals(values):
    return pyarrow.array([decimal.Decimal(f"{value:.6f}") for value in values], pyarrow.decimal128(12, 6))


def stamps(unit):
    begin = datetime.datetime(2024, 5, 1, tzinfo=datetime.UTC)
    moments = [begin + datetime.timedelta(milliseconds=20 * row) for row in range(len(TIME))]
    return pyarrow.array(moments, pyarrow.timestamp(unit, "UTC"))


@pytest.fixture
def write(tmp_path):
    def call(columns, name="log.parquet", **options):
        parquet.write_table(pyarrow.table(columns), tmp_path / name, **options)
        return tmp_path / name

    return call


@pytest.fixture
def flown(cpfls, log_study, write, tmp_path):
    def call(columns, *words, **options):
        flight = tmp_path / "flight.h5"
        result = cpfls.done("import", log_study, write(columns, **options), "-o", flight, "--json", *words)
        with h5py.File(flight) as file:
            return json.loads(result.stdout), {name: file[name][()] for name in ("time", "attitude", "body_torque")}

    return call


@pytest.fixture
def wrong(refuse, log_study, tmp_path):
    def call(log, *words):
        lines = refuse("import", log_study, log, "-o", tmp_path / "flight.h5", *words)
        return [line.replace(str(log), "LOG") for line in lines]

    return call


def test_numbers_of_every_type_give_the_same_flight(flown):
    changed = {
        "roll": COLUMNS["roll"].astype(np.float32),
        "pitch": decimals(COLUMNS["pitch"]),
        "mx": (1e3 * COLUMNS["mx"]).astype(np.int16),
        "my": COLUMNS["my"] > 0,
        "mz": pyarrow.array(np.round(COLUMNS["mz"], 1)).dictionary_encode(),
        "note": ["text that nobody asked for"] * len(TIME),
    }
    summary, flight = flown({"t": TIME} | COLUMNS | changed, row_group_size=64)
    assert (summary["samples"], summary["missing"], summary["dropped"]) == (200, {}, {})
    np.testing.assert_allclose(
        flight["attitude"], np.column_stack([COLUMNS[n] for n in ("roll", "pitch", "yaw")]), atol=1e-6
    )
    expected = [np.trunc(1e3 * COLUMNS["mx"]), COLUMNS["my"] > 0, np.round(COLUMNS["mz"], 1)]
    np.testing.assert_allclose(flight["body_torque"], np.column_stack(expected), atol=1e-9)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
@pytest.mark.parametrize("time_unit", ["s", "us"])
def test_stamps_that_state_their_unit_need_no_other(flown, unit, time_unit):
    summary, flight = flown({"t": stamps(unit)} | COLUMNS, "--set", f"import.time_unit={time_unit}")
    assert summary["rate_hz"] == pytest.approx(50.0)
    np.testing.assert_allclose(flight["time"], TIME, atol=1e-9)


def test_whole_numbers_are_stamps_in_the_unit_of_the_config(flown):
    summary, _ = flown({"t": (1e6 * TIME).round().astype(np.int64)} | COLUMNS, "--set", "import.time_unit=us")
    assert summary["rate_hz"] == pytest.approx(50.0)


def test_nulls_are_absent_values(flown):
    roll = pyarrow.array([None if row in (70, 71) else value for row, value in enumerate(COLUMNS["roll"])])
    summary, flight = flown({"t": TIME} | COLUMNS | {"roll": roll})
    assert summary["missing"] == {"roll": 2}
    np.testing.assert_allclose(flight["attitude"][:, 0], COLUMNS["roll"], atol=1e-3)


def test_null_stamps_are_dropped(flown):
    time = pyarrow.array([None if row == 9 else value for row, value in enumerate(stamps("us").to_pylist())])
    summary, _ = flown({"t": time} | COLUMNS)
    assert summary["dropped"] == {"time_not_finite": 1}


def test_a_dot_in_a_name_is_part_of_it(cpfls, log_study, write, tmp_path):
    log = write({"t": TIME, "a.roll": COLUMNS["roll"], "a.other": COLUMNS["my"]} | COLUMNS)
    log_study.write_text(log_study.read_text().replace("[roll,", "[a.roll,"))
    cpfls.done("import", log_study, log, "-o", tmp_path / "flight.h5", "--json")


def test_columns_that_hold_no_numbers_are_named(wrong, write):
    log = write({"t": TIME} | COLUMNS | {"pitch": ["up"] * len(TIME)})
    assert wrong(log) == [
        "LOG: column 'pitch' holds string, not numbers; map another column in import.signals, or write this one as "
        "numbers"
    ]
    nested = write({"t": TIME} | COLUMNS | {"yaw": [[1.0]] * len(TIME)}, "nested.parquet")
    (line,) = wrong(nested)
    assert line.startswith("LOG: column 'yaw' holds list<")


@pytest.mark.parametrize("content", [b"hello", b"PAR1" + bytes(100) + b"PAR1"])
def test_what_is_no_parquet(wrong, tmp_path, content):
    path = tmp_path / "log.parquet"
    path.write_bytes(content)
    (line,) = wrong(path)
    assert line.startswith("LOG: cannot be read as Parquet: ")


def test_a_column_whose_name_is_no_text(wrong, write):
    log = write({"t": TIME} | COLUMNS)
    log.write_bytes(log.read_bytes().replace(b"roll", b"\xf9oll"))
    (line,) = wrong(log)
    assert line.startswith("LOG: cannot be read as Parquet: 'utf-8' codec can't decode byte 0xf9")


def test_columns_of_nulls_are_named(wrong, write):
    nulls = pyarrow.array([None] * len(TIME), pyarrow.float64())
    one = pyarrow.array([1.0, *[None] * (len(TIME) - 1)], pyarrow.float64())
    lines = wrong(write({"t": TIME} | COLUMNS | {"pitch": nulls, "mz": one}))
    assert lines == [
        "LOG: import.signals.attitude.columns: 'pitch' has fewer than two values (0) in the 200 rows that are read",
        "LOG: import.signals.body_torque.columns: 'mz' has fewer than two values (1) in the 200 rows that are read; "
        "map another column, or leave the signal out of import.signals",
    ]


@pytest.mark.parametrize(
    ("name", "held", "called", "ending"),
    [
        ("log.parquet", b"t,roll\n0,1\n", "CSV", ".csv"),
        ("log.ulg", b"t;roll\r\n0;1\r\n", "CSV", ".csv"),
        ("log.csv.gz", b"t\troll\n0\t1\n", "CSV", ".csv"),
        ("log.csv", gzip.compress(b"t,roll\n0,1\n", mtime=0), "gzip-compressed data", ".csv.gz"),
    ],
)
def test_another_kind_than_the_name_says_is_named(wrong, tmp_path, name, held, called, ending):
    (tmp_path / name).write_bytes(held)
    (line,) = wrong(tmp_path / name)
    assert line == f"LOG: seems to hold {called}, unlike the ending of its name; rename it to end in {ending}"


@pytest.mark.parametrize("name", ["log.parquet", "log.csv"])
def test_a_binary_log_is_told_by_its_content(wrong, tmp_path, name):
    (tmp_path / name).write_bytes(b"ULog\x01\x12\x35\x01")
    (line,) = wrong(tmp_path / name)
    assert line.startswith("LOG: a broken ULog file: ")


@pytest.mark.parametrize("name", ["log.csv", "log.ulg"])
def test_parquet_is_read_whatever_its_name_ends_in(flown, name):
    _, found = flown({"t": TIME} | COLUMNS, name=name)
    np.testing.assert_allclose(found["time"], TIME, atol=1e-12)


def test_a_csv_whose_first_column_is_called_as_parquet_begins(wrong, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("PAR1,roll\n0,1\n")
    assert wrong(path)[0].startswith("LOG: import.time_column: the log has no column 't'")


def test_a_broken_page(wrong, write):
    log = write({"t": TIME} | COLUMNS)
    content = bytearray(log.read_bytes())
    content[4:2000] = bytes(1996)
    log.write_bytes(content)
    (line,) = wrong(log)
    assert line.startswith("LOG: cannot be read as Parquet: ")


def test_without_the_package(wrong, write, monkeypatch):
    log = write({"t": TIME} | COLUMNS)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert wrong(log) == ['LOG: reading .parquet needs the package pyarrow; pip install "cpfls[parquet]"']
