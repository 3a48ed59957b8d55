"""Allocation of many samples, against the same written out motor by motor."""

import numpy as np
import pytest

from cpfls_cli.autopilots.motors import Allocation, Limits, ThrustCurve, factor_mix, mixing, px4_mix
from cpfls_cli.autopilots.registry import AUTOPILOTS
from tests.builders.autopilots import CROSS
from tests.builders.thinned_logs import CA, FRD, mixed_by_ardupilot, mixed_by_px4

HEXA = np.array([(np.cos(angle), np.sin(angle)) for angle in np.radians([90, -90, -30, 150, 30, -150])])
SPINS = np.array([-1.0, 1.0, -1.0, 1.0, 1.0, -1.0])
RNG = np.random.default_rng(5)
THRUST, TURNING = RNG.uniform(-0.1, 1.1, 400), RNG.normal(0, 0.5, (400, 3))


@pytest.mark.parametrize(
    ("limits", "mixed", "more"),
    [
        *((Limits(by="px4", airmode=airmode), mixed_by_px4, {"airmode": airmode}) for airmode in (0, 1, 2)),
        (
            Limits(by="ardupilot", yaw_headroom=0.3, throttle_mean=0.2),
            mixed_by_ardupilot,
            {"headroom": 0.3, "mean": 0.2},
        ),
    ],
)
@pytest.mark.parametrize("rotors", [4, 6])
def test_what_does_not_fit_gives_way_as_in_each_autopilot(limits, mixed, more, rotors):
    rule, inverse = AUTOPILOTS[limits.by].mixer, limits.by == "px4"
    mix = mixing(rule, CROSS) * [1.0, *FRD] if rotors == 4 else factor_mix(rule, HEXA, SPINS, inverse=inverse)
    allocation = Allocation(mix=mix, limits=limits)
    expected = [mixed(mix, thrust, turning, **more) for thrust, turning in zip(THRUST, TURNING, strict=True)]
    np.testing.assert_allclose(allocation.thrusts(THRUST, TURNING), expected, atol=1e-12)
    wanted = np.column_stack([THRUST, TURNING]) @ mix.T
    assert 0.5 < ((wanted < 0) | (wanted > 1)).any(axis=1).mean() < 1.0


def test_the_parameters_of_px4_make_the_mixer_of_the_vehicle():
    rule = AUTOPILOTS["px4"].mixer
    expected = mixing(rule, CROSS) * [1.0, *FRD]
    np.testing.assert_allclose(px4_mix(rule, CA, [0, 1, 2, 3]), expected, atol=1e-9)
    # A motor that is weaker and as dear in torque is asked for more of everything, so that all turn and lift alike.
    weak = px4_mix(rule, CA | {"CA_ROTOR0_CT": 5.0}, [0, 1, 2, 3])
    effect = np.array([5.0, 6.5, 6.5, 6.5])[:, None] * weak
    places = np.array([rotor.position_m[:2] for rotor in CROSS.rotors])
    spins = np.array([rotor.spin for rotor in CROSS.rotors])
    torques = np.column_stack([np.ones(4), places[:, 1], places[:, 0], 0.05 * spins])
    made = torques.T @ effect
    np.testing.assert_allclose(made - np.diag(np.diag(made)), 0.0, atol=1e-2 * np.abs(made).max())


def test_a_battery_that_empties_is_made_good():
    curve = ThrustCurve(0.65, 0.15, 0.95)
    signals = np.linspace(0, 1, 50)
    lift = 0.65 * 0.9**2 + 0.35 * 0.9
    # What is asked for is raised by the same, so that thrust stays and the signal rises as voltage falls.
    raised = curve.signal(0.5 * signals[:, None] / lift, np.full((50, 1), 0.9))
    full = curve.signal(0.5 * signals[:, None])
    np.testing.assert_allclose(raised - 0.15, (full - 0.15) / 0.9, atol=1e-12)
