"""How far to trust a model: verdict, scores, other structures, evidence for an inertia that depends on attitude."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.pages.evidence import has, validated, verdict_words
from cpfls_cli.pages.figures.ridge import ridge_figure
from cpfls_cli.pages.gap_words import sentence
from cpfls_cli.pages.judged import AXES, MODEL, judged
from cpfls_cli.pages.sections.each import section_of_each
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Block, Box, Cell, Facts, Heading, Section, Table, Text
from cpfls_cli.report.numbers import UNKNOWN, count, number, percent, plain, r_squared

_SPEAKS = {1: "For it", -1: "Against it"}
_ROUNDING = 1e-9
_TIE = 1.0 + 1e-6
_SCORES = ("RMSE, N\N{NO-BREAK SPACE}m", "NRMSE", "R²", "VAF", "Largest, N\N{NO-BREAK SPACE}m", "Relative")


def validation_section(sources: Sources) -> Section | None:
    """Show the verdicts on the models and what they rest on.

    Returns
    -------
    Section or None
        None where no model was given.
    """
    return section_of_each("validation", "How far to trust it", sources.models, _validation)


def _validation(model: Source, index: int) -> Iterator[Block]:
    yield Heading(model.label)
    if has(model, "verdict"):
        yield _verdict(model)
    elif not validated(model):
        yield Text(
            f"{model.label} holds its scores only: no bands, no residuals, no verdict. To add them, identify it again "
            "with identification.validation.enabled: true: cpfls identify CONFIG FLIGHT... -o MODEL --set "
            "identification.validation.enabled=true.",
            "note",
        )
    yield _scores(model, index)
    if has(model, "period"):
        yield _period(model, index)
    if has(model, "physics"):
        yield Facts(_physics(model))
    if "ridge/weight" in model.artifact.data:
        yield Text(ridge_words(model))
        yield ridge_figure(f"ridge-curve-{index}", model)
    if has(model, "structures"):
        yield _structures(model, index)


def _verdict(model: Source) -> Box:
    artifact = model.artifact
    words, tone = verdict_words(model)
    region = artifact.text("verdict/region") if "verdict/region" in artifact.data else ""
    told = (
        zip(artifact.texts("verdict/reason"), artifact.array("verdict/speaks"), strict=True)
        if "verdict/reason" in artifact.data
        else ()
    )
    reasons = [f"{_SPEAKS.get(int(speaks), 'To know')}: {sentence(reason)}" for reason, speaks in told]
    return Box("VERDICT", words, [*([sentence(f"Region: {region}")] if region else []), *reasons], tone)


def _scores(model: Source, index: int) -> Table:
    scores, vaf = judged(model), _vaf(model)
    rows: list[list[str | Cell]] = []
    for place, part in enumerate(scores.parts):
        mse, share = scores.of("mse", MODEL, part), scores.nrmse(MODEL, part)
        for axis, word in enumerate(AXES):
            r2 = float(scores.of("r2", MODEL, part)[axis])
            rows.append(
                [
                    f"{part}, {int(scores.samples[place])} samples" if axis == 0 else "",
                    word,
                    number(float(np.sqrt(mse[axis])), 3),
                    percent(float(share[axis])),
                    Cell(r_squared(r2), "warning" if r2 < 0 else "plain"),
                    UNKNOWN if vaf is None else r_squared(float(vaf[place, axis])),
                    number(float(scores.of("max_error", MODEL, part)[axis]), 3),
                    percent(float(scores.of("relative_error", MODEL, part)[axis])),
                ]
            )
    caption = (
        f"Torque error of {model.label} by part and Euler axis. NRMSE: over the standard deviation of the torque. VAF: "
        "R² without the mean of the error. Relative: largest error over largest torque."
    )
    return Table(f"scores-{index}", caption, ("Part", "Axis", *_SCORES), rows, frozenset({0, 1}))


def _vaf(model: Source) -> np.ndarray | None:
    if "judged/vaf" not in model.artifact.data:
        return None
    return np.asarray(model.artifact.array("judged/vaf")[judged(model).models.index(MODEL)])


def _period(model: Source, index: int) -> Table:
    artifact, scores = model.artifact, judged(model)
    mse, largest = artifact.array("period/mse"), artifact.array("period/max_error")
    rows = [
        [
            part if axis == 0 else "",
            word,
            number(float(np.sqrt(scores.of("mse", MODEL, part)[axis])), 3),
            number(float(np.sqrt(mse[place, axis])), 3),
            number(float(scores.of("max_error", MODEL, part)[axis]), 3),
            number(float(largest[place, axis]), 3),
        ]
        for place, part in enumerate(artifact.texts("period/parts"))
        for axis, word in enumerate(AXES)
    ]
    caption = (
        "The same attitudes, told one turn away in roll and in pitch: no vehicle notices, and a periodic model must "
        "not either. Root mean square and largest error, N m."
    )
    header = ("Part", "Axis", "RMSE here", "RMSE one period away", "Largest here", "Largest one period away")
    return Table(f"period-{index}", caption, header, rows, frozenset({0, 1}))


def _physics(model: Source) -> list[tuple[str, str]]:
    artifact = model.artifact
    cells, indefinite = (int(artifact.number(f"physics/{key}")) for key in ("cells", "indefinite"))
    roll, pitch = np.degrees(artifact.array("physics/worst_attitude"))
    smallest = number(artifact.number("physics/smallest_eigenvalue"), 3)
    definite = "in all" if indefinite == 0 else f"not in {indefinite}"
    energy = artifact.number("physics/energy")
    rounding = " (rounding)" if energy < _ROUNDING else ""
    return [
        ("D(q) positive definite", f"{definite} of {cells} cells of roll and pitch that training visited"),
        ("Its smallest eigenvalue", f"{smallest} kg m², at roll {plain(round(roll))}°, pitch {plain(round(pitch))}°"),
        ("Energy that C(q, qd) makes", f"{number(energy, 2)} of its own terms{rounding}"),
    ]


def ridge_words(model: Source) -> str:
    """Say whether the flight holds evidence for an inertia that depends on attitude beyond a rigid body's.

    Parameters
    ----------
    model : Source
        With a ridge curve.
    """
    weight, error, deviation = (model.artifact.array(f"ridge/{key}") for key in ("weight", "error", "standard_error"))
    off, best = error[np.isinf(weight)], int(np.argmin(error))
    if not off.size:
        return "The curve has no point without the fuzzy part, so it cannot say whether that part helps."
    gain, alone = 1.0 - error[best] / off[0] if off[0] > 0 else 0.0, float(off[0])
    if np.isinf(weight[best]) or gain <= 0:
        return (
            "No fuzzy part does better on blocks that were left out than none: this flight holds no evidence for an "
            "inertia that depends on attitude in another way than a rigid body's does."
        )
    told = f"On blocks that were left out, the best fuzzy part takes {percent(gain)} off the error of the rigid body"
    if alone - error[best] <= deviation[best]:
        return f"{told}, which is within one standard error: the flight holds hardly any evidence for a fuzzy part."
    ratio = (alone - error[best]) / deviation[best] if deviation[best] > 0 else np.inf
    return f"{told}, {number(float(ratio), 2)} standard errors: the flight holds evidence for a fuzzy part."


def _structures(model: Source, index: int) -> Table:
    artifact = model.artifact
    columns = [artifact.array(f"structures/{key}") for key in ("parameters", "error", "standard_error", "ridge_weight")]
    own = artifact.array("structures/own") != 0
    least = _TIE * float(np.min(columns[1]))
    rows: list[list[str | Cell]] = []
    for place, name in enumerate(artifact.texts("structures/name")):
        parameters, error, deviation, weight = (float(column[place]) for column in columns)
        shown = "fuzzy part off" if np.isinf(weight) else number(weight, 2)
        told = f"{number(error, 4)} ± {number(deviation, 2)}"
        best = error <= least
        mark = " ◂ least" if best else ""
        label = f"{name} (this model)" if own[place] else name
        rows.append([label, count(parameters), Cell(told + mark, "good" if best else "plain"), shown])
    caption = (
        "Structures compared by cross-validation over contiguous blocks, without a search: mean squared error of the "
        "scaled torque on the blocks that were left out, ± one standard error. Differences within that are chance."
    )
    header = ("Structure", "Parameters", "Held-out error", "Ridge weight")
    return Table(f"structures-{index}", caption, header, rows, frozenset({0}), frozenset({0}))
