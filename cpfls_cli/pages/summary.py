"""The first section of a report: what came out, what to distrust, and what is not shown."""

from __future__ import annotations

from collections.abc import Iterator

from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.flights.flight import Flight, Imported
from cpfls_cli.pages.model import cautions_of
from cpfls_cli.pages.provenance import missing
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.report.content import Block, Section, Text
from cpfls_cli.stage import stage_named


def summary_section(sources: Sources) -> Section:
    """Say in plain words what ran on what and how it ended."""
    blocks: list[Block] = [Text(caution, "warning") for caution in _cautions(sources)]
    blocks += [Text(note, "note") for note in sources.settings.notes]
    judged = [each for each in sources.all if each.sha256 not in sources.answered]
    blocks += [box for source in judged for box in stage_named(source.stage).verdict(source)]
    exact = [model.label for model in sources.models if _learned_without_noise(model, sources)]
    blocks += [Text(f"{label}: {_EXACT}", "note") for label in exact]
    if not sources.models and not sources.only_gap:
        blocks.append(Text("No model was given, so there is nothing to judge yet.", "note"))
    for flight in sources.of_kind(Imported):
        said = (*flight.record.contradictions, *flight.record.warnings)
        blocks += [Text(f"{flight.label}: {warning}.", "warning") for warning in said]
    blocks += [Text(sentence, "note") for sentence in missing(sources).values()]
    return Section("summary", "Summary", blocks)


_EXACT = (
    "The flight is simulated without noise by a rigid body, so six inertia parameters reproduce it up to rounding. No "
    "fuzzy model can beat that here; the row measures how close it comes."
)


def _cautions(sources: Sources) -> Iterator[str]:
    """Say what speaks against models that the artifacts rest on, each once; those on the page say it themselves."""
    shown = {each for source in sources.vehicles for each in cautions_of(source.record, source.label)}
    given = dict.fromkeys(caution for source in sources.all for caution in source.header.cautions)
    yield from (caution for caution in given if caution not in shown)


def _learned_without_noise(model: Source[IdentifiedModel], sources: Sources) -> bool:
    """Tell whether a model's flight is shown that was simulated and to which nothing was added."""
    flight: Source[Flight] | None = sources.by_hash(model.made_from("flight"))
    if flight is None or flight.made_from("trajectory") is None:
        return False
    settings = flight.config["simulation"]
    return not any((*settings["noise"].values(), *settings["relative_noise"].values()))
