"""Prediction of a model with effects: what is left is the gap that remains."""

import h5py
import numpy as np
import pytest

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
    assert cpfls("import", gap_config, folder / "log.csv", "-o", folder / "flight.h5").exit_code == 0
    return folder / "flight.h5"


def test_error_is_the_gap_that_remains(cpfls, gap_config, extended, flown, tmp_path):
    assert cpfls("predict", gap_config, extended, flown, "-o", tmp_path / "p.h5").exit_code == 0
    assert cpfls("check", tmp_path / "p.h5").exit_code == 0
    with h5py.File(tmp_path / "p.h5") as file:
        error, measured = file["error"][50:-50], file["measured_torque"][50:-50]
        inertia = file["inertia"][0]
    # The rotors balance the offset, 0.47 N m about y, and the model knows.
    assert abs(measured[:, 1].mean()) > 0.4
    assert abs(error[:, 1].mean()) < 0.01
    assert error[:, :2].std(axis=0) == pytest.approx([0, 0], abs=0.15)
    assert np.diag(inertia) == pytest.approx([0.6, 0.6, 1.2], rel=0.02)


def test_a_flight_without_attitude_is_refused(cpfls, refuse, gap_config, extended, shifted, tmp_path):
    flight = tmp_path / "flight.h5"
    assert cpfls("import", gap_config, shifted[0], "-o", flight).exit_code == 0
    (message,) = refuse("predict", gap_config, extended, flight, "-o", tmp_path / "x.h5")
    assert "lacks the attitude" in message
