"""PX4: multicopter attitude and rate control, control allocation of a quadrotor and others."""

from math import inf, pi

from cpfls_cli.autopilots.motors import MixerRule
from cpfls_cli.autopilots.parameters import Autopilot, Firmware, Parameter

_DEGREE = pi / 180


def _axis(axis: str, word: str, limit: str, most: tuple[float, float], gains: tuple[float, ...]) -> list[Parameter]:
    p, i, d, angle = gains
    name, rate, loop = f"MC_{word}", f"MC_{word}RATE", f"{axis} rate"
    return [
        Parameter(
            f"{name}_P",
            f"{axis}.angle",
            angle,
            0.0,
            5.0 if axis == "yaw" else 12.0,
            f"{axis} angle to rate",
            "1/s",
            step=0.01,
        ),
        Parameter(f"{rate}_K", f"{axis}.k", 1.0, 0.01, 5.0, f"{loop}, factor on P, I and D", absent=1.0),
        Parameter(f"{rate}_P", f"{axis}.p", p, 0.0 if axis == "yaw" else 0.01, most[0], f"{loop}, proportional", "s"),
        Parameter(f"{rate}_I", f"{axis}.i", i, 0.0, inf, f"{loop}, integral"),
        Parameter(f"{rate}_D", f"{axis}.d", d, 0.0, most[1], f"{loop}, derivative of the gyroscope", "s^2", step=1e-5),
        Parameter(f"{rate}_FF", f"{axis}.ff", 0.0, 0.0, inf, f"{loop}, feedforward", "s"),
        Parameter(limit, f"{axis}.integral_limit", 0.3, 0.0, inf, f"{loop}, most of the integral", step=0.01),
        Parameter(
            f"{rate}_MAX",
            f"{axis}.rate_limit",
            200.0 if axis == "yaw" else 220.0,
            0.0,
            1800.0,
            f"most {loop}",
            "deg/s",
            _DEGREE,
            1.0,
        ),
    ]


PX4 = Autopilot(
    name="px4",
    title="PX4",
    firmware=Firmware("PX4 1.16", ("PX4",)),
    rate_hz=400.0,
    mixer=MixerRule("power", 1.0, 1.0),
    parameters=(
        *_axis("roll", "ROLL", "MC_RR_INT_LIM", (0.5, 0.01), (0.15, 0.2, 0.003, 6.5)),
        *_axis("pitch", "PITCH", "MC_PR_INT_LIM", (0.6, inf), (0.15, 0.2, 0.003, 6.5)),
        *_axis("yaw", "YAW", "MC_YR_INT_LIM", (0.6, inf), (0.2, 0.1, 0.0, 2.8)),
        Parameter(
            "MC_YAW_TQ_CUTOFF",
            "yaw.output.first",
            2.0,
            0.0,
            10.0,
            "low-pass of the yaw command",
            "Hz",
            step=0.01,
            absent=0.0,
        ),
        Parameter(
            "IMU_GYRO_CUTOFF", "all.measured.second", 40.0, 0.0, 1000.0, "low-pass of the gyroscope", "Hz", step=1.0
        ),
        Parameter(
            "IMU_DGYRO_CUTOFF", "all.slope.second", 30.0, 0.0, 1000.0, "low-pass of the derivative", "Hz", step=1.0
        ),
        Parameter("IMU_GYRO_NF0_FRQ", "all.measured.notch", 0.0, 0.0, 1000.0, "notch of the gyroscope", "Hz", step=1.0),
        Parameter("IMU_GYRO_NF0_BW", "all.measured.notch_width", 20.0, 0.0, 100.0, "its width", "Hz", step=1.0),
        Parameter(
            "IMU_GYRO_NF1_FRQ", "all.measured.notch2", 0.0, 0.0, 1000.0, "second notch of the gyroscope", "Hz", step=1.0
        ),
        Parameter("IMU_GYRO_NF1_BW", "all.measured.notch2_width", 20.0, 0.0, 100.0, "its width", "Hz", step=1.0),
        Parameter(
            "IMU_GYRO_RATEMAX",
            "loop.rate",
            400.0,
            100.0,
            2000.0,
            "steps of the rate control in a second",
            "Hz",
            step=1.0,
        ),
        Parameter("THR_MDL_FAC", "motors.expo", 0.0, 0.0, 1.0, "thrust curve of the motors", step=0.01),
        Parameter("MPC_THR_HOVER", "motors.hover", 0.5, 0.1, 0.8, "thrust that hovers", step=0.01),
    ),
    cross=((1, -1, 1), (-1, 1, 1), (1, 1, -1), (-1, -1, -1)),
    source=(
        "PX4 Guide, Controller Diagrams, https://docs.px4.io/main/en/flight_stack/controller_diagrams.html",
        "PX4 Guide, Parameter Reference, https://docs.px4.io/main/en/advanced_config/parameter_reference.html",
    ),
    left_out=(
        "less weight of yaw at large errors (MC_YAW_WEIGHT)",
        "the integral's weakening at errors above 100 deg/s",
    ),
    logged_as={
        # Names of 1.9 to 1.12.
        "MC_DTERM_CUTOFF": ("IMU_DGYRO_CUTOFF",),
        "IMU_GYRO_NF_FREQ": ("IMU_GYRO_NF0_FRQ",),
        "IMU_GYRO_NF_BW": ("IMU_GYRO_NF0_BW",),
    },
    filtered=("vehicle_angular_velocity", "vehicle_rates", "vehicle_attitude."),
    integrates_first=False,
)
