"""The artifact of a twin: a flight's own setpoints flown by its autopilot's law and simulated vehicles beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray, Numbers
from cpfls_cli.artifacts.flight import ClockGroup
from cpfls_cli.artifacts.spec import WORLD, Format, Record, columns_of, dataset, group, group_of, record, rows_of
from cpfls_cli.playback.settings import VEHICLE
from cpfls_cli.response.mismatch import NOT_ACCEPTABLE, Deviation, response_word
from cpfls_cli.response.spectra import decibels, degrees
from cpfls_cli.result import plain

if TYPE_CHECKING:
    from cpfls_cli.playback.flight import LoggedFlight
    from cpfls_cli.simulation.twin import Asked, Comparison, InGusts, TwinFlight

SETPOINT, STAYS = "setpoint", "nothing-moves"
"""What knows no vehicle: the setpoints themselves, and a vehicle that stays as it begins."""

CHANNEL = (
    "roll rate, pitch rate, yaw rate: rad/s, body; roll, pitch, yaw: rad; velocity x, y, z: m/s, world; thrust: "
    "specific force along z, m/s^2, body"
)


def played_words(played: str) -> str:
    """Name what is played: a file, or the vehicle of the config."""
    return "the vehicle of the config" if played == VEHICLE else played


@record
class CurveGroup:
    """Complex gains by response and frequency, as decibels and degrees."""

    magnitude: Array = dataset("20 log10 of the gain in SI units", "response", "frequency", units="dB", gaps=True)
    phase: Array = dataset("from -180 to 180", "response", "frequency", units="deg", gaps=True)

    @classmethod
    def of(cls, gains: Numbers) -> Self:
        """Arrange complex gains, shape (response, frequency), NaN where not known."""
        return cls(magnitude=decibels(gains), phase=degrees(gains))


@record
class DeviationGroup:
    """Stretches of the band of a response, each one in which the model is right, or off in one way."""

    response: IntArray = dataset("index of the response", "deviation", into="response")
    low: Array = dataset("from this frequency", "deviation", units="Hz")
    high: Array = dataset("to this one", "deviation", units="Hz")
    right: BoolArray = dataset("1 where the model is right", "deviation")
    gain: Array = dataset("gain of the model over the measured one, geometric mean", "deviation")
    phase: Array = dataset("phase of the model less the measured one, mean", "deviation", units="deg")


@record
class GainsGroup:
    """Parameters of the autopilot, and where they come from."""

    source: str = dataset("stated (in the config), log, simulation (that made the flight) or defaults")
    name: tuple[str, ...] = dataset("parameters by the autopilot's own names", "gain")
    value: Array = dataset("in the autopilot's own units", "gain", units="SI")


@record
class AnswersGroup:
    """How flight and simulated vehicles answer the same setpoints, by frequency."""

    vehicle: IntArray = dataset("index of the simulated vehicle", "response", into="vehicle")
    channel: IntArray = dataset("index of the channel", "response", into="channel")
    frequency: Array = dataset("frequencies", "frequency", units="Hz")
    measured: CurveGroup = group()
    model: CurveGroup = group()
    random_error: Array = dataset(
        "standard error of the measured gain over the gain; in radians that of the phase",
        "response",
        "frequency",
        gaps=True,
    )
    cost: Array = dataset(
        "J of the simulated vehicle; not finite where there is nothing to judge", "response", gaps=True
    )
    band: Array = dataset(
        "frequencies that are judged, first and last; not finite where none", "response", "2", units="Hz", gaps=True
    )
    deviation: DeviationGroup = group()

    @classmethod
    def of(cls, compared: Sequence[Comparison]) -> Self:
        """Arrange what can be estimated, vehicle by vehicle, channel by channel."""
        rows = [
            (vehicle, channel, found, judged)
            for vehicle, one in enumerate(compared)
            for channel, (found, judged) in enumerate(zip(one.responses, one.mismatches, strict=True))
            if found is not None and judged is not None
        ]
        frequency = np.unique(np.concatenate([np.zeros(0), *(found.frequency for _, _, found, _ in rows)]))

        def spread(values: Sequence[Numbers], found: Sequence[Array], kind: type) -> Numbers:
            whole: Numbers = np.full((len(values), len(frequency)), np.nan, dtype=kind)
            for row, own, places in zip(whole, values, found, strict=True):
                row[np.searchsorted(frequency, places)] = own
            return whole

        places = [found.frequency for _, _, found, _ in rows]
        models = [np.full_like(f.gain, np.nan) if f.model is None else f.model for _, _, f, _ in rows]
        listed = [(row, each) for row, (_, _, _, judged) in enumerate(rows) for each in judged.deviations]
        return cls(
            vehicle=np.array([vehicle for vehicle, _, _, _ in rows], dtype=np.int64),
            channel=np.array([channel for _, channel, _, _ in rows], dtype=np.int64),
            frequency=frequency,
            measured=CurveGroup.of(spread([found.gain for _, _, found, _ in rows], places, complex)),
            model=CurveGroup.of(spread(models, places, complex)),
            random_error=spread([found.random_error for _, _, found, _ in rows], places, float),
            cost=np.array([judged.cost for _, _, _, judged in rows], dtype=float),
            band=np.array([judged.band or (np.nan, np.nan) for _, _, _, judged in rows], dtype=float).reshape(-1, 2),
            deviation=columns_of(
                DeviationGroup,
                (each for _, each in listed),
                response=np.array([row for row, _ in listed], dtype=np.int64),
            ),
        )

    def row(self, vehicle: int, channel: int) -> int | None:
        """Find the row of a vehicle and a channel; None where there is none."""
        rows = np.flatnonzero((self.vehicle == vehicle) & (self.channel == channel))
        return int(rows[0]) if len(rows) else None

    def deviations(self, row: int) -> list[Deviation]:
        """List where a simulated vehicle is right and where it is off, from low to high frequencies."""
        return [Deviation(**own) for own in rows_of(self.deviation) if own.pop("response") == row]


@record
class WindowsGroup:
    """How far apart they are, second by second."""

    start: Array = dataset("begin, on the clock of the flight", "window", units="s")
    difference: Array = dataset(
        "root mean square of measured less simulated", "vehicle", "window", "channel", units="SI", gaps=True
    )
    follows: Array = dataset(
        "of the part that follows the setpoints: the fault of the simulated vehicle",
        "vehicle",
        "window",
        "channel",
        units="SI",
        gaps=True,
    )
    apart: BoolArray = dataset("1 where they are apart beyond gusts and noise", "vehicle", "window", "channel")


@record
class InGustsGroup:
    """The flight beside vehicles that the model allows, each in gusts of its own and with what the model lacks."""

    rms: Array = dataset(
        "root mean square of each less the model in still air; not finite where no gusts are known",
        "draw",
        "channel",
        units="SI",
        gaps=True,
    )
    low: Array = dataset("least of them", "sample", "channel", units="SI", gaps=True)
    high: Array = dataset("most of them", "sample", "channel", units="SI", gaps=True)
    noise: Array = dataset("white noise that the flight has, and they are given", "channel", units="SI")
    beyond: BoolArray = dataset("1 where the flight is farther off than they are", "channel")
    lost: int = dataset("how many overturn")


@record
class TwinRecord(Record):
    """The artifact `cpfls/twin`."""

    FORMAT: ClassVar = Format(
        "cpfls/twin",
        "the setpoints of a flight flown by its autopilot's law and simulated vehicles, beside the flight",
        "simulate",
        ("flight", "model"),
    )

    flight: str = dataset("name of the flight")
    autopilot: str = dataset("whose law flies")
    asked: str = dataset("what the law is asked for: attitude or body_rate, as logged")
    thrust_from: str = dataset("setpoint, or rotors: the thrust that the flight's own rotors gave stands for it")
    gains: GainsGroup = group()
    left_out: tuple[str, ...] = dataset("parts of the autopilot's law that are not simulated", "left_out")
    rotor_lag_s: float = dataset("time constant of the simulated rotors behind their command", units="s")
    instruments: str = dataset("what moves the vehicle and knows nothing of gusts: repeats, setpoints or none")
    vehicle: tuple[str, ...] = dataset("simulated vehicles: vehicle is that of /config, others are files", "vehicle")
    lost: Array = dataset("when a vehicle overturned; not finite where it did not", "vehicle", units="s", gaps=True)
    channel: tuple[str, ...] = dataset(CHANNEL, "channel")
    time: Array = dataset("on the clock of the flight", "sample", units="s")
    measured: Array = dataset("of the flight", "sample", "channel", units="SI", gaps=True)
    measured_position: Array | None = dataset(
        "of the flight", "sample", "axis", units="m", frame=WORLD, gaps=True, default=None
    )
    setpoint: Array = dataset("of the flight", "sample", "channel", units="SI", gaps=True)
    simulated: Array = dataset("of each vehicle", "vehicle", "sample", "channel", units="SI", gaps=True)
    position: Array = dataset("of each vehicle", "vehicle", "sample", "axis", units="m", frame=WORLD, gaps=True)
    movement: Array = dataset("root mean square of the flight about its mean", "channel", units="SI", gaps=True)
    prediction: tuple[str, ...] = dataset("vehicles, then setpoint and nothing-moves, which know none", "prediction")
    rms: Array = dataset("root mean square of measured less predicted", "prediction", "channel", units="SI", gaps=True)
    floor: Array = dataset(
        "part of it that does not follow the setpoints: gusts, noise, and what is not linear",
        "vehicle",
        "channel",
        units="SI",
        gaps=True,
    )
    window: WindowsGroup = group()
    answers: AnswersGroup = group()
    in_gusts: InGustsGroup | None = group(default=None)
    clock: ClockGroup | None = group(default=None)
    warning: tuple[str, ...] = dataset("what to know about flight and vehicles", "warning")
    contradiction: tuple[str, ...] | None = dataset(
        "contradictions within the flight or with the vehicle", "contradiction", default=None
    )

    @classmethod
    def of(
        cls,
        flight: LoggedFlight,
        asked: Asked,
        flown: Mapping[str, TwinFlight],
        compared: Sequence[Comparison],
        arrays: Mapping[str, Array],
        window: WindowsGroup,
        in_gusts: InGusts | None,
        **about: Any,
    ) -> Self:
        """Arrange flights of simulated vehicles; arrays are the datasets of that name that need nothing else."""
        return cls(
            flight=flight.name,
            asked=asked.kind,
            thrust_from=asked.thrust_from,
            vehicle=tuple(flown),
            lost=np.array([one.lost_s for one in flown.values()]),
            time=flight.time,
            simulated=np.array([one.values for one in flown.values()]),
            position=np.array([one.position for one in flown.values()]),
            prediction=(*flown, SETPOINT, STAYS),
            floor=np.array([one.floor for one in compared]),
            window=window,
            answers=AnswersGroup.of(compared),
            in_gusts=None if in_gusts is None else group_of(InGustsGroup, in_gusts),
            clock=ClockGroup.of(flight.begins),
            **arrays,  # type: ignore[arg-type]  # each is an array
            **about,
        )

    def cost(self, vehicle: int, channel: int) -> float:
        """Give J of a vehicle in a channel; NaN where it is not judged."""
        row = self.answers.row(vehicle, channel)
        return float("nan") if row is None else float(self.answers.cost[row])

    def word(self, vehicle: int, channel: int) -> str:
        """Judge a vehicle in a channel by frequency: good, acceptable, not-acceptable; not-judged."""
        return response_word(self.cost(vehicle, channel))

    def parts(self, vehicle: int, channel: int) -> bool:
        """Tell whether a vehicle parts from the flight in a channel, in time or by frequency."""
        return self.word(vehicle, channel) == NOT_ACCEPTABLE or bool(self.window.apart[vehicle, :, channel].any())

    def judged(self, vehicle: int) -> list[int]:
        """List the channels in which a vehicle is judged."""
        costs = [self.cost(vehicle, channel) for channel in range(len(self.channel))]
        return [channel for channel, cost in enumerate(costs) if np.isfinite(cost)]

    @property
    def held(self) -> list[int]:
        """Channels in which the flight is held against vehicles in gusts."""
        known = self.in_gusts
        return [] if known is None else np.flatnonzero(np.isfinite(known.rms).all(axis=0)).tolist()

    @property
    def beyond(self) -> list[int]:
        """Channels in which the flight is farther from the model than gusts explain."""
        return [] if self.in_gusts is None else np.flatnonzero(self.in_gusts.beyond).tolist()

    def inside(self, channel: int) -> float:
        """Give the share of the time in which the flight lies between vehicles in gusts; NaN where none are known."""
        known = self.in_gusts
        if known is None or channel not in self.held:
            return float("nan")
        low, high, own = (values[:, channel] for values in (known.low, known.high, self.measured))
        there = np.isfinite(own) & np.isfinite(low)
        return float(((low <= own) & (own <= high))[there].mean())

    def first_apart(self, vehicle: int, channel: int) -> float:
        """Give when a vehicle first parts, s; NaN where it never does."""
        apart = np.flatnonzero(self.window.apart[vehicle, :, channel])
        return float(self.window.start[apart[0]]) if len(apart) else float("nan")

    def name(self, vehicle: int) -> str:
        """Name a simulated vehicle."""
        return played_words(self.vehicle[vehicle])

    @property
    def summary(self) -> dict[str, Any]:
        """The twin for machines."""
        return {
            "flight": self.flight,
            "autopilot": self.autopilot,
            "asked": self.asked,
            "thrust_from": self.thrust_from,
            "gains": {
                "source": self.gains.source,
                **dict(zip(self.gains.name, self.gains.value.tolist(), strict=True)),
            },
            "left_out": list(self.left_out),
            "instruments": self.instruments,
            "rms": {
                name: dict(zip(self.channel, row, strict=True))
                for name, row in zip(self.prediction, self.rms.tolist(), strict=True)
            },
            "movement": dict(zip(self.channel, self.movement.tolist(), strict=True)),
            "in_gusts": self._in_gusts(),
            "vehicles": {name: self._vehicle(index) for index, name in enumerate(self.vehicle)},
            "contradictions": list(self.contradiction or ()),
            "warnings": list(self.warning),
        }

    def _in_gusts(self) -> dict[str, Any] | None:
        known = self.in_gusts
        if known is None:
            return None
        return {
            "vehicle": self.vehicle[-1],
            "flights": len(known.rms),
            "lost": known.lost,
            "channels": {
                self.channel[each]: {
                    "rms": float(self.rms[len(self.vehicle) - 1, each]),
                    "rms_in_gusts": [float(known.rms[:, each].min()), float(known.rms[:, each].max())],
                    "noise": float(known.noise[each]),
                    "inside_share": self.inside(each),
                    "beyond": bool(known.beyond[each]),
                }
                for each in self.held
            },
        }

    def _vehicle(self, vehicle: int) -> dict[str, Any]:
        return {
            "lost_s": float(self.lost[vehicle]),
            "channels": {name: self._channel(vehicle, index) for index, name in enumerate(self.channel)},
        }

    def _channel(self, vehicle: int, channel: int) -> dict[str, Any]:
        row = self.answers.row(vehicle, channel)
        apart = self.window.apart[vehicle, :, channel]
        return {
            "word": self.word(vehicle, channel),
            "cost": self.cost(vehicle, channel),
            "band_hz": None if row is None else self.answers.band[row].tolist(),
            "deviations": [] if row is None else [plain(each) for each in self.answers.deviations(row)],
            "floor": float(self.floor[vehicle, channel]),
            "first_apart_s": self.first_apart(vehicle, channel),
            "apart_share": float(apart.mean()) if len(apart) else 0.0,
            "parts": self.parts(vehicle, channel),
        }
