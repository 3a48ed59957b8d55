"""Flights for playback keep what their stretches know."""

import gc
import pickle
from typing import Any
from weakref import ref

import numpy as np
import pytest

from cpfls_cli.effects.signals import Signals, stretch_of
from cpfls_cli.gap.residual.air import known_motion
from cpfls_cli.playback.flight import playback_flight
from cpfls_cli.vehicle.settings import VehicleSettings


def _part(first: int, count: int, **setpoints: Any) -> Signals:
    time = 0.01 * np.arange(first, first + count)
    vehicle = VehicleSettings()
    speed = np.full((count, len(vehicle.rotors)), 100.0)
    return Signals(time=time, body_rate=np.zeros((count, 3)), vehicle=vehicle, rotor_speed=speed, setpoints=setpoints)


def test_setpoints_are_joined_where_all_stretches_know_them() -> None:
    wished = np.arange(60.0).reshape(20, 3)
    parts = [_part(0, 12, attitude=wished[:12], thrust=np.ones((12, 1))), _part(30, 8, attitude=wished[12:])]
    flight = playback_flight(parts, "linear")
    assert list(flight.setpoints) == ["attitude"]
    assert flight.setpoints["attitude"] == pytest.approx(wished)


def test_a_part_of_a_flight_has_its_part_of_the_setpoints() -> None:
    wished = np.arange(36.0).reshape(12, 3)
    part = stretch_of(_part(0, 12, body_rate=wished), slice(3, 9))
    assert part.setpoints["body_rate"] == pytest.approx(wished[3:9])


def test_a_flight_without_setpoints_has_none() -> None:
    assert playback_flight([_part(0, 12)], "linear").setpoints == {}


def test_flights_are_freed_when_nobody_uses_them_any_more() -> None:
    logged = [_part(0, 200), _part(300, 200)]
    flight = playback_flight(logged[:1], "linear")
    assert flight.rotor_terms(0.0, 0.01, None) is flight.rotor_terms(0.0, 0.01, None)
    assert known_motion(logged) is known_motion(logged)
    freed = [ref(each) for each in (*logged, flight)]
    gc.disable()
    try:
        del logged, flight
        assert [each() for each in freed] == [None] * 3
    finally:
        gc.enable()


def test_a_copy_of_a_flight_has_nothing_that_was_made_of_it() -> None:
    logged = [_part(0, 200), _part(300, 200)]
    known_motion(logged)
    assert "made" not in vars(pickle.loads(pickle.dumps(logged[0])))
