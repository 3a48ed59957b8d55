from dataclasses import astuple

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from cpfls_cli.trajectory.profile import BaseProfile, Holds

hold = st.one_of(st.just(0.0), st.floats(0.01, 3.0))
profiles = st.builds(
    BaseProfile,
    amplitude=st.floats(0.1, 20.0),
    period=st.floats(0.2, 3.0),
    holds=st.builds(Holds, snap=hold, jerk=hold, acceleration=hold, velocity=hold),
)


def pulse_sequence(profile):
    """Build the signs and lengths by nesting: every ramp up, its hold, its ramp down."""
    sequence = [(1, profile.period)]
    for length in (profile.holds.snap, profile.holds.jerk, profile.holds.acceleration, profile.holds.velocity):
        sequence = [*sequence, (0, length), *[(-sign, duration) for sign, duration in sequence]]
    return [(sign, length) for sign, length in sequence if length > 0]


def integrate(profile):
    """Integrate the pop six times numerically; returns the times and states at the ends of all intervals."""
    start, state = 0.0, np.zeros(6)
    times, states = [], []
    for sign, length in pulse_sequence(profile):
        frequency = 2 * np.pi / profile.period

        def slope(t, x, gain=sign * profile.amplitude * frequency, frequency=frequency, start=start):
            return np.append(x[1:], gain * np.sin(frequency * (t - start)))

        inside = start + 0.37 * length
        solution = solve_ivp(
            slope, (start, start + length), state, "DOP853", [inside, start + length], rtol=1e-11, atol=1e-12
        )
        times += [inside, start + length]
        states += list(solution.y.T)
        start, state = start + length, solution.y[:, -1]
    return np.array(times), np.array(states)


@settings(max_examples=15, deadline=None)
@given(profiles)
def test_closed_form_is_the_integral_of_the_pop(profile):
    times, states = integrate(profile)
    assert abs(times[-1] - profile.duration) < 1e-9 * profile.duration
    scale = np.array(astuple(profile.peaks))[:6]
    np.testing.assert_allclose(profile.sample(times)[:, :6] / scale, states / scale, atol=1e-8)


@settings(max_examples=50, deadline=None)
@given(profiles)
def test_peaks_bound_the_samples_and_are_reached(profile):
    lengths = [length for _, length in pulse_sequence(profile)]
    ends = np.cumsum(lengths)
    quarters = np.concatenate([ends - fraction * np.array(lengths) for fraction in (0.0, 0.25, 0.5, 0.75)])
    reached = np.abs(profile.sample(quarters)).max(axis=0)
    np.testing.assert_allclose(reached, astuple(profile.peaks), rtol=1e-9)
    everywhere = np.abs(profile.sample(np.linspace(0, profile.duration, 2000))).max(axis=0)
    assert (everywhere <= np.array(astuple(profile.peaks)) * (1 + 1e-9)).all()


@settings(max_examples=50, deadline=None)
@given(profiles, st.floats(0.0, 1.0))
def test_a_move_is_its_own_mirror_image(profile, fraction):
    time = fraction * profile.duration
    there, back = profile.sample(np.array([time, profile.duration - time]))
    parity = np.array([-1, 1, -1, 1, -1, 1, -1])
    scale = np.array(astuple(profile.peaks))
    mirrored = parity * back
    mirrored[0] += profile.peaks.displacement
    np.testing.assert_allclose(there / scale, mirrored / scale, atol=1e-9)
