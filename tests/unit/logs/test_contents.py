"""What a log holds, read without a config."""

import gzip

import h5py
import numpy as np
import pyarrow
import pytest
from pyarrow import parquet

from cpfls_cli import files
from cpfls_cli.errors import InputError
from cpfls_cli.logs.formats import log_contents
from tests.builders import ulogs


def listed(contents):
    return {topic: {field: values.tolist() for field, values in own.items()} for topic, own in contents.topics.items()}


def test_a_csv_is_one_topic_of_all_its_numbers(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,roll,mode,pitch\n0,1,hover,\n1,2,land,5\n")
    contents = log_contents(path)
    np.testing.assert_equal(listed(contents), {"": {"t": [0, 1], "roll": [1, 2], "pitch": [np.nan, 5]}})
    assert contents.warnings == ("columns that hold text are left out: mode",)
    assert (contents.units, contents.parameters, contents.system) == ({}, {}, "")


def test_of_a_csv_only_what_is_wanted_is_read(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,roll,mode\n0,1,hover\n1,2,land\n")
    assert listed(log_contents(path, ["roll"])) == {"": {"t": [], "roll": [1, 2], "mode": []}}
    with pytest.raises(InputError, match=r"log\.csv:2: column 'mode' = 'hover': not a number"):
        log_contents(path, ["mode"])


def test_a_parquet_states_the_unit_of_its_stamps(tmp_path):
    path = tmp_path / "log.parquet"
    stamps = pyarrow.array([5_000, 5_250], pyarrow.timestamp("ms"))
    parquet.write_table(pyarrow.table({"t": stamps, "roll": [1, 2], "mode": ["hover", "land"]}), path)
    contents = log_contents(path)
    assert listed(contents) == {"": {"t": [0, 0.25], "roll": [1, 2]}}
    assert contents.units == {"t": "s"}
    assert contents.warnings == ("columns that hold no numbers are left out: mode",)


def test_a_ulog_holds_topics_and_what_px4_knows_of_the_vehicle(tmp_path):
    path = tmp_path / "log.ulg"
    battery = "uint64_t timestamp;float voltage_v"
    fields = {"battery_status": battery, "battery_status[1]": battery}
    sent = [(0, 0, [12.0]), (500_000, 1, [16.0]), (750_000, 0, [11.5])]
    facts = {"sys_name": "PX4", "ver_sw_release": 0x010E00FF, "CA_ROTOR_COUNT": 4, "MPC_THR_HOVER": 0.5}
    # A parameter that is text is none, which broken files have.
    text = ulogs.message("P", b"\x0bchar[4] ODDtext")
    path.write_bytes(
        ulogs.header() + ulogs.definitions(fields, facts) + text + b"".join(ulogs.data(*row) for row in sent)
    )
    contents = log_contents(path)
    assert listed(contents) == {
        "battery_status": {"timestamp": [0, 0.75], "voltage_v": [12.0, 11.5]},
        "battery_status[1]": {"timestamp": [0.5], "voltage_v": [16.0]},
    }
    assert contents.parameters == {"CA_ROTOR_COUNT": 4.0, "MPC_THR_HOVER": 0.5}
    assert contents.system == "PX4 1.14.0"


@pytest.mark.parametrize(
    "formats",
    [
        {"a": "uint64_t timestamp;float[100000000] x"},
        {"a": "uint64_t timestamp;b[1000] x", "b": "c[1000] x", "c": "float[1000] x"},
    ],
    ids=["array", "nested"],
)
def test_a_message_of_a_ulog_that_is_longer_than_any_is_refused_before_it_is_listed(tmp_path, formats):
    path = tmp_path / "log.ulg"
    path.write_bytes(ulogs.ulog([(0, 0, [1.0])], formats))
    with pytest.raises(InputError, match=r"log\.ulg: a broken ULog file: its message 'a' would take more than 65535"):
        log_contents(path)


def test_a_message_of_a_ulog_within_itself_is_refused(tmp_path):
    path = tmp_path / "log.ulg"
    path.write_bytes(ulogs.ulog([(0, 0, [1.0])], {"a": "uint64_t timestamp;a x"}))
    with pytest.raises(InputError, match=r"log\.ulg: a broken ULog file: one of its messages contains itself"):
        log_contents(path)


def test_what_a_small_file_cannot_hold_is_refused_before_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_PLAIN", 1 << 16)
    text, table, bytes_of_eight = tmp_path / "log.csv.gz", tmp_path / "log.parquet", tmp_path / "log.h5"
    text.write_bytes(gzip.compress(b"t,roll\n" + b"1,0\n" * (1 << 20)))
    with pytest.raises(InputError, match=r"log\.csv\.gz: holds more than .* MB of text: damaged, or not a log"):
        log_contents(text)
    parquet.write_table(pyarrow.table({"t": np.zeros(1 << 22)}), table)
    with pytest.raises(InputError, match=r"log\.parquet: claims 0\.0336 GB of numbers, far more"):
        log_contents(table)
    # A byte each in the file, eight in memory.
    with h5py.File(bytes_of_eight, "w") as file:
        file.create_dataset("t", (1 << 18,), "u1", chunks=(1 << 12,))
    with pytest.raises(InputError, match=r"log\.h5: claims 0\.0021 GB of numbers"):
        log_contents(bytes_of_eight)
