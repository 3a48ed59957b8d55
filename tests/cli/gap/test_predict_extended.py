"""Prediction of a model with effects: what is left is the gap that remains."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from cpfls_cli import store
from cpfls_cli.artifacts.spec import PART
from cpfls_cli.config.load import load_study
from cpfls_cli.flights import flight_source
from cpfls_cli.flights.flight import Flight, Imported
from cpfls_cli.store import read, write
from cpfls_cli.vehicle.rotors import body_wrench

COLUMNS = "t,wx,wy,wz,om1,om2,om3,om4,phi,theta,psi"


@pytest.fixture(scope="module")
def flown(cpfls, gap_config, shifted, tmp_path_factory):
    """A flight that has an attitude too; level will do, for a prediction only turns torques by it."""
    folder = tmp_path_factory.mktemp("flown")
    data = np.loadtxt(shifted[2], delimiter=",", skiprows=1)
    # Without noise, which a prediction differentiates.
    smooth = np.array(
        [np.convolve(np.pad(c, 7, mode="edge"), np.hanning(15) / np.hanning(15).sum(), "valid") for c in data[:, 1:4].T]
    ).T
    table = np.column_stack([data[:, :1], smooth, data[:, 4:], np.zeros((len(data), 3))])
    np.savetxt(folder / "log.csv", table, delimiter=",", header=COLUMNS, comments="", fmt="%.12g")
    cpfls.done("import", gap_config, folder / "log.csv", "-o", folder / "flight.h5")
    return folder / "flight.h5"


def test_error_is_the_gap_that_remains(cpfls, gap_config, extended, flown, tmp_path):
    cpfls.done("predict", gap_config, extended, flown, "-o", tmp_path / "p.h5")
    cpfls.done("check", tmp_path / "p.h5")
    with h5py.File(tmp_path / "p.h5") as file:
        error, measured = file["error"][50:-50], file["measured_torque"][50:-50]
        inertia = file["inertia"][0]
        assert file["held_against"][()] == b"motion"
    # The rotors balance the offset, 0.47 N m about y, so that their torque turns nothing, and the model knows.
    vehicle = load_study(gap_config).vehicle
    rotors = body_wrench(vehicle, read(flown, Flight)[0].signals["rotor_speed"]).body_torque
    assert abs(rotors[50:-50, 1].mean()) > 0.4
    assert abs(measured[:, 1].mean()) < 0.01
    assert abs(error[:, 1].mean()) < 0.01
    assert error[:, :2].std(axis=0) == pytest.approx([0, 0], abs=0.15)
    assert np.diag(inertia) == pytest.approx([0.6, 0.6, 1.2], rel=0.02)


def test_a_flight_without_attitude_is_refused(cpfls, refuse, gap_config, extended, shifted, tmp_path):
    flight = tmp_path / "flight.h5"
    cpfls.done("import", gap_config, shifted[0], "-o", flight)
    (message,) = refuse("predict", gap_config, extended, flight, "-o", tmp_path / "x.h5")
    assert "lacks the attitude" in message


def test_a_long_flight_is_predicted_in_stretches(cpfls, gap_config, extended, flown, tmp_path, monkeypatch):
    record, origin = read(flown, Imported)
    times = 2 * PART // len(record.time) + 1
    tiled = {name: np.concatenate([values] * times) for name, values in record.signals.items()}
    tiled["time"] = record.time[1] * np.arange(len(tiled["body_rate"]))
    write(tmp_path / "long.h5", replace(record, **tiled), origin)

    def predicted(name):
        output = tmp_path / name
        told = cpfls.told("predict", gap_config, extended, tmp_path / "long.h5", "-o", output)
        return store.flat(output), told["samples"], output.read_bytes()

    whole, samples, _ = predicted("whole.h5")
    monkeypatch.setattr(flight_source, "STRETCH", PART)
    monkeypatch.setattr(flight_source, "IN_MEMORY", PART)
    (parts, in_parts, written), (*_, again) = predicted("parts.h5"), predicted("again.h5")
    assert samples == in_parts == len(tiled["time"]) > 2 * PART
    assert written == again
    assert parts.keys() == whole.keys()
    for name, (_, values) in whole.items():
        if values.dtype.kind == "U":
            assert parts[name][1].tolist() == values.tolist()
            continue
        np.testing.assert_allclose(parts[name][1], values, rtol=1e-9, atol=1e-12)
