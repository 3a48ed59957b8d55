"""ArduPilot: Copter's angle and rate control, motors with their thrust curve."""

from math import pi

from cpfls_cli.autopilots.motors import MixerRule
from cpfls_cli.autopilots.parameters import Autopilot, Firmware, Parameter

_DEGREE = pi / 180


def _axis(axis: str, letters: str, limit: str, gains: tuple[float, ...], filters: tuple[float, ...]) -> list[Parameter]:
    (p, i, d), (target, error, slope) = gains, filters
    yaw, rate, loop = axis == "yaw", f"ATC_RAT_{letters}", f"{axis} rate"
    return [
        Parameter(f"ATC_ANG_{letters}_P", f"{axis}.angle", 4.5, 3.0, 12.0, f"{axis} angle to rate", "1/s", step=0.01),
        Parameter(f"{rate}_P", f"{axis}.p", p, 0.1 if yaw else 0.01, 2.5 if yaw else 0.5, f"{loop}, proportional", "s"),
        Parameter(f"{rate}_I", f"{axis}.i", i, 0.01, 1.0 if yaw else 2.0, f"{loop}, integral"),
        Parameter(
            f"{rate}_D",
            f"{axis}.d",
            d,
            0.0,
            0.02 if yaw else 0.05,
            f"{loop}, derivative of the error",
            "s^2",
            step=1e-5,
        ),
        Parameter(f"{rate}_FF", f"{axis}.ff", 0.0, 0.0, 0.5, f"{loop}, feedforward", "s"),
        Parameter(f"{rate}_IMAX", f"{axis}.integral_limit", 0.5, 0.0, 1.0, f"{loop}, most of the integral", step=0.01),
        *(
            # Until 3.6 logs have one of them only.
            Parameter(
                f"{rate}_{name}",
                f"{axis}.{role}.first",
                own,
                *ends,
                f"{loop}, low-pass of the {what}",
                "Hz",
                step=0.1,
                absent=0.0,
            )
            for name, role, own, ends, what in (
                ("FLTT", "target", target, (1.0, 50.0) if yaw else (5.0, 100.0), "target"),
                ("FLTE", "error", error, (0.0, 20.0 if yaw else 100.0), "error"),
                ("FLTD", "slope", slope, (5.0, 50.0 if yaw else 100.0), "derivative"),
            )
        ),
        Parameter(
            limit,
            f"{axis}.rate_limit",
            0.0,
            0.0,
            360.0 if yaw else 1080.0,
            f"most {loop}, 0 for no limit",
            "deg/s",
            _DEGREE,
            1.0,
        ),
    ]


ARDUPILOT = Autopilot(
    name="ardupilot",
    title="ArduPilot Copter",
    firmware=Firmware(
        "ArduPilot Copter 4.6",
        ("ArduCopter",),
        oldest=(3, 4),
        older="gains of Copter before 3.4 have other names and scales (RATE_RLL_P, STB_RLL_P)",
    ),
    rate_hz=400.0,
    mixer=MixerRule("peak", 0.5, 0.5),
    parameters=(
        *_axis("roll", "RLL", "ATC_RATE_R_MAX", (0.135, 0.135, 0.0036), (20.0, 0.0, 20.0)),
        *_axis("pitch", "PIT", "ATC_RATE_P_MAX", (0.135, 0.135, 0.0036), (20.0, 0.0, 20.0)),
        *_axis("yaw", "YAW", "ATC_RATE_Y_MAX", (0.18, 0.018, 0.0), (20.0, 2.5, 20.0)),
        Parameter(
            "INS_GYRO_FILTER", "all.measured.second", 20.0, 0.0, 256.0, "low-pass of the gyroscope", "Hz", step=1.0
        ),
        Parameter(
            "INS_HNTCH_ENABLE", "all.measured.notch_on", 0.0, 0.0, 1.0, "1 for a notch of the gyroscope", step=1.0
        ),
        Parameter("INS_HNTCH_FREQ", "all.measured.notch", 80.0, 10.0, 495.0, "its centre", "Hz", step=1.0),
        Parameter("INS_HNTCH_BW", "all.measured.notch_width", 40.0, 5.0, 250.0, "its width", "Hz", step=1.0),
        Parameter(
            "INS_HNTCH_HMNCS",
            "all.measured.notch_harmonics",
            3.0,
            0.0,
            65535.0,
            "1 for a notch at its centre alone",
            step=1.0,
        ),
        Parameter("INS_HNTCH_MODE", "all.measured.notch_mode", 1.0, 0.0, 5.0, "0 for a notch that stays", step=1.0),
        Parameter("INS_HNTCH_REF", "all.measured.notch_follows", 0.0, 0.0, 1.0, "0 for a notch that stays", step=0.01),
        Parameter(
            "SCHED_LOOP_RATE", "loop.rate", 400.0, 50.0, 400.0, "steps of the rate control in a second", "Hz", step=1.0
        ),
        Parameter("MOT_THST_EXPO", "motors.expo", 0.65, -1.0, 1.0, "thrust curve of the motors", step=0.01),
        Parameter("MOT_SPIN_MIN", "motors.low", 0.15, 0.0, 0.3, "signal at which thrust begins", step=0.01),
        Parameter("MOT_SPIN_MAX", "motors.high", 0.95, 0.9, 1.0, "signal of full thrust", step=0.01),
        Parameter("MOT_THST_HOVER", "motors.hover", 0.35, 0.2, 0.8, "thrust that hovers", step=0.01),
    ),
    cross=((1, -1, 1), (-1, 1, 1), (1, 1, -1), (-1, -1, -1)),
    source=(
        "ArduPilot Dev, Copter Attitude Control, https://ardupilot.org/dev/docs/apmcopter-programming-attitude-control-2.html",
        "ArduPilot Copter, Complete Parameter List, https://ardupilot.org/copter/docs/parameters.html",
    ),
    left_out=(
        "shaping of the asked attitude (ATC_INPUT_TC, ATC_ACCEL_*) with its feedforward",
        "the limit on slew (SMAX)",
        "scaling by battery voltage and air density",
    ),
    # Until 3.6 one low-pass, of the error.
    logged_as={f"ATC_RAT_{axis}_FILT": (f"ATC_RAT_{axis}_FLTE",) for axis in ("RLL", "PIT", "YAW")},
    filtered=("IMU.Gyr", "IMU[", "RATE.", "ATT."),
    slope_of_error=True,
)
