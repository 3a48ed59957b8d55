"""The artifact of gains for an autopilot: what is proposed, what it gives with the vehicle, and what today's give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.spec import Format, Record, columns_of, dataset, group, record, rows_of
from cpfls_cli.artifacts.twin import CurveGroup

if TYPE_CHECKING:
    from cpfls_cli.autopilots.parameters import Autopilot
    from cpfls_cli.tuning.gains import AskedMargins, Proposal
    from cpfls_cli.tuning.margins import Evaluation, Margins
    from cpfls_cli.tuning.noise import Line, Noise
    from cpfls_cli.tuning.plant import HoverPlant

PROPOSED, TODAY, DEFAULT = "proposed", "today", "default"
AXES = ("roll", "pitch", "yaw")
_SHOWN = 300
"""Samples of a step that are kept."""
_NEAR_DEG = 0.5
"""Margins are met within this: gains are written with few digits."""


class ParameterRow(NamedTuple):
    """A parameter that is proposed; today's is NaN where no log tells it."""

    name: str
    meaning: str
    unit: str
    today: float
    default: float
    proposed: float
    wanted: float
    low: float
    high: float
    clipped: bool


@record
class ParametersGroup:
    """Parameters that are proposed, in the autopilot's own names and units."""

    name: tuple[str, ...] = dataset("as the autopilot writes it", "parameter")
    meaning: tuple[str, ...] = dataset("what it is", "parameter")
    unit: tuple[str, ...] = dataset("empty for a ratio", "parameter")
    today: Array = dataset("in the log; not finite where none tells it", "parameter", gaps=True)
    default: Array = dataset("of the autopilot", "parameter")
    proposed: Array = dataset("inside the documented range", "parameter")
    wanted: Array = dataset("by the margins, before it is brought inside that range", "parameter")
    low: Array = dataset("lower end of the documented range", "parameter")
    high: Array = dataset("upper end; not finite where none is documented", "parameter", gaps=True)
    clipped: BoolArray = dataset("1 where the documented range holds it back", "parameter")


@record
class MarginsGroup:
    """Margins of a loop, by set of parameters and axis; not finite where the loop is unstable."""

    gain: Array = dataset("change of gain that it bears", "set", "axis", units="dB", gaps=True)
    phase: Array = dataset("change of phase that it bears", "set", "axis", units="deg", gaps=True)
    disk: Array = dataset("phase that the disk of gain and phase together holds", "set", "axis", units="deg")
    crossover: Array = dataset("where the gain of the loop is 1", "set", "axis", units="Hz", gaps=True)

    @classmethod
    def of(cls, found: Sequence[Sequence[Margins]]) -> Self:
        """Arrange margins, by set and axis."""

        def column(name: str) -> Array:
            return np.array([[getattr(each, name) for each in own] for own in found], dtype=float)

        # What nothing makes unstable is told as a large number.
        gain, phase = np.minimum(column("gain_db"), 99.0), np.minimum(column("phase_deg"), 180.0)
        return cls(gain=gain, phase=phase, disk=column("disk_deg"), crossover=column("crossover_hz"))


@record
class NoiseGroup:
    """Noise of the gyroscope in the logs."""

    frequency: Array = dataset("as far as the logs show", "noise frequency", units="Hz")
    density: Array = dataset("of body rates, single-sided", "noise frequency", "axis", units="rad^2/s^2/Hz")
    line: Array = dataset("lines that stand out by 10 dB and more", "line", units="Hz")
    width: Array = dataset("their widths", "line", units="Hz")
    command: Array = dataset("what it makes the commands jitter, root mean square, shares of full ones", "set", "axis")

    @classmethod
    def of(cls, noise: Noise, lines: Sequence[Line], command: Array) -> Self:
        """Arrange noise."""
        hz, width = (np.array([getattr(each, name) for each in lines], dtype=float) for name in ("hz", "width_hz"))
        return cls(frequency=noise.frequency, density=noise.density, line=hz, width=width, command=command)


@record
class GainsRecord(Record):
    """The artifact `cpfls/gains`."""

    FORMAT: ClassVar = Format(
        "cpfls/gains", "gains for an autopilot, with their margins with the vehicle", "tune", ("model", "flight")
    )

    autopilot: str = dataset("px4, ardupilot, betaflight, crazyflie")
    title: str = dataset("what it is called")
    vehicle_name: str = dataset("file of the vehicle")
    source: tuple[str, ...] = dataset("documentation of the law, then of the ranges", "source")
    left_out: tuple[str, ...] = dataset("parts of its law that are not here", "part")
    asked_gain: float = dataset("asked gain margin", units="dB")
    asked_phase: float = dataset("asked phase margin", units="deg")
    asked_disk: float = dataset("phase that the asked disk margin holds", units="deg")
    required: float = dataset("phase that the disk holds that holds all three", units="deg")
    hover: float = dataset("share of the full thrust that hovers, in the units of the law")
    signal: float = dataset("of the motors in hover, from 0 to 1")
    axis: tuple[str, ...] = dataset("roll, pitch, yaw", "axis")
    set_of: tuple[str, ...] = dataset("proposed, today (of the log) or default", "set", path="set")
    plants: int = dataset("plants about roll, that of the best guess and the corners of the intervals")
    axis_plants: IntArray | None = dataset("the same about each axis", "axis", default=None)
    rate: float | None = dataset("steps of the law in a second", units="Hz", default=None)
    firmware: str | None = dataset(
        "version that the parameters are for: that of the log, or the one whose names and ranges are known",
        default=None,
    )
    command: MarginsGroup = group()
    command_worst: MarginsGroup = group()
    angle: MarginsGroup = group()
    angle_worst: MarginsGroup = group()
    bandwidth: Array = dataset("where the angle follows at half power", "set", "axis", units="Hz", gaps=True)
    overshoot: Array = dataset("of a step of the asked angle, share of it", "set", "axis")
    overshoot_most: Array = dataset("the largest with any of three plants", "set", "axis")
    rise: Array = dataset("of it, from a tenth to nine tenths", "set", "axis", units="s", gaps=True)
    frequency: Array = dataset("of the curves", "frequency", units="Hz")
    loop: CurveGroup = group()
    loop_worst: CurveGroup = group()
    angle_closed: CurveGroup = group()
    time: Array = dataset("since the step", "time", units="s")
    step: Array = dataset("angle after a step of the asked one, share of it", "set and axis", "time")
    step_low: Array = dataset("the smallest with any of three plants", "set and axis", "time")
    step_high: Array = dataset("the largest", "set and axis", "time")
    parameter: ParametersGroup = group()
    noise: NoiseGroup | None = group(default=None)
    warning: tuple[str, ...] = dataset("what to know about these gains", "warning")

    @classmethod
    def of(
        cls,
        autopilot: Autopilot,
        vehicle: str,
        asked: AskedMargins,
        hover: HoverPlant,
        sets: dict[str, Evaluation],
        proposals: Sequence[Proposal],
        today: dict[str, float],
        noise: NoiseGroup | None,
        warnings: Sequence[str],
        system: str = "",
    ) -> Self:
        """Arrange gains with what they give, the proposed set first; `system` is what wrote the log of today's."""
        found = list(sets.values())
        worst = [
            min(own, key=lambda each: float(np.abs(1 + each.command).min())).command
            for each in found
            for own in each.corners
        ]
        steps = [each.steps for each in found]
        times = steps[0][0].time
        kept = np.unique(np.linspace(0, len(times) - 1, _SHOWN).astype(int))
        # By set, plant and axis.
        angles = np.array([[each.angle.T for each in own] for own in steps])[..., kept]
        flat = (len(found) * len(AXES), len(kept))
        passed = np.array([[each.overshoot for each in own] for own in steps])
        return cls(
            autopilot=autopilot.name,
            title=autopilot.title,
            vehicle_name=vehicle,
            source=autopilot.source,
            left_out=autopilot.left_out,
            asked_gain=asked.gain_db,
            asked_phase=asked.phase_deg,
            asked_disk=asked.disk_deg,
            required=float(np.degrees(2 * np.arctan(asked.disk / 2))),
            hover=hover.share,
            signal=hover.signal,
            axis=AXES,
            set_of=tuple(sets),
            plants=len(hover.corners(0)),
            axis_plants=np.array([len(hover.corners(axis)) for axis in range(len(AXES))]),
            rate=found[0].rate_hz,
            firmware=autopilot.firmware.of(system),
            command=MarginsGroup.of([each.command for each in found]),
            command_worst=MarginsGroup.of([each.command_worst for each in found]),
            angle=MarginsGroup.of([each.angle for each in found]),
            angle_worst=MarginsGroup.of([each.angle_worst for each in found]),
            bandwidth=np.array([each.bandwidth_hz for each in found]),
            overshoot=passed[:, 0],
            overshoot_most=passed.max(axis=1),
            rise=np.array([own[0].rise_s for own in steps]),
            frequency=found[0].loops[0].frequency,
            loop=CurveGroup.of(np.array([own.command for each in found for own in each.loops])),
            loop_worst=CurveGroup.of(np.array(worst)),
            angle_closed=CurveGroup.of(np.array([own.angle_closed for each in found for own in each.loops])),
            time=times[kept],
            step=angles[:, 0].reshape(flat),
            step_low=angles.min(axis=1).reshape(flat),
            step_high=angles.max(axis=1).reshape(flat),
            parameter=_parameters(proposals, today, autopilot.firmware.names(system)),
            noise=noise,
            warning=tuple(warnings),
        )

    @property
    def rows(self) -> list[ParameterRow]:
        """The parameters one by one."""
        return [ParameterRow(**row) for row in rows_of(self.parameter)]

    @property
    def possible(self) -> str:
        """How many vehicles are possible, about each axis where they differ."""
        numbers = [self.plants] * len(self.axis) if self.axis_plants is None else self.axis_plants.tolist()
        if len(set(numbers)) == 1:
            return f"{numbers[0]} possible vehicles"
        counts = ", ".join(map(str, numbers[:-1]))
        return f"{counts} and {numbers[-1]} possible vehicles about {', '.join(self.axis[:-1])} and {self.axis[-1]}"

    @property
    def beside(self) -> str:
        """What stands beside the proposed set: today, of the log, or default."""
        return self.set_of[1]

    def row(self, which: str, axis: int) -> int:
        """Give the row of a set and an axis among the curves."""
        return self.set_of.index(which) * len(self.axis) + axis

    def falls_short(self, which: str) -> list[str]:
        """Name the axes of a set whose margins are not as asked with every possible plant, or that are unstable."""
        own = self.set_of.index(which)
        least = np.minimum(self.command_worst.disk[own], self.angle_worst.disk[own])
        return [name for name, disk in zip(self.axis, least, strict=True) if disk < self.required - _NEAR_DEG]

    @property
    def summary(self) -> dict[str, Any]:
        """The gains for machines."""
        return {
            "autopilot": self.autopilot,
            "firmware": self.firmware,
            "rate_hz": self.rate,
            "vehicle": self.vehicle_name,
            "asked": {"gain_db": self.asked_gain, "phase_deg": self.asked_phase, "disk_deg": self.asked_disk},
            "disk_required_deg": self.required,
            "hover_thrust": self.hover,
            "parameters": {row.pop("name"): row for row in rows_of(self.parameter)},
            "sets": {
                name: {axis: self._axis(own, place) for place, axis in enumerate(self.axis)}
                for own, name in enumerate(self.set_of)
            },
            "falls_short": {name: self.falls_short(name) for name in self.set_of},
            "noise_lines_hz": None if self.noise is None else self.noise.line.tolist(),
            "left_out": list(self.left_out),
            "source": list(self.source),
            "warnings": list(self.warning),
        }

    def _axis(self, own: int, axis: int) -> dict[str, Any]:
        groups = ("command", "command_worst", "angle", "angle_worst")
        margins = {"gain_db": "gain", "phase_deg": "phase", "disk_deg": "disk", "crossover_hz": "crossover"}
        answers = {"bandwidth_hz": "bandwidth", "overshoot": "overshoot"}
        answers |= {"overshoot_most": "overshoot_most", "rise_s": "rise"}

        def told(group: object, names: Mapping[str, str]) -> dict[str, Any]:
            return {name: float(getattr(group, column)[own, axis]) for name, column in names.items()}

        return {name: told(getattr(self, name), margins) for name in groups} | told(self, answers)


def _parameters(proposals: Sequence[Proposal], today: dict[str, float], names: Mapping[str, str]) -> ParametersGroup:
    own = [each.parameter for each in proposals]
    high = np.array([each.high for each in own], dtype=float)
    return columns_of(
        ParametersGroup,
        own,
        name=tuple(names.get(each.name, each.name) for each in own),
        today=np.array([today.get(each.name, np.nan) for each in own], dtype=float),
        proposed=np.array([each.value for each in proposals], dtype=float),
        wanted=np.array([each.wanted for each in proposals], dtype=float),
        high=np.where(np.isfinite(high), high, np.nan),
        clipped=np.array([each.clipped for each in proposals], dtype=bool),
    )
