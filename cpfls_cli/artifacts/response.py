"""The artifact of frequency responses: of the vehicle as flights show it, and of a model along the same flights."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, IntArray
from cpfls_cli.artifacts.spec import Format, Record, columns_of, dataset, group, record, rows_of
from cpfls_cli.response.mismatch import ACCEPTABLE, COHERENT, GOOD, ROTOR_SPEED, Deviation, clearness
from cpfls_cli.rounding import at_most

if TYPE_CHECKING:
    from cpfls_cli.response.flown import VehicleResponse

NO_INSTRUMENTS = "none"
"""In the place of what the instruments are: nothing in the flights moves the vehicle and knows nothing of gusts."""

NOT_JUDGED, NOT_ACCEPTABLE = "not-judged", "not-acceptable"


def response_word(cost: float) -> str:
    """Judge a model by its cost J: good, acceptable, not-acceptable; not-judged where it is not known."""
    if not np.isfinite(cost):
        return NOT_JUDGED
    return "good" if at_most(cost, GOOD) else "acceptable" if at_most(cost, ACCEPTABLE) else NOT_ACCEPTABLE


@record
class CurveGroup:
    """Complex gains by response and frequency, as decibels and degrees."""

    magnitude: Array = dataset("20 log10 of the gain in SI units", "response", "frequency", units="dB", gaps=True)
    phase: Array = dataset("from -180 to 180", "response", "frequency", units="deg", gaps=True)

    @classmethod
    def of(cls, gains: Array) -> Self:
        """Arrange complex gains, shape (response, frequency), NaN where not known."""
        known = np.abs(gains) > 0
        size = np.where(known, np.abs(gains), 1.0)
        return cls(
            magnitude=np.where(known, 20 * np.log10(size), np.nan),
            phase=np.where(known, np.degrees(np.angle(np.where(known, gains, 1.0))), np.nan),
        )


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
class ResponseRecord(Record):
    """The artifact `cpfls/response`."""

    FORMAT: ClassVar = Format(
        "cpfls/response",
        "frequency responses of a vehicle as flights show it, and of a model along the same flights",
        "response",
        ("model", "flight"),
    )

    played: str = dataset("the model: a file, or vehicle for that of /config")
    flown: tuple[str, ...] = dataset("names of the flights", "flight")
    instruments: str = dataset(
        "what moves the vehicle and knows nothing of gusts: repeats (the same path flown again), setpoints, or none"
    )
    name: tuple[str, ...] = dataset(
        "roll, pitch, yaw: torque of the rotors to angular acceleration; thrust: to specific force along z; rotor "
        "speed: from its command; roll rate, roll angle and others alike: from its setpoint",
        "response",
    )
    instrumented: BoolArray = dataset(
        "1 where it was estimated with instruments, which they have to move, in all flights", "response"
    )
    frequency: Array = dataset("frequencies, evenly spread on a logarithmic scale", "frequency", units="Hz")
    measured: CurveGroup = group()
    model: CurveGroup = group()
    direct: CurveGroup = group()
    coherence_input: Array = dataset(
        "share of the input that the instruments explain; 1 without", "response", "frequency", gaps=True
    )
    coherence_output: Array = dataset(
        "share of the output that the instruments explain; without, the input", "response", "frequency", gaps=True
    )
    random_error: Array = dataset(
        "standard error of the measured gain over the gain; in radians that of the phase",
        "response",
        "frequency",
        gaps=True,
    )
    averages: Array = dataset("windows that count as independent", "response", "frequency", gaps=True)
    cost: Array = dataset("J of the model; not finite where there is nothing to judge", "response", gaps=True)
    band: Array = dataset(
        "frequencies that are judged, first and last; not finite where none", "response", "2", units="Hz", gaps=True
    )
    deviation: DeviationGroup = group()
    warning: tuple[str, ...] = dataset("what to know about flights and model", "warning")
    contradiction: tuple[str, ...] | None = dataset(
        "contradictions within the flights or with the vehicle", "contradiction", default=None
    )

    @classmethod
    def of(
        cls,
        played: str,
        flown: Sequence[str],
        instruments: str,
        responses: Sequence[VehicleResponse],
        warnings: Sequence[str],
        contradictions: tuple[str, ...] | None,
    ) -> Self:
        """Arrange responses."""
        estimates = [each.estimate for each in responses]
        frequency = np.unique(np.concatenate([each.frequency for each in estimates]))

        def spread(rows: Sequence[Array]) -> Array:
            """Put each row at its frequencies, which are some of all."""
            whole = np.full((len(rows), len(frequency)), np.nan, dtype=rows[0].dtype)
            for row, values, estimate in zip(whole, rows, estimates, strict=True):
                row[np.searchsorted(frequency, estimate.frequency)] = values
            return whole

        models = [np.full_like(each.gain, np.nan) if each.model is None else each.model for each in estimates]
        listed = [(index, each) for index, own in enumerate(responses) for each in own.mismatch.deviations]
        return cls(
            played=played,
            flown=tuple(flown),
            instruments=instruments,
            name=tuple(each.name for each in responses),
            instrumented=np.array([each.instrumented for each in estimates]),
            frequency=frequency,
            measured=CurveGroup.of(spread([each.gain for each in estimates])),
            model=CurveGroup.of(spread(models)),
            direct=CurveGroup.of(spread([each.direct for each in estimates])),
            coherence_input=spread([each.coherence_input for each in estimates]),
            coherence_output=spread([each.coherence_output for each in estimates]),
            random_error=spread([each.random_error for each in estimates]),
            averages=spread([each.averages for each in estimates]),
            cost=np.array([each.mismatch.cost for each in responses]),
            band=np.array([each.mismatch.band or (np.nan, np.nan) for each in responses]),
            deviation=columns_of(
                DeviationGroup,
                (each for _, each in listed),
                response=np.array([index for index, _ in listed], dtype=np.int64),
            ),
            warning=tuple(warnings),
            contradiction=contradictions,
        )

    @property
    def has_instruments(self) -> bool:
        """Whether there are any; without, all responses are of vehicle and autopilot together."""
        return self.instruments != NO_INSTRUMENTS

    @property
    def coherence(self) -> Array:
        """The smaller of both coherences, shape (response, frequency)."""
        return np.fmin(self.coherence_input, self.coherence_output)

    @property
    def coherent(self) -> BoolArray:
        """Whether a response shows at a frequency, shape (response, frequency)."""
        return np.asarray(self.clearness > COHERENT)

    @property
    def clearness(self) -> Array:
        """The coherence that counts, shape (response, frequency); see `cpfls_cli.response.mismatch.clearness`."""
        return np.array(
            [
                clearness(coherence, error, averages, bool(instrumented))
                for coherence, error, averages, instrumented in zip(
                    self.coherence, self.random_error, self.averages, self.instrumented, strict=True
                )
            ]
        )

    def is_of_vehicle(self, index: int) -> bool:
        """Tell whether a response is of the vehicle: speeds that follow their command feel no gust."""
        return bool(self.instrumented[index]) or self.name[index] == ROTOR_SPEED

    def is_modelled(self, index: int) -> bool:
        """Tell whether the model has the response: no model of a vehicle says what follows a setpoint."""
        return bool(np.isfinite(self.model.magnitude[index]).any())

    def word(self, index: int) -> str:
        """Judge the model by one response: good, acceptable, not-acceptable; not-judged where nothing shows it."""
        return response_word(float(self.cost[index])) if self.is_of_vehicle(index) else NOT_JUDGED

    def deviations(self, index: int) -> list[Deviation]:
        """List where the model is right and where it is off in one response, from low to high frequencies."""
        return [Deviation(**row) for row in rows_of(self.deviation) if row.pop("response") == index]

    @property
    def columns(self) -> dict[str, Array]:
        """All that is known of each response by frequency, shape (response, frequency), by names with units."""
        return {
            "magnitude_db": self.measured.magnitude,
            "phase_deg": self.measured.phase,
            "model_magnitude_db": self.model.magnitude,
            "model_phase_deg": self.model.phase,
            "direct_magnitude_db": self.direct.magnitude,
            "direct_phase_deg": self.direct.phase,
            "coherence_input": self.coherence_input,
            "coherence_output": self.coherence_output,
            "random_error": self.random_error,
            "averages": self.averages,
        }

    @property
    def summary(self) -> dict[str, Any]:
        """The responses for machines."""
        return {
            "model": self.played,
            "flights": list(self.flown),
            "instruments": self.instruments,
            "frequency_hz": self.frequency.tolist(),
            "responses": {name: self._response(index) for index, name in enumerate(self.name)},
            "contradictions": list(self.contradiction or ()),
            "warnings": list(self.warning),
        }

    def _response(self, index: int) -> dict[str, Any]:
        band = self.band[index]
        return {
            "word": self.word(index),
            "instrumented": bool(self.instrumented[index]),
            "cost": float(self.cost[index]),
            "band_hz": band.tolist() if np.isfinite(band).all() else None,
            "deviations": [each._asdict() for each in self.deviations(index)],
            **{name: values[index].tolist() for name, values in self.columns.items()},
        }
