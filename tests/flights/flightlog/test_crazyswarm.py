"""Flights of a real Crazyflie whose Lee controller commanded the logged torques (crazyswarm2-tools, MIT)."""

from functools import partial

import numpy as np
import pytest

from cpfls_cli.consistency.check import check
from cpfls_cli.effects.signals import Signals
from cpfls_cli.flightlog.importing import import_log
from cpfls_cli.flightlog.settings import ImportSettings, SignalMap
from cpfls_cli.flightlog.smoothing import derivative
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders.recorded_flights import columns_of_log

columns_of = partial(columns_of_log, "real/crazyswarm2_lee")


def imported(name, **changes):
    return taken(columns_of(name), **changes)


def taken(columns, lowpass_hz=8.0, **changes):
    units = {"attitude": ("rpy", "rad"), "body_rate": ("omega", "rad/s"), "body_torque": ("torque", "N m")}
    signals = {
        signal: SignalMap(columns=tuple(f"ctrlLee_{column}{axis}" for axis in "xyz"), unit=unit)
        for signal, (column, unit) in units.items()
    }
    return import_log(columns, ImportSettings(signals=signals, lowpass_hz=lowpass_hz, **changes))


def wrong_with(flight):
    """What the check finds between gyroscope and attitude, in sentences."""
    names = ("time", "body_rate", "attitude")
    signals = Signals(vehicle=VehicleSettings(), **{name: getattr(flight, name) for name in names})
    return [finding.sentence for finding in check([signals], GapSettings())]


def explained(flight, axis):
    """R2 of a rigid body turning about one axis: angular acceleration, gyroscopic product, constant."""
    rate, torque = flight.body_rate, flight.body_torque[:, axis]
    product = rate[:, (axis + 1) % 3] * rate[:, (axis + 2) % 3]
    acceleration = derivative(flight.time, rate[:, axis])
    regressor = np.column_stack([acceleration, product, np.ones(len(torque))])
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


@pytest.mark.parametrize("name", ["log119", "log149", "log45"])
@pytest.mark.parametrize("lowpass_hz", [None, 3.0, 8.0, 30.0])
def test_gyroscope_and_attitude_of_a_real_flight_are_not_warned_of(name, lowpass_hz):
    flight = imported(name, lowpass_hz=lowpass_hz)
    assert flight.report.warnings == ()
    assert wrong_with(flight) == []
    # One pause of the logger in each flight, 24 to 68 ms long.
    assert flight.report.gaps == 1
    assert 0.02 < flight.report.longest_gap_s < 0.07


@pytest.mark.parametrize("name", ["log119", "log149", "log45"])
@pytest.mark.parametrize("signal", ["omega", "rpy"])
def test_swapped_columns_of_a_real_flight_are_warned_of(name, signal):
    columns = columns_of(name)
    x, y = f"ctrlLee_{signal}x", f"ctrlLee_{signal}y"
    columns[x], columns[y] = columns[y], columns[x]
    assert "import.signals.body_rate" in " ".join(wrong_with(taken(columns)))


@pytest.mark.parametrize(("axis", "word"), [("x", "roll"), ("y", "pitch")])
def test_a_wrong_sign_in_a_real_flight_is_warned_of_by_axis(axis, word):
    columns = columns_of("log119")
    columns[f"ctrlLee_omega{axis}"] *= -1
    (warning,) = wrong_with(taken(columns))
    assert f"about body {axis} ({word})" in warning
    assert float(warning.split("correlation ")[1].split(",")[0]) < -0.95


@pytest.mark.parametrize("row", [0, 1, 700, 1437, 1438])
def test_a_spike_in_the_gyroscope_of_a_real_flight_is_counted_and_can_be_repaired(row):
    columns, clean = columns_of("log119"), imported("log119")
    columns["ctrlLee_omegax"][row] += 50
    seen = taken(columns).report
    assert (seen.suspected_spikes, seen.spikes) == ({"ctrlLee_omegax": 1}, {})
    assert any("1 suspected spike in column ctrlLee_omegax" in text for text in seen.warnings)
    repaired = taken(columns, spike_deviations=10.0)
    # Nothing is there to interpolate from beyond an end, so the row goes.
    at_end = row in (0, 1438)
    assert (repaired.report.spikes, repaired.report.dropped.get("incomplete_ends", 0)) == (
        ({}, 1) if at_end else ({"ctrlLee_omegax": 1}, 0)
    )
    assert (repaired.report.suspected_spikes, repaired.report.warnings) == ({}, ())
    at = clean.report.span_s[0] + clean.time
    rate = np.interp(at, repaired.report.span_s[0] + repaired.time, repaired.body_rate[:, 0])
    assert np.abs(rate - clean.body_rate[:, 0])[20:-20].max() < 0.05


def test_rows_lost_from_a_real_flight_are_counted_as_a_gap():
    columns = {name: np.delete(values, slice(400, 412)) for name, values in columns_of("log119").items()}
    assert taken(columns).report.gaps == imported("log119").report.gaps + 1
