"""An IMU that is turned against the body."""

import numpy as np

from cpfls_cli.arrays import Array
from cpfls_cli.effects.effect import Effect, of_axes
from cpfls_cli.effects.hooks import ReadingError, SensorTest, gyroscope_log


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
    sentence="The IMU is mounted askew, so rotation about one axis shows on another.",
    coefficients=of_axes("delta_{}", "rad", -0.35, 0.35, "turn of the IMU about {}"),
    needs=frozenset({"attitude"}),
    excitation="large turns about each axis; the attitude must not come from the gyro alone",
    rivals={
        "products_of_inertia": "compare roll on pitch with pitch on roll: products have one sign, misalignment has two",
        "gyro_bias": "roll, pitch and yaw the vehicle: a bias stays the same at every rate",
        "rotor_gyroscopic": "repeat the roll rates with the yaw effort reversed: misalignment stays",
    },
    source="definition; comparison of the gyro with the derivative of the attitude",
    log=gyroscope_log(lambda rate, turn: rate - np.cross(turn, rate)),
    test=SensorTest(
        estimate="misalignment",
        smallest=0.0025,
        number=lambda axis, value: f"{np.degrees(value):+.2f} deg about {axis}",
        found="The gyroscope is rotated relative to the attitude: {}.",
        nothing="The gyroscope is aligned with the attitude.",
        error=_turned,
        integrated=True,
    ),
)
