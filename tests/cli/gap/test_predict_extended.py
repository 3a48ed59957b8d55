"""Prediction of a model with effects: what is left is the gap that remains."""

import numpy as np
import pytest

import cpfls_cli
from cpfls_cli.config.load import load_study
from cpfls_cli.errors import InputError
from cpfls_cli.flightlog.results import Flight
from cpfls_cli.store import read
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


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_error_is_the_gap_that_remains(gap_config, extended, flown):
    found = cpfls_cli.load_model(extended).predict(flown)
    error, measured, inertia = found.error[50:-50], found.measured_torque[50:-50], found.inertia[0]
    # The rotors balance the offset, 0.47 N m about y, so that their torque turns nothing, and the model knows.
    vehicle = load_study(gap_config).vehicle
    rotors = body_wrench(vehicle, read(flown, Flight)[0].signals["rotor_speed"]).body_torque
    assert abs(rotors[50:-50, 1].mean()) > 0.4
    assert abs(measured[:, 1].mean()) < 0.01
    assert abs(error[:, 1].mean()) < 0.01
    assert error[:, :2].std(axis=0) == pytest.approx([0, 0], abs=0.15)
    assert np.diag(inertia) == pytest.approx([0.6, 0.6, 1.2], rel=0.02)


def test_a_flight_without_attitude_is_refused(cpfls, gap_config, extended, shifted, tmp_path):
    flight = tmp_path / "flight.h5"
    cpfls.done("import", gap_config, shifted[0], "-o", flight)
    with pytest.raises(InputError, match="lacks the attitude"):
        cpfls_cli.load_model(extended).predict(flight)
