"""Held-out flights of another vehicle than the training flights: said to be, whatever no effect explains of both."""

import numpy as np
import pytest

from cpfls_cli.changes.numbers import FlightNumbers
from cpfls_cli.errors import InputError
from cpfls_cli.gap import diagnose
from cpfls_cli.weak_form.windows import Recording
from tests.builders.closed_loop_flights import flown, signals_of

NAMES = [f"load M{index}" for index in range(1, 5)]


@pytest.fixture
def told(monkeypatch):
    """Tell the loads of flights whose names say by how much M3 is asked for more."""
    rng = np.random.default_rng(1)

    def numbers(recording):
        loads = 0.01 * rng.normal(size=4) + [0, 0, float(recording.name), 0]
        return FlightNumbers(
            recording.name, dict(zip(NAMES, loads, strict=True)), dict.fromkeys(NAMES, 0.0), np.nan, 9.0, True
        )

    monkeypatch.setattr(diagnose, "flight_numbers", numbers)
    signals = signals_of(flown())
    return lambda *names: diagnose._changed_between(
        [Recording(name, signals) for name in names[:-1]], [Recording(names[-1], signals)]
    )


def test_a_weak_rotor_in_the_held_out_flight(told):
    (sentence,) = told("0", "0", "0.5")
    assert "is not that of the training flights" in sentence
    assert "rotor M3, sure to" in sentence


def test_nothing_is_said_of_like_flights_or_of_one(told):
    assert told("0", "0", "0") == ()
    assert told("0", "0.5") == ()


def test_nothing_is_said_without_rotors(monkeypatch):
    def refuse(_recording):
        raise InputError("has no rotor_speed")

    monkeypatch.setattr(diagnose, "flight_numbers", refuse)
    flight = Recording("flight.h5", signals_of(flown()))
    assert diagnose._changed_between([flight, flight], [flight]) == ()
