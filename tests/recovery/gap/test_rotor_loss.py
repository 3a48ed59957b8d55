"""A rotor that loses thrust in mid-flight: which, by how much, from when on; and nothing that only looks like it."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import fit
from cpfls_cli.gap.balance.weak_flight import weak_flight
from cpfls_cli.gap.diagnose import diagnose
from cpfls_cli.gap.naming.ranking import best_floor
from cpfls_cli.gap.naming.results import GapVerdict
from cpfls_cli.gap.residual.rotor_loss import rotor_losses
from cpfls_cli.gap.settings import GapSettings
from cpfls_cli.weak_form.windows import common_windows
from tests.builders.gusty_flights import CALM, GUSTS, SMALL, Flight, gusty_flights, logged

TRUE = SMALL._replace(drag=0.0, damping=0.0)
FEW = GapSettings(shifts=39)
WHEN_S = 12.0


@pytest.fixture(scope="module")
def flown():
    """Three flights of three paths in each air."""
    airs = {"calm": CALM, "gusts": GUSTS}
    asked = [Flight(TRUE, gusts, path, path, reach=3.0) for gusts in airs.values() for path in range(3)]
    flights = [(each.name, logged(each, TRUE.vehicle).parts[0]) for each in gusty_flights(asked, 30.0)]
    return {"calm": flights[:3], "gusts": flights[3:]}


def logged_faster(signals, loss):
    """Speeds as they are logged where rotors pull less than by their speed, by shares of shape (time, rotor)."""
    return replace(signals, rotor_speed=signals.rotor_speed / np.sqrt(1 - loss))


def recorded(flights, loss):
    """Recordings in which rotors lose thrust, by what gives shares of the flight's number and its times."""
    return [
        replace(logged_faster(signals, loss(at, signals.time)), name=name) for at, (name, signals) in enumerate(flights)
    ]


def one_rotor(share, flight, rotor):
    return lambda at, time: share * (at == flight) * (time > WHEN_S)[:, None] * (np.arange(4) == rotor)


@pytest.mark.parametrize(("air", "share", "flight"), [("calm", 0.04, 0), ("calm", 0.04, 2), ("gusts", 0.3, 0)], ids=str)
def test_a_propeller_that_loses_a_piece_is_found(flown, air, share, flight):
    recordings = recorded(flown[air], one_rotor(share, flight, 0))
    found = diagnose(recordings[:2], recordings[2:], FEW, np.random.default_rng(1)).diagnosis
    assert found.verdict is GapVerdict.FLIGHTS_DIFFER
    assert not found.effects
    (loss,) = found.rotor_losses
    assert (loss.flight, loss.rotor) == (recordings[flight].name, 1)
    assert loss.time_s == pytest.approx(WHEN_S, abs=1.0)
    assert loss.loss.low < share < loss.loss.high
    assert found.differences == (loss.sentence,)


@pytest.mark.parametrize("air", ["calm", "gusts"])
@pytest.mark.parametrize(
    "loss",
    [
        lambda _at, _time: np.zeros(4),
        # An emptier battery: all rotors, more and more.
        lambda _at, time: 0.003 * time[:, None] * np.ones(4),
        # A load that shifts: what one side loses the other gains.
        lambda _at, time: 0.04 * (time > WHEN_S)[:, None] * np.array([1, -1, 1, -1]),
        # As wrong all the time.
        lambda _at, _time: 0.1 * (np.arange(4) == 1),
    ],
)
def test_what_no_single_rotor_does_at_once_is_none(flown, air, loss):
    recordings = recorded(flown[air], loss)
    windows = common_windows(recordings, FEW)
    every = system([weak_flight(each, windows, None, force=True) for each in recordings])
    floor = best_floor(every)
    assert list(rotor_losses(every, fit(every, floor), floor, FEW, np.random.default_rng(1))) == []


@pytest.mark.parametrize("stopped", [lambda time: time > 24.0, lambda time: time >= 0.0], ids=["lands", "never turns"])
@pytest.mark.parametrize("rotors", [slice(None), slice(1, 2)], ids=["all", "one"])
def test_rotors_that_stand_still_identify_nothing(flown, stopped, rotors):
    recordings = recorded(flown["calm"], one_rotor(0.04, 0, 0))
    still = []
    for each in recordings:
        speed = each.rotor_speed.copy()
        speed[stopped(each.time), rotors] = 0.0
        still.append(replace(each, rotor_speed=speed))
    windows = common_windows(still, FEW)
    every = system([weak_flight(each, windows, None, force=True) for each in still])
    floor = best_floor(every)
    rng = np.random.default_rng(1)
    found = list(rotor_losses(every, fit(every, floor), floor, FEW, rng))
    assert np.isfinite([(each.loss.value, each.loss.low, each.loss.high) for each in found]).all()
