"""Put the named effects into the model, and show that the gap shrinks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from cpfls_cli.arguments import DiagnosisArgument, ModelOption
from cpfls_cli.artifacts.diagnosis import Diagnosis, Extended
from cpfls_cli.artifacts.model import as_inputs, joined_flights
from cpfls_cli.config.study import Study
from cpfls_cli.effects.registry import effect
from cpfls_cli.effects.signals import HELD_OUT, TRAINING, Signals, in_roles
from cpfls_cli.errors import ComputationError
from cpfls_cli.flights.models import learned_by, read_base
from cpfls_cli.flights.same_vehicle import read_result_of_vehicle
from cpfls_cli.gap.before_after import PlaybackChange, errors_by_horizon, left_out, played_pairs, rates_fade
from cpfls_cli.gap.extended import extend as refitted
from cpfls_cli.gap.extended import plain
from cpfls_cli.gap.naming.causes import all_numbers
from cpfls_cli.gap.naming.results import NAMES_EFFECTS, GapChange, GapVerdict, NamedEffect
from cpfls_cli.gap.whole_vehicle import (
    above_thrust,
    on_top_of,
    require_body,
    thrust_put_in,
    whole_vehicle,
    with_known_wrench,
)
from cpfls_cli.inertia import six_parameters
from cpfls_cli.pages.gap import intervals_drawn, sizes_drawn
from cpfls_cli.pages.gap_words import GAP_WORDS, playback_drawn
from cpfls_cli.pages.model import WORDS as MODEL_WORDS
from cpfls_cli.pages.playback import WORDS as PLAYBACK_WORDS
from cpfls_cli.playback.model import VehicleModel
from cpfls_cli.stage import Run, stage
from cpfls_cli.stages._numbers import with_numbers

WORDS: Mapping[str, Any] = {**GAP_WORDS, **MODEL_WORDS, **PLAYBACK_WORDS}
FIGURES = {
    "gap-sizes": sizes_drawn(lambda r: r.gap),
    "playback": playback_drawn(),
    "intervals": intervals_drawn(lambda r: r.effects),
}


@stage(Extended, title="The extended model", figures=FIGURES, words=WORDS, study=True)
def extend(run: Run, diagnosis: DiagnosisArgument, model: ModelOption = None) -> Extended | None:
    """Put the effects that a diagnosis names into a model."""
    run.take({"diagnosis": diagnosis} | ({} if model is None else {"model": model}))
    with_numbers(run, "extend", model)
    study = run.study
    diagnosed, origin = read_result_of_vehicle(diagnosis, Diagnosis, study)
    base = diagnosed.base if model is None else read_base(model, study)
    named_effects(diagnosed)
    if run.dry_run:
        return None
    flights = (in_roles(diagnosed.recorded, role) for role in (TRAINING, HELD_OUT))
    training, held = (
        with_known_wrench([each.flight(study.vehicle, study.gap.ground_height_m) for each in own], base)
        for own in flights
    )
    known = diagnosed.learned if model is None else learned_by(model)
    learned = joined_flights(diagnosed.learned_from(origin.inputs), known)
    run.take_also(as_inputs("flight", learned))
    run.next.append(("cpfls", "export", run.output, "-o", run.output.with_suffix(".c")))
    return replace(extended(study, training, held, diagnosed, base), learned_from=learned)


def named_effects(diagnosis: Diagnosis) -> Sequence[NamedEffect]:
    """Take the effects that a diagnosis names; one that names none, or what is not known here, is refused."""
    for each in diagnosis.effects or diagnosis.closest:
        effect(each.name)
    if diagnosis.verdict not in NAMES_EFFECTS or not diagnosis.effects:
        unexplained = diagnosis.verdict == GapVerdict.UNEXPLAINED
        closest = " (those that it calls closest are not it)" if unexplained else ""
        raise ComputationError(
            f"not extended: the diagnosis is {diagnosis.verdict} and names no effect that could be added{closest}"
        )
    return diagnosis.effects


def extended(
    study: Study, training: Sequence[Signals], held: Sequence[Signals], diagnosis: Diagnosis, base: VehicleModel
) -> Extended:
    """Put the effects that a diagnosis names into a model; refused where the held-out gap does not shrink."""
    gusty_floor = diagnosis.gap.floor if diagnosis.gusts else None
    named = named_effects(diagnosis), diagnosis.audit
    others = *named, study.gap, base.fuzzy, gusty_floor
    extension, vehicle = refitted(training, held, *others), base.vehicle
    by_speed = all(each.rotor_speed is not None for each in (*training, *held))
    lifting = thrust_put_in(extension, vehicle) if by_speed else vehicle
    if lifting != vehicle:
        moved = replace(base, vehicle=lifting)
        # A refit that is refused says nothing against the first one, which has the thrust as an effect.
        with suppress(ComputationError):
            again = refitted(with_known_wrench(training, moved), with_known_wrench(held, moved), *others, extension)
            extension, vehicle = above_thrust(again, extension, lifting)
    whole = on_top_of(base, whole_vehicle(extension.model, vehicle))
    given = on_top_of(base, whole_vehicle(plain(base.fuzzy), base.vehicle))
    if diagnosis.air is not None and diagnosis.gusts:
        whole = replace(whole, gusts=diagnosis.air.gusts)
    require_body(extension.model, vehicle)
    played = played_pairs(held, whole, given, rates_fade(training, study.gap.horizon_s))
    playback = PlaybackChange.of_pairs(played, errors_by_horizon(played, study.gap.horizon_s))
    missing = left_out(whole, whole.unsimulated, held, study.gap.horizon_s)
    fitted, unseen, moments = extension.model, extension.unseen, vehicle.inertia_kg_m2
    rigid_body = six_parameters(moments) if fitted.base is None else np.zeros(6)
    correction = np.array([*fitted.parameters[:3] * np.array(moments[:3]), 0.0, 0.0, 0.0])
    scale = next((each.value for each in extension.estimates.parameters if each.name == "thrust_scale"), 0.0)
    return Extended(
        model=whole,
        inertia=rigid_body + correction,
        thrust_scale=1.0 + scale,
        effects=extension.effects,
        vehicle_numbers=all_numbers(extension.estimates),
        gap=GapChange.of(unseen.size(unseen.before), unseen.size(unseen.after), unseen.floor),
        playback=playback,
        left_out=tuple(missing),
    )
