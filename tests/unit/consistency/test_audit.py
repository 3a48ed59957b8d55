"""What the audit says where it cannot test, and what it says about the other channels."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cpfls_cli.consistency.audit import audit
from cpfls_cli.consistency.sensors import sensors_of
from cpfls_cli.effects.signals import stretch_of
from cpfls_cli.vehicle.rotors import body_wrench
from cpfls_cli.weak_form.windows import windows
from tests.builders.closed_loop_flights import COARSE, flown, signals_of
from tests.builders.faulty_gyroscopes import LEVELS, Faults, faulty_flight

WINDOWS = windows(0.01, 0.4, 0.5)
UP = np.array([0, 0, 9.81])
FAULTS = {"gyro_bias", "gyro_scale", "imu_misalignment", "channel_delay"}


@pytest.fixture(scope="module")
def turning():
    return faulty_flight(np.random.default_rng(0), Faults(), LEVELS["mid"], duration=40.0)


def moved(signals, amplitude=2.0):
    """Position, velocity and acceleration of one motion, by hand."""
    speed = 2 * np.pi * np.array([0.2, 0.27, 0.15])
    phase = speed * signals.time[:, None]
    return replace(
        signals,
        position=amplitude * np.sin(phase),
        velocity=amplitude * speed * np.cos(phase),
        acceleration=-amplitude * speed**2 * np.sin(phase),
    )


def test_without_attitude_nothing_is_tested(turning):
    found = audit([replace(turning, attitude=None)], WINDOWS)
    assert found.findings == ()
    assert set(found.untested) == FAULTS
    assert found.repaired(turning) is turning


def test_too_short_a_flight_is_not_tested():
    found = audit([faulty_flight(np.random.default_rng(0), Faults(), LEVELS["mid"], duration=5.0)], WINDOWS)
    assert found.findings == ()
    assert set(found.untested.values()) == {"the flights are too short"}


@pytest.mark.parametrize("seed", [3, 5, 6])
def test_a_flight_that_rests_for_most_of_its_time_is_told_to_hardly_turn(seed):
    """Without the few seconds in which it turns noise is all there is, which may tell of mirrored axes."""
    rng = np.random.default_rng(seed)
    flight = faulty_flight(rng, Faults(), LEVELS["high"], duration=12.0)
    count = 60 * len(flight)
    still = {name: 0.01 * rng.standard_normal((count, 3)) for name in ("attitude", "body_rate")}
    both = {name: np.concatenate([values, getattr(flight, name)]) for name, values in still.items()}
    time = flight.period * np.arange(count + len(flight))
    found = audit([replace(flight, time=time, **both)], WINDOWS)
    assert found.named == ()
    assert "the flights barely rotate, so it would not show" in found.untested.values()


def integrated(signals):
    steps = Rotation.from_rotvec(0.5 * (signals.body_rate[1:] + signals.body_rate[:-1]) * signals.period)
    turned = [Rotation.identity()]
    for step in steps:
        turned.append(turned[-1] * step)
    return replace(signals, attitude=np.unwrap(Rotation.concatenate(turned).as_euler("ZYX")[:, ::-1], axis=0))


def test_an_attitude_integrated_from_the_gyroscope_tells_no_scale(turning):
    found = audit([integrated(turning)], WINDOWS)
    assert {"gyro_scale", "imu_misalignment"} <= set(found.untested)
    assert found.named == ()


def test_an_attitude_integrated_from_the_corrected_gyroscope_still_tells_the_bias(turning):
    estimated = integrated(turning)
    found = audit([replace(estimated, body_rate=estimated.body_rate + np.array([0.02, 0, 0]))], WINDOWS)
    assert [finding.name for finding in found.named] == ["gyro_bias"]
    assert "+0.0200 rad/s about x" in found.named[0].sentence


def test_swapped_and_turned_axes_of_the_gyroscope_are_a_contradiction_not_a_fault(turning):
    swapped = audit([replace(turning, body_rate=turning.body_rate[:, [1, 0, 2]])], WINDOWS)
    turned = audit([replace(turning, body_rate=turning.body_rate * [1, -1, -1])], WINDOWS)
    assert swapped.findings == turned.findings == ()
    assert any("axes are swapped" in sentence for sentence in swapped.contradictions)
    assert [sentence.split(" the ")[0] for sentence in turned.contradictions] == [
        "about body y (pitch)",
        "about body z (yaw)",
    ]
    assert all("opposite signs" in sentence for sentence in turned.contradictions)
    assert set(turned.untested) == FAULTS


def test_channels_that_agree_are_not_warned_about(turning):
    found = audit([moved(turning)], WINDOWS)
    assert (found.warnings, found.contradictions) == ((), ())
    checks = sensors_of([moved(turning)], WINDOWS).motion.checks
    exact = [check for check in checks if check.pair.exact]
    assert {check.pair.words for check in exact} == {"position and velocity", "velocity and acceleration"}
    np.testing.assert_allclose([check.scale for check in exact], 1.0, atol=1e-3)
    np.testing.assert_allclose([check.delay.value for check in exact], 0.0, atol=1e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: replace(s, velocity=1.5 * s.velocity, acceleration=1.5 * s.acceleration), "factor of 1.50"),
        (lambda s: replace(s, velocity=s.velocity[:, [1, 0, 2]], acceleration=None), "axes are swapped"),
        (lambda s: replace(s, velocity=s.velocity * [1, -1, -1], acceleration=None), "opposite signs along y"),
        (lambda s: replace(s, position=None, acceleration=s.acceleration + 0.5 * UP), "gravity"),
        (lambda s: replace(s, velocity=np.roll(s.velocity, 6, axis=0), acceleration=None), "late by (59|60)\\."),
        (lambda s: replace(s, velocity=s.velocity[::-1] ** 2 - 2.0, acceleration=None), "do not match"),
    ],
)
def test_channels_that_disagree_are_warned_about(turning, change, words):
    found = audit([change(moved(turning))], WINDOWS)
    assert any(re.search(words, sentence) for sentence in (*found.warnings, *found.contradictions))


def test_noise_of_a_hover_is_not_taken_for_disagreement(turning):
    rng = np.random.default_rng(1)
    noisy = replace(
        turning,
        position=rng.normal(0, 0.05, turning.body_rate.shape),
        velocity=rng.normal(0, 0.15, turning.body_rate.shape),
        acceleration=rng.normal(0, 0.5, turning.body_rate.shape),
    )
    assert audit([noisy], WINDOWS).warnings == ()


def test_the_accelerometer_is_compared_with_the_velocity(turning):
    flying = moved(turning)
    felt = np.einsum("tji,tj->ti", flying.rotation, flying.acceleration + UP)
    good, bad = (audit([replace(flying, specific_force=sign * felt)], WINDOWS) for sign in (1, -1))
    assert (good.warnings, good.settled) == ((), ())
    assert any("accelerometer has its sign reversed" in sentence for sentence in bad.settled)


def test_constant_clipped_and_rounded_channels_are_named(turning):
    rate = turning.body_rate.copy()
    rate[:, 0] = np.clip(rate[:, 0], -1.0, 1.0)
    rate[:, 1] = np.round(rate[:, 1] / 0.05) * 0.05
    told = " ".join(audit([replace(turning, body_rate=rate, voltage=np.ones(len(turning)))], WINDOWS).warnings)
    assert "about x is clipped at 1 rad/s" in told
    assert "about y is rounded to steps of 0.05 rad/s" in told
    assert "The channel voltage never changes" in told


def test_a_slow_rounded_gyroscope_is_not_called_clipped():
    for seed in range(20):
        still = faulty_flight(
            np.random.default_rng(seed), Faults(), LEVELS["low"], coloured=True, amplitude=(0.004, 0.004, 0.004)
        )
        assert audit([still], WINDOWS).warnings == ()


@pytest.mark.parametrize(("commanded", "whom"), [(True, "commands"), (False, "logged torque")])
def test_the_motion_follows_the_torque(turning, commanded, whom):
    clean = faulty_flight(np.random.default_rng(3), Faults(), duration=20.0)
    inertia = np.diag(clean.vehicle.inertia_kg_m2)
    momentum = clean.body_rate @ inertia
    torque = np.gradient(momentum, clean.time, axis=0) + np.cross(clean.body_rate, momentum)
    early = np.roll(torque, -5, axis=0)
    found = audit([replace(clean, stated_torque=early, commanded=commanded)], WINDOWS)
    (note,) = found.notes
    # Of an interval that is narrower than a millisecond the digits are shown.
    says = re.fullmatch(rf"The motion follows the {whom} by (\d+\.\d+) ms \[(\d+\.\d+), (\d+\.\d+)\]\.", note)
    delay, low, high = map(float, says.groups())
    assert low < delay < high
    assert delay == pytest.approx(50.0, abs=0.1)
    assert not any("follows" in note for note in audit([turning], WINDOWS).notes)
    # Behind measured speeds it may be the autopilot that comes first.
    measured = replace(clean, stated_torque=early, rotor_speed=np.full((len(early), 4), 500.0))
    assert not any("follows" in note for note in audit([measured], WINDOWS).notes)


def test_a_torque_that_moves_nothing_tells_no_delay(turning):
    noise = np.random.default_rng(4).normal(size=turning.body_rate.shape)
    for torque in (noise, np.zeros_like(noise)):
        assert audit([replace(turning, stated_torque=torque)], WINDOWS).notes == ()


def test_rotors_that_hold_one_speed_are_named(turning):
    speed = np.full((len(turning), 4), 348.0)
    assert body_wrench(turning.vehicle, speed).thrust.std() == 0
    told = audit([replace(turning, rotor_speed=speed)], WINDOWS).warnings
    assert sum("rotor speed" in sentence for sentence in told) == 4


def test_of_a_part_of_a_flight_the_rotors_are_held_against_the_whole():
    """A third of a flight may leave open what all of it tells; `cpfls vehicle` looks at all of it."""
    signals = signals_of(flown(12.0, integration_rate_hz=COARSE))
    swapped = replace(signals, rotor_speed=signals.rotor_speed[:, [1, 0, 2, 3]])
    part = stretch_of(swapped, slice(0, 300))
    assert audit([part], WINDOWS).contradictions == ()
    (told,) = audit([part], WINDOWS, [swapped]).contradictions
    assert told.startswith("judged by the motion, the rotors are")


def test_a_delay_that_runs_away_is_no_repair():
    """Shifted beyond the flight a channel stands still, and the next delay had no bound: an array of exabytes."""
    noise = {"body_rate": 0.01, "attitude": 0.003, "velocity": 0.02, "position": 0.005, "acceleration": 0.1}
    flights = [
        signals_of(flown(20.0, seed=seed, noise=noise, also=0.05, integration_rate_hz=COARSE)) for seed in (3, 13)
    ]
    found = audit([replace(signals, position=1e3 * signals.position) for signals in flights], WINDOWS)
    assert any("is the position in mm" in sentence for sentence in found.contradictions)
