"""Battery sag: a motor turns slower than commanded on an empty battery."""

from collections.abc import Mapping

from cpfls_cli.effects.effect import Effect, Shape, a_few_percent
from cpfls_cli.effects.hooks import Actuation
from cpfls_cli.effects.signals import Signals


# Thrust and drag torque go with the square of the speed.
def _apply(signals: Signals, shape: Mapping[str, float]) -> Signals:
    assert signals.voltage is not None, "declared among the needs"
    return signals.with_rotor_speed(signals.speed * signals.voltage[:, None] ** (shape["exponent"] / 2))


EFFECT = Effect(
    name="battery_sag",
    order=170,
    title="battery sag",
    kind="actuator",
    formula="T_i = k w_i,commanded^2 (V/V_0)^n, drag torque alike;  M = M_rot(T) - M_rot(commanded)",
    sentence="As the battery empties, the same command gives less thrust.",
    needs=frozenset({"body_rate", "rotor_speed", "voltage"}),
    excitation="a flight from a full to an empty battery",
    rivals={
        "parameter_error": "compare the start with the end of a flight: a wrong parameter stays",
        "motor_lag": "compare slow with fast torque: sag acts in both",
        "vertical_descent": "repeat the descent with a full and with an empty battery",
    },
    source="SkyFlow (motor.py, motor_electrical.py); SkyDreamer (thrust over a discharge)",
    shapes=(Shape("exponent", "1", (0.2, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0), "power of the voltage"),),
    apply=_apply,
    actuation=Actuation(supply=lambda values, voltage: voltage ** (values["exponent"] / 2)),
    accounts=a_few_percent,
)
