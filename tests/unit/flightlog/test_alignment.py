import numpy as np
import pytest

from cpfls_cli.flightlog.importing import apply_rotor_lag
from cpfls_cli.flightlog.results import ImportedFlight

TAU, PERIOD = 0.07, 0.004


@pytest.fixture
def stepped(make_signals):
    time = PERIOD * np.arange(200)
    return make_signals(time, np.where(time[:, None] < 0.2 - 1e-9, 0.5, 0.8) * np.ones(4))


@pytest.fixture
def make_signals():
    def call(time, command):
        empty = dict.fromkeys(ImportedFlight.__dataclass_fields__)
        return ImportedFlight(**{**empty, "time": time, "rotor_command": command})

    return call


def test_rotors_follow_a_step_as_an_exponential(stepped):
    speed = apply_rotor_lag(stepped, TAU).rotor_command[:, 2]
    after = stepped.time - 0.2
    expected = np.where(after < 0, 0.5, 0.8 - 0.3 * np.exp(-np.maximum(after, 0) / TAU))
    assert speed == pytest.approx(expected, abs=1e-12)


def test_without_lag_or_command_nothing_changes(stepped, make_signals):
    assert apply_rotor_lag(stepped, 0.0) is stepped
    without = make_signals(stepped.time, None)
    assert apply_rotor_lag(without, TAU) is without
