"""Held-out flights of another vehicle than the training flights: said to be, whatever no effect explains of both."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.gap import diagnose
from tests.builders.closed_loop_flights import flown, signals_of
from tests.builders.drawn_numbers import flight_of

LOADS = [f"thrust M{index}" for index in range(1, 5)]
GUSTS = [f"gusts {axis}" for axis in ("roll", "pitch", "yaw")]


@pytest.fixture
def result(monkeypatch):
    """Tell the loads of flights whose names say by how much M3 is asked for more, and the air is rougher."""
    rng = np.random.default_rng(1)
    signals = signals_of(flown())

    def numbers(recording):
        load, rough = map(float, recording.name.split())
        values = [*(0.01 * rng.normal(size=4) + [0, 0, load, 0]), *(0.1 * rng.normal(size=3) + rough)]
        names = [*LOADS, *GUSTS]
        return flight_of(recording.name, dict(zip(names, values, strict=True)))

    monkeypatch.setattr(diagnose, "flight_numbers", numbers)
    return lambda *names: diagnose._changed_between(
        [replace(signals, name=name) for name in names[:-1]], [replace(signals, name=names[-1])]
    )


def test_a_weak_rotor_in_the_held_out_flight(result):
    (sentence,) = result("0 0", "0 0", "0.5 0")
    assert "is not that of the training flights" in sentence
    assert "rotor M3, sure to" in sentence


def test_nothing_is_said_of_like_flights_or_of_one(result):
    assert result("0 0", "0 0", "0 0") == ()
    assert result("0 0", "0.5 0") == ()


def test_rougher_air_is_no_other_vehicle(result):
    calm = ["0 0"] * 5
    assert result(*calm, "0 2") == ()
    (sentence,) = result(*calm, "0.5 2")
    assert "rotor M3, sure to" in sentence


def test_nothing_is_said_without_rotors(monkeypatch):
    def refuse(_recording):
        raise InputError("has no rotor_speed")

    monkeypatch.setattr(diagnose, "flight_numbers", refuse)
    flight = replace(signals_of(flown()), name="flight.h5")
    assert diagnose._changed_between([flight, flight], [flight]) == ()
