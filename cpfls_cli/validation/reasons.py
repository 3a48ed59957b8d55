"""Reasons for and against a model, one sentence each."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.identification.findings import AXES
from cpfls_cli.result import About
from cpfls_cli.validation.evidence import MODEL, RIGID_BODY, Evidence
from cpfls_cli.validation.paired import Comparison
from cpfls_cli.validation.replay import NOTHING_MOVES

FOR, NEITHER, AGAINST = 1, 0, -1

# White errors fall below it once in a hundred times an axis.
_NOT_WHITE = 0.01
_SMALLEST_P = 1e-16
DEFINITE_SHARE = 0.975
"""Share of the bootstrap draws that are to be positive definite wherever training was."""

# A constant torque is reported from a quarter of the noise of errors on, if it is a hundredth of all torque.
_LARGE_BESIDE_NOISE, _SMALL = 0.25, 0.01


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
    of_errors = (_held_out, _hardly_excited, _beside_rigid_body, _constant, _steps, _lost)
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


def _beside_rigid_body(evidence: Evidence) -> Iterator[Reason]:
    several = len(evidence.held_out) > 1
    for part, compared in evidence.torque.items():
        where = f" ({part})" if several else ""
        yield _compared(f"squared error of held-out torque{where}", compared)
    for part, steps in evidence.replayed.items():
        if steps.windows:
            compared = evidence.replay_beside(part, MODEL, RIGID_BODY)
            reason = _compared(f"squared error of the replayed body rate ({part})", compared)
            # What was learned from is no witness.
            yield reason if part in evidence.held_out else Reason(reason.text, NEITHER)


def _constant(evidence: Evidence) -> Iterator[Reason]:
    """Name a constant torque that is large beside the noise, and not negligible beside the torque."""
    axes = evidence.identification.axes
    constant, noise = np.abs(axes.constant), axes.torque * np.sqrt(np.clip(1.0 - axes.r2, 0.0, None))
    for axis in np.flatnonzero((constant > _LARGE_BESIDE_NOISE * noise) & (constant > _SMALL * axes.torque)):
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
