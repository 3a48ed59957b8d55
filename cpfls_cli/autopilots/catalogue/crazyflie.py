"""Crazyflie: the PID controller of its firmware for attitude and rate, legacy power distribution."""

from math import inf, pi

from cpfls_cli.autopilots.motors import MixerRule
from cpfls_cli.autopilots.parameters import Autopilot, Firmware, Parameter

_DEGREES = 180 / pi
_FULL = 65535.0
_RATE = _DEGREES / _FULL
_DEGREE = pi / 180


def _axis(axis: str, rate: tuple[float, ...], angle: tuple[float, ...]) -> list[Parameter]:
    (p, i, d), (angle_p, angle_i, angle_d), loop = rate, angle, f"{axis} rate"
    return [
        Parameter(
            f"pid_attitude.{axis}_kp", f"{axis}.angle", angle_p, 0.0, inf, f"{axis} angle to rate", "1/s", step=0.01
        ),
        Parameter(
            f"pid_attitude.{axis}_ki", f"{axis}.angle_i", angle_i, 0.0, inf, "the same, integral", "1/s^2", step=0.01
        ),
        Parameter(f"pid_attitude.{axis}_kd", f"{axis}.angle_d", angle_d, 0.0, inf, "the same, derivative", step=0.01),
        Parameter(f"pid_rate.{axis}_kp", f"{axis}.p", p, 0.0, inf, f"{loop}, proportional", "s/deg", _RATE, 0.1),
        Parameter(f"pid_rate.{axis}_ki", f"{axis}.i", i, 0.0, inf, f"{loop}, integral", "1/deg", _RATE, 0.1),
        Parameter(
            f"pid_rate.{axis}_kd",
            f"{axis}.d",
            d,
            0.0,
            inf,
            f"{loop}, derivative of the gyroscope",
            "s^2/deg",
            _RATE,
            0.01,
        ),
        Parameter(f"pid_rate.{axis}_kff", f"{axis}.ff", 0.0, 0.0, inf, f"{loop}, feedforward", "s/deg", _RATE, 0.1),
    ]


CRAZYFLIE = Autopilot(
    name="crazyflie",
    title="Crazyflie",
    firmware=Firmware("crazyflie-firmware 2025.02", ("Crazyflie",)),
    rate_hz=500.0,
    # Roll and pitch are halved, yaw is not.
    mixer=MixerRule("peak", 0.5, 1.0),
    parameters=(
        *_axis("roll", (250.0, 500.0, 2.5), (6.0, 3.0, 0.0)),
        *_axis("pitch", (250.0, 500.0, 2.5), (6.0, 3.0, 0.0)),
        *_axis("yaw", (120.0, 16.7, 0.0), (6.0, 1.0, 0.35)),
        Parameter(
            "pid_rate.rateFiltEn", "all.slope.second_on", 0.0, 0.0, 1.0, "1 for a low-pass of the derivative", step=1.0
        ),
        Parameter("pid_rate.omxFiltCut", "roll.slope.second", 30.0, 0.0, inf, "its cut-off", "Hz", step=1.0),
        Parameter("pid_rate.omyFiltCut", "pitch.slope.second", 30.0, 0.0, inf, "its cut-off", "Hz", step=1.0),
        Parameter("pid_rate.omzFiltCut", "yaw.slope.second", 30.0, 0.0, inf, "its cut-off", "Hz", step=1.0),
    ),
    # The battery's voltage is made up for by a thrust curve of the motors, so that thrust follows the command.
    fixed={
        "motors.expo": 1.0,
        "all.measured.second": 80.0,
        "all.limit": 32767 / _FULL,
        "tilt.integral_range": 33.3 * _DEGREE,
        "yaw.integral_range": 166.7 * _DEGREE,
        "tilt.angle_integral_range": 20.0 * _DEGREE,
        "yaw.angle_integral_range": 360.0 * _DEGREE,
    },
    cross=((1, -1, 1), (-1, -1, -1), (-1, 1, 1), (1, 1, -1)),
    source=(
        "Crazyflie firmware, Controllers, https://www.bitcraze.io/documentation/repository/crazyflie-firmware/master/"
        "functional-areas/sensor-to-control/controllers/",
        "Crazyflie firmware, Parameters, https://www.bitcraze.io/documentation/repository/crazyflie-firmware/master/"
        "api/params/ (gives no ranges)",
    ),
    filtered=("gyro.", "stateEstimate", "stabilizer"),
    left_out=("angles of roll, pitch and yaw one by one, in place of a rotation",),
    holds_integral=False,
)
