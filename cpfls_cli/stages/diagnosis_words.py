"""A diagnosis for people and for machines."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from cpfls_cli.gap.diagnose import Diagnosed
from cpfls_cli.gap.evidence import Evidence
from cpfls_cli.gap.results import Diagnosis, Estimate, GapSize, NamedEffect, Unexplained, Verdict
from cpfls_cli.gap.weak_flight import CHANNELS
from cpfls_cli.stages.audit_file import audit_lines, audit_summary
from cpfls_cli.stages.disagreement_words import UNITS, gap_summary, replay_line, replay_summary, unseen_lines

_VERDICTS = {
    Verdict.NAMED: "what is missing has a name and explains the gap",
    Verdict.PARTIAL: "what is named is the closest, and does not explain all of the gap",
    Verdict.AMBIGUOUS: "these flights cannot tell what is named from something else",
    Verdict.UNEXPLAINED: "there is a gap, and nothing in the catalogue explains it",
    Verdict.NO_GAP: "model and flights agree to the noise",
    Verdict.NOT_EXCITED: "these flights move too little to show a gap",
}


def diagnosis_lines(found: Diagnosed, shown: Evidence, split: str) -> list[str]:
    """Say what a model misses.

    Parameters
    ----------
    found : Diagnosed
    shown : Evidence
    split : str

    Returns
    -------
    list of str
    """
    diagnosis = found.diagnosis
    return [
        *headline(diagnosis),
        *(_rival_line(rival.name, rival.instead_of, rival.separated_by) for rival in diagnosis.alternatives),
        *(_unexplained_line(left) for left in diagnosis.unexplained),
        *_levels(diagnosis),
        *gap_lines(diagnosis.before, diagnosis.after),
        replay_line("held out, simulated before", shown.before, shown.held),
        replay_line("held out, simulated after", shown.after, shown.held),
        f"flights: {split}",
        *unseen_lines((each.name, each.reason) for each in diagnosis.not_excited),
        *audit_lines(found.audit),
    ]


def diagnosis_summary(found: Diagnosed, shown: Evidence, split: str) -> dict[str, Any]:
    """Describe a diagnosis for machines.

    Parameters
    ----------
    found : Diagnosed
    shown : Evidence
    split : str

    Returns
    -------
    dict
    """
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
    """Describe a named effect for machines.

    Parameters
    ----------
    effect : NamedEffect

    Returns
    -------
    dict
    """
    return {
        "name": effect.name,
        "coefficients": {c.name: _estimate(c) for c in effect.coefficients},
        "p_value": effect.p_value,
        "share": effect.share,
        "selection_frequency": effect.selection_frequency,
        "sentence": effect.sentence,
    }


def headline(diagnosis: Diagnosis) -> Iterator[str]:
    """Say the verdict and each effect.

    Parameters
    ----------
    diagnosis : Diagnosis

    Yields
    ------
    str
    """
    yield f"{diagnosis.verdict}: {_VERDICTS[diagnosis.verdict]}"
    for effect in diagnosis.effects:
        yield effect_line(effect)
    for effect in diagnosis.closest:
        yield f"closest, but not it: {effect_line(effect)}"


def gap_lines(before: GapSize, after: GapSize) -> Iterator[str]:
    """Say how the gap of each channel shrinks on held-out flights.

    Parameters
    ----------
    before, after : GapSize

    Yields
    ------
    str
    """
    for place, channel in enumerate(CHANNELS):
        if np.isfinite(before.value[place]):
            size = f"{before.value[place]:.3g} -> {after.value[place]:.3g} {UNITS[place]}"
            yield f"held out, {channel}: gap {size}, {before.floors[place]:.2g} -> {after.floors[place]:.2g} floors"


def effect_line(effect: NamedEffect) -> str:
    """Say an effect in one sentence with its numbers.

    Parameters
    ----------
    effect : NamedEffect

    Returns
    -------
    str
    """
    numbers = "; ".join(_coefficient(c) for c in effect.coefficients)
    chance = "p < 1e-6" if effect.p_value < 1e-6 else f"p = {effect.p_value:.2g}"
    return f"{effect.name}: {effect.sentence} {numbers} ({chance}, {effect.share:.0%} of the gap)"


def _coefficient(coefficient: Estimate) -> str:
    unit = "" if coefficient.unit == "1" else f" {coefficient.unit}"
    interval = f"[{coefficient.low:.4g}, {coefficient.high:.4g}]"
    return f"{coefficient.name} = {coefficient.value:.4g} {interval}{unit}"


def _rival_line(name: str, instead_of: str, separated_by: str) -> str:
    return f"could be {name} instead of {instead_of}; to tell: {separated_by}"


def _unexplained_line(left: Unexplained) -> str:
    signal = f", depends on {left.signal} most" if left.signal else ""
    band = f", rings at {left.frequency_hz:.3g} Hz" if left.frequency_hz is not None else ""
    told = f" ({left.share:.0%} of it)" if signal or band else ""
    energy = "" if left.energy == "neither" else f"; it {left.energy} energy"
    return f"unexplained: {left.axis}, {left.floors:.2g} floors{signal}{band}{told}{energy}"


def _levels(diagnosis: Diagnosis) -> Iterator[str]:
    """Explain why torque alone and torque with force give two names, where they do."""
    # Faults of sensors and wrong numbers of the vehicle are told on other grounds.
    named = {effect.name for effect in diagnosis.effects if effect.candidate is not None}
    if not named or not diagnosis.torque_alone or diagnosis.torque_alone[0][0] in named:
        return
    name, share = diagnosis.torque_alone[0]
    yield (
        f"torque alone would say {name} ({share:.0%} of the gap): about the axes it looks the same. The forces tell "
        f"them apart, and with them it is {', '.join(sorted(named))}"
    )


def _estimate(number: Estimate) -> dict[str, Any]:
    return {
        "value": number.value,
        "unit": number.unit,
        "low": number.low,
        "high": number.high,
        "plausible": list(number.plausible),
    }
