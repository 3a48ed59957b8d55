"""A diagnosis for people and for machines."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cpfls_cli.artifacts.audit_file import audit_lines, audit_summary
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.before_after import BeforeAfter
from cpfls_cli.gap.diagnose import DiagnosisRun
from cpfls_cli.gap.naming.results import Alternative, Diagnosis, Estimate, GapSize, GapVerdict, NamedEffect, Unexplained
from cpfls_cli.pages.disagreement_words import UNITS, gap_summary, replay_lines, replay_summary, unseen_lines
from cpfls_cli.pages.gap_words import whole_percent
from cpfls_cli.report.numbers import with_interval

_ENERGY = {
    "feeds": "; it feeds energy into the rotation",
    "drains": "; it drains energy from the rotation",
}
_VERDICTS = {
    GapVerdict.NAMED: "what is missing has a name and explains the gap",
    GapVerdict.PARTIAL: "what is named is the closest, and does not explain all of the gap",
    GapVerdict.AMBIGUOUS: "these flights cannot tell what is named from something else",
    GapVerdict.UNEXPLAINED: "there is a gap, and nothing in the catalogue explains it",
    GapVerdict.NO_GAP: "model and flights agree to the noise",
    GapVerdict.NOT_EXCITED: "these flights move too little to show a gap",
}


def diagnosis_lines(found: DiagnosisRun, shown: BeforeAfter, split: str) -> list[str]:
    """Say what a model misses."""
    diagnosis = found.diagnosis
    return [
        *headline(diagnosis),
        *(f"the log looks wrong: {sentence}" for sentence in diagnosis.impossible),
        *(_unexplained_line(left) for left in diagnosis.unexplained),
        *_levels(diagnosis),
        *diagnosis.look_alikes,
        *gap_lines(diagnosis.before, diagnosis.after),
        *replay_lines("held out, simulated before", shown.before, shown.held),
        *replay_lines("held out, simulated after", shown.after, shown.held),
        f"flights: {split}",
        *unseen_lines((each.name, each.reason) for each in diagnosis.not_excited),
        *audit_lines(found.audit),
    ]


def diagnosis_summary(found: DiagnosisRun, shown: BeforeAfter, split: str) -> dict[str, Any]:
    """Describe a diagnosis for machines."""
    diagnosis = found.diagnosis
    return {
        "verdict": str(diagnosis.verdict),
        "share": diagnosis.share,
        "effects": [effect_summary(effect) for effect in diagnosis.effects],
        "closest": [effect_summary(effect) for effect in diagnosis.closest],
        "alternatives": [vars(rival) for rival in diagnosis.alternatives],
        "unexplained": [vars(left) for left in diagnosis.unexplained],
        "not_excited": [vars(each) for each in diagnosis.not_excited],
        "gap_before": gap_summary(diagnosis.before.value, diagnosis.before.floors),
        "gap_after": gap_summary(diagnosis.after.value, diagnosis.after.floors),
        "replay": replay_summary(shown.held, before=shown.before, after=shown.after, held=shown.held),
        "whiteness": {
            "p_value_before": shown.white_before.p_value.tolist(),
            "p_value_after": shown.white_after.p_value.tolist(),
        },
        "torque_alone": [{"name": name, "share": share} for name, share in diagnosis.torque_alone],
        "audit": audit_summary(found.audit),
        "parameters": {name: _estimate(number) for name, number in diagnosis.parameters.items()},
        "split": split,
        "notes": list(diagnosis.notes),
    }


def effect_summary(effect: NamedEffect) -> dict[str, Any]:
    """Describe a named effect for machines."""
    return {
        "name": effect.name,
        "coefficients": {c.name: _estimate(c) for c in effect.coefficients},
        "p_value": effect.p_value,
        "share": effect.share,
        "selection_frequency": effect.selection_frequency,
        "sentence": effect.sentence,
    }


def headline(diagnosis: Diagnosis) -> Iterator[str]:
    """Say the verdict and each effect; before them the flight that would tell, where the verdict hangs on it."""
    yield f"{diagnosis.verdict}: {_VERDICTS[diagnosis.verdict]}"
    rivals = [_rival_line(rival) for rival in diagnosis.alternatives]
    ambiguous = diagnosis.verdict is GapVerdict.AMBIGUOUS
    yield from rivals if ambiguous else []
    for effect in diagnosis.effects:
        yield effect_line(effect)
    for effect in diagnosis.closest:
        yield f"closest, but not it: {effect_line(effect)}"
    yield from [] if ambiguous else rivals


def gap_lines(before: GapSize, after: GapSize) -> Iterator[str]:
    """Say how the gap of each channel shrinks on held-out flights."""
    for place, channel in enumerate(CHANNELS):
        if np.isfinite(before.value[place]):
            size = f"{before.value[place]:.3g} -> {after.value[place]:.3g} {UNITS[place]}"
            yield f"held out, {channel}: gap {size}, {before.floors[place]:.2g} -> {after.floors[place]:.2g} floors"


def effect_line(effect: NamedEffect) -> str:
    """Say an effect in one sentence with its numbers."""
    numbers = "; ".join(_coefficient(c) for c in effect.coefficients)
    chance = "p < 1e-6" if effect.p_value < 1e-6 else f"p = {effect.p_value:.2g}"
    return f"{effect.name}: {effect.sentence} {numbers} ({chance}, {_share_words(effect.share)} of the gap)"


def _coefficient(coefficient: Estimate) -> str:
    unit = "" if coefficient.unit == "1" else f" {coefficient.unit}"
    value, low, high = with_interval(coefficient.value, coefficient.low, coefficient.high)
    return f"{coefficient.name} = {value} [{low}, {high}]{unit}"


def _share_words(share: float) -> str:
    """Write a share in whole per cent; what rounding alone would make nothing or all of it is not called so."""
    return whole_percent(share).replace("> ", "more than ").replace("< ", "less than ")


def _rival_line(rival: Alternative) -> str:
    return f"could be {rival.name} instead of {rival.instead_of}; to tell: {rival.separated_by}"


def _unexplained_line(left: Unexplained) -> str:
    signal = f", depends on {left.signal} most" if left.signal else ""
    band = f", rings at {left.frequency_hz:.3g} Hz" if left.frequency_hz is not None else ""
    told = f" ({_share_words(left.share)} of it)" if signal or band else ", depends on no one signal"
    energy = _ENERGY.get(left.energy, "")
    return f"unexplained: {left.axis}, {left.floors:.2g} floors{signal}{band}{told}{energy}"


def _levels(diagnosis: Diagnosis) -> Iterator[str]:
    """Explain why torque alone and torque with force give two names, where they do."""
    # Faults of sensors and wrong numbers of the vehicle are told on other grounds.
    named = {effect.name for effect in diagnosis.effects if effect.candidate is not None}
    forces = np.isfinite(diagnosis.before.value[3:]).any()
    if not forces or not named or not diagnosis.torque_alone or diagnosis.torque_alone[0][0] in named:
        return
    name, share = diagnosis.torque_alone[0]
    yield (
        f"torque alone would say {name} ({_share_words(share)} of the gap): about the axes it looks the same. "
        f"The forces tell them apart, and with them it is {', '.join(sorted(named))}"
    )


def _estimate(number: Estimate) -> dict[str, Any]:
    return {
        "value": number.value,
        "unit": number.unit,
        "low": number.low,
        "high": number.high,
        "plausible": list(number.plausible),
    }
