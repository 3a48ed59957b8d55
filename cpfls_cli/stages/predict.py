"""Predict torque, inertia and Coriolis matrices of a model along a flight."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.arguments import FlightArgument, ModelArgument
from cpfls_cli.arrays import Array, BoolArray, runs
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.spec import PART
from cpfls_cli.autopilots.law import AXES
from cpfls_cli.config.study import Study
from cpfls_cli.consistency.findings import contradictions
from cpfls_cli.dynamics.equations_of_motion import coriolis_matrix
from cpfls_cli.dynamics.rigid_body import inertia_matrix, inertia_matrix_gradient
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.flights.flight import Flight
from cpfls_cli.flights.flight_source import FlightStretch, check_file, flight_source, flight_stretches, torque_source_of
from cpfls_cli.flights.inputs import hashes_of
from cpfls_cli.flights.models import any_model, is_found, read_model
from cpfls_cli.flights.same_vehicle import model_of_another, other_vehicles
from cpfls_cli.gap.balance.weak_flight import rotation_balance, translation_balance
from cpfls_cli.gap.whole_vehicle import of_vehicle
from cpfls_cli.pages.sensors import contradicted
from cpfls_cli.pages.trust import seen_words
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.regressor.regressor import InertiaValues
from cpfls_cli.report.canvas import BASELINE, Drawn, band, legend_above, line, stacked, style_of
from cpfls_cli.rotations import attitude_rate, generalised_torque
from cpfls_cli.stage import Parts, Run, stage
from cpfls_cli.stages._numbers import with_numbers
from cpfls_cli.store import count_rows, read_first
from cpfls_cli.validation.prediction import AlongFlight, Totals
from cpfls_cli.validation.trust import Trust
from cpfls_cli.weak_form.windows import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INERTIA_PANELS = (("D22", "D33"), ("D13", "D23"))
_UNJUDGED = "has no verdict and no bands; `cpfls identify` with identification.validation.enabled adds them"


def _error(r: AlongFlight, figure: Figure) -> None:
    """Draw the torque error along a flight: Figure 7."""
    assert r.error is not None, "drawn where there is one"
    panels = stacked(figure, 3)
    for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
        line(axes, r.time, r.error[:, index], **style_of(0))
        _shade(axes, r.time, r.extrapolates)
        axes.set_title(f"error on {axis}")
        axes.set_ylabel("N m")
    panels[-1].set_xlabel("time, s")


def _torques(r: AlongFlight, figure: Figure) -> None:
    """Draw the torque of the model over the torque of the flight."""
    panels = _against(figure, r.time, r.torque, r.measured_torque, [f"torque on {axis}" for axis in AXES], "N m")
    for index, axes in enumerate(panels):
        if r.torque_low is not None and r.torque_high is not None:
            _shade_band(axes, r.time, r.torque_low[:, index], r.torque_high[:, index], 0, "95 % band of the model")
        _shade(axes, r.time, r.extrapolates)
    legend_above(panels[0])


def _forces(r: AlongFlight, figure: Figure) -> None:
    """Draw the force of a whole vehicle over what the motion takes."""
    assert r.force is not None, "drawn where there is one"
    panels = _against(figure, r.time, r.force, r.measured_force, [f"force along {axis}" for axis in "xyz"], "N")
    legend_above(panels[0])


def _against(
    figure: Figure, time: Array, model: Array, flown: Array | None, titles: list[str], unit: str
) -> list[Axes]:
    panels = stacked(figure, 3)
    for index, (axes, title) in enumerate(zip(panels, titles, strict=True)):
        line(axes, time, model[:, index], label="model", **style_of(0))
        if flown is not None:
            line(axes, time, flown[:, index], label="flight", **BASELINE)
        axes.set_title(title, loc="left" if index else "right")
        axes.set_ylabel(unit)
    panels[-1].set_xlabel("time, s")
    return panels


def _shade_band(axes: Axes, time: Array, low: Array, high: Array, style: int, label: str) -> None:
    band(axes, time, low, high, color=style_of(style)["color"], alpha=0.25, label=label)


def _shade(axes: Axes, time: Array, outside: BoolArray) -> None:
    """Shade the samples whose attitude the training data never visited."""
    half = 0.5 * float(np.median(np.diff(time))) if len(time) > 1 else 0.5
    spans = [(time[first] - half, time[after - 1] - time[first] + 2 * half) for first, after in runs(outside)]
    if spans:
        axes.broken_barh(
            spans, (0.0, 1.0), transform=axes.get_xaxis_transform(), facecolor="#f3d9b8", edgecolor="none", zorder=0
        )


def _inertia(r: AlongFlight, figure: Figure) -> None:
    """Draw the entries of D(q) that depend on attitude: equations (14) and (15)."""
    panels = stacked(figure, len(_INERTIA_PANELS))
    for axes, entries in zip(panels, _INERTIA_PANELS, strict=True):
        for index, entry in enumerate(entries):
            row, column = int(entry[1]) - 1, int(entry[2]) - 1
            line(axes, r.time, r.inertia[:, row, column], label=entry, **style_of(index))
            if r.inertia_low is not None and r.inertia_high is not None:
                low, high = (each[:, row, column] for each in (r.inertia_low, r.inertia_high))
                _shade_band(axes, r.time, low, high, index, f"95 % band of {entry}")
        _shade(axes, r.time, r.extrapolates)
        axes.set_ylabel("kg m²")
        legend_above(axes)
    panels[-1].set_xlabel("time, s")


FIGURES = {
    "figure-7-error": Drawn(
        "Torque error on roll, pitch and yaw over time", 4.6, _error, lambda r: r.error is not None
    ),
    "torques": Drawn("Torque of the model and of the flight over time", 4.8, _torques),
    "forces": Drawn("Force of the model and of the flight over time", 4.8, _forces, lambda r: r.force is not None),
    "inertia-matrix": Drawn("Entries 22, 33, 13 and 23 of the inertia matrix over time", 3.8, _inertia),
}


@stage(
    AlongFlight,
    title="Torque along a flight",
    figures=FIGURES,
    words={"contradicted": contradicted},
    study=True,
)
def predict(run: Run, model: ModelArgument, flight: FlightArgument) -> Parts | None:
    """Predict along a flight, some samples at a time."""
    inputs = run.take({"model": model, "flight": flight})
    with_numbers(run, "predict", model, whole=is_found(model))
    record = any_model(model)
    identified = record if isinstance(record, IdentifiedModel) else None
    wrong = contradictions(check_file(flight, run.study, driven=identified is None))
    known: dict[str, Any] = {
        "seen": seen_words(record, hashes_of(flight, inputs["flight"])),
        "contradictions": tuple(wrong),
    }
    if identified is None:
        predicted, stretches = _of_vehicle(model, flight, run.study), flight_stretches(flight, run.study)
        if run.dry_run:
            predicted(next(iter(stretches)))
            return None
        known |= {
            "begins_s": stretches.begins,
            "warnings": tuple(f"{stretches.name}: {each}" for each in stretches.warnings),
        }
        found = (predicted(stretch).part(stretch.own) for stretch in stretches)
        return _summed(run, found, len(stretches), known)
    functions, draws = identified.functions, identified.uncertainty
    torque = count_rows(flight, Flight, "torque") is not None
    flown = flight_source(flight, torque=torque)
    if run.dry_run:
        return None
    others = (*model_of_another(model, run.study), *other_vehicles([flight], run.study))
    known |= {
        "begins_s": read_first(flight, Flight)[0].begins,
        "condition_number": identified.condition_number if identified.known_everywhere else None,
        "warnings": (*([f"{model.name}: {_UNJUDGED}"] if identified.trust == Trust.NOT_JUDGED else ()), *others),
    }
    chunks = (data[start : start + PART] for data in flown.chunks() for start in range(0, len(data), PART))
    parts = (
        AlongFlight.of(functions, some.time, some.motion, some.torque if torque else None, draws) for some in chunks
    )
    return _summed(run, parts, len(flown), known)


def _summed(run: Run, found: Iterator[AlongFlight], samples: int, known: dict[str, Any]) -> Parts:
    """Give a prediction in parts, each with what is known of all until there."""

    def parts() -> Iterator[AlongFlight]:
        totals = Totals()
        for own in found:
            for start in range(0, len(own.time), PART):
                yield totals.with_next(replace(own.part(slice(start, start + PART)), **known))
                run.progress(totals.samples, samples)

    return Parts(parts(), samples)


def _of_vehicle(path: Path, flight: Path, study: Study) -> Callable[[FlightStretch], AlongFlight]:
    """Predict torque and force on a whole vehicle; they are held against what the motion takes.

    A torque that was logged next to the rotor speeds is taken in its place. A stretch raises an InputError if the
    flight lacks the attitude or a signal that the model needs.
    """
    model, logged = read_model(path, study), torque_source_of(flight, study) == "column"

    def predicted(stretch: FlightStretch) -> AlongFlight:
        (recording,) = of_vehicle([Recording(flight.name, stretch.signals)], model)
        if recording.signals.attitude is None:
            raise InputError(f"{flight}: lacks the attitude; a prediction is in Euler coordinates")
        signals = model.acting(model.repaired(recording.signals))
        wrench = model.wrench_along(signals)
        recorded = stretch.known.get("body_torque") if logged else None
        against = rotation_balance(signals, model.fuzzy).along(signals.time) if recorded is None else recorded
        return replace(
            _prediction(signals, model, wrench[:, :3], against),
            held_against="motion" if recorded is None else "recorded",
            force=wrench[:, 3:],
            measured_force=translation_balance(signals).along(signals.time) if signals.has_force else None,
        )

    return predicted


def _prediction(signals: Signals, model: VehicleModel, body_torque: Array, measured: Array) -> AlongFlight:
    """Arrange torques along a flight with attitude, shape (time, 3) each, N m, body frame."""
    attitude = signals.attitude
    assert attitude is not None, "checked before"
    torque, given = (generalised_torque(attitude, each) for each in (body_torque, measured))
    inertia = _inertia_values(model, attitude)
    return AlongFlight(
        time=signals.time,
        attitude=attitude,
        torque=torque,
        body_torque=body_torque,
        measured_torque=given,
        error=given - torque,
        inertia=inertia.value,
        coriolis=coriolis_matrix(inertia, attitude_rate(attitude, signals.body_rate)),
        extrapolates=np.zeros(len(attitude), dtype=bool) if model.fuzzy is None else model.fuzzy.outside(attitude),
    )


def _inertia_values(model: VehicleModel, attitude: Array) -> InertiaValues:
    if model.fuzzy is not None:
        return model.fuzzy.inertia(attitude)
    tensor = model.body.inertia
    return InertiaValues(inertia_matrix(attitude, tensor), inertia_matrix_gradient(attitude, tensor))
