"""The first section of a page: what was done, what came out, what to distrust; and each model summarised."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.flights.flight import Flight, Imported
from cpfls_cli.identification.scores import AXES, MODEL, RIGID_BODY, TRAINING, Judged, Winner
from cpfls_cli.pages.identification import scores_table, solution, verdict_line
from cpfls_cli.pages.model import cautions_of
from cpfls_cli.pages.provenance import missing
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.pages.trust import learned_words
from cpfls_cli.report.content import Block, Facts, Heading, Section, Text, Tone
from cpfls_cli.report.numbers import ROUNDING, percent, plain, sentence
from cpfls_cli.stage import stage_named


def summary_section(sources: Sources) -> Section:
    """Say in plain words what ran on what and how it ended."""
    blocks: list[Block] = list(_cautions(sources))
    blocks += [verdict_line(model) for model in sources.models]
    blocks += [Text(note, "note") for note in sources.settings.notes]
    # The verdict on an identified model is a line here.
    told = [each for each in sources.all if each.stage != "identify" and each.sha256 not in sources.answered]
    blocks += [box for source in told for box in stage_named(source.stage).verdict(source)]
    if len(sources.models) == 1:
        blocks += _model(sources.models[0], sources, 1)
    if not sources.models and not sources.only_gap:
        blocks.append(Text("No model was given, so there is nothing to judge yet.", "note"))
    for flight in sources.of_kind(Imported):
        said = (*flight.record.contradictions, *flight.record.warnings)
        blocks += [Text(f"{flight.label}: {warning}.", "warning") for warning in said]
    if len(sources.models) < 2:
        blocks += _missing(sources)
    return Section("summary", "Summary", blocks)


def _cautions(sources: Sources) -> Iterator[Text]:
    """Say what speaks against models that the artifacts rest on, each once; those on the page say it themselves."""
    shown = {each for source in sources.vehicles for each in cautions_of(source.record, source.label)}
    given = dict.fromkeys(caution for source in sources.all for caution in source.header.cautions)
    yield from (Text(caution, "warning") for caution in given if caution not in shown)


def models_section(sources: Sources) -> Section | None:
    """Summarise each model; one alone stands in the summary itself; None for fewer than two models."""
    if len(sources.models) < 2:
        return None
    blocks = [block for index, model in enumerate(sources.models, start=1) for block in _model(model, sources, index)]
    return Section("models", "The models one by one", [*blocks, *_missing(sources)])


def _missing(sources: Sources) -> list[Text]:
    return [Text(sentence, "note") for sentence in missing(sources).values()]


def _model(model: Source[IdentifiedModel], sources: Sources, index: int) -> Iterator[Block]:
    record = model.record
    yield Heading(f"Model {model.label}")
    yield Facts(_facts(model))
    yield from solution(model)
    yield from _beside_rigid_body(model, sources)
    yield scores_table(model, index)
    yield Heading("Findings")
    yield from [Text(sentence(finding), "warning") for finding in record.findings]
    if not record.findings:
        yield Text(
            "None: the rank is full, every rule and every axis is excited, and the rigid body is not better on data "
            "that were held out."
            if record.judged.held_out
            else "None: the rank is full, and every rule and every axis is excited. Nothing more could be checked."
        )


def _facts(model: Source[IdentifiedModel]) -> list[tuple[str, str]]:
    record = model.record
    learned, training = len(record.training_indices), record.judged.samples_of(TRAINING)
    chosen = f", chosen in {model.input_name('selection')}" if model.made_from("selection") else ""
    return [
        ("Learned from", f"{learned_words(record)}: {learned} of {training} training samples{chosen}"),
        ("Structure", _structure(model)),
        ("Parameters", _parameters(record)),
        ("Search", _search(model)),
        ("Made by", f"cpfls {model.header.version}, seed {model.header.seed}"),
    ]


def _structure(model: Source[IdentifiedModel]) -> str:
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


def _parameters(record: IdentifiedModel) -> str:
    fuzzy = f"{len(record.functions.coefficients)} of the fuzzy part"
    if not record.on_rigid_body:
        return fuzzy
    if record.fuzzy_part_off:
        return f"6 of inertia and {fuzzy}, all zero because the fuzzy part is off"
    return f"6 of inertia and {fuzzy}, held by a ridge of {plain(record.ridge_weight)}"


def _search(model: Source[IdentifiedModel]) -> str:
    if not model.record.searched:
        return "no search: one chromosome"
    settings = model.config["identification"]
    number = settings["generations"]
    return f"population {settings['population']}, {number} generation{'' if number == 1 else 's'}"


def _beside_rigid_body(model: Source[IdentifiedModel], sources: Sources) -> Iterator[Text]:
    """Compare a model with the rigid body with six inertia parameters, part by part."""
    judged = model.record.judged
    if model.record.fuzzy_part_off:
        yield Text(
            "Cross-validation switched the fuzzy part off: this model is the rigid body and nothing else. The table "
            "says how well that does.",
            "note",
        )
    else:
        for part in judged.parts:
            winners = judged.winners(part)
            yield Text(_comparison(judged, part, winners), _tone(winners, part))
    if not judged.held_out:
        yield Text(
            "Nothing was held out. These figures say how closely the model fits the flight that it learned from, not "
            "how it predicts another one: give other flights with --validate, or lower identification.training_share.",
            "warning",
        )
    flight = sources.by_hash(model.made_from("flight"))
    if flight is not None and _noise_free(flight):
        yield Text(
            "The flight is simulated without noise by a rigid body, so six inertia parameters reproduce it up to "
            "rounding. No fuzzy model can beat that here; the row measures how close it comes.",
            "note",
        )


def _noise_free(flight: Source[Flight]) -> bool:
    """Tell whether a flight was simulated and nothing was added to it."""
    added = [*flight.config["simulation"]["noise"].values(), *flight.config["simulation"]["relative_noise"].values()]
    return flight.made_from("trajectory") is not None and not any(added)


def _comparison(judged: Judged, part: str, winners: Sequence[Winner]) -> str:
    ours, axis = judged.worst(MODEL, part)
    rigid, rigid_axis = judged.worst(RIGID_BODY, part)
    where = {TRAINING: "In training", "held-out rest": "On the held-out rest"}.get(part, f"On {part}")
    reached = (
        f"{where} ({judged.samples_of(part)} samples) the largest error of the model is {percent(ours)} of the "
        f"largest torque ({axis}, the worst axis); the rigid body with six inertia parameters: {percent(rigid)}"
    )
    other_axis = f" ({rigid_axis})" if rigid > ROUNDING and rigid_axis != axis else ""
    return f"{reached}{other_axis}. {_who_is_better(winners)}"


def _who_is_better(winners: Sequence[Winner]) -> str:
    if len(set(winners)) == 1:
        whole = {
            "model": "By mean squared error the model is better about every axis.",
            "rigid-body": "By mean squared error the rigid body is better about every axis.",
            "tie": "By mean squared error they are equal about every axis.",
        }
        return whole[winners[0]]
    words = {"model": "the model is better about", "rigid-body": "the rigid body about", "tie": "they are equal about"}
    clauses = []
    for winner, clause in words.items():
        axes = [axis for axis, who in zip(AXES, winners, strict=True) if who == winner]
        if axes:
            clauses.append(f"{clause} {' and '.join(axes)}")
    return f"By mean squared error {', '.join(clauses)}."


def _tone(winners: Sequence[Winner], part: str) -> Tone:
    if "rigid-body" in winners:
        return "warning"
    return "good" if "model" in winners and part != TRAINING else "plain"
