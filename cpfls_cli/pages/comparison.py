"""Models beside each other: their errors on the same data, their inertia, and what their configs differ in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.artifacts.parameters import FOUND_AS, Parameter
from cpfls_cli.artifacts.vehicle_model import Vehicle
from cpfls_cli.config.load import flat_keys
from cpfls_cli.identification.scores import AXES, MODEL, RIGID_BODY, TRAINING
from cpfls_cli.pages.identification import TORQUE
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.trust import model_words, trust_words
from cpfls_cli.pages.uncertainty import compared_curves_figure
from cpfls_cli.report.canvas import GREY, legend_over, plot, style_of
from cpfls_cli.report.content import Block, Cell, Facts, Heading, Plot, Section, Table, Text, Tone
from cpfls_cli.report.numbers import ROUNDING, UNKNOWN, count, number, percent, plain, r_squared
from cpfls_cli.rounding import less
from cpfls_cli.words import joined

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_OVERALL = (
    "Model",
    "Verdict",
    "Parameters",
    "Condition number",
    f"Largest error, {TORQUE}",
    "Relative error, worst axis",
    "R², worst axis",
)
_BY_AXIS = ("Model", *(f"{axis}, {TORQUE}" for axis in AXES))
_SENTENCES = frozenset({0, 1})
_TIE = 1.0 + 1e-6
_MARKERS = ("o", "s", "D", "^", "v", "P")
_DECADE = 10.0
_FLOOR = 1e-9
_FLOOR_TICK = "< 10⁻⁷"
_MOST_KEYS = 30
_LONGEST = 60
_ABSENT = "not there"
# What a page looks like does not change a model.
_LEFT_OUT = ("report",)
BEYOND = "beyond both intervals"

_Model = Source[IdentifiedModel]


@dataclass(frozen=True)
class JudgedOn:
    """One part of the data, and the models that were judged on it: only those can be ranked.

    Attributes
    ----------
    names : tuple of str
        What each model calls it.
    hashes : tuple of str
        Of the flights that it is taken from.
    """

    names: tuple[str, ...]
    hashes: tuple[str, ...]
    models: tuple[_Model, ...]

    @property
    def title(self) -> str:
        """What it is called, with the flights of a part whose name says nothing of them."""
        return " or ".join(dict.fromkeys(self.names))

    @property
    def learned_only(self) -> bool:
        """Whether models learned from this part: errors there are no prediction."""
        return set(self.names) == {TRAINING}

    @property
    def pairs(self) -> list[tuple[_Model, str]]:
        """Each model with what it calls the part."""
        return list(zip(self.models, self.names, strict=True))


def comparison_section(sources: Sources) -> Section | None:
    """Compare the models with each other; None for fewer than two models."""
    models = sources.models
    if len(models) < 2:
        return None
    return Section("comparison", "The models beside each other", [*_tables(models), *_curves(models), *_keys(models)])


def judged_on(models: Sequence[_Model]) -> list[JudgedOn]:
    """Group what models were judged on by the data themselves, not by their names, in the order of appearance."""
    groups: dict[tuple[str, ...], JudgedOn] = {}
    for model in models:
        for name, identity, hashes in _parts(model):
            known = groups.get(identity, JudgedOn((), hashes, ()))
            groups[identity] = JudgedOn((*known.names, name), hashes, (*known.models, model))
    return list(groups.values())


def _parts(model: _Model) -> list[tuple[str, tuple[str, ...], tuple[str, ...]]]:
    """Name each part, what tells it from all others, and the flights that it is taken from."""
    inputs = model.header.inputs
    learned = tuple(file.sha256 for role, file in inputs.items() if role.split("-")[0] == "flight")
    others = sorted((role for role in inputs if role.startswith("validate-")), key=lambda role: int(role.split("-")[1]))
    settings = model.config["identification"]
    split = (f"{settings['training_share']:g}", f"{settings['embargo_s']:g}")
    names = model.record.judged.parts
    of_training = names[: len(names) - len(others)]
    hashes = [(inputs[role].sha256,) for role in others]
    return [(name, (name, *learned, *split), learned) for name in of_training] + [
        (name, sha256, sha256) for name, sha256 in zip(names[len(of_training) :], hashes, strict=True)
    ]


def _tables(models: Sequence[_Model]) -> Iterator[Block]:
    parts = judged_on(models)
    common = [part for part in parts if len(part.models) > 1]
    alone = _alone([part for part in parts if len(part.models) == 1])
    if not common:
        yield Text(f"Judged on different flights, so the errors cannot be ranked: {alone}.", "warning")
        return
    for index, part in enumerate(common, start=1):
        yield _overall(f"comparison-{index}", part)
        yield _by_axis(f"comparison-axes-{index}", part)
    yield compared_errors_figure("comparison-errors", common, models)
    if alone:
        yield Text(f"Judged by itself, so not ranked: {alone}.", "note")


def _alone(parts: Sequence[JudgedOn]) -> str:
    """Say which model was judged on what, each model once."""
    by_label: dict[str, list[JudgedOn]] = {}
    for part in parts:
        by_label.setdefault(part.models[0].label, []).append(part)
    return "; ".join(
        f"{label} on {joined(part.title for part in own)} ({_hashes_words(*(part.hashes for part in own))})"
        for label, own in by_label.items()
    )


def _hashes_words(*flights: Sequence[str]) -> str:
    return "sha256 " + joined(sha256[:12] for hashes in flights for sha256 in hashes)


@dataclass(frozen=True)
class _Line:
    """A row of a table: words, and what is compared, as numbers and as they are shown."""

    words: tuple[str, ...]
    errors: tuple[float, ...]
    shown: tuple[str, ...]


def _overall(name: str, part: JudgedOn) -> Table:
    learned = " They learned from it: these errors are no prediction." if part.learned_only else ""
    caption = (
        f"All on {part.title} ({_hashes_words(part.hashes)}), the same data for all.{learned} Each rigid body was "
        "fitted to what its model learned from. ◂ marks the best of a column, of models and rigid bodies alike."
    )
    lines = [_Line(_words(model), *_worst(model, MODEL, name)) for model, name in part.pairs]
    lines += [
        _Line((label, "", "6", UNKNOWN), *_worst(model, RIGID_BODY, name)) for label, model, name in _bodies(part)
    ]
    return Table(name, caption, _OVERALL, _marked(lines), _SENTENCES, _SENTENCES)


def _by_axis(name: str, part: JudgedOn) -> Table:
    caption = (
        f"The same by axis: root mean square error of the torque on {part.title}, and in brackets over the standard "
        "deviation of the torque. ◂ as above."
    )
    lines = [_Line((model.label,), *_axes(model, MODEL, name)) for model, name in part.pairs]
    lines += [_Line((label,), *_axes(model, RIGID_BODY, name)) for label, model, name in _bodies(part)]
    return Table(name, caption, _BY_AXIS, _marked(lines), frozenset({0}), frozenset({0}))


def _marked(lines: Sequence[_Line]) -> list[list[str | Cell]]:
    # Below rounding nobody is better than another.
    best = np.fmax(np.fmin.reduce([line.errors for line in lines]) * _TIE, ROUNDING)
    return [[*line.words, *map(_cell, line.shown, line.errors, best)] for line in lines]


def _cell(text: str, error: float, least: float) -> Cell:
    return Cell(f"{text} ◂", "good") if error <= least else Cell(text)


def _words(model: _Model) -> tuple[str, ...]:
    record = model.record
    size = (count(record.parameters), number(record.condition_number, 4))
    return (model.label, trust_words(record.trust).short, *size)


def _bodies(part: JudgedOn) -> list[tuple[str, _Model, str]]:
    """Name each rigid body once: models that learned from the same samples have the same."""
    owners: dict[tuple[str, ...], list[tuple[_Model, str]]] = {}
    for model, name in part.pairs:
        shown = (*_worst(model, RIGID_BODY, name)[1], *_axes(model, RIGID_BODY, name)[1])
        owners.setdefault(shown, []).append((model, name))
    if len(owners) == 1:
        return [("rigid body", *part.pairs[0])]
    return [(f"rigid body of {joined(model.label for model, _ in who)}", *who[0]) for who in owners.values()]


def _worst(model: _Model, kind: str, part: str) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Gather what is compared over all axes; R² as what it lacks, so that the least is the best of every column."""
    judged = model.record.judged
    r2 = judged.worst_r2(kind, part)
    largest, relative = float(np.max(judged.of_axes("max_error", kind, part))), judged.worst(kind, part)[0]
    return (largest, relative, 1.0 - r2), (number(largest, 3), percent(relative), r_squared(r2))


def _axes(model: _Model, kind: str, part: str) -> tuple[tuple[float, ...], tuple[str, ...]]:
    judged = model.record.judged
    error, share = np.sqrt(judged.of_axes("mse", kind, part)), judged.nrmse(kind, part)
    shown = (f"{number(float(e), 3)} ({percent(float(s))})" for e, s in zip(error, share, strict=True))
    return tuple(map(float, error)), tuple(shown)


def compared_errors_figure(name: str, parts: Sequence[JudgedOn], models: Sequence[_Model]) -> Plot:
    """Draw the error of every model and its rigid body on the data that several were judged on."""
    titles = [part.title for part in parts]
    shown = [model for model in models if any(model in part.models for part in parts)]

    def draw(figure: Figure) -> None:
        panels = figure.subplots(1, len(AXES), sharey=True)
        for axis, axes in enumerate(panels):
            for kind in (MODEL, RIGID_BODY):
                for index, model in enumerate(shown):
                    offset = (0.5 - (index + 0.5) / len(shown)) * 0.6
                    _draw_errors(axes, *_errors(parts, model, kind, axis), offset, model.label, kind, index)
            axes.set_title(AXES[axis])
            axes.set_yticks(range(len(parts)), titles[::-1])
            axes.set_ylim(-0.6, len(parts) - 0.4)
            axes.grid(visible=False, axis="y")
            axes.tick_params(axis="y", length=0)
            _scale(axes)
        panels[1].set_xlabel("root mean square error over the standard deviation of the torque, %")
        legend_over(figure, panels[0])

    caption = (
        "Errors on the data that two models or more were judged on, by axis. Filled: the models; hollow and grey: the "
        f"rigid body of each, at its height. {_FLOOR_TICK} %: below 1e-9 of the standard deviation of the torque."
    )
    height = 1.3 + 0.16 * len(parts) * (len(shown) + 1.5)
    return plot(name, caption, "Errors of the models and their rigid bodies, by part and axis", height, draw)


def _errors(parts: Sequence[JudgedOn], model: _Model, kind: str, axis: int) -> tuple[list[float], list[float]]:
    """Gather the errors of a model or its rigid body in per cent, and the rows of their parts, from below."""
    errors, rows = [], []
    for row, part in enumerate(parts[::-1]):
        if model in part.models:
            name = part.names[part.models.index(model)]
            share = float(model.record.judged.nrmse(kind, name)[axis])
            errors.append(0.0 if share < _FLOOR else 100 * share)
            rows.append(float(row))
    return errors, rows


def _draw_errors(
    axes: Axes, errors: list[float], rows: list[float], offset: float, label: str, kind: str, index: int
) -> None:
    heights = [row + offset for row in rows]
    mark: dict[str, Any] = {"marker": _MARKERS[index % len(_MARKERS)], "linestyle": "none"}
    if kind == MODEL:
        axes.plot(errors, heights, label=label, color=style_of(index)["color"], markersize=5, **mark)
    else:
        hollow = {**mark, "markersize": 9, "color": GREY, "markerfacecolor": "none", "zorder": 1.9}
        axes.plot(errors, heights, label=f"rigid body of {label}", **hollow)


def _scale(axes: Axes) -> None:
    """Give the errors that can be told apart the whole width; those that are rounding stand at the left end."""
    from matplotlib.ticker import FuncFormatter

    values = np.concatenate([np.asarray(line.get_xdata(), dtype=float) for line in axes.lines])
    known, floored = values[np.isfinite(values) & (values > 0)], bool(np.any(values == 0))
    if not known.size:
        return
    low, high = float(known.min()), float(known.max())
    if high > _DECADE * low:
        axes.set_xscale("symlog", linthresh=0.7 * low, linscale=0.4) if floored else axes.set_xscale("log")
        axes.set_xlim(-0.3 * low if floored else None, 1.6 * high)
    else:
        axes.set_xlim(-0.06 * high if floored else 0.0, 1.1 * high)
    axes.minorticks_off()
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: _tick(value, floored)))


def _tick(value: float, floored: bool) -> str:
    if value < 0:
        return ""
    return _FLOOR_TICK if value == 0 and floored else plain(value, smallest=1e-4)


def _curves(models: Sequence[_Model]) -> Iterator[Block]:
    curves = [(model.label, model.record.curves) for model in models if model.record.curves is not None]
    names = dict.fromkeys(name for _, entries in curves for name in entries.name)
    for index, name in enumerate(names, start=1):
        compared = [(label, entries) for label, entries in curves if name in entries.name]
        if len(compared) > 1:
            yield compared_curves_figure(f"comparison-curves-{index}", compared, name)


def _keys(models: Sequence[_Model]) -> Iterator[Block]:
    differing = differences([model.config for model in models])
    yield Heading("What their configs differ in")
    if not differing:
        yield Text("Nothing: the same config made all of them.")
        return
    rows = [[key, *values] for key, values in differing[:_MOST_KEYS]]
    hidden = len(differing) - _MOST_KEYS
    more = f" {hidden} more keys differ; see the configs under Provenance." if hidden > 0 else ""
    words = frozenset(range(len(models) + 1))
    header = ("Key", *(model.label for model in models))
    yield Table("comparison-keys", f"Keys of the configs that differ.{more}", header, rows, words, words - {0})


def differences(configs: Sequence[Mapping[str, Any]]) -> list[tuple[str, list[str]]]:
    """List the keys whose values differ.

    Parameters
    ----------
    configs : sequence of mapping
        Resolved studies.

    Returns
    -------
    list of (str, list of str)
        Dotted key, and its value in each study; long values are cut.
    """
    told = [{name: own for name, own in config.items() if name not in _LEFT_OUT} for config in configs]
    flat = [dict(flat_keys(config)) for config in told]
    keys = dict.fromkeys(key for one in flat for key in one)
    by_key = {key: [config.get(key, _ABSENT) for config in flat] for key in keys}
    return [(key, list(map(_short, values))) for key, values in by_key.items() if len(set(map(str, values))) > 1]


def _short(value: Any) -> str:
    names = {None: "null", True: "true", False: "false"}
    text = names[value] if value is None or isinstance(value, bool) else str(value)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


def compared_vehicles_section(sources: Sources) -> Section | None:
    """Set the constants of several vehicles side by side; None for fewer than two."""
    vehicles = sources.vehicles
    if len(vehicles) < 2:
        return None
    rows: list[list[str | Cell]] = []
    for constants in _constants(vehicles):
        known = [each for each in constants if each is not None]
        apart = _apart(known)
        tone: Tone = "warning" if apart else "plain"
        values = [Cell(_with_interval(each), tone) for each in constants]
        rows.append([f"{known[0].name}, {known[0].unit}", *values, BEYOND if apart else ""])
    header = ("Constant", *(vehicle.label for vehicle in vehicles), "Differ")
    caption = (
        "Constants with 95 % intervals; in brackets what the flights do not tell. Marked where two of them lie beyond "
        "the intervals of both."
    )
    columns = frozenset(range(len(header)))
    table = Table("vehicles-compared", caption, header, rows, columns, columns - {0})
    return Section("vehicles", "The vehicles side by side", [_judged(vehicles), table])


def differing(sources: Sources) -> tuple[str, ...] | None:
    """Name the constants of vehicles that differ beyond their intervals; None of fewer than two vehicles."""
    if len(sources.vehicles) < 2:
        return None
    listed = ([each for each in constants if each is not None] for constants in _constants(sources.vehicles))
    return tuple(known[0].name for known in listed if _apart(known))


def _judged(models: Sequence[Source[Any]]) -> Facts:
    return Facts([(model.label, model_words(model.record).sentence) for model in models])


def _constants(vehicles: Sequence[Source[Vehicle]]) -> Iterator[list[Parameter | None]]:
    """Give each constant that one vehicle or more has, of all of them."""
    listed = [{key: each for key, each in vehicle.record.parameters.items() if each.needed} for vehicle in vehicles]
    yield from ([own.get(key) for own in listed] for key in FOUND_AS if any(key in own for own in listed))


def _apart(known: Sequence[Parameter]) -> bool:
    """Tell whether two numbers lie beyond the intervals of each other; one that was not fitted is known exactly."""
    spans = [
        (each.value, each.value) if each.low is None or each.high is None else (each.low, each.high)
        for each in known
        if each.value is not None
    ]
    ends = [(low, high) for low, high in spans if low is not None and high is not None]
    return any(bool(less(one[1], two[0])) or bool(less(two[1], one[0])) for one, two in combinations(ends, 2))


def _with_interval(parameter: Parameter | None) -> str:
    if parameter is None or parameter.value is None:
        return UNKNOWN
    value = number(parameter.value, 4)
    if parameter.low is None or parameter.high is None:
        return f"{value} ({parameter.identified})"
    span = f"{value}, {number(parameter.low, 3)} to {number(parameter.high, 3)}"
    return span if parameter.determined else f"({span})"
