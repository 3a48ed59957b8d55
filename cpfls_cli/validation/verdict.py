"""The verdict on a model: words of trust, and by rules whether to control with it, at which attitudes, and why."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.consistency.findings import as_contradiction
from cpfls_cli.dynamics import why_unphysical
from cpfls_cli.identification.findings import AXES, loop_in_words
from cpfls_cli.playback.loop import LoopBounds
from cpfls_cli.result import About, about, part
from cpfls_cli.validation.evidence import MODEL, RIGID_BODY, Comparison, Evidence
from cpfls_cli.validation.replay import NOTHING_MOVES
from cpfls_cli.validation.trust import Trust, capped

FOR, NEITHER, AGAINST = 1, 0, -1

# White errors fall below it once in a hundred times an axis.
_NOT_WHITE = 0.01
_SMALLEST_P = 1e-16
DEFINITE_SHARE = 0.975
"""Share of the bootstrap draws that are to be positive definite wherever training was."""

# A constant torque is reported from a quarter of the noise of errors on, if it is a hundredth of all torque.
_LARGE_OVER_NOISE, _SMALL = 0.25, 0.01


class Reason(NamedTuple):
    """One sentence on a model, and whether it speaks for or against it."""

    text: Annotated[str, About("one sentence with its number")]
    speaks: Annotated[int, About("1 for the model, -1 against it, 0 neither", least=-1)]


def numbers(values: Array, shown: BoolArray | None = None) -> str:
    """Format the values of the three axes, or of those shown, as ``roll 0.95 pitch 0.97 yaw 0.23``."""
    axes = np.flatnonzero(np.ones(3, dtype=bool) if shown is None else shown)
    return " ".join(f"{AXES[axis]} {values[axis]:.3g}" for axis in axes)


def reasons(evidence: Evidence) -> Iterator[Reason]:
    """List the reasons for and against a model, the most important first."""
    of_errors = (_held_out, _hardly_excited, _against_rigid_body, _constant, _steps, _lost)
    of_inertia = (_definite, _draws, _elsewhere, _fuzzy_part, _determined)
    for rule in (*of_errors, *of_inertia, _band, _search, _outside, _white):
        yield from rule(evidence)


def _definite(evidence: Evidence) -> Iterator[Reason]:
    physics = evidence.physics
    if physics.cells and not evidence.impossible:
        yield Reason(
            f"D(q) is positive definite in all {physics.cells} cells of attitude that training visited; its smallest "
            f"eigenvalue is {physics.smallest_eigenvalue:.3g} kg m^2",
            FOR,
        )


def _draws(evidence: Evidence) -> Iterator[Reason]:
    share = evidence.definite
    if share is not None and not evidence.impossible:
        text = f"D(q) is positive definite in all cells away from vertical pitch in {100 * share:.3g} % of the draws"
        enough = share >= DEFINITE_SHARE
        yield Reason(text if enough else f"{text}; {100 * DEFINITE_SHARE:g} % are required", FOR if enough else AGAINST)


def _elsewhere(evidence: Evidence) -> Iterator[Reason]:
    """Report attitudes without a definite D(q) that training, though it went all round, did not visit."""
    physics = evidence.physics
    if evidence.one_rule and not evidence.impossible and physics.indefinite_anywhere:
        text = f"D(q) is not positive definite in {physics.indefinite_anywhere} of {physics.every_cell} cells of roll"
        yield Reason(f"{text} and pitch, but in none that training visited", AGAINST)


def _fuzzy_part(evidence: Evidence) -> Iterator[Reason]:
    if evidence.fuzzy_part_off:
        text = "cross-validation switched the fuzzy part off: no evidence for an inertia that depends on attitude"
        yield Reason(text, AGAINST)


def _determined(evidence: Evidence) -> Iterator[Reason]:
    result = evidence.identification
    if evidence.fuzzy_part_off:
        return
    if evidence.determined:
        yield Reason(f"every coefficient is determined; condition number {result.system.condition_number:.3g}", FOR)
    else:
        share, weak = 100 * float(np.mean(result.excitation.determined)), int(np.sum(~result.excitation.excited))
        rules = f"{weak} of {len(result.excitation.name)} rules are not excited beyond the noise"
        yield Reason(f"{share:.3g} % of what the rules could express is determined by the flight; {rules}", AGAINST)


def _band(evidence: Evidence) -> Iterator[Reason]:
    if evidence.band is None:
        return
    widest = float(np.max(evidence.band))
    freed = evidence.identification.freed
    if freed is not None:
        # Draws know the scatter of the torque that was freed, not that of what freed it.
        widest = max(widest, *(2 * np.sinh(freed.half[freed.identified])).tolist())
    text = f"the widest 95 % band of a moment of inertia is {100 * widest:.3g} % of the inertia itself"
    # A band as wide as its value leaves open by more than a factor of two how hard the body is to turn.
    yield Reason(text, FOR if widest < 1 else AGAINST)


def _search(evidence: Evidence) -> Iterator[Reason]:
    result = evidence.identification
    if not result.complete:
        done = len(result.history.evaluations) - 1
        text = f"the search stopped before its end ({result.stop_reason}, after {done} generations)"
        yield Reason(f"{text}: better partitions may exist", AGAINST)


def _outside(evidence: Evidence) -> Iterator[Reason]:
    result = evidence.identification
    counts = (result.outside, result.samples)
    outside, samples = (sum(count[part] for part in evidence.held_out) for count in counts)
    if outside and not (evidence.fuzzy_part_off or evidence.everywhere):
        yield Reason(
            f"{100 * outside / samples:.3g} % of the held-out samples lie outside the attitudes that training visited",
            NEITHER,
        )


def _white(evidence: Evidence) -> Iterator[Reason]:
    errors = evidence.residuals
    tested = np.flatnonzero(np.isfinite(errors.ljung_box))
    biased = np.flatnonzero(errors.mean_p < _NOT_WHITE)
    if len(biased):
        torques = ", ".join(f"{errors.mean[axis]:.3g} N m about {AXES[axis]}" for axis in biased)
        text = f"a constant torque remains: {torques} ({errors.part}"
        yield Reason(f"{text}, p {_printed(float(np.min(errors.mean_p[biased])))}), which the model lacks", NEITHER)
    coloured = [AXES[axis] for axis in tested if errors.ljung_box[axis] < _NOT_WHITE]
    if coloured:
        smallest = float(np.min(errors.ljung_box[tested]))
        text = f"torque errors about {', '.join(coloured)} are not white ({errors.part}, p {_printed(smallest)})"
        yield Reason(f"{text}: filters of the log cause that, and so does an effect without a term", NEITHER)
    elif len(tested) and not len(biased):
        text = f"torque errors are white noise, as far as {errors.samples} samples of {errors.part} show"
        yield Reason(f"{text} (p {_printed(float(np.min(errors.ljung_box[tested])))})", FOR)
    elif not len(tested) and np.all(errors.exact):
        yield Reason(f"the torque of {errors.part} is matched to rounding", FOR)


def _printed(p_value: float) -> str:
    return f"{p_value:.2g}" if p_value > _SMALLEST_P else f"below {_SMALLEST_P:g}"


def _held_out(evidence: Evidence) -> Iterator[Reason]:
    r2 = evidence.r2(MODEL)
    if not evidence.held_out:
        yield Reason(
            f"judged only on its own training data (R2 of body torque {numbers(r2)}), which says nothing about other "
            "flights: hold some out with identification.training_share below 1, or --validate another flight",
            AGAINST,
        )
        return
    low = [name for name, value in zip(AXES, r2, strict=True) if not value >= evidence.r2_min]
    parts = f"worst of {len(evidence.held_out)} held-out parts" if len(evidence.held_out) > 1 else "held out"
    text = f"R2 of body torque, {parts}: {numbers(r2)}"
    if low:
        yield Reason(f"{text}; below {evidence.r2_min:g} about {', '.join(low)}", AGAINST)
    else:
        yield Reason(f"{text}; {evidence.r2_min:g} or more about every axis", FOR)


def _hardly_excited(evidence: Evidence) -> Iterator[Reason]:
    for axis in np.flatnonzero(evidence.hardly_excited):
        ours, still = evidence.rate_error(MODEL)[axis], evidence.rate_error(NOTHING_MOVES)[axis]
        text = f"{AXES[axis]} barely moves in training: its rate is predicted with an error of {ours:.3g} rad/s"
        if not np.isfinite(ours):
            yield Reason(f"{AXES[axis]} barely moves in training, and windows of it cannot be replayed", AGAINST)
        elif evidence.beats_nothing_moves(MODEL)[axis]:
            neither = "which is better by more than chance but confirms no model of its torque"
            yield Reason(f"{text}, {still:.3g} if nothing moved, {neither}", NEITHER)
        else:
            yield Reason(f"{text}, {still:.3g} if nothing moved: not better by more than chance", AGAINST)


def _against_rigid_body(evidence: Evidence) -> Iterator[Reason]:
    several = len(evidence.held_out) > 1
    for flown, compared in evidence.torque.items():
        where = f" ({flown})" if several else ""
        yield _compared(f"squared error of held-out torque{where}", compared)
    for flown, steps in evidence.replayed.items():
        if steps.windows:
            compared = evidence.replay_compared(flown, MODEL, RIGID_BODY)
            reason = _compared(f"squared error of the replayed body rate ({flown})", compared)
            # What was learned from is no witness.
            yield reason if flown in evidence.held_out else Reason(reason.text, NEITHER)


def _constant(evidence: Evidence) -> Iterator[Reason]:
    """Name a constant torque that is large against the noise, and not negligible against the torque."""
    axes = evidence.identification.axes
    constant, noise = np.abs(axes.constant), axes.torque * np.sqrt(np.clip(1.0 - axes.r2, 0.0, None))
    for axis in np.flatnonzero((constant > _LARGE_OVER_NOISE * noise) & (constant > _SMALL * axes.torque)):
        share = f"{100 * constant[axis] / axes.torque[axis]:.3g} % of its torque"
        text = f"{AXES[axis]}: a constant torque of {axes.constant[axis]:.3g} N m acts in training, {share}"
        yield Reason(f"{text}: no inertia causes it; errors are compared with the rigid body's without it", NEITHER)


def _compared(what: str, errors: Comparison) -> Reason:
    if not errors.blocks:
        return Reason(f"{what}: nothing to compare", AGAINST)
    if errors.ratio == 1:
        return Reason(f"{what}: the same as that of the rigid body", AGAINST)
    if np.isinf(errors.ratio):
        return Reason(f"{what}: that of the rigid body is rounding, the model's is not", AGAINST)
    text = f"{what}: {errors.ratio:.3g} times that of the rigid body"
    if errors.lower or errors.higher:
        return Reason(f"{text}, by more than chance over {errors.blocks} blocks", FOR if errors.lower else AGAINST)
    return Reason(f"{text}, which may be chance over {errors.blocks} blocks", AGAINST)


def _steps(evidence: Evidence) -> Iterator[Reason]:
    steps = evidence.steps
    if not steps.windows:
        yield Reason(f"{steps.part}: no stretch without a pause or a vertical pitch to replay torques on", NEITHER)
        return
    ours, still = (
        float(np.degrees(np.linalg.norm(steps.attitude[steps.model.index(name), -1])))
        for name in (MODEL, NOTHING_MOVES)
    )
    if np.isfinite(ours):
        text = f"after {steps.horizon[-1]:.3g} s of replayed torques ({steps.part}, {steps.windows} windows), attitude"
        yield Reason(
            f"{text} is off by {ours:.3g} degrees, {still:.3g} if nothing moved", FOR if ours < still else AGAINST
        )


def _lost(evidence: Evidence) -> Iterator[Reason]:
    if evidence.lost(MODEL):
        yield Reason(
            f"{evidence.lost(MODEL)} of {evidence.windows} replayed windows do not run to the end: D(q) is not "
            "positive definite there, or the model turns faster than any step of integration",
            AGAINST,
        )


@dataclass(frozen=True, eq=False)
class Verdict:
    """How far to trust a model, and why; what decided comes first."""

    label: str = about("good-for-control, good-inside-region, shows-the-loop, not-better-than-rigid-body, do-not-use")
    region: str = about("region of attitudes that the verdict is about, in words")
    reasons: tuple[Reason, ...] = part()


def verdict(evidence: Evidence) -> Verdict:
    """Judge a model by the first rule that applies.

    1. *do-not-use* where D(q) is not positive definite at an attitude that training visited: then some torque turns
       the model the wrong way, and a controller that inverts D(q) diverges.
    2. A model has to show that it is better than the rigid body, which has six parameters and holds at every
       attitude: in one held-out part at least its error of torque, or of the body rate replayed, is lower by more than
       chance, and neither is higher by more than chance in any. Both are compared with the constant torque that they
       miss in training, which is not inertia's, and which a fuzzy part can imitate and a rigid body cannot. Otherwise,
       and always if nothing was held out, *not-better-than-rigid-body*; or *do-not-use*, where the rigid body is no
       body, or explains no more of the torque about an excited axis than a constant does (R2 of 0 or less).
    3. *do-not-use* where the model loses more than one in twenty windows of a held-out part; where less than 97.5 % of
       the bootstrap draws of D(q) are positive definite at all attitudes visited that are 17 degrees from a vertical
       pitch; or where the held-out R2 of body torque about any axis is below `r2_min` in any part, or its body rate,
       replayed, is farther off than if nothing moved: R2 of torque alone is no evidence of prediction. Instead of R2,
       which then measures noise, an axis that hardly accelerates is judged by its body rate replayed: better by more
       than chance, in every part, than the prediction that it stays what it is.
    4. *good-for-control* where the model is the same rule at every attitude, training went all round, the samples
       determine every coefficient beyond their noise, D(q) is positive definite at every roll and pitch, and R2
       confirms every axis; otherwise *good-inside-region*: nothing is known outside.

    An unfinished search, wide bands, residuals that are not white and a few windows that were lost are reported as
    reasons and do not decide: each of them harms a model only as far as it predicts worse, and that is measured.
    """
    label, decisive = _decided(evidence)
    listed = (decisive, *reasons(evidence))
    everywhere = label == "good-for-control"
    region = "every roll and pitch" if everywhere else region_in_words(evidence.identification.model.visited)
    return Verdict(label, region, listed)


def contradicted(found: Verdict, contradictions: Sequence[str]) -> Verdict:
    """Take back the verdict on a model whose flights contradict themselves: it repeats what is wrong with them.

    Parameters
    ----------
    contradictions : sequence of str
        Sentences on the flights; nothing is taken back where there are none.
    """
    if not contradictions:
        return found
    wrong = tuple(as_contradiction(each) for each in contradictions)
    against = (Reason(each, AGAINST) for each in wrong)
    return replace(found, label=capped(Trust(found.label), wrong), reasons=(*against, *found.reasons))


def with_loop(found: Verdict, loop: LoopBounds | None, *, by_past: bool = False) -> Verdict:
    """Take back a good verdict on a model whose flights show the loop, unless the past identifies it.

    `loop` is None where something from outside separates the vehicle from its autopilot.
    """
    if loop is None or not loop.shows_loop:
        return found
    label = capped(Trust(found.label), (), loop=True)
    # What decided stays first.
    first = 0 if label is Trust.LOOP else 1
    against = Reason(loop_in_words(loop, by_past=by_past), AGAINST)
    return replace(found, label=label, reasons=(*found.reasons[:first], against, *found.reasons[first:]))


def good_axes(evidence: Evidence, predictor: str) -> BoolArray:
    """Flag the body axes about which a predictor is good enough for control, by rule 3 of `verdict`; shape (3,)."""
    unexcited = evidence.hardly_excited | np.isnan(evidence.r2(predictor))
    return confirmed_axes(evidence, predictor) | (unexcited & evidence.beats_nothing_moves(predictor))


def confirmed_axes(evidence: Evidence, predictor: str) -> BoolArray:
    """Flag the body axes, shape (3,), whose held-out R2 of torque is at least `r2_min` and not denied by playback."""
    return np.asarray((evidence.r2(predictor) >= evidence.r2_min) & evidence.predicts(predictor))


def _decided(evidence: Evidence) -> tuple[Trust, Reason]:
    if evidence.impossible:
        return Trust.DO_NOT_USE, Reason(_no_body(evidence), AGAINST)
    if not _better(evidence):
        return _not_better(evidence)
    why = _not_good_enough(evidence)
    if why is not None:
        return Trust.DO_NOT_USE, Reason(f"better than the rigid body, but {why}", AGAINST)
    confirmed = bool(np.all(confirmed_axes(evidence, MODEL)))
    label = Trust.CONTROL if evidence.everywhere and confirmed else Trust.INSIDE
    text = "better than the rigid body on held-out data, and good enough for control"
    return label, Reason(f"{text}: {_r2_in_words(evidence, MODEL)}", FOR)


def _better(evidence: Evidence) -> bool:
    replayed = [evidence.replay_compared(part, MODEL, RIGID_BODY) for part in evidence.held_out]
    compared = [*evidence.torque.values(), *replayed]
    return any(one.lower for one in compared) and not any(one.higher for one in compared)


def _not_good_enough(evidence: Evidence) -> str | None:
    """Explain why a model that is better than the rigid body is not to be used; None where it is."""
    if evidence.loses_many:
        return f"{evidence.lost(MODEL)} of {evidence.windows} replayed windows do not run to the end"
    if evidence.definite is not None and evidence.definite < DEFINITE_SHARE:
        share = f"only {100 * evidence.definite:.3g} % of the bootstrap draws"
        return (
            f"{share} have a D(q) that is positive definite wherever training was; {100 * DEFINITE_SHARE:g} % are "
            "required"
        )
    if np.all(good_axes(evidence, MODEL)) and np.any(confirmed_axes(evidence, MODEL)):
        return None
    r2 = numbers(evidence.r2(MODEL))
    denied = (evidence.r2(MODEL) >= evidence.r2_min) & ~evidence.predicts(MODEL)
    if np.any(denied):
        return f"its replayed body rate about {_names(denied)} is farther off than if nothing moved (R2 of torque {r2})"
    return f"not good enough for control: R2 of held-out body torque {r2}; {evidence.r2_min:g} is required"


def _r2_in_words(evidence: Evidence, predictor: str) -> str:
    """Format the R2 of the axes that it confirms, and name those that nothing confirms."""
    confirmed, r2 = confirmed_axes(evidence, predictor), evidence.r2(predictor)
    text = f"R2 of body torque {numbers(r2, confirmed)}; {evidence.r2_min:g} is required"
    return text if np.all(confirmed) else f"{text}; nothing confirms it about {_names(~confirmed)}"


def _not_better(evidence: Evidence) -> tuple[Trust, Reason]:
    r2 = evidence.r2(RIGID_BODY)
    explains = f"R2 of body torque {numbers(r2)}"
    why = why_unphysical(evidence.identification.rigid_body)
    if np.any((r2 <= 0) & ~evidence.hardly_excited):
        text = f"neither the model nor the rigid body explains more of the torque than a constant does: {explains}"
        return Trust.DO_NOT_USE, Reason(text, AGAINST)
    if why is not None:
        return Trust.DO_NOT_USE, Reason(
            f"the model is not shown to be better than the rigid body, and that {why}", AGAINST
        )
    if not evidence.held_out:
        text = "nothing was held out, so nothing shows that the model is better than the rigid body, which is simpler"
        return Trust.RIGID_BODY, Reason(f"{text} (rigid body in training: {explains})", AGAINST)
    return Trust.RIGID_BODY, _rigid_body_instead(evidence)


def _rigid_body_instead(evidence: Evidence) -> Reason:
    """Explain whether the rigid body is to be used in place of a model that is not better."""
    bad = ~good_axes(evidence, RIGID_BODY)
    if not np.any(bad):
        use = "use the rigid body: it is simpler, and the model is not better by more than chance on held-out data"
        return Reason(f"{use}; it is itself good for control ({_r2_in_words(evidence, RIGID_BODY)})", NEITHER)
    neither = bad & ~good_axes(evidence, MODEL)
    who, where = ("neither is", neither) if np.any(neither) else ("the latter is not", bad)
    text = f"the model is not better than the rigid body by more than chance, and {who} "
    explains = f"rigid body: R2 of body torque {numbers(evidence.r2(RIGID_BODY))}; {evidence.r2_min:g} is required"
    return Reason(f"{text}good enough for control about {_names(where)} ({explains})", AGAINST)


def _names(axes: BoolArray) -> str:
    return ", ".join(np.array(AXES)[axes])


def _no_body(evidence: Evidence) -> str:
    physics, result = evidence.physics, evidence.identification
    if physics.indefinite:
        where = " and ".join(f"{angle:.0f}" for angle in np.degrees(physics.worst_attitude))
        at = f"in {physics.indefinite} of {physics.cells} cells of attitude that training visited, worst at roll and "
        at += f"pitch of {where} degrees"
    else:
        at = f"at {result.indefinite} of {next(iter(result.samples.values()))} training samples"
    text = f"D(q) is not positive definite {at}: no body turns like that"
    if evidence.held_out and np.all(confirmed_axes(evidence, RIGID_BODY)) and why_unphysical(result.rigid_body) is None:
        text += f"; the rigid body is good for control (R2 of body torque {numbers(evidence.r2(RIGID_BODY))})"
    return text


def region_in_words(visited: BoolArray) -> str:
    """Describe the attitudes that training visited: the shortest ranges that hold all visited cells, and their share.

    Roll is along the first axis of the cells, from -180 degrees.
    """
    roll, pitch = (_range(np.asarray(visited.any(axis=other))) for other in (1, 0))
    return f"roll {roll}, pitch {pitch} ({100 * np.mean(visited):.3g} % of all roll and pitch)"


def _range(marked: BoolArray) -> str:
    """Describe the shortest arc that holds all marked cells of a circle."""
    cells, index = len(marked), np.flatnonzero(marked)
    if len(index) == cells:
        return "all round"
    if len(index) == 0:
        return "nowhere"
    # The arc ends where the longest pause begins, and starts behind it.
    pauses = np.diff(np.append(index, index[0] + cells))
    longest = int(np.argmax(pauses))
    start = int(index[(longest + 1) % len(index)])
    end = start + cells - int(pauses[longest]) + 1
    return f"{_degrees(start, cells)} to {_degrees(end, cells)} degrees"


def _degrees(edge: int, cells: int) -> str:
    return f"{360 * edge / cells - 180:g}"
