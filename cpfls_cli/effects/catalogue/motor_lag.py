"""Motor lag: rotors reach the commanded speed late."""

from cpfls_cli.effects.effect import Effect, Shape
from cpfls_cli.effects.hooks import Actuation, with_actuation
from cpfls_cli.lag import lagged

_TIMES = (0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.065, 0.08, 0.1, 0.125, 0.15)
EFFECT = Effect(
    name="motor_lag",
    order=150,
    title="motor lag",
    quantity="lag",
    kind="actuator",
    formula="tau w_i' + w_i = w_i,commanded;  M = M_rot(w) - M_rot(w_commanded)",
    sentence="The motors need time to reach the commanded speed.",
    needs=frozenset({"body_rate", "command", "torque"}),
    excitation="roll and pitch torque sweeps from 0.5 to 3 Hz",
    rivals={
        "command_delay": "sweep the torque up to 3 Hz and above: lag also weakens it, a delay does not",
        "linear_damping": "log measured rotor speeds; lag looks like negative damping",
        "parameter_error": "compare slow with fast torque: a wrong inertia acts in both",
    },
    source="RotorS and PX4 (first-order filter, 12.5 and 25 ms); RotorPy (tau_m)",
    shapes=(Shape("time_constant_s", "s", _TIMES, "time to reach 63 % of a step"),),
    apply=lambda signals, shape: with_actuation(
        signals, lambda values: lagged(values, shape["time_constant_s"] / signals.period).start
    ),
    actuation=Actuation(lag=lambda values: values["time_constant_s"]),
)
