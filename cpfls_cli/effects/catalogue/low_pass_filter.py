"""Second-order low-pass between the autopilot's command and the rotors: a filter, or a drive that swings."""

from cpfls_cli.effects.effect import Effect, Shape
from cpfls_cli.effects.hooks import Actuation, CommandFilter

_FILTER = CommandFilter("damping", (0.0, 0.0, 1.0))
EFFECT = Effect(
    name="low_pass_filter",
    order=156,
    title="second-order low-pass before the rotors",
    kind="actuator",
    formula="w_i = W^2/(s^2 + 2 b W s + W^2) w_i,commanded, W = 2 pi f;  M = M_rot(w) - M_rot(w_commanded)",
    sentence="A filter in the autopilot, or a drive with speed control, passes slow commands and loses fast ones.",
    needs=frozenset({"body_rate", "command", "torque"}),
    excitation="roll and pitch torque sweeps to beyond the cut-off, or steps of the command",
    rivals={
        "motor_lag": "log the speeds of the rotors at steps of the command: a lag sets off at once, a low-pass slowly",
        "command_delay": "sweep the torque to higher frequencies: a delay passes all, a low-pass less and less",
        "notch_filter": "sweep the torque through the notch and beyond: beyond a notch the motion follows again",
    },
    source="second-order low-pass; ArduPilot LowPassFilter2p.cpp, PX4 LowPassFilter2p.hpp (bilinear transform)",
    shapes=(
        Shape("frequency_hz", "Hz", (1.5, 2.2, 3.2, 4.7, 7.0, 11.0), "natural frequency"),
        Shape("damping", "1", (0.4, 0.7, 1.5), "damping ratio b; 0.71 for a Butterworth filter", first=0.7),
    ),
    apply=_FILTER.apply,
    actuation=Actuation(link=_FILTER.link),
)
