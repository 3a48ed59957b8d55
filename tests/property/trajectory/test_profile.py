from dataclasses import astuple

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

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
