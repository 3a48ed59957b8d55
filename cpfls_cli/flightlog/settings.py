"""Settings of the section `import`: how the columns of a log become the signals of a flight."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le
from typing_extensions import Doc

from cpfls_cli.errors import SettingError
from cpfls_cli.flightlog.signal_map import SignalMap, SignalName, check_signal
from cpfls_cli.settings import Settings


@dataclass(frozen=True, kw_only=True)
class ImportSettings(Settings):
    """Settings of the import of a flight log."""

    time_column: Annotated[str, Doc("name of the column of time stamps")] = "t"
    time_unit: Annotated[Literal["s", "ms", "us", "ns"], Doc("unit of the time stamps")] = "s"
    signals: Annotated[
        Mapping[SignalName, SignalMap], Doc("for each signal of the log: its columns and their unit")
    ] = field(default_factory=dict)
    quaternion_order: Annotated[Literal["wxyz", "xyzw"], Doc("order of the quaternion's columns")] = "wxyz"
    body_frame: Annotated[Literal["FLU", "FRD"], Doc("body axes of the log; converted to FLU")] = "FLU"
    world_frame: Annotated[Literal["ENU", "NED"], Doc("world axes of the log; converted to ENU")] = "ENU"
    acceleration_frame: Annotated[
        Literal["world", "body-specific-force"],
        Doc("acceleration in the world, or what an accelerometer senses; the latter is kept as specific_force too"),
    ] = "world"
    rotor_command_is: Annotated[
        Literal["speed", "thrust"],
        Doc("what a rotor_command of unit 1 is a share of; of thrust, its root is kept, which is the share of speed"),
    ] = "speed"
    rotor_command_lag_s: Annotated[
        float, Ge(0), Doc("known time constant, s, with which the rotors follow rotor_command; what follows is kept")
    ] = 0.0
    torque_source: Annotated[
        Literal["column", "rotor-speed", "rotor-command"] | None,
        Doc(
            "column: torque or body_torque of the log; rotor-speed, rotor-command: of the vehicle's rotors, commands in"
            " 0..1 times vehicle.rotor_speed_max_rad_s, speeds as they are; null: no torque"
        ),
    ] = "column"
    crop_s: Annotated[tuple[float, float] | None, Doc("begin and end that are kept, s from the first stamp")] = None
    rate_hz: Annotated[
        Annotated[float, Gt(0)] | None, Doc("sampling rate of the flight, Hz; null: the log's median rate")
    ] = None
    lowpass_hz: Annotated[
        Annotated[float, Gt(0)] | None,
        Doc("cut-off (-6 dB) of the zero-phase low-pass filter of all signals, Hz; null: none"),
    ] = None
    lowpass_order: Annotated[int, Ge(1), Le(12), Doc("order of the Butterworth filter, run in both directions")] = 4
    gap_s: Annotated[float, Gt(0), Doc("longest gap that is interpolated, s")] = 0.1
    gap_rule: Annotated[
        Literal["stop", "longest-part"], Doc("at a longer gap: stop with a message, or keep the longest part")
    ] = "stop"
    spike_deviations: Annotated[
        Annotated[float, Gt(0)] | None,
        Doc(
            "departure from the running median, in robust standard deviations, from which a value is a spike and is"
            " interpolated; null: spikes beyond 10 are counted and warned of, and nothing is changed"
        ),
    ] = None
    spike_window_samples: Annotated[int, Ge(3), Le(101), Doc("window of the running median of the spike test")] = 7
    saturation_samples: Annotated[int, Ge(2), Doc("equal extreme values in a row that count as saturated")] = 20
    delay_s: Annotated[
        Annotated[float, Ge(0)] | Literal["estimate"], Doc("time from command to motion, s, or estimate")
    ] = 0.0
    delay_max_s: Annotated[float, Gt(0), Doc("longest delay that the estimate tries, s")] = 0.2

    def __post_init__(self) -> None:
        """Check the rules between keys."""
        if self.crop_s is not None and not 0 <= self.crop_s[0] < self.crop_s[1]:
            raise SettingError("crop_s", "needs 0 <= begin < end")
        for name, signal in self.signals.items():
            check_signal(name, signal)
        if self.signals:
            _check_attitude(self)
            _check_torque(self)
            _check_command(self)


def _check_attitude(settings: ImportSettings) -> None:
    names = settings.signals.keys()
    if {"attitude", "quaternion"} <= names:
        raise SettingError("signals", "attitude and quaternion are both given; keep one")
    if {"body_rate", "attitude_rate"} <= names:
        raise SettingError("signals", "body_rate and attitude_rate are both given; keep one")
    needing = [name for name in ("attitude_rate", "torque") if name in names]
    if needing and not {"attitude", "quaternion"} & names:
        raise SettingError("signals", f"{', '.join(needing)} needs attitude or quaternion to be converted")


def _check_torque(settings: ImportSettings) -> None:
    names = settings.signals.keys()
    needed: dict[str | None, set[SignalName]] = {
        "column": {"torque", "body_torque"},
        "rotor-speed": {"rotor_speed"},
        "rotor-command": {"rotor_command"},
    }
    wanted = needed.get(settings.torque_source)
    if wanted is not None and not wanted & names:
        missing = " or ".join(sorted(wanted))
        raise SettingError("torque_source", f"{settings.torque_source!r} needs the signal {missing}")
    if {"torque", "body_torque"} <= names:
        raise SettingError("signals", "torque and body_torque are both given; keep one")


def _check_command(settings: ImportSettings) -> None:
    command = settings.signals.get("rotor_command")
    if settings.rotor_command_is == "thrust" and (command is None or command.unit != "1"):
        raise SettingError("rotor_command_is", "'thrust' needs the signal rotor_command in unit 1")
