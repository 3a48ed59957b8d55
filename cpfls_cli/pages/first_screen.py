"""The first screen of a diagnosis: what is missing, how much, how sure, where, before and after, what to do next."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from cpfls_cli.artifacts.diagnosis import KINDS, DiagnosisRecord
from cpfls_cli.artifacts.disagreement import DisagreementRecord
from cpfls_cli.artifacts.gap_effects import PlaybackChangeGroup, above_noise
from cpfls_cli.artifacts.gap_flights import HELD_OUT, TRAINING
from cpfls_cli.config.load import stored_study
from cpfls_cli.config.unknown import is_of_guesses
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.naming.results import Alternative, GapVerdict
from cpfls_cli.pages.disturbance import beside_gaps, left_to_gusts
from cpfls_cli.pages.effects import (
    closest_sentence,
    effect_title,
    named_sentences,
    share_words,
    titles,
    wrong_numbers,
)
from cpfls_cli.pages.gap import channel_name, channel_unit, channel_words
from cpfls_cli.pages.playback import SIGNALS, WHO
from cpfls_cli.pages.repeats import NO_EFFECT, NOT_SPLIT, again_box
from cpfls_cli.pages.sensors import contradicted
from cpfls_cli.report.content import Block, Box, Cell, Facts, Folded, Table, Text, Tone, in_short
from cpfls_cli.report.numbers import number, plain, sentence
from cpfls_cli.rounding import less
from cpfls_cli.words import capitalised, joined

if TYPE_CHECKING:
    from cpfls_cli.gap.naming.results import Unexplained

_TONES: dict[str, Tone] = {
    GapVerdict.NAMED: "good",
    GapVerdict.NO_GAP: "good",
    GapVerdict.NOT_EXCITED: "note",
    GapVerdict.AMBIGUOUS: "note",
    GapVerdict.PARTIAL: "note",
    GapVerdict.UNEXPLAINED: "warning",
    GapVerdict.CONTRADICTED: "warning",
    GapVerdict.FLIGHTS_DIFFER: "warning",
}
_EFFECTS_SHOWN = 2
_PRINTED = 2
"""Digits of what is played back."""
_VISIBLE = 0.05
"""Share of the error without a model by which a playback has to grow to be called worse."""
_ENERGY = {"feeds": ", feeds energy into the motion", "drains": ", drains energy from the motion"}
_USE = "take the model with it, extended.h5"
_GUSTS = (
    "nothing on the model: what is left is gusts or noise; to see smaller effects, fly in still air or fly more runs"
)
_FORECAST = "it forecasts worse than no model in all that is played back; `cpfls vehicle` looks for one that forecasts"
_PLAN = "`cpfls trajectory CONFIG --for diagnosis.h5 -o path.h5` plans such a flight"
_NEXT: dict[str, str] = {
    GapVerdict.NAMED: _USE,
    GapVerdict.PARTIAL: f"{_USE}; then look at what is left",
    GapVerdict.AMBIGUOUS: f"until then {_USE}",
    GapVerdict.UNEXPLAINED: "look at what is left: its axis, what it follows, whether it feeds or drains energy",
    GapVerdict.FLIGHTS_DIFFER: "find out what changed between the flights; learn from flights of one state",
    GapVerdict.NO_GAP: "nothing, unless you suspect one of the effects that these flights cannot show",
    GapVerdict.NOT_EXCITED: "fly more: roll, pitch and yaw sweeps at two amplitudes, climbs, stops, a yaw turn",
}


def first_screen(record: DiagnosisRecord, index: int) -> Iterator[Block]:
    """Say what a diagnosis found, how sure that is, where, what it becomes on held-out flights, and what to do next."""
    yield verdict_box(record)
    yield Facts(list(_facts(record)))
    yield _held_out_table(record, index)
    yield from _again(record)
    yield from (Text(sentence(remark), "note") for remark in record.remarks)
    yield Facts(list(_beside(record)))


def first_lines(record: DiagnosisRecord, index: int) -> Iterator[Block]:
    """Say the same with what a small screen has no room for folded away."""
    yield from in_short(verdict_box(record), _EFFECTS_SHOWN, "more effects")
    yield Facts(list(_facts(record)))
    for box in _again(record):
        yield from in_short(box, 0, "what comes again, channel by channel")
    remarks = [Text(sentence(remark), "note") for remark in record.remarks]
    rest: list[Block] = [_held_out_table(record, index), *remarks, Facts(list(_beside(record)))]
    yield Folded("held-out flights before and after, and what to know of the verdict", rest)


def _again(record: DiagnosisRecord) -> Iterator[Box]:
    """Say what of the gap comes again, where flights repeat a path."""
    if record.again_before is not None and not record.contradiction:
        yield again_box(record.again_before, record.again_after, model_words(record))


def _shrunk(record: DiagnosisRecord) -> Iterator[tuple[str, str]]:
    """Say in a line what becomes of the held-out gap, in noise floors; of what has none there is nothing to say."""
    gap = record.gap
    changes = [f"{channel_name(gap.channel[channel])} {_floors(record, channel)}" for channel in gap.loud[0]]
    if changes:
        yield "Gap", sentence(f"held out, in noise floors: {', '.join(changes)}")


def _floors(record: DiagnosisRecord, channel: int) -> str:
    before, after = (
        number(float(values[channel]), 2) for values in (record.gap.before_floors, record.gap.after_floors)
    )
    return f"{before} → {after}"


def verdict_box(record: DiagnosisRecord) -> Box:
    """Say what a diagnosis found, and how much of it."""
    named = named_sentences(record.effects.named)
    named += [closest_sentence(effect) for effect in record.effects.closest]
    named += [NO_EFFECT] if record.only_gusts else []
    named = [*_of_model(record), *named]
    label = record.verdict.replace("_", " ")
    return Box(label, _headline(record), named, _TONES.get(record.verdict, "note"))


def _of_model(record: DiagnosisRecord) -> list[str]:
    """Say what speaks first against the model that the gap is one of; of guesses the headline says it."""
    said = [each for each in record.origin.cautions if not is_of_guesses(each)]
    return [f"The gap is that of {said[0].rstrip('.')}."] if said else []


def _headline(record: DiagnosisRecord) -> str:
    if record.contradiction:
        return contradicted(record.contradiction[0])
    match record.verdict:
        case GapVerdict.NO_GAP:
            return f"Nothing is missing that these flights can show{' beside their gusts' if record.gusts else ''}."
        case GapVerdict.NOT_EXCITED:
            return "These flights move too little to show whether anything is missing."
        case GapVerdict.UNEXPLAINED if record.gusts and not record.unexplained.axis:
            return "There may be a gap beside the gusts of these flights; none that could be named."
        case GapVerdict.UNEXPLAINED:
            return "There is a gap that nothing in the catalogue explains."
        case GapVerdict.FLIGHTS_DIFFER:
            return "These flights differ: what shows in some of them does not show in the others."
        case GapVerdict.AMBIGUOUS if record.alternative.name:
            return _ambiguous(record)
    named = " ".join(_blame(record)) or "There is a gap without a name."
    return f"{named} That is the closest, not all of it." if record.verdict == GapVerdict.PARTIAL else named


def _blame(record: DiagnosisRecord) -> Iterator[str]:
    """Say who is at fault: the model, the sensors, or the numbers of the vehicle."""
    # What the audit tests is a fault of the log, clocks among it, whatever it is in a model.
    sensors = [name for name in record.effects.names() if CATALOGUE[name].test is not None]
    missed = [name for name in record.effects_of_motion if name not in sensors]
    if missed:
        yield f"What the model misses is {joined(titles(missed))}."
    if sensors:
        yield f"The sensors are at fault: {joined(titles(sensors))}."
    if record.effects.names("parameter"):
        wrong = list(_wrong(record))
        which = f": {joined(wrong)}" if wrong else ": its inertia or its thrust"
        several = len(wrong_numbers(record.effects)) > 1
        yield f"{'Numbers of the vehicle are' if several else 'A number of the vehicle is'} wrong{which}."


def _wrong(record: DiagnosisRecord) -> Iterator[str]:
    """Say of the wrong numbers how far they are off, and from what: from what was taken where the config has null."""
    vehicle = stored_study(record.origin.config, "the diagnosis").vehicle
    guessed = any(map(is_of_guesses, record.origin.cautions))
    taken = "the guess" if guessed else "the vehicle that was found"
    by_place: dict[str, list[str]] = {}
    for name, words in wrong_numbers(record.effects).items():
        quantity = "thrust_factor" if name == "thrust_scale" else name.rpartition("_")[0]
        by_place.setdefault(taken if quantity in vehicle.unknown else "the config", []).append(words)
    yield from (f"{joined(words)} against {place}" for place, words in by_place.items())


def _ambiguous(record: DiagnosisRecord) -> str:
    rivals = _by_named(record)
    parts = [f"{effect_title(named)} from {joined(others, 'or')}" for named, others in rivals.items()]
    certain = [name for name in record.effects.names() if name not in rivals]
    besides = f" Besides, the model misses {joined(titles(certain))}." if certain else ""
    return f"These flights cannot tell {joined(parts)}.{besides}"


def model_words(record: DiagnosisRecord) -> str:
    """Say what the second model of a diagnosis is."""
    if record.effects.names():
        return f"with {joined(titles(record.effects.names()))}"
    closest = [effect.name for effect in record.effects.closest]
    if closest:
        return f"with the closest effects, {joined(titles(closest))}, which are not the answer"
    return "with nothing but the vehicle's own numbers refitted"


def _facts(record: DiagnosisRecord) -> Iterator[tuple[str, str]]:
    yield from _shrunk(record)
    sure = [sentence(each) for each in (*_taken_off(record), *_rivals(record), *record.contradiction[1:])]
    if sure:
        yield "How sure", " ".join(sure)
    yield from (("Differs", sentence(difference)) for difference in record.difference or ())
    yield "Where", _where(record)
    left = [_unexplained(each) for each in record.unexplained.unexplained()]
    if left:
        yield "Left", sentence(f"in what it was fitted to: {'; '.join(left)}")
    if record.disturbance and record.gusts:
        yield "Gusts", left_to_gusts(record.gusts, record.disturbance.told_by)
    yield "Next", " ".join(next_steps(record))


def _beside(record: DiagnosisRecord) -> Iterator[tuple[str, str]]:
    """Explain the effects, the flights that would tell rivals apart, and which flights were held out and why."""
    for effect in (*record.effects.named, *record.effects.closest):
        yield "What it is", f"{capitalised(effect_title(effect.name))}: {effect.sentence}"
    if record.verdict != GapVerdict.AMBIGUOUS:
        yield from (("To tell", flight) for flight in _telling_flights(record))
    if record.again_before is None and record.largest_gap is not None and not record.gusts:
        yield "Gusts", NOT_SPLIT
    elif record.gusts_beside:
        yield "Gusts", beside_gaps(record.gusts_beside)
    yield "Fitted to", ", ".join(record.flights.names(TRAINING))
    yield "Held out", ", ".join(record.flights.names(HELD_OUT))
    yield "Why", sentence(record.split)


def _taken_off(record: DiagnosisRecord) -> Iterator[str]:
    """Say how much of the gap is gone, and what else would do."""
    share = _gone(record)
    if record.effects.closest:
        yield f"With the closest effects, of the held-out gap above the noise{_beside_numbers(record)}, {share} is gone"
    elif record.effects_of_motion:
        alone = "" if record.alternative.name else "; each rival that could be tried leaves more"
        yield f"Of the held-out gap above the noise{_beside_numbers(record)}, {share} is gone{alone}"
    if record.verdict == GapVerdict.NO_GAP and record.gap.known:
        largest = number(float(record.gap.before_floors[record.gap.known].max()), 2)
        unseen = f"; not ruled out, as listed below: {len(record.not_excited.name)} of the catalogue"
        yield f"The largest gap is {largest} noise floors{unseen if record.not_excited.name else ''}"


def _beside_numbers(record: DiagnosisRecord) -> str:
    """Say that effects are credited with what the vehicle's own numbers, refitted, leave, where these take some off."""
    left, given = (np.sqrt(np.nansum(rows**2, axis=0)) for rows in (record.residual.parameters, record.residual.before))
    takes = (left < (1 - _VISIBLE) * given) & above_noise(record.gap.before_floors)
    return " that is left when the vehicle's own numbers are refitted" if takes.any() else ""


def _gone(record: DiagnosisRecord) -> str:
    """Write the share that is gone: of torque and force each, where both had a gap."""
    if record.shares is None or not np.isfinite(record.shares).all():
        return share_words(record.share)
    return joined(
        f"{share_words(float(share))} of the {kind}" for kind, share in zip(KINDS, record.shares, strict=True)
    )


def _rivals(record: DiagnosisRecord) -> Iterator[str]:
    """Say which effects would explain it as well; AMBIGUOUS says so in its headline."""
    if record.verdict != GapVerdict.AMBIGUOUS:
        for instead_of, rivals in _by_named(record).items():
            yield f"It could be {joined(rivals, 'or')} instead of {effect_title(instead_of)}"


def _by_named(record: DiagnosisRecord) -> dict[str, list[str]]:
    """Gather what people call the rivals of each named effect."""
    rivals: dict[str, list[str]] = {}
    for rival in record.alternative.rows():
        rivals.setdefault(rival.instead_of, []).append(_rival_title(rival))
    return rivals


def _rival_title(rival: Alternative) -> str:
    """Say what people call a rival, with the effect that it needs beside it."""
    return effect_title(rival.name) + (f" with {effect_title(rival.beside)}" if rival.beside else "")


def _where(record: DiagnosisRecord) -> str:
    """Say in which channels the gap is, when it is largest, and how much of the time it is there."""
    largest = record.largest_gap
    if largest is None:
        return "Nowhere above the noise."
    first, *others = largest.channels
    when = f", most from {largest.start_s:.1f} to {largest.end_s:.1f} s of {largest.flight}" if largest.flight else ""
    also = f"; also {joined(others)}" if others else ""
    return sentence(
        f"{channel_words(first)}, above the noise {share_words(largest.share_of_time)} of the time{when}{also}"
    )


def _unexplained(channel: Unexplained) -> str:
    """Say on which axis something is left, and what it follows."""
    follows = [f"follows {channel.signal} most"] if channel.signal else []
    rings = [f"rings at {number(channel.frequency_hz, 3)} Hz"] if channel.frequency_hz is not None else []
    cause = joined([*follows, *rings]) if follows or rings else "follows no one signal"
    share = f" ({share_words(channel.share)} of it)" if follows or rings else ""
    energy = _ENERGY.get(channel.energy, "")
    return f"{channel_words(channel.axis)}, {number(channel.floors, 2)} floors: {cause}{share}{energy}"


def next_steps(record: DiagnosisRecord) -> list[str]:
    """Say what to do next, in sentences."""
    if record.contradiction:
        return ["Correct what is wrong, in the section `import` of the config or in `vehicle`, and run this again."]
    only_gusts = record.only_gusts and record.verdict == GapVerdict.UNEXPLAINED
    only_gusts |= bool(record.gusts) and not record.effects.names() and not record.unexplained.axis
    usual = _GUSTS if only_gusts else _NEXT.get(record.verdict)
    farther = [] if record.playback is None else _farther_off(record.playback)
    if usual and _USE in usual and farther:
        usual = f"leave the model as it is: with what is named, held-out flights play back worse in {joined(farther)}"
    ends = () if record.playback is None else record.playback.at_end.values()
    # A named effect is a fact about the vehicle; whether all of the model forecasts is another question.
    lost = [_FORECAST] if usual and _USE in usual and ends and all(end.worse for end in ends) else []
    first = [f"to tell {flight}" for flight in _telling_flights(record)]
    # A rival that was not tried wants a signal, and two that do what one does another log; else a flight is planned.
    rivals = record.alternative.rows()
    plan = [_PLAN] if any(np.isfinite(rival.relative_gain) and not rival.beside for rival in rivals) else []
    told = [*first, *plan] if record.verdict == GapVerdict.AMBIGUOUS else []
    return [sentence(step) for step in (*told, usual, *lost) if step]


def _telling_flights(record: DiagnosisRecord) -> Iterator[str]:
    for rival in record.alternative.rows():
        yield f"{_rival_title(rival)} from {effect_title(rival.instead_of)}: {rival.separated_by}"


def _held_out_table(record: DiagnosisRecord, index: int) -> Table:
    """Show held-out flights before and after: the gap where there is one, and how far playback is off."""
    loud, quiet = record.gap.loud
    rows = [_gap_row(record, channel) for channel in loud]
    rows += [] if record.playback is None else list(_playback_rows(record.playback))
    within = ", ".join(record.gap.channel[channel] for channel in quiet)
    beside = ", which holds the gusts" if record.gusts else ""
    caption = [
        f"Held-out flights, before and after. To beat: the noise floor{beside}, or no model.",
        "" if record.playback is None else _playback_words(record.playback),
        f"Within the noise: {within}." if within else "",
        "" if record.effects.names() else f"After: {model_words(record)}.",
    ]
    header = ("Held out", "Unit", "Before", "After", "To beat", "That is")
    return Table(f"held-out-{index}", " ".join(filter(None, caption)), header, rows, frozenset({0, 1, 5}))


def _gap_row(record: DiagnosisRecord, channel: int) -> list[str | Cell]:
    gap = record.gap
    name = gap.channel[channel]
    sizes = [number(float(values[channel]), 3) for values in (gap.before, gap.after, gap.floor)]
    grown = bool(gap.grown[channel])
    said = Cell(f"{_floors(record, channel)} floors{', worse' if grown else ''}", "warning" if grown else "plain")
    return [f"gap, {channel_name(name)}", channel_unit(name), *sizes, said]


def _playback_rows(playback: PlaybackChangeGroup) -> Iterator[list[str | Cell]]:
    for signal, end in playback.at_end.items():
        words, unit, scale = SIGNALS[signal]
        values = [number(scale * value, _PRINTED) for value in (end.before, end.after, end.without_model)]
        than = f"{'worse' if end.worse else 'better'} than “{WHO[end.rival]}”"
        yield [f"playback, {words}", unit, *values, Cell(than, "warning" if end.worse else "plain")]


def _farther_off(playback: PlaybackChangeGroup) -> list[str]:
    """List the signals that the model with the effects plays back visibly worse than the model as given."""
    return [
        SIGNALS[signal][0]
        for signal, end in playback.at_end.items()
        if less(end.before + _VISIBLE * end.without_model, end.after)
    ]


def _playback_words(playback: PlaybackChangeGroup) -> str:
    """Say what the playback is, and what of the motion it cannot judge."""
    if not playback.at_end:
        return "The flights show no motion that could be played back."
    lacks = [words for name, (words, _, _) in SIGNALS.items() if name not in playback.by_horizon.signals]
    more = f"; {joined(lacks)} cannot be played back, for lack of signals" if lacks else ""
    return f"Playback: mean error after {plain(round(float(playback.horizon_s[-1]), 3))} s{more}."


def notes_on_flights(records: Sequence[DiagnosisRecord | DisagreementRecord]) -> Iterator[Folded]:
    """Fold what an import and the reading of the flights had to say."""
    notes = list(dict.fromkeys(note for each in records for note in each.warning))
    if notes:
        rows = [[sentence(note)] for note in notes]
        table = Table("flight-notes", "", ("As read and imported",), rows, frozenset({0}), frozenset({0}))
        yield Folded(counted_notes(notes), [table])


def counted_notes(notes: Sequence[str]) -> str:
    """Say how many notes on the flights there are."""
    return f"{len(notes)} note{'' if len(notes) == 1 else 's'} on the flights and their import"
