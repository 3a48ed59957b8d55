"""Small flights as `look` takes them, with a known truth."""

from dataclasses import replace

import numpy as np

from cpfls_cli.filters import recursion
from cpfls_cli.look.flight import LogFlight, Samples
from cpfls_cli.units import STANDARD_GRAVITY as GRAVITY

CROSS = np.array([[1, 1], [-1, -1], [1, -1], [-1, 1]]) / np.sqrt(2)
SPINS = np.array([1.0, 1.0, -1.0, -1.0])


def still_flight(seconds=60.0, rate_hz=50.0, **given):
    """A quadrotor that hovers without a motion: signals that are given replace those."""
    time = np.arange(round(seconds * rate_hz)) / rate_hz
    three, one = np.zeros((len(time), 3)), np.zeros(len(time))
    unknown = np.full(len(time), np.nan)
    base = LogFlight(
        name="still",
        rate_hz=rate_hz,
        time=time,
        body_rate=three,
        command=three,
        rate_setpoint=three,
        stick=three,
        attitude_setpoint=three,
        attitude=three,
        collective=one + 0.4,
        voltage=unknown,
        current=unknown,
        height=one,
        climb_rate=one,
        specific_force=three - [0, 0, GRAVITY],
        flown=one == 0,
        usable=one == 0,
        rotors=Samples(time, np.full((len(time), 4), 0.4), "rotors"),
        rotors_source="logged",
        places=CROSS,
        spins=SPINS,
        gyroscope=Samples(time, three, "gyro"),
        gaps_s=np.empty((0, 2)),
    )
    return replace(base, **given)


def correlated(generator, samples, rate_hz, memory_s=1.0, columns=1):
    """Noise of unit variance that forgets with a time constant, shape (sample, column)."""
    kept = np.exp(-1 / (rate_hz * memory_s))
    noise = generator.normal(size=(samples, columns))
    noise[0] /= np.sqrt(1 - kept**2)
    return recursion([-kept], np.sqrt(1 - kept**2) * noise)


def hovering(needed, seed=0, seconds=60.0, rate_hz=20.0, gusts=0.02, weak=None, heading=None, wind=(0.0, 0.0), **given):
    """Commands of rotors that hover: thrusts that `needed` has, shape (rotor,), in gusts of torque.

    `weak` maps the index of a rotor to its thrust over that of the others at one command; `wind` pushes, forward and
    right in the world, as shares of the arm.
    """
    generator = np.random.default_rng(seed)
    samples = round(seconds * rate_hz)
    heading = np.zeros(samples) if heading is None else heading(np.arange(samples) / rate_hz)
    trims = gusts * correlated(generator, samples, rate_hz, columns=3)
    cosine, sine = np.cos(heading), np.sin(heading)
    lean = np.stack([cosine * wind[0] + sine * wind[1], -sine * wind[0] + cosine * wind[1]], axis=1)
    # A push by a share of the arm takes twice that, over the root of two, of each rotor's thrust.
    trims[:, :2] += lean * np.sqrt(2)
    thrust = 0.3 * (np.asarray(needed) + trims @ np.column_stack([CROSS * np.sqrt(2), SPINS]).T)
    for rotor, share in (weak or {}).items():
        thrust[:, rotor] /= share
    time = np.arange(samples) / rate_hz
    attitude = np.stack([0 * heading, 0 * heading, np.angle(np.exp(1j * heading))], axis=1)
    return still_flight(seconds, rate_hz, attitude=attitude, rotors=Samples(time, thrust, "rotors"), **given)
