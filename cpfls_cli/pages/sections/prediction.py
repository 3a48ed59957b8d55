"""Figure 7: models along flights."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.artifacts.formats import MODEL
from cpfls_cli.pages.figures.inertia import inertia_figure
from cpfls_cli.pages.figures.prediction import error_figure, torques_figure
from cpfls_cli.pages.source import Source, Sources, section_of_each
from cpfls_cli.report.content import Block, Heading, Section, Text


def prediction_section(sources: Sources) -> Section | None:
    """Show the predictions.

    Returns
    -------
    Section or None
        None where no prediction was given.

    References
    ----------
    Figure 7 of the paper.
    """
    return section_of_each(
        "prediction",
        "Torque along a flight",
        sources.predictions,
        lambda given, index: _prediction(given, index, sources),
    )


def _prediction(prediction: Source, index: int, sources: Sources) -> Iterator[Block]:
    artifact = prediction.artifact
    yield Heading(prediction.label)
    yield Text(_seen(prediction, sources))
    outside, samples = int(np.sum(artifact.array("outside") != 0)), len(artifact.array("time"))
    if outside:
        visited = f"{outside} of {samples} samples lie outside the attitudes that training visited"
        model = sources.by_hash(prediction.made_from("model"))
        if model is not None and model.artifact.spec == MODEL and model.record.known_everywhere:
            known = "one rule holds everywhere and all its coefficients are known"
            yield Text(f"{visited}: {known}, so it holds there too, if the structure does.", "note")
        else:
            yield Text(f"{visited}: the model extrapolates there.", "warning")
    if "error" in artifact.data:
        yield error_figure(f"figure-7-error-{index}", prediction)
    else:
        yield Text("The flight holds no torque, so there is no error to show.", "note")
    yield torques_figure(f"torques-{index}", prediction)
    yield inertia_figure(f"inertia-matrix-{index}", prediction)


def _seen(prediction: Source, sources: Sources) -> str:
    """Tell whether the model has seen the flight before."""
    model = sources.by_hash(prediction.made_from("model"))
    names = f"{prediction.input_name('model')} along {prediction.input_name('flight')}"
    if model is None:
        return f"{names}. The model was not given, so it is not known here whether it learned from this flight."
    if model.made_from("flight") == prediction.made_from("flight"):
        samples, training = len(prediction.artifact.array("time")), int(model.artifact.array("judged/samples")[0])
        part = "" if training == samples else f" (its first {training} of {samples} samples; the rest was held out)"
        return f"{names}: the flight that it learned from{part}."
    return f"{names}: a flight that it did not learn from."
