"""Rotor speeds that are logged on another clock than the gyro."""

from collections.abc import Mapping

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Effect, Shape
from cpfls_cli.effects.hooks import ReadingError, SensorLog, SensorTest, TrueMotion, shifted
from cpfls_cli.lag import delayed


def _log(signals: Mapping[str, Array], motion: TrueMotion, values: Mapping[str, float]) -> dict[str, Array]:
    return {"rotor_speed": delayed(signals["rotor_speed"], -values["delay_s"] / motion.period)}


EFFECT = Effect(
    name="channel_delay",
    order=270,
    title="time shift between rotor and gyro channels",
    kind="actuator",
    formula="w(t) = w_logged(t - d);  M = M_rot(w) - M_rot(w_logged)",
    sentence="Rotor speeds and rates are logged at different times, so cause and effect do not line up.",
    needs=frozenset({"measured_rotor_speed"}),
    excitation="roll and pitch torque sweeps from 0.5 to 3 Hz",
    rivals={
        "linear_damping": "correlate gyro and attitude first; a shift acts on all axes alike",
        "rotor_acceleration": "compare yaw with roll and pitch: a shift acts on all axes alike",
    },
    source="alignment of clocks; SkyDreamer (11 ms)",
    shapes=(
        Shape(
            "delay_s",
            "s",
            (-0.05, -0.035, -0.02, -0.012, -0.006, 0.006, 0.012, 0.02, 0.03, 0.045, 0.06),
            "the rotors act this much later than logged",
        ),
    ),
    apply=shifted,
    log=SensorLog(change=_log, does="shifts measured rotor speeds"),
    test=SensorTest(
        estimate="delay",
        labels=("delay",),
        smallest=0.002,
        smallest_samples=0.2,
        number=lambda _, value: f"{1000 * abs(value):.3g} ms {'behind' if value > 0 else 'ahead of'}",
        found="The gyroscope runs {} the attitude.",
        nothing="Gyroscope and attitude are on the same clock.",
        error=lambda values: ReadingError(delay=float(values[0])),
    ),
)
