"""Pick the samples of flights that are worth learning from."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from cpfls_cli.arguments import TrainingArgument
from cpfls_cli.config.study import generator, settings_of
from cpfls_cli.errors import ComputationError, ConfigError, about
from cpfls_cli.flights.training import flight_roles, split_training, uniform_regressor
from cpfls_cli.reduction.survey import survey
from cpfls_cli.reduction.training_set import Selection, check_streamed, random_streamed, reduce_streamed
from cpfls_cli.report.canvas import BASELINE, Drawn, Figure, legend_above, style_of
from cpfls_cli.report.content import count
from cpfls_cli.rounding import at_most, less
from cpfls_cli.stage import Run, stage

RANDOM_DRAWS = 20


def _draw(r: Selection, figure: Figure) -> None:
    """Draw condition number and extreme singular values after each sample: Figure 5."""
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    size, style = np.arange(1, r.selected + 1), style_of(0)
    label = f"{r.criterion}, {r.selected} samples{', rank deficient' if r.stalled else ''}"
    known = np.where(np.isfinite(r.condition_number_trace), r.condition_number_trace, np.nan)
    upper.plot(size, known, label=label, **style)
    if np.isfinite(r.condition_number_random):
        upper.plot(
            size[-1:], [r.condition_number_random], "x", color=style["color"], markersize=7, label="random choice"
        )
    upper.axhline(r.condition_number_full, label=f"full set, {r.condition_number_full:.0f}", **BASELINE)
    extremes = (r.singular_value_max_trace, "largest", "-"), (r.singular_value_min_trace, "smallest", (0, (4, 1.5)))
    for values, word, dashes in extremes:
        lower.plot(size, np.where(values > 0, values, np.nan), color=style["color"], linestyle=dashes, label=word)
    lower.set_xlabel("selected samples")
    for axes, name in ((upper, "condition number"), (lower, "singular value")):
        axes.set(ylabel=name, yscale="log")
        legend_above(axes, columns=2)


@stage(
    Selection,
    title="Reduced training set",
    figures={"figure-5": Drawn("Condition number over the number of selected samples, on a log scale", 5.0, _draw)},
    words={"at_most": at_most, "less": less, "count": count},
    study=True,
)
def reduce(run: Run, flights: TrainingArgument) -> Selection | None:
    """Select samples of flights; random selections of equal size are drawn for comparison."""
    inputs = run.take(flight_roles(flights))
    split = split_training(flights, run.study, inputs, torque=False)
    settings, rng = run.study.reduction, generator(run.study, "reduce")
    with _naming(flights), settings_of("reduction", run.study):
        surveyed = survey(uniform_regressor(split.training, run.study), settings.rank_tolerance)
        if run.dry_run:
            check_streamed(surveyed, settings, rng)
            return None
        found = reduce_streamed(surveyed, settings, rng, run.progress)
        draws = random_streamed(surveyed, found.selected, RANDOM_DRAWS, rng)
    run.go_on("identify", *flights, "--selection", run.output, output=run.sibling("model.h5"))
    return replace(
        found,
        indices=split.training_indices[found.indices],
        candidates=surveyed.samples,
        random=np.array([factor.condition_number for _, factor in draws]),
    )


@contextmanager
def _naming(flights: Sequence[Path]) -> Iterator[None]:
    names = " ".join(str(path) for path in flights)
    try:
        with about(names, ConfigError, ComputationError):
            yield
    except np.linalg.LinAlgError:
        # Numbers that a damaged file holds, of sizes that overflow in products.
        raise ComputationError(
            f"{names}: the regressor has numbers too far apart in size to choose samples; look at the flight's largest "
            "values with `cpfls info`"
        ) from None
