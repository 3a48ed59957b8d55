"""Flights of one axis under an autopilot's rate control in gusts, as `look` reads them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cpfls_cli.autopilots.law import Controller
from cpfls_cli.autopilots.registry import AUTOPILOTS
from cpfls_cli.look.flight import LogFlight, Samples
from tests.builders.looked import log_of_nothing

RATE_HZ = 500.0


@dataclass(frozen=True)
class AxisTruth:
    """What turns an axis: rad/s^2 per full command, s, s, 1/s."""

    gain: float = 200.0
    delay: float = 0.01
    lag: float = 0.03
    damping: float = 1.0


TRUTH = AxisTruth()
PARAMETERS = {"pid_rate.roll_kp": 40.0, "pid_rate.roll_ki": 100.0, "pid_rate.roll_kd": 0.5}


def flown(rng, *, seconds=40.0, gusts=4.0, angle=0.0, sticks=3.0, truth=TRUTH) -> LogFlight:
    """Fly a Crazyflie's law about roll; with an angle gain, 1/s, the stick asks for the angle instead of the rate."""
    steps, period = round(seconds * RATE_HZ), 1 / RATE_HZ
    hand = np.repeat(rng.standard_normal(int(seconds / 0.4) + 1), round(0.4 * RATE_HZ))[:steps]
    kernel = np.hanning(round(0.12 * RATE_HZ))
    stick = np.clip(sticks / 3 * 0.4 * np.convolve(hand, kernel / kernel.sum(), "same"), -1, 1)
    controller = Controller(AUTOPILOTS["crazyflie"].law(PARAMETERS))
    sent, lagged, rate, turned = np.zeros(round(truth.delay / period) + 1), 0.0, 0.0, 0.0
    decay = np.exp(-period / 0.1)
    shocks = gusts * np.sqrt(1 - decay**2) * rng.standard_normal(steps)
    noise = 0.02 * rng.standard_normal(steps)
    gust, kept = 0.0, np.zeros((steps, 4))
    zero = np.zeros(3)
    for step in range(steps):
        wanted = angle * (0.5 * stick[step] - turned) if angle else 3.0 * stick[step]
        zero[0] = wanted
        gyroscope = rate + noise[step]
        command = float(controller.command(zero, np.array([gyroscope, 0.0, 0.0]))[0])
        sent = np.concatenate([[command], sent[:-1]])
        lagged += (sent[-1] - lagged) * (1 - np.exp(-period / truth.lag))
        gust = decay * gust + shocks[step]
        kept[step] = gyroscope, command, wanted, turned
        rate += period * (truth.gain * lagged + gust - truth.damping * rate)
        turned += period * rate
    for each in controller_filters():
        kept[:, 0] = each.section(period).along(kept[:, 0])
    return logged(kept, stick)


def controller_filters():
    """List the filters that a gyroscope passes before it is logged."""
    return AUTOPILOTS["crazyflie"].law(PARAMETERS).axes[0].measured


def logged(kept, stick) -> LogFlight:
    """Lay columns of rate, command, setpoint and angle about roll into a flight whose other axes are silent."""
    time, one = np.arange(len(kept)) / RATE_HZ, np.full(len(kept), np.nan)

    def roll(values):
        return np.stack([values, one, one], axis=1)

    names = ("body_rate", "command", "rate_setpoint", "attitude")
    signals = {name: roll(column) for name, column in zip(names, kept.T, strict=True)} | {"stick": roll(stick)}
    origin = {"name": "flown", "autopilot": "crazyflie", "parameters": dict(PARAMETERS)}
    return log_of_nothing(time, RATE_HZ, **origin, **signals, gyroscope=Samples(time, roll(kept[:, 0])))


def without_sticks(flight: LogFlight) -> LogFlight:
    """Let the sticks rest, as in a mission."""
    return replace(flight, stick=np.where(np.isnan(flight.stick), np.nan, 0.0))
