"""Notch filter of an autopilot between its command and the rotors."""

from cpfls_cli.effects.effect import Effect, Shape
from cpfls_cli.effects.hooks import Actuation, CommandFilter

_FILTER = CommandFilter("width", (1.0, 0.0, 1.0))
EFFECT = Effect(
    name="notch_filter",
    order=155,
    title="notch filter of the autopilot",
    kind="actuator",
    formula="w_i = (s^2 + W^2)/(s^2 + 2 b W s + W^2) w_i,commanded, W = 2 pi f;  M = M_rot(w) - M_rot(w_commanded)",
    sentence="The autopilot removes a band of frequencies from its commands before the rotors get them.",
    needs=frozenset({"body_rate", "command", "torque"}),
    excitation="roll and pitch torque sweeps through the frequency of the notch, from 0.5 to 6 Hz",
    rivals={
        "command_delay": "sweep the torque through the notch: there the motion stops following, a delay passes all",
        "motor_lag": "sweep the torque through the notch and beyond: beyond the notch the motion follows again",
    },
    source="second-order notch; ArduPilot NotchFilter.cpp, PX4 NotchFilter.hpp (bilinear transform, frequency kept)",
    shapes=(
        Shape("frequency_hz", "Hz", (2.0, 2.8, 4.0, 5.5, 8.0, 12.0), "middle of the band that is taken out"),
        Shape("width", "1", (0.2, 0.7, 1.5), "half of the band's width over its middle", first=0.7),
    ),
    apply=_FILTER.apply,
    actuation=Actuation(link=_FILTER.link),
)
