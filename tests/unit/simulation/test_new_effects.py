"""An effect that the catalogue does not have is simulated, found and repaired by what its own description says."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from cpfls_cli.consistency import audit as audit_module
from cpfls_cli.effects.effect import Coefficient, Effect, Shape
from cpfls_cli.effects.hooks import Actuation, FaultFit, ReadingError, SensorLog, SensorTest
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.simulation import model
from cpfls_cli.vehicle.motion import Wrench
from cpfls_cli.weak_form.windows import windows
from tests.builders.closed_loop_flights import PERIOD, flown, signals_of


def new_effect(**fields):
    words = dict.fromkeys(("title", "formula", "sentence", "excitation", "source"), "made up")
    known = {"needs": frozenset(), "rivals": {}, "columns": None, "coefficients": (), **words}
    return Effect(**{**known, **fields})


def leaning_log(signals, _motion, values):
    return {"acceleration": signals["acceleration"] + np.array(list(values.values()))}


def leaning_fit(flights):
    """Mean acceleration of each tenth of a flight, less the change of the velocity over it."""
    [flight] = flights
    parts = [slice(first, first + 30) for first in range(0, len(flight) - 30, 30)]
    apart = [
        flight.acceleration[p].mean(axis=0)
        - (flight.velocity[p][-1] - flight.velocity[p][0]) / (PERIOD * (len(flight.time[p]) - 1))
        for p in parts
    ]
    error = np.std(apart, axis=0, ddof=1) / np.sqrt(len(apart))
    return FaultFit(np.mean(apart, axis=0), error, np.zeros(3), np.ones(3, dtype=bool), len(apart))


ACCELEROMETER = new_effect(
    name="accelerometer_offset",
    kind="sensor",
    coefficients=tuple(Coefficient(f"a_{axis}", "m/s^2", -2.0, 2.0, f"offset along {axis}") for axis in "xyz"),
    log=SensorLog(change=leaning_log),
    test=SensorTest(
        estimate=leaning_fit,
        labels=("x", "y", "z"),
        smallest=0.05,
        number=lambda axis, value: f"{value:+.2f} m/s^2 along {axis}",
        found="The accelerometer is off by {}.",
        nothing="The accelerometer is right.",
        error=lambda values: ReadingError(offset=values),
        signal="acceleration",
    ),
)


def slowest(rotors, values, memory):
    return rotors._replace(speed=memory.functions.smallest(rotors.speed, values["limit"]))


LIMITED = new_effect(
    name="limited_rotors",
    kind="actuator",
    shapes=(Shape("limit", "rad/s", (100.0, 900.0), "fastest that a rotor turns"),),
    actuation=Actuation(link=slowest),
)


PULLED_UP = new_effect(
    name="pulled_up",
    kind="wrench",
    coefficients=(Coefficient("f", "N", 0.0, 10.0, "force along body z, where the vehicle is above a metre"),),
    acts=lambda see, p: Wrench(force=(0, 0, see.functions.where(see.height > 1.0, p["f"], 0.0))),
)


def flown_with(monkeypatch, **effects):
    entries = {effect.name: effect for effect in (ACCELEROMETER, LIMITED, PULLED_UP)}
    monkeypatch.setattr(model, "find", entries.__getitem__)
    return flown(effects=effects)


def test_a_new_sensor_effect_is_flown_found_and_repaired(monkeypatch):
    flight = signals_of(flown_with(monkeypatch, accelerometer_offset=(0.5, 0.0, -0.3)))
    grown = MappingProxyType({**CATALOGUE, ACCELEROMETER.name: ACCELEROMETER})
    monkeypatch.setattr(audit_module, "CATALOGUE", grown)
    found = audit_module.audit([flight], windows(PERIOD, 0.4, 0.5))
    [finding] = [each for each in found.named if each.name == ACCELEROMETER.name]
    assert finding.sentence == "The accelerometer is off by +0.50 m/s^2 along x, -0.30 m/s^2 along z."
    np.testing.assert_allclose([number.value for number in finding.coefficients], [0.5, 0.0, -0.3], atol=0.01)
    repaired = replace(found, findings=(finding,)).repaired(flight)
    np.testing.assert_allclose(repaired.acceleration, flight.acceleration - [0.5, 0.0, -0.3], atol=0.01)
    np.testing.assert_array_equal(repaired.body_rate, flight.body_rate)


def test_a_new_actuator_effect_is_a_link_of_the_chain(monkeypatch):
    free = flown_with(monkeypatch)
    flight = flown_with(monkeypatch, limited_rotors=(500.0,))
    assert free.signals["rotor_speed"].min() < 345 < free.signals["rotor_speed"].max() < 500
    assert flight.effects.hides_rotor_speed
    np.testing.assert_array_equal(flight.signals["position"], free.signals["position"])
    slow = flown_with(monkeypatch, limited_rotors=(345.0,))
    assert slow.position_error[-1, 2] < free.position_error[-1, 2] - 0.01


def test_a_new_effect_on_the_vehicle_is_one_function(monkeypatch):
    free, pulled = flown_with(monkeypatch), flown_with(monkeypatch, pulled_up=(3.0,))
    thrust = [121.5e-6 * (each.signals["rotor_speed"][-1] ** 2).sum() for each in (free, pulled)]
    assert thrust[0] - thrust[1] == pytest.approx(3.0, rel=0.3)
    high = flown_with(monkeypatch, pulled_up=(0.0,))
    np.testing.assert_array_equal(high.signals["position"], free.signals["position"])
