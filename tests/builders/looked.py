"""What `look` takes and finds of a log, without a log: signals, and the plant of an axis."""

from types import SimpleNamespace

import numpy as np

from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.look.flight import LogFlight, Samples

SYSTEMS = {"px4": "PX4 1.15.0", "ardupilot": "ArduCopter 4.5", "betaflight": "Betaflight 4.5.1"}
PLANTS = {"px4": (130.0, 0.02, 0.03), "ardupilot": (150.0, 0.02, 0.03), "betaflight": (900.0, 0.008, 0.02)}
"""Effectiveness, delay, lag."""
NARROW = (0.03, 0.002, 0.1)


def looked_plant(gain, delay, lag, spread=NARROW, axis="roll", seed=1):
    """A plant as a log shows it, with draws of effectiveness, delay and lag."""
    own, scale, late, slow = np.random.default_rng(seed).standard_normal((3, 200)), *spread
    draws = np.stack(
        [
            gain * np.exp(scale * own[0]),
            delay * np.exp(late / delay * own[1]),
            lag * np.exp(slow * own[2]),
            np.ones(200),
            np.zeros(200),
        ],
        axis=1,
    )
    found = np.array([gain, delay, lag, 1.0, 0.0])
    band = np.array([0.5, 100.0])
    return SimpleNamespace(axis=axis, identified=True, reason="", parameters=found, draws=draws, band_hz=band)


def log_of_nothing(time, rate_hz, **given):
    """A flight of a log that holds nothing but its clock, and what is given."""
    three, one, every = np.full((len(time), 3), np.nan), np.full(len(time), np.nan), np.ones(len(time), dtype=bool)
    names = ("body_rate", "command", "rate_setpoint", "stick", "attitude_setpoint", "attitude", "specific_force")
    known = dict.fromkeys(names, three) | {"rotors": Samples(np.zeros(0), np.zeros((0, 4)))}
    known |= dict.fromkeys(("collective", "voltage", "current", "height", "climb_rate"), one)
    known |= {"flown": every, "usable": every, "gaps_s": np.zeros((0, 2))}
    return LogFlight(**known | {"time": time, "rate_hz": rate_hz} | given)


def looked_flight(autopilot, values=None, system=None, *, noise=0.02, attitude=False):
    """A log with the parameters of an autopilot, in which nothing but noise of the gyroscope is there."""
    time, random = np.arange(4000) / 500, np.random.default_rng(0)
    return log_of_nothing(
        time,
        500.0,
        name="log",
        autopilot=autopilot,
        system=SYSTEMS[autopilot] if system is None else system,
        parameters=AUTOPILOTS[autopilot].defaults() | (values or {}),
        gyroscope=Samples(time, noise * random.standard_normal((4000, 3))),
        **({"attitude_setpoint": np.zeros((4000, 3))} if attitude else {}),
    )
