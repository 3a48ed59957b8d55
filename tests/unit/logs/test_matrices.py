"""Arrays in HDF5 and in MATLAB's files of all versions, and files that hold none."""

import h5py
import numpy as np
import pytest
import scipy.io

from cpfls_cli import files
from cpfls_cli.errors import InputError
from cpfls_cli.logs import matrices
from cpfls_cli.logs.formats import log_contents

TIME = np.arange(5) * 0.02
RATE = np.arange(15.0).reshape(5, 3)


def hdf5(path, **options):
    with h5py.File(path, "w", **options) as file:
        file["t"] = (1e3 * TIME).astype("i8")
        file["t"].attrs["units"] = "ms"
        file["imu/rate"] = RATE.astype("f4")
        file["imu/rate"].attrs["unit"] = b"rad/s"
        file["imu/turned"] = RATE.T
        file["imu/row"] = TIME[None, :]
        file["imu/valid"] = TIME > 0.03
        file["imu/name"] = "a gyroscope"
        file["imu/mass"] = 0.5
        file["imu/images"] = np.zeros((5, 8, 8))
        file["imu/wide"] = np.zeros((500, 65))
        file["#refs#/a"] = TIME


def listed(contents):
    return {name: values.tolist() for name, values in contents.topics[""].items()}


@pytest.mark.parametrize("name", ["log.h5", "log.HDF5"])
def test_columns_of_hdf5_are_paths(tmp_path, name):
    hdf5(tmp_path / name)
    contents = log_contents(tmp_path / name)
    assert listed(contents) == (
        {"t": TIME.tolist(), "imu/row": TIME.tolist(), "imu/valid": [0, 0, 1, 1, 1]}
        | {f"imu/rate[{axis}]": RATE[:, axis].tolist() for axis in range(3)}
        | {f"imu/turned[{axis}]": RATE[:, axis].tolist() for axis in range(3)}
    )
    # Stamps that state their unit are in seconds.
    assert contents.units == {"t": "s"} | {f"imu/rate[{axis}]": "rad/s" for axis in range(3)}


def test_only_what_is_wanted_is_read(tmp_path):
    hdf5(tmp_path / "log.h5")
    columns = listed(log_contents(tmp_path / "log.h5", ["imu/rate[1]", "none"]))
    assert {name for name, values in columns.items() if values} == {f"imu/rate[{axis}]" for axis in range(3)}
    assert {"t", "imu/turned[0]"} <= columns.keys()


@pytest.mark.parametrize("version", ["4", "5"])
def test_columns_of_matlab_are_paths(tmp_path, version):
    data = {"t": TIME[:, None], "rate": RATE, "mass": 0.5}
    nested = (
        {}
        if version == "4"
        else {"log": {"imu": {"acc": RATE.T, "name": "a"}, "cells": np.array([1, "b"], dtype=object)}}
    )
    scipy.io.savemat(tmp_path / "log.mat", data | nested, format=version)
    expected = {"t": TIME.tolist()} | {f"rate[{axis}]": RATE[:, axis].tolist() for axis in range(3)}
    if version == "5":
        expected |= {f"log/imu/acc[{axis}]": RATE[:, axis].tolist() for axis in range(3)}
    assert listed(log_contents(tmp_path / "log.mat")) == expected


def test_matlab_is_read_whatever_its_name_ends_in(tmp_path):
    scipy.io.savemat(tmp_path / "log.mat", {"t": TIME[:, None]})
    (tmp_path / "log.mat").rename(tmp_path / "log.h5")
    assert listed(log_contents(tmp_path / "log.h5")) == {"t": TIME.tolist()}


def test_matlab_of_version_7_3_is_hdf5_behind_a_line_of_text(tmp_path):
    path = tmp_path / "log.mat"
    hdf5(path, userblock_size=512)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    assert listed(log_contents(path))["imu/rate[2]"] == RATE[:, 2].tolist()


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("log.mat", b"", "an empty file: nothing was logged, or the copy failed"),
        (
            "log.mat",
            b"MATLAB 5.0 MAT-file".ljust(126) + b"IM" + b"\x0f\0\0\0\xff\xff\0\0broken",
            "cannot be read as MATLAB: ",
        ),
        ("log.h5", b"\x89HDF\r\n\x1a\n" + bytes(30), "cannot be read as HDF5: "),
        ("log.h5", b"MATLAB 5.0 MAT-file".ljust(126), "cannot be read as MATLAB: "),
    ],
    ids=["empty", "broken", "cut", "under another ending"],
)
def test_what_cannot_be_read(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as caught:
        log_contents(tmp_path / name)
    assert f"{name}: {message}" in str(caught.value)


def test_what_keeps_hdf5_busy_for_ever(tmp_path, monkeypatch):
    hdf5(tmp_path / "log.h5")
    # As damage does, where HDF5 follows addresses in a circle.
    monkeypatch.setattr(matrices, "_PROBE", "while True: pass")
    monkeypatch.setattr(matrices, "longest_read_s", lambda _: 0.3)
    with pytest.raises(InputError, match=r"log\.h5: damaged: HDF5 did not finish reading it within"):
        log_contents(tmp_path / "log.h5")
    assert not matrices.is_log(tmp_path / "log.h5")


def test_a_file_without_columns(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["name"] = "nothing"
    with pytest.raises(InputError, match=r"log\.h5: holds no vectors or matrices of numbers"):
        log_contents(tmp_path / "log.h5")


def test_an_artifact_of_this_program_is_no_log(tmp_path):
    hdf5(tmp_path / "flight.h5")
    with h5py.File(tmp_path / "flight.h5", "a") as file:
        file.attrs["format"] = "cpfls/flight"
    with pytest.raises(InputError, match=r"flight\.h5: is an artifact of this program \(cpfls/flight\), not a log"):
        log_contents(tmp_path / "flight.h5")


def test_a_file_that_states_more_than_memory_may_hold_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_PLAIN", 1 << 20)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file.create_dataset("t", (10**9,), "f8", chunks=(1 << 16,))
    scipy.io.savemat(tmp_path / "log.mat", {"t": np.zeros(3 << 20)}, do_compression=True)
    with pytest.raises(InputError, match=r"log\.h5: claims 8 GB of numbers, far more"):
        log_contents(tmp_path / "log.h5")
    with pytest.raises(InputError, match=r"log\.mat: holds more than .* GB of numbers in .* MB: damaged, or not a log"):
        log_contents(tmp_path / "log.mat")
