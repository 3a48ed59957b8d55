"""The verdict of a diagnosis in words that a pilot understands."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.gap.naming.results import GapVerdict
from cpfls_cli.pages.gap_words import (
    channel_words,
    effect_title,
    joined,
    known_channels,
    probability,
    titles_of,
    whole_percent,
)
from cpfls_cli.pages.source import Source
from cpfls_cli.report.content import Box, Tone
from cpfls_cli.report.numbers import number

_TONES: dict[str, Tone] = {
    GapVerdict.NAMED: "good",
    GapVerdict.NO_GAP: "good",
    GapVerdict.NOT_EXCITED: "note",
    GapVerdict.AMBIGUOUS: "note",
    GapVerdict.PARTIAL: "note",
    GapVerdict.UNEXPLAINED: "warning",
}
_PHYSICS = ("wrench", "actuator")
_ENERGY = {
    "feeds": "it feeds energy into the motion",
    "drains": "it drains energy from the motion",
}


def verdict_box(diagnosis: Source) -> Box:
    """Say what a diagnosis found."""
    verdict = diagnosis.artifact.text("verdict")
    sentences = [*_named(diagnosis), *rivals(diagnosis), *unexplained(diagnosis), *_shrunk(diagnosis, verdict)]
    return Box(verdict.replace("_", " "), _headline(diagnosis, verdict), sentences, _TONES.get(verdict, "note"))


def rivals(diagnosis: Source) -> Iterator[str]:
    """Say which effects look alike and which flight would tell them apart."""
    artifact = diagnosis.artifact
    columns = (artifact.texts(f"alternative/{key}") for key in ("name", "instead_of", "separated_by"))
    for name, instead_of, flight in zip(*columns, strict=True):
        yield f"It could be {effect_title(name)} instead of {effect_title(instead_of)}. To tell: {flight}."


def unexplained(diagnosis: Source) -> Iterator[str]:
    """Say on which axis something is left, and what it follows."""
    artifact = diagnosis.artifact
    words = (artifact.texts(f"unexplained/{key}") for key in ("axis", "signal", "energy"))
    numbers = (artifact.array(f"unexplained/{key}") for key in ("floors", "share", "frequency"))
    for axis, signal, energy, floors, share, frequency in zip(*words, *numbers, strict=True):
        follows = f"it follows {signal} most" if signal else ""
        rings = f"it rings at {number(frequency, 3)} Hz" if np.isfinite(frequency) else ""
        cause = joined([part for part in (follows, rings) if part]) if follows or rings else "it follows no one signal"
        part = f" ({whole_percent(share)} of it)" if follows or rings else ""
        tail = f"; {_ENERGY[energy]}" if energy in _ENERGY else ""
        yield f"Left unexplained: {channel_words(axis)}, {number(floors, 2)} floors; {cause}{part}{tail}."


def levels(diagnosis: Source) -> str:
    """Explain why torque alone, and torque and force together, name different effects.

    Returns
    -------
    str
        Empty where they agree, or no force is known, or what was named is not physics of the vehicle.
    """
    artifact = diagnosis.artifact
    alone, named = artifact.texts("torque_alone/name"), titles_of(diagnosis, _PHYSICS)
    forces = [channel for _, channel in known_channels(diagnosis, "gap/before") if channel.startswith("force")]
    if not alone or not named or not forces or effect_title(alone[0]) in named:
        return ""
    share = whole_percent(float(artifact.array("torque_alone/share")[0]))
    return (
        f"From the torques alone it would be {effect_title(alone[0])}, which explains {share} of their gap: about the "
        f"body axes the two look alike. What pulls at the hubs or the fuselage also pushes the vehicle, and with the "
        f"forces the flights say {joined(named)}. Without an accelerometer or a velocity, only the first name could be "
        f"given."
    )


def _headline(diagnosis: Source, verdict: str) -> str:
    if verdict == GapVerdict.NO_GAP:
        return "Nothing is missing that these flights can show."
    if verdict == GapVerdict.NOT_EXCITED:
        return "These flights move too little to show whether anything is missing."
    if verdict == GapVerdict.UNEXPLAINED:
        return "There is a gap that nothing in the catalogue explains."
    if verdict == GapVerdict.AMBIGUOUS and len(diagnosis.artifact.texts("alternative/name")):
        return _ambiguous(diagnosis)
    named = " ".join(_blame(diagnosis)) or "There is a gap without a name."
    return f"{named} That is the closest, not all of it." if verdict == GapVerdict.PARTIAL else named


def _blame(diagnosis: Source) -> Iterator[str]:
    """Say who is at fault: the model, the sensors, or the numbers of the vehicle."""
    physics, sensors, numbers = (titles_of(diagnosis, kinds) for kinds in (_PHYSICS, ("sensor",), ("parameter",)))
    if physics:
        yield f"What the model misses is {joined(physics)}."
    if sensors:
        yield f"The sensors are at fault: {joined(sensors)}."
    if numbers:
        yield "A number of the vehicle is wrong: its inertia or its thrust."


def _ambiguous(diagnosis: Source) -> str:
    artifact = diagnosis.artifact
    groups: dict[str, list[str]] = {}
    pairs = zip(artifact.texts("alternative/name"), artifact.texts("alternative/instead_of"), strict=True)
    for name, instead_of in pairs:
        groups.setdefault(effect_title(instead_of), []).append(effect_title(name))
    parts = [f"{kept} from {joined(others, 'or')}" for kept, others in groups.items()]
    others = [title for title in titles_of(diagnosis) if title not in groups]
    besides = f" Besides, the model misses {joined(others)}." if others else ""
    return f"These flights cannot tell {joined(parts)}.{besides}"


def _named(diagnosis: Source) -> Iterator[str]:
    """Describe each effect; where nothing is named, say which was the closest."""
    artifact = diagnosis.artifact
    columns = (artifact.texts("effect/name"), artifact.texts("effect/sentence"))
    for name, sentence, named, p_value in zip(
        *columns, artifact.array("effect/named"), artifact.array("effect/p_value"), strict=True
    ):
        title = effect_title(name)
        if named:
            yield f"{title[0].upper()}{title[1:]}: {sentence}"
        else:
            yield f"The closest was {title}, and that is not it (p {probability(p_value)})."


def _shrunk(diagnosis: Source, verdict: str) -> Iterator[str]:
    artifact = diagnosis.artifact
    before, after = artifact.array("gap/before_floors"), artifact.array("gap/after_floors")
    if not np.isfinite(before).any():
        return
    worst, left = int(np.nanargmax(before)), int(np.nanargmax(after))
    names = [channel_words(channel) for channel in artifact.texts("gap/channel")]
    if verdict in (GapVerdict.NO_GAP, GapVerdict.NOT_EXCITED) or not artifact.array("effect/named").any():
        still = f"; with the closest effects {number(after[left], 2)} are left" if artifact.texts("effect/name") else ""
        size = f"{number(before[worst], 2)} noise floors, in the {names[worst]}"
        yield f"On flights held out, the largest gap is {size}{still}."
        return
    yield (
        f"On flights held out from the fit, the largest gap shrinks from {number(before[worst], 2)} noise floors, "
        f"in the {names[worst]}, to {number(after[left], 2)}, in the {names[left]}. Of what stood above the noise, "
        f"{whole_percent(artifact.number('share'))} is gone."
    )
