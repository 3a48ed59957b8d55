"""Delay between a command and the rotors."""

from __future__ import annotations

from cpfls_cli.effects.effect import Effect, Shape
from cpfls_cli.effects.hooks import Actuation, shifted

EFFECT = Effect(
    name="command_delay",
    order=160,
    title="delay of the command",
    kind="actuator",
    formula="w(t) = w_commanded(t - d);  M = M_rot(w) - M_rot(w_commanded)",
    sentence="The command takes time to reach the motors.",
    needs=frozenset({"body_rate", "command", "torque"}),
    excitation="roll and pitch torque sweeps from 0.5 to 3 Hz",
    rivals={
        "motor_lag": "sweep the torque up to 3 Hz and above: lag also weakens it, a delay does not",
        "linear_damping": "log measured rotor speeds; a delay looks like negative damping",
    },
    source="SkyFlow (command transport delay)",
    shapes=(Shape("delay_s", "s", (0.004, 0.008, 0.012, 0.02, 0.03, 0.04, 0.055, 0.07, 0.09, 0.12), "time of travel"),),
    apply=shifted,
    actuation=Actuation(
        link=lambda rotors, values, memory: memory.delayed(rotors, values["delay_s"] / memory.step),
        delay=lambda values: values["delay_s"],
    ),
)
