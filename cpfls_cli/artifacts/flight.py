"""The artifact of a flight, simulated or measured."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.artifacts.spec import BODY, EULER, WORLD, Format, Record, dataset, group, paired, record
from cpfls_cli.flightlog.settings import SETPOINTS
from cpfls_cli.regressor.motion import Motion

if TYPE_CHECKING:
    from cpfls_cli.flightlog.results import ImportedFlight
    from cpfls_cli.simulation.model import SimulatedEffects

MOTION = ("attitude", "attitude_rate", "attitude_acceleration")
"""Fields of trajectories and flights that hold Euler angles and their derivatives."""

BEGINS = "stamp of the log's own clock at time 0 of the flight; not finite where there is none"
CLOCK = "clock/begins"
"""Path of the same of a single flight."""


def known_begins(begins: Iterable[float]) -> Array | None:
    """Arrange where flights begin on the clocks of their logs, s; None where none has a log."""
    stamps = np.fromiter(begins, float)
    return stamps if np.isfinite(stamps).any() else None


@record
class ClockGroup:
    """The log's own clock."""

    begins: float = dataset("stamp of the log at time 0", units="s")

    @classmethod
    def of(cls, begins: float) -> Self | None:
        """Keep the stamp, s; None where there is none."""
        return cls(begins=begins) if np.isfinite(begins) else None


@record
class QualityGroup:
    """What an import found in its log, and what was done about it."""

    reason: tuple[str, ...] | None = dataset("what was found in the log, and what was done", "reason", default=None)
    count: IntArray | None = dataset("rows, gaps or values by reason", "reason", default=None)
    warning: tuple[str, ...] | None = dataset("what to know about the log", "warning", default=None)
    filtered: tuple[str, ...] | None = dataset(
        "signals that were low-passed before they were logged", "filtered", default=None
    )
    cut_off: Array | None = dataset(
        "where that filter halves the amplitude, seen in the spectrum", "filtered", units="Hz", default=None
    )
    slow: tuple[str, ...] | None = dataset(
        "signals of the log that were updated slower than it has rows", "slow", default=None
    )
    updated: Array | None = dataset("updates a second of these", "slow", units="Hz", default=None)

    @classmethod
    def of(
        cls,
        findings: Mapping[str, int],
        warnings: Sequence[str],
        cut_off_hz: Mapping[str, float],
        updated_hz: Mapping[str, float],
    ) -> Self | None:
        """Arrange what was found in a log, how often, the warnings, and how fast it is; None where there is none."""
        if not findings and not warnings and not cut_off_hz and not updated_hz:
            return None
        return cls(
            reason=tuple(findings) if findings else None,
            count=np.array(list(findings.values()), dtype=np.int64) if findings else None,
            warning=tuple(warnings) if warnings else None,
            filtered=tuple(cut_off_hz) if cut_off_hz else None,
            cut_off=np.array(list(cut_off_hz.values())) if cut_off_hz else None,
            slow=tuple(updated_hz) if updated_hz else None,
            updated=np.array(list(updated_hz.values())) if updated_hz else None,
        )

    @property
    def cut_off_hz(self) -> dict[str, float]:
        """Cut-off of the filter before the log, by signal of `import.signals`; those in which none is seen lack."""
        return paired(self.filtered, self.cut_off)

    @property
    def updated_hz(self) -> dict[str, float]:
        """Updates a second, by signal of `import.signals`; those that are as fast as the log lack."""
        return paired(self.slow, self.updated)

    @property
    def findings(self) -> dict[str, int]:
        """What was found and done, with how often."""
        return paired(self.reason, self.count)


@record
class DelayGroup:
    """Delay of motion behind command, and its estimate."""

    value: float = dataset("delay of motion behind command, taken out", units="s")
    tried: Array | None = dataset("delays tried by the estimate", "tried", units="s", default=None)
    r2: Array | None = dataset("R2 of the rigid body by delay, axes together", "tried", default=None)

    @property
    def best_r2(self) -> float | None:
        """R2 of the rigid body at the delay that was estimated; None where the config states the delay."""
        return None if self.r2 is None else float(np.max(self.r2, initial=-np.inf))


@record
class StatedGroup:
    """What the log says of its vehicle, by which flights of two vehicles are told apart."""

    name: tuple[str, ...] = dataset("parameter of the frame and the rotors, or `written by`", "stated")
    value: tuple[str, ...] = dataset("as the log has it", "stated")

    @classmethod
    def of(cls, facts: Mapping[str, str]) -> Self | None:
        """Keep facts; None where there are none."""
        return cls(name=tuple(facts), value=tuple(facts.values())) if facts else None

    @property
    def facts(self) -> dict[str, str]:
        """Values by name."""
        return dict(zip(self.name, self.value, strict=True))


@record
class AutopilotGroup:
    """What the log knew of the autopilot: parameters of a control law that is known here, as the law names them."""

    system: str = dataset("what wrote the log, and its version; empty where it does not say")
    name: tuple[str, ...] = dataset("as the autopilot writes it", "parameter")
    value: Array = dataset("in its own unit", "parameter")

    @classmethod
    def of(cls, system: str, parameters: Mapping[str, float]) -> Self | None:
        """Keep parameters; None where there are none."""
        if not parameters:
            return None
        return cls(system=system, name=tuple(parameters), value=np.array(list(parameters.values()), dtype=float))

    @property
    def parameters(self) -> dict[str, float]:
        """Values by name."""
        return paired(self.name, self.value)


@record
class NoiseGroup:
    """Noise that a simulation added."""

    signal: tuple[str, ...] = dataset("signals with added noise", "noisy")
    std: Array = dataset("standard deviation added", "noisy", "axis", units="SI")

    @classmethod
    def of(cls, std: Mapping[str, Array]) -> Self | None:
        """Arrange the standard deviations of the noise of signals with three axes; None where none is noisy."""
        names = [name for name, deviations in std.items() if np.shape(deviations) == (3,)]
        return cls(signal=tuple(names), std=np.array([std[name] for name in names])) if names else None


@record
class FlownEffectsGroup:
    """Effects that a simulation flew beyond its model."""

    name: tuple[str, ...] = dataset("what was flown beyond the model, by value", "flown")
    value: Array = dataset("the true value of each", "flown", units="SI")

    @classmethod
    def of(cls, effects: SimulatedEffects) -> Self | None:
        """Arrange the effects of a flight; None where it has none."""
        values = dict(_effect_values(effects))
        return cls(name=tuple(values), value=np.array(list(values.values()))) if values else None

    @property
    def by_name(self) -> dict[str, float]:
        """The true values by ``effect.coefficient``."""
        return paired(self.name, self.value)


def _effect_values(effects: SimulatedEffects) -> Iterator[tuple[str, float]]:
    for flown in effects.listed:
        name = flown.effect.name
        # An effect without numbers is there once.
        yield from [(f"{name}.{entry}", value) for entry, value in flown.values.items()] or [(name, 1.0)]


@record
class FlightRecord(Record):
    """The artifact `cpfls/flight`."""

    FORMAT: ClassVar = Format(
        "cpfls/flight",
        "a flight, simulated or measured; a source that lacks a signal leaves it out",
        "simulate, import",
        ("trajectory", "model", "log"),
    )

    time: Array = dataset("time from the first sample", "time", units="s")
    attitude: Array | None = dataset("roll, pitch, yaw q", "time", "axis", units="rad", frame=EULER, default=None)
    attitude_rate: Array | None = dataset("Euler rates qd", "time", "axis", units="rad/s", frame=EULER, default=None)
    attitude_acceleration: Array | None = dataset(
        "Euler accelerations qdd", "time", "axis", units="rad/s^2", frame=EULER, default=None
    )
    body_rate: Array | None = dataset("body rates p, q, r", "time", "axis", units="rad/s", frame=BODY, default=None)
    torque: Array | None = dataset(
        "generalised torque, W^T body_torque", "time", "axis", units="N m", frame=EULER, default=None
    )
    body_torque: Array | None = dataset(
        "torque about the body axes", "time", "axis", units="N m", frame=BODY, default=None
    )
    thrust: Array | None = dataset("total thrust along body z", "time", units="N", frame=BODY, default=None)
    position: Array | None = dataset("position", "time", "axis", units="m", frame=WORLD, default=None)
    velocity: Array | None = dataset("velocity", "time", "axis", units="m/s", frame=WORLD, default=None)
    acceleration: Array | None = dataset("acceleration", "time", "axis", units="m/s^2", frame=WORLD, default=None)
    specific_force: Array | None = dataset(
        "what an accelerometer senses: +g along z in hover", "time", "axis", units="m/s^2", frame=BODY, default=None
    )
    rotor_speed: Array | None = dataset(
        "rotor speeds", "time", "rotor", units="rad/s", frame=BODY, gaps=True, default=None
    )
    rotor_command: Array | None = dataset(
        "commands to the rotors; rad/s if simulated, else aligned, filtered, in import.signals.rotor_command.unit",
        "time",
        "rotor",
        units="SI",
        frame=BODY,
        default=None,
    )
    voltage: Array | None = dataset(
        "of the battery: V; share of the full one if simulated or where import.signals.voltage.unit is 1",
        "time",
        units="SI",
        default=None,
    )
    setpoint_position: Array | None = dataset(
        "position setpoint; not finite where there is none",
        "time",
        "axis",
        units="m",
        frame=WORLD,
        gaps=True,
        default=None,
    )
    setpoint_velocity: Array | None = dataset(
        "velocity setpoint", "time", "axis", units="m/s", frame=WORLD, gaps=True, default=None
    )
    setpoint_attitude: Array | None = dataset(
        "roll, pitch, yaw setpoints", "time", "axis", units="rad", frame=EULER, gaps=True, default=None
    )
    setpoint_body_rate: Array | None = dataset(
        "body rate setpoints", "time", "axis", units="rad/s", frame=BODY, gaps=True, default=None
    )
    setpoint_thrust: Array | None = dataset(
        "thrust setpoint: N, or share of the largest where import.signals.setpoint_thrust.unit is 1",
        "time",
        units="SI",
        frame=BODY,
        gaps=True,
        default=None,
    )
    sticks: Array | None = dataset(
        "roll, pitch, yaw and, where it counts alike, throttle of the pilot, shares of full deflection as logged",
        "time",
        "stick",
        gaps=True,
        default=None,
    )
    clock: ClockGroup | None = group(default=None)
    quality: QualityGroup | None = group(default=None)
    delay: DelayGroup | None = group(default=None)
    autopilot: AutopilotGroup | None = group(default=None)
    stated: StatedGroup | None = group(default=None)
    noise: NoiseGroup | None = group(default=None)
    effects: FlownEffectsGroup | None = group(default=None)

    @classmethod
    def of_simulation(
        cls,
        signals: Mapping[str, Array],
        noise_std: Mapping[str, Array],
        effects: SimulatedEffects | None = None,
    ) -> Self:
        """Arrange a simulated flight: signals by the names of the fields, and standard deviations of their noise."""
        named: Mapping[str, Any] = signals
        return cls(
            **named,
            noise=NoiseGroup.of(noise_std),
            effects=None if effects is None else FlownEffectsGroup.of(effects),
        )

    @classmethod
    def of_import(cls, flight: ImportedFlight, findings: Mapping[str, int]) -> Self:
        """Arrange an imported flight, with what was found in the log and done about it, and how often."""
        report = flight.report
        estimate = report.delay
        names = [name for name in cls.signal_names() if name not in SETPOINTS]
        signals = {name: values for name in names if (values := getattr(flight, name)) is not None}
        setpoints: dict[str, Any] = {
            name: flight.setpoints[short] for name, short in SETPOINTS.items() if short in flight.setpoints
        }
        if "setpoint_thrust" in setpoints:
            setpoints["setpoint_thrust"] = setpoints["setpoint_thrust"][:, 0]
        return cls(
            **signals,
            **setpoints,
            clock=ClockGroup(begins=report.first_stamp_s + report.span_s[0]),
            quality=QualityGroup.of(findings, report.warnings, report.cut_off_hz, report.updated_hz),
            autopilot=AutopilotGroup.of(report.system, report.parameters),
            stated=StatedGroup.of(report.stated),
            delay=DelayGroup(
                value=report.delay_s,
                tried=None if estimate is None else estimate.delays,
                r2=None if estimate is None else estimate.curve,
            ),
        )

    def with_warnings(self, warnings: Sequence[str]) -> Self:
        """Add to what is to be known about the log."""
        if not warnings:
            return self
        quality = self.quality or QualityGroup()
        return replace(self, quality=replace(quality, warning=(*(quality.warning or ()), *warnings)))

    @classmethod
    def signal_names(cls) -> list[str]:
        """List time and the signals that a flight can hold."""
        return [spec.path for spec in cls.spec().datasets if "/" not in spec.path]

    @property
    def signals(self) -> dict[str, Array]:
        """Time and the signals that it holds, by the names of the fields."""
        return {name: values for name in self.signal_names() if (values := getattr(self, name)) is not None}

    @property
    def setpoints_known(self) -> dict[str, int]:
        """Count the samples at which each setpoint that it holds is known, by the names of `SETPOINTS`."""
        held = {short: values for name, short in SETPOINTS.items() if (values := getattr(self, name)) is not None}
        known = {name: np.isfinite(values.reshape(len(values), -1)).all(axis=1) for name, values in held.items()}
        return {name: int(np.sum(own)) for name, own in known.items()}

    @property
    def begins(self) -> float:
        """Stamp of the log's own clock at time 0, s; NaN where there is none."""
        return np.nan if self.clock is None else self.clock.begins

    @property
    def motion(self) -> Motion:
        """Euler angles and their derivatives, of a flight that was read with all of `MOTION`."""
        assert self.attitude is not None, "the flight has no attitude"
        assert self.attitude_rate is not None, "the flight has no Euler rates"
        assert self.attitude_acceleration is not None, "the flight has no Euler accelerations"
        return Motion(self.attitude, self.attitude_rate, self.attitude_acceleration)

    @property
    def largest_torque(self) -> list[float]:
        """Largest generalised torque on roll, pitch and yaw, N m; empty where it holds no torque."""
        return [] if self.torque is None else np.max(np.abs(self.torque), axis=0).tolist()

    @property
    def turns(self) -> bool:
        """Whether roll or pitch goes round the circle."""
        if self.attitude is None or self.attitude_rate is None:
            return False
        return bool(np.ptp(self.attitude[:, :2], axis=0).max() > 2 * np.pi)

    @property
    def lacks(self) -> tuple[str, ...]:
        """What later commands will miss: ``attitude``, ``rotation`` (of any kind), ``torque``."""
        missing = {
            "attitude": self.attitude is None,
            "rotation": self.attitude is None and self.body_rate is None,
            "torque": self.torque is None and self.body_torque is None,
        }
        return tuple(name for name, lacking in missing.items() if lacking)

    @property
    def summary(self) -> dict[str, Any]:
        """The flight for machines."""
        return {"samples": len(self.time), "max_torque": self.largest_torque}
