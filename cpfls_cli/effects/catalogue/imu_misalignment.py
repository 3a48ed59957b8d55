"""An IMU that is turned against the body."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Coefficient, Effect
from cpfls_cli.effects.hooks import ReadingError, SensorLog, SensorTest, TrueMotion


def _log(signals: Mapping[str, Array], _motion: TrueMotion, values: Mapping[str, float]) -> dict[str, Array]:
    rate = signals["body_rate"]
    return {"body_rate": np.asarray(rate - np.cross(np.array(list(values.values())), rate))}


def _turned(values: Array) -> ReadingError:
    # Loaded where it is needed: who reads a model waits for nothing of scipy.
    from scipy.spatial.transform import Rotation

    return ReadingError(matrix=Rotation.from_rotvec(-values).as_matrix())


EFFECT = Effect(
    name="imu_misalignment",
    order=260,
    title="misaligned IMU",
    kind="sensor",
    formula="gyro = omega - delta x omega",
    sentence="The IMU is mounted askew, so that turning about one axis shows on another.",
    coefficients=tuple(
        Coefficient(f"delta_{letter}", "rad", -0.35, 0.35, f"turn of the IMU about {letter}") for letter in "xyz"
    ),
    needs=frozenset({"attitude"}),
    excitation="large turns about each axis; the attitude must not come from the gyro alone",
    rivals={
        "products_of_inertia": "compare roll on pitch with pitch on roll: products have one sign, misalignment has two",
        "gyro_bias": "roll, pitch and yaw: a bias stays the same at every rate",
        "rotor_gyroscopic": "repeat the roll rates with the yaw effort reversed: misalignment stays",
    },
    source="definition; comparison of the gyro with the derivative of the attitude",
    columns=None,
    log=SensorLog(change=_log),
    test=SensorTest(
        estimate="misalignment",
        labels=("x", "y", "z"),
        smallest=0.0025,
        number=lambda axis, value: f"{np.degrees(value):+.2f} deg about {axis}",
        found="The gyroscope sits turned against the attitude: {}.",
        nothing="The gyroscope sits straight against the attitude.",
        error=_turned,
        integrated=True,
    ),
)
