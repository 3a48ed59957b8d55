"""Diagnosis: which physical effect is missing in a model, found on some flights and judged on others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.changes.judge import changed
from cpfls_cli.changes.numbers import flight_numbers
from cpfls_cli.consistency.check import Audit, audit
from cpfls_cli.consistency.findings import contradictions
from cpfls_cli.consistency.rotors import impossible
from cpfls_cli.dynamics import InertiaModel
from cpfls_cli.effects.effect import Effect
from cpfls_cli.effects.registry import CATALOGUE, VEHICLE_NUMBERS, acting
from cpfls_cli.effects.signals import Signals
from cpfls_cli.errors import InputError
from cpfls_cli.gap.balance.balance_system import System, is_free, system
from cpfls_cli.gap.balance.refine import fit_within_bounds
from cpfls_cli.gap.balance.weak_flight import TURNING, Preparation, WeakFlight
from cpfls_cli.gap.extended import ExtendedModel, renewed
from cpfls_cli.gap.naming.actuation import decided_by_instruments
from cpfls_cli.gap.naming.by_instruments import (
    by_instruments,
    significant_effects,
    unidentified,
    unidentified_axes,
    with_lean,
)
from cpfls_cli.gap.naming.by_samples import small_effects, with_small_effects
from cpfls_cli.gap.naming.causes import (
    JudgedEffect,
    all_numbers,
    carries_the_weight,
    impossible_ratios,
    judge_effects,
    likely_sets,
    sensor_fault,
    with_lever,
    wrong_numbers,
)
from cpfls_cli.gap.naming.estimate import Estimates, NamedFit, Refusal, earned, ends_on_bound, fitted
from cpfls_cli.gap.naming.held_out import HeldOut, Judge, Judgement, differences
from cpfls_cli.gap.naming.noisy_rate import with_noisy_rate
from cpfls_cli.gap.naming.open_questions import not_excited, not_separated, unexplained_channels, untried, with_unnamed
from cpfls_cli.gap.naming.ranking import RankedStep
from cpfls_cli.gap.naming.results import (
    NAMES_EFFECTS,
    Alternative,
    ByKind,
    Conclusion,
    Estimate,
    GapChange,
    GapVerdict,
    NamedEffect,
    gap_remains,
    verdict_of,
)
from cpfls_cli.gap.naming.search import forward_selection
from cpfls_cli.gap.residual.air import Air, air, known_motion
from cpfls_cli.gap.residual.rotor_loss import RotorLoss, rotor_losses
from cpfls_cli.gap.settings import CLEAR, ERRORS, NOISE, GapSettings
from cpfls_cli.playback.instruments import Instruments
from cpfls_cli.rounding import ascending
from cpfls_cli.vehicle.settings import VehicleSettings
from cpfls_cli.weak_form.windows import common_windows


@dataclass(frozen=True)
class DiagnosisRun:
    """A diagnosis with the fits and residuals that it was made from."""

    diagnosis: Conclusion
    # Gusts in the training flights; None where nothing but noise is left, or the flights are too short.
    air: Air | None
    audit: Audit
    hypothesis: System  # Of the training flights, with the chosen effects.
    estimates: Estimates
    held_out: HeldOut

    def model(self, base: InertiaModel | None) -> ExtendedModel:
        """Build the model with the effects of the diagnosis."""
        return ExtendedModel.of(base, self.hypothesis, self.estimates, self.audit)


def diagnose(
    training: Sequence[Signals],
    held: Sequence[Signals],
    settings: GapSettings,
    rng: np.random.Generator,
    *,
    whole: Sequence[Signals] = (),
    model: InertiaModel | None = None,
    progress: Callable[[float, str], None] = lambda _done, _note: None,
) -> DiagnosisRun:
    """Name the effects that a model misses.

    The sensors are audited first and repaired where they are at fault. Effects are then added one at a time while each
    explains more of blocks it has not seen than chance does anywhere in the catalogue; what is chosen is judged on
    the held-out flights, once. Where the residual is gusts by instruments, these are a part of the noise, the effects
    are sought once more above them, and their numbers come by instruments. What looks like many others is tried last:
    where, without it, a gap or a wrong number of the vehicle is left.

    `training`, `held`: at least one each.
    `whole`: the flights that these are parts of, where they are.
    `model`: None for the rigid body of the vehicle.
    `progress`: takes the share of the work that is done and a note.
    Raises InputError if the flights are too short, of different rates, or have nothing in common with the catalogue.
    """
    last = [name for name, each in CATALOGUE.items() if each.tried_last and name not in settings.ignore]
    can = [name for name in last if not any(CATALOGUE[name].missing(own) for own in (*training, *held))]

    def run(ignored: Sequence[str], begun: float) -> DiagnosisRun:
        without, part = replace(settings, ignore=(*settings.ignore, *ignored)), 0.5 if can else 1.0
        return _diagnosed(training, held, without, rng, whole, model, lambda d, note: progress(begun + part * d, note))

    first = run(last, 0.0)
    if not can or not _left_open(first.diagnosis):
        progress(1.0, "diagnosis")
        return first
    second = run((), 0.5)
    before, after = (float(np.nanmax(each.diagnosis.gap.after_floors)) for each in (first, second))
    return second if {*can} & _causes(second.diagnosis) and after <= max(before, CLEAR) else first


def _left_open(found: Conclusion) -> bool:
    """Check whether a gap, or a wrong number of the vehicle, is left."""
    return found.verdict in _OPEN or any(each.name == VEHICLE_NUMBERS.name for each in found.effects)


def _causes(found: Conclusion) -> set[str]:
    """Name what may be the cause: effects that are named, and rivals of wrong numbers of the vehicle."""
    rivals = {each.name for each in found.alternatives if each.instead_of == VEHICLE_NUMBERS.name}
    return rivals.union(each.name for each in found.effects) if found.verdict in NAMES_EFFECTS else set()


_OPEN = (GapVerdict.PARTIAL, GapVerdict.UNEXPLAINED, GapVerdict.FLIGHTS_DIFFER)


def _diagnosed(
    training: Sequence[Signals],
    held: Sequence[Signals],
    settings: GapSettings,
    rng: np.random.Generator,
    whole: Sequence[Signals],
    model: InertiaModel | None,
    progress: Callable[[float, str], None],
) -> DiagnosisRun:
    progress(0.0, "sensor audit")
    windows = common_windows([*training, *held], settings)
    audited = audit(training, windows, whole).with_offsets(held, windows)
    prepared = Preparation(windows, model, settings, audited)
    flights = _Flights(prepared.repaired(training), prepared.logged(held), prepared.repaired(held))
    named = _named(flights, settings, rng, progress)
    gusts, quiet = None, named.judgement.found.floor
    if unexplained_channels(named.judgement.found, rng):
        given = known_motion(training)
        gusts = _gusts(named.learned, given, settings)
        if gusts is not None and gusts.split.any():
            quiet = np.minimum(quiet, gusts.noise(windows))
            flights = flights.in_air(gusts, unidentified_axes(named.learned, given))
            across = gusts.found.size[3:5]
            named = _significant(_named(flights, settings, rng, progress), given)
            named = _judged_with_lags(named, given, across)
            named = _with_small(named, gusts, given, across)
            gusts = _gusts(named.judgement.found, given, settings)
    losses = _losses(flights, named, settings, rng)
    if losses:
        # What else flights differ by may be these.
        named = named._replace(losses=losses, differ=tuple(each.sentence for each in losses))
    weak, (found, held_out) = flights.training, named.judgement
    hypothesis, estimates = found.hypothesis, found.estimates
    progress(0.75, "rivals")
    # Lags of rotors in gusts instruments have decided.
    tried = [each for each in named.effects if gusts is None or not each.is_lag]
    judged = [named.in_gusts(each) for each in judge_effects(found, named.effects, rng)]
    # What may be there instead of a named effect is no small one next to it.
    instead = {rival.name for each in judged for rival in each.alternatives}
    wider, unnamed, bends = with_unnamed(found, named.steps[-1], tried, instead, rng)
    named = named._replace(bends=bends)
    pairs = zip(hypothesis.chosen, estimates.effects, wider.effects, strict=True)
    # Averages over windows, which widen the others, are biased by the loop for what is small.
    held_by = tuple(
        own if (each.effect.is_lag and named.sure) or each.effect.name in named.small else with_it
        for each, own, with_it in pairs
    )
    fit = found._replace(estimates=replace(wider, effects=held_by))
    hypothesis, estimates, *_ = with_noisy_rate(fit)
    known = renewed([each.effect for each in judged], hypothesis, estimates)
    judged = [replace(each, effect=effect) for each, effect in zip(judged, known, strict=True)]
    progress(0.9, "sensor faults")
    faults = [sensor_fault(finding, prepared.logged(training), weak) for finding in audited.named]
    doubts = [
        *_doubts(unnamed, bends, judged, named.unsure, settings),
        *(refused.sentence for refused in named.refusals),
    ]
    notes = [*not_judged(held_out), *([] if named.differ else doubts)]
    inertial = hypothesis.by_flight(lambda flight, _: flight.motion)
    # Above the floor of the sensors alone.
    excited = bool((inertial[:, :3].std(axis=0) > TURNING * quiet[:3]).any())
    diagnosis = _concluded(named, judged, faults, excited, audited, notes, (training, held), settings)
    return DiagnosisRun(diagnosis, gusts, audited, hypothesis, estimates, held_out)


def _changed_between(training: Sequence[Signals], held: Sequence[Signals]) -> tuple[str, ...]:
    """Say how the vehicle changed between the training flights and the held-out ones; nothing where it did not.

    What no effect explains may be the same in all of them; what they differ by is not.
    """
    if len(training) < 2:
        # Of one flight nobody knows what it differs by from the next.
        return ()
    try:
        before, today = ([flight_numbers(each) for each in flights] for flights in (training, held))
        # What chance gives is drawn, and hangs on no seed of the study.
        change = changed(today, before, training[0].vehicle, np.random.default_rng(0))
    except InputError:
        # Torques are stated, or it hardly flies.
        return ()
    of_vehicle = [each for each in change.causes if not each.of_air]
    if not of_vehicle:
        return ()
    first, p_value = of_vehicle[0], change.p
    alike = ", ".join(f"{each.name} {100 * each.belief:.0f} %" for each in first.alike)
    return (
        f"the vehicle of the held-out flights is not that of the training flights (p = {p_value:.2g}): "
        f"{first.name}, sure to {100 * first.belief:.0f} %{f' ({alike})' if alike else ''}; cpfls changed says by"
        " how much",
    )


class _Flights(NamedTuple):
    """Flights that train, and those held out as logged and repaired."""

    training: Sequence[WeakFlight]
    logged: Sequence[WeakFlight]
    repaired: Sequence[WeakFlight]

    def in_air(self, gusts: Air, axes: BoolArray) -> _Flights:
        """Give all of them the floor of their air; inertia that instruments do not identify is the loop's."""
        in_gusts = (gusts.around(flights, gusts.floor(self.training, flights)) for flights in self)
        return _Flights(*([flight.as_stated(axes) for flight in flights] for flights in in_gusts))


class _Named(NamedTuple):
    """What was named, by which evidence, what was refused, and whose numbers instruments do not identify."""

    effects: list[Effect]
    steps: list[RankedStep]
    judge: Judge
    judgement: Judgement
    learned: NamedFit
    """With what these flights have, and those held out surely have not."""
    refusals: list[Refusal]
    differ: tuple[str, ...]
    alike: tuple[Alternative, ...] = ()
    losses: tuple[RotorLoss, ...] = ()
    sure: Mapping[str, float] = MappingProxyType({})
    unsure: Mapping[str, float] = MappingProxyType({})
    """Effects that instruments do not show, each with its p-value, and without which a gap above the gusts is left."""
    unidentified: tuple[str, ...] = ()
    small: frozenset[str] = frozenset()
    """Effects whose numbers are by samples."""
    bends: tuple[str, ...] = ()
    """Of formulas, which are a part of the gap that counts."""

    def in_gusts(self, judged: JudgedEffect) -> JudgedEffect:
        """Take the p-value of an effect by instruments, and drop rivals of a lag: a fit sees the loop."""
        effect = replace(judged.effect, identified=judged.effect.name not in self.unidentified)
        if effect.name not in self.sure:
            return replace(judged, effect=effect)
        effect = replace(effect, p_value=self.sure[effect.name])
        return replace(judged, effect=effect, alternatives=() if CATALOGUE[effect.name].is_lag else judged.alternatives)


def _named(
    flights: _Flights, settings: GapSettings, rng: np.random.Generator, progress: Callable[[float, str], None]
) -> _Named:
    """Search for effects, and judge them on the flights held out."""
    effects, steps, found, refusals = _searched(flights.training, settings, rng, progress)
    progress(0.65, "estimates")
    judge = Judge(*flights, rng)
    first = judge.judge(found)
    judgement, unconfirmed = judge.confirmed(first)
    differ = differences(first, judgement, steps[0], judge)
    learned = first.found if any(each.harms for each in unconfirmed) else judgement.found
    return _Named(effects, steps, judge, first if differ else judgement, learned, [*refusals, *unconfirmed], differ)


def _losses(flights: _Flights, named: _Named, settings: GapSettings, rng: np.random.Generator) -> tuple[RotorLoss, ...]:
    """Find rotors that lose thrust in flight, which is no effect of the catalogue, though several together look alike.

    What is named may take a part of it, so it has to be sure, and its size is that, of the model as given; what that
    alone shows is what is named.
    """
    every, found = [*flights.training, *flights.repaired], named.judgement.found
    explained = system(every, found.hypothesis.chosen)
    with_names = rotor_losses(explained, found.estimates.linear, found.floor, settings, rng, ERRORS**2)
    left = {(each.flight, each.rotor) for each in with_names}
    if not left:
        return ()
    numbers, _ = fit_within_bounds(system(flights.training), found.floor)
    given = rotor_losses(system(every), numbers, found.floor, settings, rng)
    return tuple(each for each in given if (each.flight, each.rotor) in left)


def _gusts(found: NamedFit, given: Instruments, settings: GapSettings) -> Air | None:
    """Find gusts in the residual of the training flights."""
    return air(found.hypothesis, found.estimates.linear, found.block, given, settings)


def _significant(named: _Named, given: Instruments) -> _Named:
    """Give what was named the numbers that instruments identify, without what is 0 by them."""
    judge, refusals, fit = named.judge, list(named.refusals), named.judgement.found
    unsure = dict[str, float]()
    while True:
        found = by_instruments(fit, given)
        refusal = ends_on_bound(found)
        if refusal is not None:
            refusals.append(refusal)
            fit = found.without([refusal.name])
            continue
        kept = significant_effects(found, given, found.settings.significance)
        names = {each.effect.name for each, _ in kept}
        out = [each.effect for each in found.hypothesis.chosen if each.effect.name not in names]
        if not out:
            break
        fewer = fitted(judge.training, [each for each, _ in kept], found.floor, found.settings)
        # A gap above the gusts is none of them: what it takes to explain it stays.
        if (fewer.rms_floors > np.maximum(found.rms_floors, CLEAR)).any():
            unsure = {each.effect.name: chance for each, chance in significant_effects(found, given, 1.0)}
            break
        for effect in out:
            what = "".join(f"all that it adds to {name}" for name in effect.holds & names) or "it"
            refusals.append(Refusal(effect.name, f"by instruments {what} may be 0"))
        fit = fewer
    loose = tuple(effect.name for effect in unidentified(fit, found))
    sure = {each.effect.name: chance for each, chance in kept if np.isfinite(chance)}
    judgement = named.judgement._replace(found=found)
    unsure = {name: chance for name, chance in unsure.items() if np.isfinite(chance) and name not in sure}
    return named._replace(judgement=judgement, refusals=refusals, sure=sure, unsure=unsure, unidentified=loose)


def _within_bounds(found: NamedFit, given: Instruments) -> tuple[NamedFit, list[Refusal]]:
    """Fit by instruments without what these move onto a bound."""
    refusals = list[Refusal]()
    while (refusal := ends_on_bound(moved := by_instruments(found, given))) is not None:
        found, refusals = moved.without([refusal.name]), [*refusals, refusal]
    return moved, refusals


def _judged_with_lags(named: _Named, given: Instruments, across: Array) -> _Named:
    """Judge what is significant by instruments, and name lags where they are.

    A loop that answers gusts looks like a lag.

    `across`: gusts along x and y, shape (2,), N.
    """
    found, refusals = named.judgement.found, named.refusals
    lags = decided_by_instruments(found, named.effects, given)
    while (refusal := ends_on_bound(lags.found)) is not None:
        # With the right lags it is none.
        found, refusals = by_instruments(found.without([refusal.name]), given), [*refusals, refusal]
        lags = decided_by_instruments(found, named.effects, given)
    judgement = named.judge.judge(with_lean(lags.found, across))
    if not lags.chances:
        refusals = refusals + [
            Refusal(each.effect.name, "a loop that answers gusts looks alike, and instruments do not identify it")
            for each in found.hypothesis.chosen
            if each.effect.is_lag
        ]
    sure = {**named.sure, **lags.chances}
    differ = named.differ
    if differ:
        # Numbers of a fit are the loop's, and what instruments name may be in both.
        last, unconfirmed = named.judge.confirmed(judgement)
        differ = differences(judgement, last, named.steps[0], named.judge)
        if unconfirmed and not differ:
            found, refused = _within_bounds(last.found, given)
            judgement = named.judge.judge(with_lean(found, across))
            refusals = [*refusals, *unconfirmed, *refused]
    names = {each.effect.name for each in judgement.found.hypothesis.chosen}
    alike = tuple(each for each in lags.alike if each.instead_of in names)
    return named._replace(judgement=judgement, refusals=refusals, alike=alike, sure=sure, differ=differ)


def _with_small(named: _Named, gusts: Air, given: Instruments, across: Array) -> _Named:
    """Add what is significant by samples, which averages over windows do not resolve in gusts."""
    found, last = named.judgement.found, named.steps[-1]
    judged = found.hypothesis.shown_in(named.judge.repaired)
    signals = (*found.hypothesis.signals, *(flight.signals for flight in judged))

    def known(effect: Effect) -> bool:
        return not any(effect.missing(own) for own in signals)

    chosen = [each.effect for each in found.hypothesis.chosen]
    if named.differ or not all(map(known, chosen)):
        return named
    names = {each.name for each in chosen}
    held = frozenset[str]().union(*(each.holds for each in chosen))
    candidates = [
        each
        for each in (*(scored.candidate for scored in last.ranking), *last.hypothesis.chosen)
        if is_free(each)
        and known(each.effect)
        and each.effect.name not in names | held
        and not (each.effect.is_lag or each.effect.physical)
    ]
    # Filtered noise correlates with what was before.
    unfiltered = np.all([np.isinf(flight.cut_off) for flight in (*found.hypothesis.flights, *judged)], axis=0)
    small = small_effects(found, judged, candidates, gusts.split & unfiltered)
    if not small:
        return named
    fit, refusals = with_small_effects(found, small, given), named.refusals
    new = frozenset(each.candidate.effect.name for each in small)
    while (refusal := ends_on_bound(fit)) is not None:
        if refusal.name in new:
            return named
        # It stood for the small ones.
        found, refusals = by_instruments(found.without([refusal.name]), given), [*refusals, refusal]
        fit = with_small_effects(found, small, given)
    judgement = named.judge.judge(with_lean(fit, across))
    taken = min(judgement.held_out.shares().values())
    if taken < found.settings.named_share or named.judge.harmed(judgement, named.judgement):
        return named
    return named._replace(
        judgement=judgement,
        alike=(*named.alike, *(rival for each in small for rival in each.rivals)),
        sure={**named.sure, **{each.candidate.effect.name: each.chance for each in small}},
        small=new,
        refusals=refusals,
    )


def _wrong_numbers(
    named: _Named, effects: Mapping[str, Sequence[Estimate]], least: float, *, of_weight: bool = True
) -> NamedEffect | None:
    """Name the numbers of the vehicle that are wrong, where a gap is: a mean square of `least` squared floors.

    `of_weight`: whether a thrust has to carry the weight.
    """
    (hypothesis, estimates, *_), held_out = named.judgement
    taken, unknown = held_out.removed_by_numbers(least), named.judge.unknown(held_out)
    if of_weight and not carries_the_weight(named.judgement.found):
        taken[5] = 0.0
    return wrong_numbers(estimates, effects, taken, unknown, hypothesis.vehicle)


def _weightless(named: _Named, effects: Mapping[str, Sequence[Estimate]], least: float) -> bool:
    """Check whether what changes the force as a wrong thrust would is none, so that it has no name."""
    asked, numbers = (_wrong_numbers(named, effects, least, of_weight=own) for own in (False, True))
    return asked is not None and (numbers is None or len(numbers.numbers) < len(asked.numbers))


def _doubts(
    unnamed: Sequence[str],
    bends: Sequence[str],
    judged: Sequence[JudgedEffect],
    unsure: Mapping[str, float],
    settings: GapSettings,
) -> Iterator[str]:
    """Say what intervals cover, whose formula is another one, and which effects are not significant."""
    if bends:
        yield f"a part of the gap that counts is {' and '.join(bends)}: the formula is another one"
    if unnamed:
        yield (
            f"something unnamed explains more than chance ({', '.join(unnamed)}); the intervals cover the numbers with"
            " and without it"
        )
    for effect in (each.effect for each in judged):
        title = CATALOGUE[effect.name].title
        if effect.p_value > settings.significance:
            yield f"{title} is not significant jointly with the others, p = {effect.p_value:.2g}"
        if effect.name in unsure:
            yield (
                f"by instruments {title} may be 0 (p = {unsure[effect.name]:.2g}); it is named because without it a gap"
                " above the gusts is left"
            )
        if not effect.identified:
            yield (
                f"instruments do not identify the numbers of {title}: they come from a fit to all motion, in"
                " which the loop answers gusts, and may be off by more than their intervals"
            )


def not_judged(unseen: HeldOut) -> Iterator[str]:
    """Say where the held-out flights go beyond what was learned, and what that costs."""
    for name, share in unseen.unlearned.items():
        yield (
            f"{100 * share:.2g} % of what is held out goes where no training flight went, and {name} is not known"
            " there: not judged there; learn from a flight that goes as far"
        )


def _searched(
    weak: Sequence[WeakFlight], settings: GapSettings, rng: np.random.Generator, progress: Callable[[float, str], None]
) -> tuple[list[Effect], list[RankedStep], NamedFit, list[Refusal]]:
    """Search for effects that earn their names; once more without those on a bound, or beyond.

    Such an effect takes up what others would explain, and has to go before they can be seen.
    """
    effects, refusals = considered(settings, weak[0].signals.vehicle), list[Refusal]()
    while True:
        chosen, steps = forward_selection(
            weak, effects, settings, rng, lambda n: progress(0.1 + 0.1 * min(n, 5), "search")
        )
        found, refused = earned(weak, chosen, steps[-1].floor, settings)
        refusals += refused
        out = {each.name for each in refused if each.in_the_way}
        if not out:
            return effects, steps, found, refusals
        effects = [effect for effect in effects if effect.name not in out]


def considered(settings: GapSettings, vehicle: VehicleSettings) -> list[Effect]:
    """List the effects that the search tries."""
    return [
        acting(name, vehicle)
        for name, effect in CATALOGUE.items()
        if effect.columns is not None and effect.kind != "parameter" and name not in settings.ignore
    ]


def _concluded(
    found: _Named,
    judged: Sequence[JudgedEffect],
    faults: Sequence[NamedEffect],
    excited: bool,
    audited: Audit,
    notes: Sequence[str],
    flown: tuple[Sequence[Signals], Sequence[Signals]],
    settings: GapSettings,
) -> Conclusion:
    (hypothesis, estimates, *_), held_out = found.judgement
    remainder = unexplained_channels(found.judgement.found, found.judge.rng)
    named = ascending((each.effect for each in judged), lambda effect: -effect.share)
    effects = [*faults, *named]
    floor, differ = found.steps[-1].floor, found.differ
    # In gusts instruments identify the numbers, and a gap need not be clear.
    known, least = {e.name: e.numbers for e in effects}, NOISE if (still := not hypothesis.gusty.any()) else 0.0
    numbers = _wrong_numbers(found, known, least)
    effects = [with_lever(each, numbers) for each in effects] + ([] if numbers is None else [numbers])
    # Where wrong numbers leave no gap, there is none that names could take a share of.
    removed = held_out.shares(as_given=numbers is not None and held_out.closed_by_numbers)
    if not named:
        # Faults and wrong numbers alone: of all the gap, where one is left.
        removed = held_out.shares(as_given=True) if effects and remainder else {}
    share = min(removed.values(), default=1.0)
    listed = [*found.alike, *(rival for each in judged for rival in each.alternatives)]
    once = {(rival.name, rival.instead_of, rival.jointly_with): rival for rival in listed}
    rivals = (*once.values(), *untried(hypothesis, named, settings), *not_separated(found.judgement.found, numbers))
    before, after = (held_out.size(each).floors for each in (held_out.parameters, held_out.after))
    remains = bool(remainder)
    if effects:
        remains = gap_remains(before, after, remainder, settings.named_share, len(named)) or bool(found.bends)
    remains = remains or _weightless(found, known, least)
    verdict = verdict_of(effects, rivals, remains, tuple(removed.values()) or (1.0,), excited, settings)
    if verdict is GapVerdict.NAMED and any(not CATALOGUE[rival.instead_of].is_lag for rival in found.alike):
        # A rival that does as well as a small effect may be there instead.
        verdict = GapVerdict.AMBIGUOUS
    # A fit that asks for numbers that no vehicle has says that the log is wrong, not the vehicle; or that its rotors,
    # held between rare samples, do not turn it.
    ratios = impossible_ratios(estimates.parameters)
    if any(each.slow_rotors for role in flown for each in role):
        ratios = {name: ratio for name, ratio in ratios.items() if name == "thrust_scale"}
    wrong = (*audited.contradictions, *contradictions(impossible(ratios)))
    if not (wrong or differ) and verdict in (GapVerdict.UNEXPLAINED, GapVerdict.PARTIAL):
        # A gap that is left may be that of another vehicle.
        differ = _changed_between(*flown)
    if wrong:
        verdict = GapVerdict.CONTRADICTED
    elif differ:
        verdict = GapVerdict.FLIGHTS_DIFFER
    lags = any(CATALOGUE[each.effect.name].is_lag for each in judged)
    refused = verdict in (GapVerdict.UNEXPLAINED, GapVerdict.FLIGHTS_DIFFER, GapVerdict.CONTRADICTED)
    return Conclusion(
        verdict=verdict,
        contradictions=wrong,
        share=share,
        share_by_kind=ByKind(torque=removed.get("torque", np.nan), force=removed.get("force", np.nan)),
        differences=differ,
        rotor_losses=found.losses,
        effects=tuple(faults if refused else effects),
        closest=tuple(named) if refused and not found.losses else (),
        alternatives=() if found.losses else rivals,
        # In gusts fits of lags see the loop, and do not compare.
        sets=() if found.losses or (lags and not still) else likely_sets(judged),
        unexplained=() if verdict is GapVerdict.NAMED else remainder,
        not_excited=not_excited(hypothesis, [e for n, e in CATALOGUE.items() if n not in settings.ignore], floor),
        vehicle_numbers=all_numbers(estimates),
        gap=GapChange.of(held_out.size(held_out.before), held_out.size(held_out.after), held_out.floor),
        notes=(*audited.filtered, *audited.settled, *differ, *wrong, *notes, *audited.warnings, *audited.notes),
    )
