"""Betaflight: PID of the rate in its own scales, angle mode, quadrotor mixer."""

from math import pi

from cpfls_cli.autopilots.law import AXES
from cpfls_cli.autopilots.motors import MixerRule
from cpfls_cli.autopilots.parameters import Autopilot, Firmware, Parameter

_DEGREES = 180 / pi
_FULL = 1000.0
"""Sum of P, I and D that is a full command."""
_P, _I, _D = (scale * _DEGREES / _FULL for scale in (0.032029, 0.244381, 0.000529))
"""Shares of a full command per rad/s, rad and rad/s^2 for a gain of 1."""


def _axis(axis: str, gains: tuple[float, ...]) -> list[Parameter]:
    p, i, d, most = gains
    return [
        Parameter(f"p_{axis}", f"{axis}.p", p, 0.0, 250.0, f"{axis} rate, proportional", scale=_P, step=1.0),
        Parameter(f"i_{axis}", f"{axis}.i", i, 0.0, 250.0, f"{axis} rate, integral", scale=_I, step=1.0),
        Parameter(
            f"d_{axis}", f"{axis}.d", d, 0.0, 250.0, f"{axis} rate, derivative of the gyroscope", scale=_D, step=1.0
        ),
        Parameter(
            f"d_max_{axis}",
            f"{axis}.d_raised",
            most,
            0.0,
            250.0,
            "the same in fast moves; the law here has the other",
            scale=_D,
            step=1.0,
        ),
    ]


def _notch(name: str, role: str, meaning: str) -> tuple[Parameter, Parameter]:
    return (
        Parameter(f"{name}_hz", role, 0.0, 0.0, 1000.0, meaning, "Hz", step=1.0),
        Parameter(f"{name}_cutoff", f"{role}_lower", 0.0, 0.0, 1000.0, "its lower end", "Hz", step=1.0),
    )


BETAFLIGHT = Autopilot(
    name="betaflight",
    title="Betaflight",
    firmware=Firmware(
        "Betaflight 2025.12",
        ("Betaflight",),
        oldest=(4, 3),
        older="Betaflight before 4.3 has other names of filters and another thrust_linear",
        # The scales of P, I and D and of their sum are the same since.
        oldest_gains=(3, 1),
        renamed=(
            # D of the PID is that of fast moves there.
            (
                (2025, 12),
                {f"{new}_{axis}": f"{old}_{axis}" for axis in AXES for new, old in (("d", "d_min"), ("d_max", "d"))},
            ),
            # D has one value, and no other in fast moves.
            ((4, 0), {f"d_{axis}": f"d_{axis}" for axis in AXES} | {f"d_max_{axis}": "" for axis in AXES}),
            ((4, 5), {"angle_p_gain": "angle_level_strength"}),
        ),
    ),
    rate_hz=4000.0,
    mixer=MixerRule("peak", 1.0, 1.0),
    parameters=(
        *_axis("roll", (45.0, 80.0, 30.0, 40.0)),
        *_axis("pitch", (47.0, 84.0, 34.0, 46.0)),
        *_axis("yaw", (45.0, 80.0, 0.0, 0.0)),
        Parameter("angle_p_gain", "tilt.angle", 50.0, 0.0, 200.0, "angle to rate in angle mode", "0.1/s", 0.1, 1.0),
        Parameter(
            "iterm_limit",
            "all.integral_limit",
            400.0,
            0.0,
            500.0,
            "most of the integral; since 2025.12 a share of the command's",
            scale=1 / _FULL,
            step=1.0,
        ),
        Parameter(
            "pidsum_limit",
            "tilt.limit",
            500.0,
            100.0,
            1000.0,
            "most of a roll or pitch command",
            scale=1 / _FULL,
            step=1.0,
        ),
        Parameter(
            "pidsum_limit_yaw", "yaw.limit", 400.0, 100.0, 1000.0, "most of a yaw command", scale=1 / _FULL, step=1.0
        ),
        Parameter(
            "gyro_lpf1_dyn_min_hz",
            "all.measured.first",
            250.0,
            0.0,
            1000.0,
            "low-pass of the gyroscope",
            "Hz",
            step=1.0,
            absent=0.0,
        ),
        Parameter(
            "gyro_lpf2_static_hz",
            "all.measured.first2",
            500.0,
            0.0,
            1000.0,
            "second low-pass of the gyroscope",
            "Hz",
            step=1.0,
            absent=0.0,
        ),
        *_notch("gyro_notch1", "all.measured.notch", "notch of the gyroscope"),
        *_notch("gyro_notch2", "all.measured.notch2", "second notch of the gyroscope"),
        Parameter(
            "dterm_lpf1_dyn_min_hz",
            "all.slope.first",
            75.0,
            0.0,
            1000.0,
            "low-pass of the derivative",
            "Hz",
            step=1.0,
            absent=0.0,
        ),
        Parameter(
            "dterm_lpf2_static_hz",
            "all.slope.first2",
            150.0,
            0.0,
            1000.0,
            "second low-pass of the derivative",
            "Hz",
            step=1.0,
            absent=0.0,
        ),
        *_notch("dterm_notch", "all.slope.notch", "notch of the derivative"),
        Parameter(
            "dterm_lpf1_type",
            "all.slope.first_kind",
            0.0,
            0.0,
            3.0,
            "of the low-pass of the derivative: one pole, two of Butterworth, two, three",
            step=1.0,
            absent=0.0,
        ),
        Parameter(
            "pid_process_denom",
            "loop.every",
            2.0,
            1.0,
            16.0,
            "samples of the gyroscope for a step of the law",
            step=1.0,
        ),
        Parameter(
            "looptime",
            "loop.period",
            125.0,
            31.0,
            1000.0,
            "from sample to sample of the gyroscope, as logs tell it",
            "us",
            1e-6,
            1.0,
        ),
        Parameter("thrust_linear", "motors.expo", 0.0, 0.0, 150.0, "thrust curve of the motors", "%", 0.01, 1.0),
    ),
    # A pilot holds the heading; here its error asks for a rate.
    fixed={"motors.low": 0.055, "yaw.angle": 1.0},
    logged_as={
        **{f"{axis}PID": (f"p_{axis}", f"i_{axis}", f"d_{axis} d_max_{axis}") for axis in AXES},
        # Until 4.5 the gains above are those of fast moves.
        "d_min": ("d_roll", "d_pitch", "d_yaw"),
        "d_max": ("d_max_roll", "d_max_pitch", "d_max_yaw"),
        "levelPID": ("angle_p_gain",),
        # A filter that does not rise with throttle stands at its other cut-off; 0 in both is no filter.
        "gyro_lpf1_static_hz": ("gyro_lpf1_dyn_min_hz",),
        "gyro_lpf1_dyn_hz": ("gyro_lpf1_dyn_min_hz",),
        "dterm_lpf1_static_hz": ("dterm_lpf1_dyn_min_hz",),
        "dterm_lpf1_dyn_hz": ("dterm_lpf1_dyn_min_hz",),
        # Until 4.2, and the first until 3.4.
        "dterm_lpf_hz": ("dterm_lpf1_dyn_min_hz",),
        "gyro_lowpass_hz": ("gyro_lpf1_dyn_min_hz",),
        "gyro_lowpass_dyn_hz": ("gyro_lpf1_dyn_min_hz",),
        "gyro_lowpass2_hz": ("gyro_lpf2_static_hz",),
        "dterm_lowpass_hz": ("dterm_lpf1_dyn_min_hz",),
        "dterm_lowpass_dyn_hz": ("dterm_lpf1_dyn_min_hz",),
        "dterm_lowpass2_hz": ("dterm_lpf2_static_hz",),
        "gyro_notch_hz": ("gyro_notch1_hz", "gyro_notch2_hz"),
        "gyro_notch_cutoff": ("gyro_notch1_cutoff", "gyro_notch2_cutoff"),
        "dterm_filter_type": ("dterm_lpf1_type",),
    },
    filtered=("gyroADC",),
    cross=((-1, -1, -1), (1, -1, 1), (-1, 1, 1), (1, 1, -1)),
    source=(
        "Betaflight, PID Tuning Guide, https://betaflight.com/docs/wiki/guides/current/PID-Tuning-Guide",
        "Betaflight, Command Line Interface, https://betaflight.com/docs/development/Cli (`get NAME` prints the range)",
    ),
    left_out=(
        "feedforward of the sticks",
        "D that grows in fast moves (d_max), filters that rise with throttle, TPA, anti-gravity",
        "smoothing of the angle at 50 Hz, the low-pass of yaw's P (yaw_lowpass_hz)",
        "the pilot, who holds the heading: here its error asks for a rate, 1 1/s",
    ),
    holds_integral=False,
    series=True,
)
