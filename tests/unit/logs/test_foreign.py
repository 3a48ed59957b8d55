"""Files that people hand in for logs: each is named by what it holds, with the way to a log."""

import io
import struct
import tarfile
import zipfile

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.logs.formats import foreign_file, log_contents
from tests.builders.dataflash_logs import dataflash, definition


def archive(**members):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as packed:
        for name, content in members.items():
            packed.writestr(name.replace("_", "/", 1).replace("__", "."), content)
    return stream.getvalue()


def tape():
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w") as packed:
        packed.addfile(tarfile.TarInfo("log.bin"), io.BytesIO())
    return stream.getvalue()


def array():
    stream = io.BytesIO()
    np.save(stream, np.zeros(3))
    return stream.getvalue()


TELEMETRY = b"".join(struct.pack(">Q", 14 * 10**14 + 10**5 * i) + b"\xfe\x09" + bytes(15) for i in range(9))


@pytest.mark.parametrize(
    ("name", "content", "what", "way"),
    [
        ("a.bag", b"#ROSBAG V2.0\n" + bytes(99), "a bag of ROS 1", "rosbags-convert"),
        ("a.bin", bytes(999), "a file that begins with zeros alone", "take it from the device again"),
        ("a.tlog", TELEMETRY, "telemetry of MAVLink", "the log that the autopilot writes itself"),
        ("a.bin", TELEMETRY, "telemetry of MAVLink", "the log that the autopilot writes itself"),
        ("a.rlog", TELEMETRY[8:], "telemetry of MAVLink", "the log that the autopilot writes itself"),
        ("a.zip", archive(a="x"), "a zip archive", "unpack it first"),
        ("a.ulg", archive(a="x"), "a zip archive", "unpack it first"),
        ("a.bin.gz", b"\x1f\x8b\x08" + bytes(9), "data compressed by gzip", "unpack it first"),
        ("a.tar", tape(), "a tar archive", "unpack it first"),
        ("a.xlsx", archive(xl_book="x"), "a spreadsheet", "save its table as CSV"),
        ("a.px4log", definition(0x80, "FMT", "BBnZ", "Type,Length"), "a log of PX4 before ULog (sdlog2)", "to CSV"),
        ("a.npy", array(), "an array of NumPy", "a name for each column"),
        ("a.ulg", b"version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS", "git lfs pull"),
        ("a.DAT", bytes(16) + b"BUILD 2019", "a .DAT of DJI", "to CSV"),
        ("a.gpx", b'<?xml version="1.0"?>\n<gpx version="1.1">', "a GPX track", "log of the autopilot"),
        ("a.kml", b"<kml>", "a KML track", "log of the autopilot"),
        ("a.csv", b"<!DOCTYPE html>\n<html>a,b", "a web page", "save the log itself"),
        ("a.csv", b'{"t": 1,\n', "JSON", "write its numbers as CSV"),
        ("a.px4log", b"\xa3\x95\x80\x027ATT" + bytes(80), "a log of PX4 before ULog (sdlog2)", "to CSV"),
        ("a.log", b"[2024-06-13 11:56:33.1] [0x7f] Time [s], x [m]\n", "text with a stamp in brackets", "as CSV"),
        (
            "a.csv",
            b"Date,Time,1RSS(dB),Alt(m),Alt(m)\n",
            "telemetry that a radio logs",
            "log that the flight controller",
        ),
        ("a.log", b"#DroneDeploy\t2.7\n", "a log of an app", "the log that the autopilot writes"),
        ("a.txt", b'[{"t": 1}]', "JSON", "write its numbers as CSV"),
        ("a.bin", b"", "an empty file", "the copy failed"),
        ("a.log", b"", "an empty file", "the copy failed"),
        ("a.pdf", b"%PDF-1.4", "a PDF", "the log that it shows"),
        ("a.jpg", b"\xff\xd8\xff\xe0", "a picture", "the log that it shows"),
    ],
)
def test_a_file_that_is_no_log_is_named_with_the_way_to_one(tmp_path, name, content, what, way):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        log_contents(path)
    said = str(caught.value)
    assert said.startswith(f"{path}: {what}")
    assert way in said


def test_messages_of_sdlog2_are_told_from_those_of_dataflash_whatever_the_name(tmp_path):
    kinds = {"TIME": ("Q", "StartTime"), "ATT": ("fff", "Roll,Pitch,Yaw"), "PARM": ("Nf", "Name,Value")}
    path = tmp_path / "log.bin"
    path.write_bytes(dataflash(kinds | {"MSG": ("Z", "Message")}, [("TIME", (5,)), ("ATT", (0.1, 0.2, 0.3))]))
    with pytest.raises(InputError, match="sdlog2"):
        log_contents(path)


def test_a_log_is_no_foreign_file(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t,x\n0,1\n")
    assert foreign_file(path) is None
