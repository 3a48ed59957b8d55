import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from cpfls_cli import rotations
from cpfls_cli.dynamics import newton_euler_torque
from cpfls_cli.trajectory.rotation import RotationLimits, full_rotation
from cpfls_cli.trajectory.settings import RotationSettings

INERTIA = (0.6, 0.7, 1.2, 0.02, -0.01, 0.03)
TORQUE = (5.0, 5.0, 3.0)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    rate=st.floats(2.0, 20.0),
    acceleration=st.floats(4.0, 100.0),
    frequency=st.floats(0.1, 1.0),
    duration=st.floats(15.0, 30.0),
    torque=st.booleans(),
)
def test_limits_hold_between_the_samples_that_were_looked_at(seed, rate, acceleration, frequency, duration, torque):
    chosen = RotationSettings(
        rate_max_rad_s=rate,
        acceleration_max_rad_s2=acceleration,
        frequency_max_hz=frequency,
        torque_max_n_m=TORQUE if torque else None,
    )
    path = full_rotation(chosen, duration, np.random.default_rng(seed), INERTIA)
    motion = path.sample(path.times(20_000))
    motions = motion.attitude, motion.attitude_rate, motion.attitude_acceleration
    assert np.abs(motion.attitude_rate).max() <= rate
    assert np.abs(rotations.body_rate(*motions[:2])).max() <= rate
    assert np.abs(motion.attitude_acceleration).max() <= acceleration
    assert np.abs(rotations.body_acceleration(*motions)).max() <= acceleration
    if torque:
        assert np.all(np.abs(RotationLimits(chosen, INERTIA).loads(motion)[:, 12:]) <= 1)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_torque_shares_are_those_of_newton_and_euler(seed):
    chosen = RotationSettings(torque_max_n_m=TORQUE)
    path = full_rotation(chosen, 10.0, np.random.default_rng(seed), INERTIA)
    motion = path.sample(path.times(50))
    motions = motion.attitude, motion.attitude_rate, motion.attitude_acceleration
    inertia = np.array([[0.6, 0.02, -0.01], [0.02, 0.7, 0.03], [-0.01, 0.03, 1.2]])
    expected = newton_euler_torque(*motions, inertia)
    shares = RotationLimits(chosen, INERTIA).loads(motion)[:, 12:]
    np.testing.assert_allclose(rotations.generalised_torque(motion.attitude, shares * TORQUE), expected, atol=1e-12)
