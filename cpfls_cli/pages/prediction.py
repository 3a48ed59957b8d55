"""The page of a prediction: how well a model explains a flight, where not to trust it; Figure 7 of the paper."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli.arrays import Array, BoolArray, runs
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.prediction import Findings, PredictionRecord
from cpfls_cli.artifacts.spec import Record
from cpfls_cli.identification.scores import AXES
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.trust import seen_words
from cpfls_cli.pages.uncertainty import MISFIT_WORDS, OUTSIDE_WORDS
from cpfls_cli.report.canvas import BASELINE, band, legend_above, line, plot, stacked, style_of
from cpfls_cli.report.content import Block, Heading, Plot, Text
from cpfls_cli.report.numbers import number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_AGAINST = {
    "motion": "what the motion takes with its inertia, noise of the differentiated rates included",
    "recorded": "the torque that was logged",
}
_INERTIA_PANELS = (("D22", "D33"), ("D13", "D23"))


def answer(findings: Findings, model: Record | None = None) -> Iterator[Text]:
    """Say how well a model explains a flight, and where it cannot be trusted.

    Parameters
    ----------
    model : Record or None
        That predicted; None where it is not at hand.
    """
    if findings.held_against is None:
        yield Text(f"{findings.samples} samples, {findings.outside} outside the region that the training data visited")
    else:
        against = _AGAINST[findings.held_against]
        yield Text(f"{findings.samples} samples; torque of the whole vehicle, held against {against}")
    score = findings.score
    if score is None:
        yield Text("the flight holds no torque, so there is no error to show")
    else:
        error = f"MSE {score.mse.mean():.4g} (N m)^2, relative error {score.worst_relative_error:.3%} (worst axis)"
        r2 = " ".join(f"{value:.4f}" for value in score.r2_body)
        without = f" (without {findings.vertical} samples near a vertical pitch)" if findings.vertical else ""
        yield from (Text(error), Text(f"R2 of body torque, roll pitch yaw: {r2}{without}"))
    yield from _errors_of_vehicle(findings)
    yield from trust_along(findings.outside, findings.not_positive_definite, findings.samples, model)


def _errors_of_vehicle(findings: Findings) -> Iterator[Text]:
    """Say how far torque and force of a whole vehicle are off at a sample, and what that does not tell."""
    if findings.held_against is None:
        return
    rows = (("torque about", "N m", findings.body_torque_rms), ("force along", "N", findings.force_rms))
    for name, unit, rms in rows:
        if rms is not None:
            values = " ".join(number(value, 3) for value in rms.tolist())
            yield Text(f"rms error of the {name} x, y, z of the body: {values} {unit}")
    if findings.force_rms is None:
        yield Text("the flight knows neither acceleration nor velocity, so there is no force to hold the model against")
    yield Text("a torque that is right at each sample may still predict nothing; `cpfls replay` says what it predicts")


def trust_along(outside: int, not_positive_definite: int, samples: int, model: Record | None) -> Iterator[Text]:
    """Say what a model is worth at attitudes that training did not visit, and where no body has its D(q).

    Parameters
    ----------
    outside, not_positive_definite : int
        Samples of the flight of which that is true.
    model : Record or None
        The model; None where it is not at hand.
    """
    if outside:
        visited = f"{outside} of {samples} samples lie outside the attitudes that training visited"
        yield Text(f"{visited}: {_outside_words(model)}", "warning")
    if not_positive_definite:
        share = f"{not_positive_definite} of {samples} samples"
        yield Text(f"D(q) is not positive definite at {share}: no body moves like that", "warning")


def _outside_words(model: Record | None) -> str:
    if isinstance(model, IdentifiedModel) and model.known_everywhere:
        condition = number(model.condition_number, 3)
        return (
            "the same coefficients hold there, if the structure does: one rule holds everywhere and all its "
            f"coefficients are known (condition number {condition})"
        )
    return "do not trust it there, the model extrapolates"


def prediction_blocks(prediction: Source[PredictionRecord], index: int, sources: Sources) -> Iterator[Block]:
    """Show a prediction: Figure 7 of the paper."""
    model = sources.by_hash(prediction.made_from("model"))
    yield Heading(prediction.label)
    yield Text(_seen(prediction, model, sources))
    yield from answer(prediction.record.findings, None if model is None else model.record)
    if prediction.record.error is not None:
        yield error_figure(f"figure-7-error-{index}", prediction)
    yield torques_figure(f"torques-{index}", prediction)
    if prediction.record.force is not None:
        yield forces_figure(f"forces-{index}", prediction)
    yield inertia_figure(f"inertia-matrix-{index}", prediction)


def _seen(prediction: Source[PredictionRecord], model: Source | None, sources: Sources) -> str:
    """Tell whether the model has seen the flight before."""
    names = _model_and_flight(prediction)
    if model is None:
        return f"{names}. The model was not given, so it is not known here whether it learned from this flight."
    flight = sources.by_hash(prediction.made_from("flight"))
    hashes = (prediction.made_from("flight"), flight and flight.made_from("log"))
    return f"{names}: {seen_words(model.record, [sha256 for sha256 in hashes if sha256])}."


def _model_and_flight(prediction: Source[PredictionRecord]) -> str:
    return f"{prediction.input_name('model')} along {prediction.input_name('flight')}"


def error_figure(name: str, prediction: Source[PredictionRecord]) -> Plot:
    """Draw the torque error along a flight; samples outside the excited region are shaded.

    Parameters
    ----------
    prediction : Source
        With measured torque.

    References
    ----------
    Figure 7 of the paper.
    """
    time, error, outside = prediction.record.time, prediction.record.error, prediction.record.outside
    assert error is not None, "the flight holds no torque"

    def draw(figure: Figure) -> None:
        panels = stacked(figure, 3)
        for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
            line(axes, time, error[:, index], **style_of(0))
            _shade(axes, time, outside)
            axes.set_title(f"error on {axis}")
            axes.set_ylabel("N m")
        panels[-1].set_xlabel("time, s")

    caption = f"Figure 7. Torque error (flight minus model) of {_model_and_flight(prediction)}.{_shaded(prediction)}"
    return plot(name, caption, "Torque error on roll, pitch and yaw over time", 4.6, draw)


def torques_figure(name: str, prediction: Source[PredictionRecord]) -> Plot:
    """Draw the torque of the model over the torque of the flight."""
    record = prediction.record
    ends = _ends(record.torque_low, record.torque_high)

    def draw(figure: Figure) -> None:
        panels = stacked(figure, 3)
        for index, (axes, axis) in enumerate(zip(panels, AXES, strict=True)):
            if ends:
                low, high = (end[:, index] for end in ends)
                colour = style_of(0)["color"]
                band(axes, record.time, low, high, color=colour, alpha=0.25, label="95 % band of the model")
            line(axes, record.time, record.torque[:, index], label="model", **style_of(0))
            if record.measured_torque is not None:
                line(axes, record.time, record.measured_torque[:, index], label="flight", **BASELINE)
            _shade(axes, record.time, record.outside)
            axes.set_title(f"torque on {axis}", loc="left" if index else "right")
            axes.set_ylabel("N m")
        legend_above(panels[0])
        panels[-1].set_xlabel("time, s")

    banded = ", with the 95 % band of the prediction; a measured torque has its own noise beside it" if ends else ""
    words = f" {OUTSIDE_WORDS} {MISFIT_WORDS}" if ends else ""
    caption = f"Generalised torque of {_model_and_flight(prediction)}{banded}.{_shaded(prediction)}{words}"
    return plot(name, caption, "Torque of the model and of the flight over time", 4.8, draw)


def forces_figure(name: str, prediction: Source[PredictionRecord]) -> Plot:
    """Draw the force of a whole vehicle over what the motion takes."""
    record = prediction.record
    force, measured = record.force, record.measured_force
    assert force is not None, "asked for by the caller"

    def draw(figure: Figure) -> None:
        panels = stacked(figure, 3)
        for index, (axes, axis) in enumerate(zip(panels, "xyz", strict=True)):
            line(axes, record.time, force[:, index], label="model", **style_of(0))
            if measured is not None:
                line(axes, record.time, measured[:, index], label="flight", **BASELINE)
            axes.set_title(f"force along {axis}", loc="left" if index else "right")
            axes.set_ylabel("N")
        legend_above(panels[0])
        panels[-1].set_xlabel("time, s")

    caption = f"Force on the body without weight, body axes, of {_model_and_flight(prediction)}."
    return plot(name, caption, "Force of the model and of the flight over time", 4.8, draw)


def inertia_figure(name: str, prediction: Source[PredictionRecord]) -> Plot:
    """Draw the entries of D(q) that depend on attitude.

    References
    ----------
    Equations (14) and (15).
    """
    record = prediction.record
    ends = _ends(record.inertia_low, record.inertia_high)

    def draw(figure: Figure) -> None:
        panels = stacked(figure, len(_INERTIA_PANELS))
        for axes, entries in zip(panels, _INERTIA_PANELS, strict=True):
            for index, entry in enumerate(entries):
                row, column = int(entry[1]) - 1, int(entry[2]) - 1
                line(axes, record.time, record.inertia[:, row, column], label=entry, **style_of(index))
                if ends:
                    low, high = (end[:, row, column] for end in ends)
                    colour = style_of(index)["color"]
                    band(axes, record.time, low, high, color=colour, alpha=0.22, label=f"95 % band of {entry}")
            _shade(axes, record.time, record.outside)
            axes.set_ylabel("kg m²")
            legend_above(axes)
        panels[-1].set_xlabel("time, s")

    caption = (
        f"Entries of the inertia matrix D(q) of {prediction.input_name('model')} that depend on attitude, along "
        f"{prediction.input_name('flight')}{f', with 95 % bands. {OUTSIDE_WORDS} {MISFIT_WORDS}' if ends else '.'}"
    )
    return plot(name, caption, "Entries 22, 33, 13 and 23 of the inertia matrix over time", 3.8, draw)


def _ends(low: Array | None, high: Array | None) -> tuple[Array, Array] | None:
    """Both ends of a band; None where there is none."""
    return None if low is None or high is None else (low, high)


def _shade(axes: Axes, time: Array, outside: BoolArray) -> None:
    """Shade the samples whose attitude the training data never visited."""
    half = 0.5 * float(np.median(np.diff(time))) if len(time) > 1 else 0.5
    spans = [(time[first] - half, time[after - 1] - time[first] + 2 * half) for first, after in runs(outside)]
    if spans:
        axes.broken_barh(
            spans, (0.0, 1.0), transform=axes.get_xaxis_transform(), facecolor="#f3d9b8", edgecolor="none", zorder=0
        )


def _shaded(prediction: Source[PredictionRecord]) -> str:
    outside, samples = prediction.record.findings.outside, len(prediction.record.time)
    return f" Shaded: {outside} of {samples} samples outside the region that training visited." if outside else ""
