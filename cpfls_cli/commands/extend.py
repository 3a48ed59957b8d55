"""Stage `extend`: the model with the effects that it missed in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cpfls_cli.artifacts.audit_file import audit_data, audit_of
from cpfls_cli.artifacts.base_file import base_artifact, base_data, base_model, model_base
from cpfls_cli.artifacts.diagnosis_file import replay_data, shrunk_data
from cpfls_cli.artifacts.effects_file import effects_data, effects_of
from cpfls_cli.artifacts.flights_file import flights_of
from cpfls_cli.artifacts.formats import DIAGNOSIS, EXTENDED
from cpfls_cli.artifacts.job import Job, begin, finish_data
from cpfls_cli.artifacts.store import Artifact
from cpfls_cli.config.study import Study
from cpfls_cli.errors import ComputationError
from cpfls_cli.flights.same_vehicle import require_vehicle_of
from cpfls_cli.flights.sources import read_good
from cpfls_cli.gap.balance.weak_flight import CHANNELS
from cpfls_cli.gap.balance.windows import Recording
from cpfls_cli.gap.extended import Refit, extend, plain, worse_axes
from cpfls_cli.gap.naming.results import GapSize, GapVerdict, NamedEffect
from cpfls_cli.gap.replay import Replayed, replayed
from cpfls_cli.gap.sensors.audit import Audit
from cpfls_cli.inertia import six_parameters
from cpfls_cli.pages.diagnosis_words import effect_line, effect_summary, gap_lines
from cpfls_cli.pages.disagreement_words import gap_summary, replay_lines
from cpfls_cli.report.outcome import Outcome, nothing_written

_EXTENDS = (GapVerdict.NAMED, GapVerdict.PARTIAL, GapVerdict.AMBIGUOUS)


@dataclass(frozen=True)
class Grown:
    """An extension with its sizes on held-out flights."""

    extension: Refit
    study: Study
    before: GapSize
    after: GapSize
    replay_before: Replayed
    replay_after: Replayed
    held: Replayed

    @property
    def data(self) -> dict[str, Any]:
        """Datasets."""
        model, unseen = self.extension.model, self.extension.unseen
        assert model.audit is not None, "an extension repairs what the audit found"
        vehicle = self.study.vehicle
        moments = six_parameters(vehicle.inertia_kg_m2) if model.base is None else np.zeros(6)
        correction = np.array([*model.parameters[:3] * np.array(vehicle.inertia_kg_m2[:3]), 0.0, 0.0, 0.0])
        numbers = {number.name: number for number in self.extension.estimates.parameters}
        return {
            "inertia": moments + correction,
            "thrust_scale": 1.0 + numbers["thrust_scale"].value if "thrust_scale" in numbers else 1.0,
            **effects_data(self.extension.effects, True, numbers, model.parameters),
            **shrunk_data(self.before, self.after, unseen.floor),
            **replay_data(self.replay_before, self.replay_after, self.held),
            **audit_data(model.audit),
        }

    @property
    def lines(self) -> Iterator[str]:
        """The extension for people."""
        yield from (effect_line(effect) for effect in self.extension.effects)
        yield from gap_lines(self.before, self.after)
        yield from replay_lines("held out, simulated before", self.replay_before, self.held)
        yield from replay_lines("held out, simulated after", self.replay_after, self.held)

    @property
    def warnings(self) -> Iterator[str]:
        """Axes that the extension serves ill, although it serves the whole well."""
        for place in worse_axes(self.before.floors, self.after.floors):
            size = f"{self.before.floors[place]:.3g} -> {self.after.floors[place]:.3g} floors"
            yield f"held out, {CHANNELS[place]}: the gap grows, {size}, although the sum over all channels shrinks"

    @property
    def summary(self) -> dict[str, Any]:
        """The extension for machines."""
        return {
            "effects": [effect_summary(effect) for effect in self.extension.effects],
            "gap_before": gap_summary(self.before.value, self.before.floors),
            "gap_after": gap_summary(self.after.value, self.after.floors),
            "warnings": list(self.warnings),
        }


def run(job: Job, diagnosis: Path, model: Path | None) -> Outcome:
    """Put the named effects into a model and write it.

    Parameters
    ----------
    diagnosis : Path
        Holds the flights, the effects and the model that it was made with.
    model : Path or None
        Another identified model to extend.

    Raises
    ------
    ComputationError
        If the diagnosis names nothing, or the gap on the held-out flights does not shrink.
    """
    inputs = begin(job, {"diagnosis": diagnosis} | ({} if model is None else {"model": model}))
    source = read_good(diagnosis, DIAGNOSIS)
    require_vehicle_of(diagnosis, source, job.study)
    base = base_artifact(source) if model is None else model_base(model, job.study)
    effects = named_effects(source)
    if job.dry_run:
        return nothing_written(job)
    flights = (flights_of(source, job.study, "training"), flights_of(source, job.study, "held-out"))
    grown = extended(job.study, *flights, effects, audit_of(source), base, model or diagnosis)
    finish_data(job, EXTENDED, {**grown.data, **base_data(base)}, inputs)
    return Outcome(grown.summary, tuple(grown.lines), tuple(grown.warnings))


def named_effects(diagnosis: Artifact) -> list[NamedEffect]:
    """Take the effects that a diagnosis names.

    Raises
    ------
    ComputationError
        If it names none.
    """
    effects = effects_of(diagnosis)
    verdict = diagnosis.text("verdict")
    named = bool(diagnosis.array("effect/named").all())
    require_named(verdict, effects if named else ())
    return effects


def require_named(verdict: str, effects: Sequence[NamedEffect]) -> None:
    """Refuse a diagnosis that names no effect to add.

    Parameters
    ----------
    effects : sequence of NamedEffect
        Those that it names.

    Raises
    ------
    ComputationError
    """
    if verdict not in _EXTENDS or not effects:
        closest = " (those that it calls closest are not it)" if verdict == GapVerdict.UNEXPLAINED else ""
        raise ComputationError(
            f"not extended: the diagnosis is {verdict} and names no effect that could be added{closest}"
        )


def extended(
    study: Study,
    training: Sequence[Recording],
    held: Sequence[Recording],
    effects: Sequence[NamedEffect],
    audit: Audit,
    base: Artifact | None,
    path: Path,
) -> Grown:
    """Put effects into a model.

    Parameters
    ----------
    base : Artifact or None
        The identified model; None for the rigid body of the vehicle.
    path : Path
        For messages.
    """
    model = base_model(base, path)
    found = extend(training, held, effects, audit, study.gap, model)
    signals = [recording.signals for recording in held]
    errors = [replayed(signals, each, study.gap.horizon) for each in (plain(model), found.model, None)]
    unseen = found.unseen
    return Grown(found, study, unseen.size(unseen.before), unseen.size(unseen.after), *errors)
