"""Identify with several settings, and with several seeds each."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli.arguments import (
    ChooseOnOption,
    ResumeSweepOption,
    SchedulerOption,
    SweepTimeLimitOption,
    TrainingArgument,
    ValidateOption,
    WorkersOption,
)
from cpfls_cli.arrays import Array
from cpfls_cli.artifacts.job import check_outputs, origin_before
from cpfls_cli.flights.inputs import input_roles
from cpfls_cli.flights.same_vehicle import other_vehicles
from cpfls_cli.identification.replicates import Spread, Sweep, spread
from cpfls_cli.identification.search import is_end
from cpfls_cli.report.canvas import Drawn, plain_ticks, style_of
from cpfls_cli.report.numbers import UNKNOWN, number
from cpfls_cli.report.source import Source
from cpfls_cli.search.resumable import SearchOptions, Watch
from cpfls_cli.search.sweep_runs import PartialSweep, finish_runs, sweep_plan
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages._stopped import stop_note

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_DECADE = 10.0
_TICKS = 4


def _draw(r: Sweep, figure: Figure) -> None:
    """Draw mean squared error and condition number of every run, in a row for each setting."""
    panels = figure.subplots(1, 2, sharey=True)
    upwards = r.settings[::-1]
    panels[0].set_yticks(range(len(upwards)), [setting.name for setting in upwards])
    panels[0].set_ylim(-0.6, len(upwards) - 0.4)
    for axes, name, words in zip(panels, ("mse", "condition_number"), ("MSE, (N m)²", "condition number"), strict=True):
        for row, setting in enumerate(upwards):
            _dots(axes, row, setting.of(name))
        axes.set_xlabel(words)
        axes.grid(visible=False, axis="y")
        axes.tick_params(axis="y", length=0)
        _scale(axes)


def _dots(axes: Axes, row: int, values: Array) -> None:
    """Draw runs side by side in their order, so that equal values do not hide each other."""
    offsets = np.linspace(0.22, -0.22, len(values)) if len(values) > 1 else np.zeros(len(values))
    axes.plot(values, row + offsets, "o", markersize=4.5, markerfacecolor="none", color=style_of(0)["color"])
    mean = spread(values).mean
    if np.isfinite(mean):
        axes.vlines(mean, row - 0.34, row + 0.34, color="black", linewidth=2.2, zorder=1)


def _scale(axes: Axes) -> None:
    """Take a logarithmic scale where values differ by more than a decade."""
    from matplotlib.ticker import MaxNLocator

    values = np.concatenate([line.get_xdata() for line in axes.lines]) if axes.lines else np.zeros(0)
    known = values[np.isfinite(values) & (values > 0)]
    if len(known) and known.max() > _DECADE * known.min():
        axes.set_xscale("log")
    else:
        axes.xaxis.set_major_locator(MaxNLocator(_TICKS))
        plain_ticks(axes.xaxis)


def joined_sweeps(sweeps: Sequence[Source[Sweep]]) -> list[Source[Sweep]]:
    """Take sweeps of equal settings and inputs as one, in the order of the first of each, unless they share a seed."""
    joined: list[Source[Sweep]] = []
    for sweep in sweeps:
        both = ((index, _joined(other, sweep)) for index, other in enumerate(joined))
        index, one = next(((index, one) for index, one in both if one is not None), (None, None))
        if index is None or one is None:
            joined.append(sweep)
        else:
            joined[index] = one
    return joined


def _joined(first: Source[Sweep], second: Source[Sweep]) -> Source[Sweep] | None:
    one, two = (sorted((role, file.sha256) for role, file in own.header.inputs.items()) for own in (first, second))
    sweep = first.record.joined(second.record) if one == two else None
    if sweep is None:
        return None
    seeds = sum(int(own.config["sweep"]["seeds"]) for own in (first, second))
    config = {**first.config, "sweep": {**first.config["sweep"], "seeds": seeds}}
    began = min(int(own.header.seed or 0) for own in (first, second))
    label = f"{first.label} and {second.label}"
    return replace(first, label=label, record=sweep, config=config, header=replace(first.header, seed=began))


def _mean(values: Spread, digits: int = 3) -> str:
    return number(values.mean, digits)


def _deviation(values: Spread) -> str:
    return number(values.standard_deviation, 2)


def _both(values: Spread) -> str:
    return _mean(values) if np.isnan(values.variance) else f"{_mean(values)} ± {_deviation(values)}"


def _best(r: Sweep, name: str) -> list[str]:
    """Give a number of the best run of each setting, on the training part."""
    runs = (setting.best for setting in r.settings)
    return [UNKNOWN if run is None else number(np.atleast_1d(getattr(run, name))[0], 3) for run in runs]


@stage(
    Sweep,
    title="Replicates of the search",
    figures={
        "replicates": Drawn(
            "Mean squared error and condition number by setting, one circle for each seed",
            lambda r: 0.9 + 0.36 * len(r.settings),
            _draw,
        )
    },
    words={"mean": _mean, "deviation": _deviation, "both": _both, "best": _best},
    study=True,
    resumes=True,
    together=joined_sweeps,
)
def sweep(
    run: Run,
    flights: TrainingArgument,
    validate: ValidateOption = None,
    choose_on: ChooseOnOption = None,
    resume: ResumeSweepOption = False,
    time_limit: SweepTimeLimitOption = None,
    workers: WorkersOption = 1,
    scheduler: SchedulerOption = None,
) -> Sweep | None:
    """Run every setting of a sweep with every seed."""
    options = SearchOptions(resume, time_limit, workers, scheduler)
    options.require_workers()
    judged, kept = validate or [], choose_on or []
    inputs = run.take(input_roles(flights, None, judged, kept))
    partial = PartialSweep.beside(run.output, origin_before(run.study, inputs, "sweep"))
    before = partial.take_up(resume=resume, force=run.force)
    check_outputs(run, run.output, replaceable=resume and partial.output_may_be_replaced())
    plan = sweep_plan(run, flights, judged, inputs, kept)
    for sentence in other_vehicles([*kept, *judged], run.study):
        run.note(sentence)
    if run.dry_run:
        return None
    clock, watch = time.perf_counter(), Watch(run, time_limit)
    run.until_written.enter_context(partial.kept())
    found, reason = finish_runs(run, plan, partial.begin(plan, before), partial, options, watch)
    if is_end(reason):
        run.afterwards.append(partial.remove)
    run.also = {"runs_in_all": plan.runs, "seconds": round(time.perf_counter() - clock, 3)}
    run.next.append(("cpfls", "report", run.config, run.output, "-o", run.beside("report.html")))
    note, run.exit_code = stop_note(reason, watch.signal, run.output)
    run.said += [note] if note else []
    return found
