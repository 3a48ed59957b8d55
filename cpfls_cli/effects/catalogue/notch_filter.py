"""Notch filter of an autopilot between its command and the rotors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.actuation import SecondOrder, with_actuation, wrench_change
from cpfls_cli.effects.effect import Columns, Effect, Shape
from cpfls_cli.effects.hooks import Actuation, Link, RotorMotion
from cpfls_cli.effects.signals import Signals


def _filter(shape: Mapping[str, float], period: float) -> SecondOrder:
    return SecondOrder.of(shape["frequency_hz"], shape["width"], period, (1.0, 0.0, 1.0))


def _apply(signals: Signals, shape: Mapping[str, float]) -> Signals:
    return with_actuation(signals, _filter(shape, signals.period).along)


def _columns(signals: Signals, shape: Mapping[str, float]) -> Columns:
    return wrench_change(signals, _apply(signals, shape))


def _link(values: Mapping[str, float], step: float) -> Link:
    """Filter speeds and accelerations of the rotors, which were settled before the first step."""
    passing = _filter(values, step)
    state: list[Array] = []

    def link(rotors: RotorMotion) -> RotorMotion:
        now = np.concatenate([rotors.speed, rotors.acceleration])
        if not state:
            state.append(passing.settled(np.concatenate([rotors.speed, np.zeros_like(rotors.acceleration)])))
        passed, state[0] = passing.step(now, state[0])
        return RotorMotion(*np.split(passed, 2))

    return link


EFFECT = Effect(
    name="notch_filter",
    order=155,
    title="notch filter of the autopilot",
    kind="actuator",
    formula="w_i = (s^2 + W^2)/(s^2 + 2 b W s + W^2) w_i,commanded, W = 2 pi f;  M = M_rot(w) - M_rot(w_commanded)",
    sentence="The autopilot takes a band of frequencies out of its commands before the rotors get them.",
    coefficients=(),
    needs=frozenset({"body_rate", "command", "torque"}),
    excitation="roll and pitch torque sweeps through the frequency of the notch, from 0.5 to 6 Hz",
    rivals={
        "command_delay": "sweep the torque through the notch: there motion stops following, a delay lets all through",
        "motor_lag": "sweep the torque through the notch and beyond: behind the notch the motion follows again",
    },
    source="second-order notch; ArduPilot NotchFilter.cpp, PX4 NotchFilter.hpp (bilinear transform, frequency kept)",
    columns=_columns,
    shapes=(
        Shape("frequency_hz", "Hz", (2.0, 2.8, 4.0, 5.5, 8.0, 12.0), "middle of the band that is taken out"),
        Shape("width", "1", (0.2, 0.7, 1.5), "half of the band's width over its middle", first=0.7),
    ),
    unit_coefficient=True,
    apply=_apply,
    actuation=Actuation(link=_link),
)
