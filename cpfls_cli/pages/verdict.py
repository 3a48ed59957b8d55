"""The verdict on a model in plain words: what it reaches, and whether it beats the rigid body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from cpfls_cli.pages.judged import AXES, MODEL, RIGID_BODY, TRAINING, Judged, Winner, judged
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Text, Tone
from cpfls_cli.report.numbers import ROUNDING, percent


def verdict(model: Source, sources: Sources) -> Iterator[Text]:
    """Judge one model against the rigid body with six inertia parameters.

    Parameters
    ----------
    sources : Sources
        To learn whether the flight was simulated without noise.
    """
    scores = judged(model)
    if fuzzy_part_off(model):
        yield Text(
            "Cross-validation switched the fuzzy part off: this model is the rigid body and nothing else. The table "
            "says how well that does.",
            "note",
        )
    else:
        for part in scores.parts:
            winners = scores.winners(part)
            yield Text(_sentence(scores, part, winners), _tone(winners, part))
    if scores.parts == [TRAINING]:
        yield Text(
            "Nothing was held out. These figures say how closely the model fits the flight that it learned from, not "
            "how it predicts another one: give other flights with --validate, or lower identification.training_share.",
            "warning",
        )
    flight = sources.by_hash(model.made_from("flight"))
    if flight is not None and noise_free(flight):
        yield Text(
            "The flight is simulated without noise by a rigid body, so six inertia parameters reproduce it up to "
            "rounding. No fuzzy model can beat that here; the row measures how close it comes.",
            "note",
        )


def noise_free(flight: Source) -> bool:
    """Tell whether a flight was simulated and nothing was added to it."""
    added = [*flight.config["simulation"]["noise"].values(), *flight.config["simulation"]["relative_noise"].values()]
    return flight.made_from("trajectory") is not None and not any(added)


def fuzzy_part_off(model: Source) -> bool:
    """Tell whether cross-validation switched the fuzzy part of a model off."""
    return bool(np.isinf(model.artifact.number("model/ridge_weight")))


def _sentence(scores: Judged, part: str, winners: Sequence[Winner]) -> str:
    ours, axis = scores.worst(MODEL, part)
    rigid, rigid_axis = scores.worst(RIGID_BODY, part)
    samples = int(scores.samples[scores.parts.index(part)])
    reached = (
        f"{_where(part)} ({samples} samples) the largest error of the model is {percent(ours)} of the largest torque "
        f"({axis}, the worst axis); the rigid body with six inertia parameters: {percent(rigid)}"
    )
    place = f" ({rigid_axis})" if rigid > ROUNDING and rigid_axis != axis else ""
    return f"{reached}{place}. {_comparison(winners)}"


def _where(part: str) -> str:
    return {TRAINING: "In training", "held-out rest": "On the held-out rest"}.get(part, f"On {part}")


def _comparison(winners: Sequence[Winner]) -> str:
    if len(set(winners)) == 1:
        whole = {
            "model": "By mean squared error the model is better about every axis.",
            "rigid-body": "By mean squared error the rigid body is better about every axis.",
            "tie": "By mean squared error they are equal about every axis.",
        }
        return whole[winners[0]]
    words = {"model": "the model is better about", "rigid-body": "the rigid body about", "tie": "they are equal about"}
    parts = []
    for winner, words_of in words.items():
        axes = [axis for axis, who in zip(AXES, winners, strict=True) if who == winner]
        if axes:
            parts.append(f"{words_of} {' and '.join(axes)}")
    return f"By mean squared error {', '.join(parts)}."


def _tone(winners: Sequence[Winner], part: str) -> Tone:
    if "rigid-body" in winners:
        return "warning"
    return "good" if "model" in winners and part != TRAINING else "plain"
