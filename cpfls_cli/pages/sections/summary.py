"""The first section: what was done, what came out, what to distrust."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.pages.evidence import complete, has, verdict_words
from cpfls_cli.pages.judged import AXES, MODEL, RIGID_BODY, Judged, judged
from cpfls_cli.pages.missing import missing
from cpfls_cli.pages.sections.gap_summary import gap_blocks
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.verdict import fuzzy_part_off, verdict
from cpfls_cli.report.content import Block, Cell, Facts, Heading, Section, Table, Text
from cpfls_cli.report.numbers import ROUNDING, count, percent, plain, r_squared

_SHOWN = {MODEL: "model", RIGID_BODY: "rigid body", "uniform-partitions": "no search: uniform partitions"}


def summary_section(sources: Sources) -> Section:
    """Say in plain words what ran on what and how it ended."""
    blocks: list[Block] = [_line(model) for model in sources.models]
    blocks += [Text(note, "note") for note in sources.settings.notes]
    blocks += gap_blocks(sources)
    if len(sources.models) == 1:
        blocks += _model(sources.models[0], sources, 1)
    if not sources.models and not sources.only_gap:
        blocks.append(Text("No model was given, so there is nothing to judge yet.", "note"))
    for flight in sources.flights:
        blocks += _flight_warnings(flight)
    if len(sources.models) < 2:
        blocks += _missing(sources)
    return Section("summary", "Summary", blocks)


def models_section(sources: Sources) -> Section | None:
    """Summarise each model; one alone stands in the summary itself.

    Returns
    -------
    Section or None
        None for fewer than two models.
    """
    if len(sources.models) < 2:
        return None
    blocks = [block for index, model in enumerate(sources.models, start=1) for block in _model(model, sources, index)]
    return Section("models", "The models one by one", [*blocks, *_missing(sources)])


def _missing(sources: Sources) -> list[Text]:
    return [Text(sentence, "note") for sentence in missing(sources).values()]


def _line(model: Source) -> Text:
    """Say the verdict on a model in one line."""
    if not complete(model):
        reason = model.artifact.text("search/stop_reason") if "search/stop_reason" in model.artifact.data else "stopped"
        incomplete = f" The search is incomplete ({reason}): this is the best so far, and --resume goes on."
    else:
        incomplete = ""
    if not has(model, "verdict"):
        told = "no verdict, because the evidence was not gathered (identification.validation.enabled)"
        return Text(f"{model.label}: {told}.{incomplete}", "warning" if incomplete else "note")
    words, tone = verdict_words(model)
    region = model.artifact.text("verdict/region") if "verdict/region" in model.artifact.data else ""
    where = f" Region: {region.rstrip('.')}." if region else ""
    return Text(f"{model.label}: {words}.{where}{incomplete}", "warning" if incomplete else tone)


def _model(model: Source, sources: Sources, number: int) -> Iterator[Block]:
    yield Heading(f"Model {model.label}")
    yield Facts(_facts(model))
    yield from verdict(model, sources)
    yield _scores(model, number)
    found = model.artifact.texts("findings")
    yield Heading("Findings")
    yield from [Text(f"{finding}.", "warning") for finding in found]
    if not found:
        yield Text(
            "None: the rank is full, every rule and every axis is excited, and the rigid body is not better on data "
            "that were held out."
            if len(model.artifact.texts("judged/parts")) > 1
            else "None: the rank is full, and every rule and every axis is excited. Nothing more could be checked."
        )


def _facts(model: Source) -> list[tuple[str, str]]:
    artifact = model.artifact
    learned = len(artifact.array("training/indices"))
    training = int(artifact.array("judged/samples")[0])
    source = artifact.header.inputs.get("flight")
    flight = f"{source.name} (sha256 {source.sha256[:12]})" if source else "unknown"
    chosen = f", chosen in {model.input_name('selection')}" if model.made_from("selection") else ""
    return [
        ("Learned from", f"{flight}: {learned} of {training} training samples{chosen}"),
        ("Structure", structure(model)),
        ("Parameters", parameters(model)),
        ("Search", _search(model)),
        ("Made by", f"cpfls {artifact.header.version}, seed {artifact.header.seed}"),
    ]


def _search(model: Source) -> str:
    if not model.searched:
        return "no search: one chromosome"
    settings = model.config["identification"]
    number = settings["generations"]
    return f"population {settings['population']}, {number} generation{'' if number == 1 else 's'}"


def structure(model: Source) -> str:
    """Describe the structure of a model in words."""
    settings = model.config["identification"]
    kind = {"cpfls": "continuous periodic fuzzy system", "fls": "classic TSK fuzzy system"}[settings["structure"]]
    functions = settings["membership_functions"]
    counted = f"{functions}" if isinstance(functions, int) else ", ".join(str(n) for n in functions)
    order = f" of order {settings['harmonic_order']}" if settings["consequents"] == "harmonic" else ""
    base = "on a rigid body" if settings["base"] == "rigid-body" else "alone, without a rigid body underneath"
    noun = "function" if counted == "1" else "functions"
    return (
        f"{kind} {base}; {counted} membership {noun} per input, input map {settings['input_map']}, "
        f"{settings['consequents']} consequents{order} ({settings['products']})"
    )


def parameters(model: Source) -> str:
    """Count the parameters of a model in words."""
    artifact = model.artifact
    fuzzy = count(len(artifact.array("model/coefficients")))
    if artifact.text("model/base") != "rigid-body":
        return f"{fuzzy} linear parameters, rank {count(artifact.number('solve/rank'))}"
    off = ", all zero because the fuzzy part is off" if fuzzy_part_off(model) else ""
    held = f", held by a ridge of {plain(artifact.number('model/ridge_weight'))}" if not off else ""
    return f"6 of inertia and {fuzzy} of the fuzzy part{off}{held}"


def _scores(model: Source, number: int) -> Table:
    scores = judged(model)
    return Table(
        f"headline-{number}",
        f"{model.label} beside the rigid body with six inertia parameters, and where there is something to search for, "
        "beside the same structure without a search. Relative error: largest error over largest torque, worst axis. "
        "R²: share of the variance of the body torque explained.",
        ("Judged on", "Model", "Relative error", *(f"R² {axis}" for axis in AXES)),
        [row for part in scores.parts for row in _rows(scores, part)],
        frozenset({0, 1}),
    )


def _rows(scores: Judged, part: str) -> Iterator[list[str | Cell]]:
    for name, shown in _SHOWN.items():
        if name not in scores.models:
            continue
        relative, axis = scores.worst(name, part)
        r2 = [Cell(r_squared(value), "warning" if value < 0 else "plain") for value in scores.of("r2_body", name, part)]
        worst = f"{percent(relative)} ({axis})" if relative > ROUNDING else percent(relative)
        yield [part if name == MODEL else "", shown, worst, *r2]


def _flight_warnings(flight: Source) -> Iterator[Block]:
    if "quality/warning" in flight.artifact.data:
        for warning in flight.artifact.texts("quality/warning"):
            yield Text(f"{flight.label}: {warning}.", "warning")
