"""Flights of a real Crazyflie whose Lee controller commanded the logged torques (crazyswarm2-tools, MIT)."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from cpfls_cli.flightlog import ImportSettings, SignalMap, import_log

FOLDER = Path(os.environ.get("CPFLS_FLIGHTS", "../shared/data")) / "real" / "crazyswarm2_lee"


def imported(name, **changes):
    path = FOLDER / f"{name}.csv"
    if not path.exists():
        pytest.skip(f"{path} is absent; set CPFLS_FLIGHTS to the folder of other people's flights")
    with path.open() as stream:
        header, *rows = csv.reader(stream)
    columns = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
    units = {"attitude": ("rpy", "rad"), "body_rate": ("omega", "rad/s"), "body_torque": ("torque", "N m")}
    signals = {
        signal: SignalMap(columns=tuple(f"ctrlLee_{column}{axis}" for axis in "xyz"), unit=unit)
        for signal, (column, unit) in units.items()
    }
    return import_log(columns, ImportSettings(signals=signals, lowpass_hz=8.0, **changes))


def explained(flight, axis):
    """R2 of a rigid body turning about one axis: angular acceleration, gyroscopic product, constant."""
    rate, torque = flight.body_rate, flight.body_torque[:, axis]
    product = rate[:, (axis + 1) % 3] * rate[:, (axis + 2) % 3]
    regressor = np.column_stack([flight.body_acceleration[:, axis], product, np.ones(len(torque))])
    residual = torque - regressor @ np.linalg.lstsq(regressor, torque, rcond=None)[0]
    return 1 - residual.var() / torque.var()


@pytest.mark.parametrize(("name", "roll", "pitch"), [("log119", 0.90, 0.95), ("log149", 0.86, 0.97)])
def test_the_estimated_delay_makes_a_rigid_body_explain_the_torque(name, roll, pitch):
    """The estimate lies between what roll alone and what pitch alone would choose by a regression of their own."""
    flight = imported(name, delay_s="estimate")
    tried = np.arange(0.05, 0.111, 0.005)
    scanned = [imported(name, delay_s=float(delay)) for delay in tried]
    alone = [tried[np.argmax([explained(candidate, axis) for candidate in scanned])] for axis in (0, 1)]
    assert min(alone) - 0.005 <= flight.report.delay_s <= max(alone) + 0.005
    assert not flight.report.delay.at_bound
    assert explained(flight, 0) > roll
    assert explained(flight, 1) > pitch
    assert flight.report.warnings == ()


@pytest.mark.parametrize("name", ["log119", "log149"])
def test_without_the_delay_it_explains_half(name):
    flight = imported(name)
    assert max(explained(flight, 0), explained(flight, 1)) < 0.6


@pytest.mark.parametrize("name", ["log119", "log149", "log45"])
def test_attitude_and_gyroscope_of_the_log_agree_about_the_motion(name):
    """The rates derived from the attitude alone are those of the gyroscope, so frames and signs are right."""
    flight = imported(name)
    derived = np.gradient(flight.attitude, flight.time, axis=0)
    for axis in (0, 1):
        assert np.corrcoef(derived[:, axis], flight.attitude_rate[:, axis])[0, 1] > 0.9
