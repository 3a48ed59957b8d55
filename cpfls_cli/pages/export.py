"""What `cpfls export` and `cpfls verify-export` say: files, what speaks against a model, how far off it flies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from cpfls_cli.artifacts.identified import IdentifiedRecord
from cpfls_cli.config.load import stored_study
from cpfls_cli.export.holding import Missing
from cpfls_cli.export.registry import TARGETS
from cpfls_cli.export.verify import AGREES, Verification
from cpfls_cli.playback.flight import LoggedFlight
from cpfls_cli.report.content import Block, Table, Text
from cpfls_cli.report.numbers import number

_SCORE_UNITS = {"mse": "(N m)^2", "max_error": "N m", "relative_error": "1", "r2": "1", "vaf": "1", "r2_body": "1"}
_SIGNALS = (
    ("position", "m", 1.0),
    ("velocity", "m/s", 1.0),
    ("attitude", "°", 180 / np.pi),
    ("body rate", "rad/s", 1.0),
)


def export_answer(
    told: Sequence[str], warnings: Sequence[str], sizes: Mapping[str, int], dry_run: bool
) -> Iterator[Text]:
    """Say which files a model was exported to and their bytes, what it is worth, and what speaks against it."""
    verb = "would be written" if dry_run else "written"
    for file, size in sizes.items():
        yield Text(f"{file}: {verb} ({size} bytes)")
    yield from map(Text, told)
    yield from (Text(warning, "warning") for warning in warnings)


def identified_evidence(record: IdentifiedRecord) -> dict[str, Any]:
    """Say the same for machines."""
    verdict, judged = record.verdict, record.judged
    counts = zip(judged.parts, judged.samples, judged.outside, strict=True)
    stated = None
    if verdict is not None and verdict.label is not None:
        reasons = [{"reason": reason, "speaks": float(speaks)} for reason, speaks in verdict.reasons]
        stated = {"label": verdict.label, "region": verdict.region or "", "reasons": reasons}
    return {
        "stop_reason": record.stop_reason or None,
        "verdict": stated,
        "findings": record.findings,
        "judged": {
            "units": _SCORE_UNITS,
            "parts": {part: {"samples": int(samples), "outside": int(outside)} for part, samples, outside in counts},
            "models": {
                model: {
                    part: {measure: judged.of_axes(measure, model, part).tolist() for measure in judged.measures}
                    for part in judged.parts
                }
                for model in judged.models
            },
        },
    }


def identified_warnings(model: IdentifiedRecord, path: object) -> Iterator[str]:
    """Say what speaks against flying with an identified model."""
    if not model.complete:
        yield "the model is incomplete, and marked as such: do not fly with it"
    if model.verdict is None or model.verdict.label is None:
        off = not stored_study(model.origin.config, path).identification.validation.enabled
        why = "identification.validation.enabled was off when it was identified" if off else "it was not validated"
        yield f"{path}: holds no verdict: {why}; nothing says how far to trust it; `cpfls identify` it with it on"
    elif model.verdict.label == "do-not-use":
        against = [reason for reason, speaks in model.verdict.reasons if speaks < 0]
        yield ": ".join([f"{path}: its verdict is do-not-use, exported all the same", *against[:1]])


def verification_answer(form: str, told: Sequence[str], flight: LoggedFlight, found: Verification) -> Iterator[Block]:
    """Say how far the flown export is from its model, what makes the difference, and what the target does not hold."""
    title, step = TARGETS[form].title, TARGETS[form]
    runs = f"{found.windows} runs of {found.horizon_s:.3g} s along {flight.name}"
    verdict = "flies what was exported" if found.agrees else "DOES NOT FLY what was exported"
    yield Text(
        f"{title} {verdict}: {runs}, from measured states along {flight.actuation}; largest difference "
        f"{found.equations.max():.2g} SI{', steps of no length' if step.levels else ''} (bound {AGREES:g}).",
        "good" if found.agrees else "warning",
    )
    rows = [
        ("playback of the model less measured, mean at the end", found.errors[0]),
        (f"{title} less measured, mean at the end", found.errors[1]),
        (f"{title} less playback, mean at the end", found.errors[2]),
        ("of it: not held by the target, largest", found.missing),
        ("of it: step of the target, largest", found.step),
        ("of it: equations, largest", found.equations),
    ]
    header = ("", *(f"{name}, {unit}" for name, unit, _ in _SIGNALS))
    scale = np.array([factor for _, _, factor in _SIGNALS])
    shown = [[name, *(number(value, 3) for value in values * scale)] for name, values in rows]
    yield Table("verification", "", header, shown)
    yield from map(Text, told)
    yield from (Text(warning, "warning") for warning in flight.warnings)


def verification_summary(form: str, missing: Sequence[Missing], found: Verification) -> dict[str, Any]:
    """Say the same for machines, SI."""
    names = [name.replace(" ", "_") for name, _, _ in _SIGNALS]

    def by_signal(values: Any) -> dict[str, float]:
        return dict(zip(names, values.tolist(), strict=True))

    return {
        "format": form,
        "agrees": found.agrees,
        "windows": found.windows,
        "horizon_s": found.horizon_s,
        "playback_error": by_signal(found.errors[0]),
        "target_error": by_signal(found.errors[1]),
        "difference": by_signal(found.errors[2]),
        "largest": {
            "not_held": by_signal(found.missing),
            "step": by_signal(found.step),
            "equations": by_signal(found.equations),
        },
        "missing": [asdict(each) for each in missing],
    }
