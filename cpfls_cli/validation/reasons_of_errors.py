"""What the errors of torque and of replayed rates speak for, one sentence each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.identification.findings import AXES
from cpfls_cli.validation.grounds import MODEL, RIGID_BODY, Grounds
from cpfls_cli.validation.paired import Comparison
from cpfls_cli.validation.reason import AGAINST, FOR, NEITHER, Reason, numbers
from cpfls_cli.validation.steps import NOTHING_MOVES

_LARGE_BESIDE_NOISE, _SMALL = 0.25, 0.01


def reasons_of_errors(grounds: Grounds) -> Iterator[Reason]:
    """List what the errors on held-out data speak for, the most important first."""
    for rule in (_held_out, _hardly_excited, _beside_rigid_body, _constant, _steps, _lost):
        yield from rule(grounds)


def _held_out(grounds: Grounds) -> Iterator[Reason]:
    r2 = grounds.r2(MODEL)
    if not grounds.held_out:
        yield Reason(
            f"judged on its own training data alone (R2 of body torque {numbers(r2)}), which says nothing of any other "
            "flight: hold some out with identification.training_share below 1, or --validate another flight",
            AGAINST,
        )
        return
    low = [name for name, value in zip(AXES, r2, strict=True) if not value >= grounds.r2_min]
    parts = f"worst of {len(grounds.held_out)} held-out parts" if len(grounds.held_out) > 1 else "held out"
    text = f"R2 of body torque, {parts}: {numbers(r2)}"
    if low:
        yield Reason(f"{text}; below {grounds.r2_min:g} about {', '.join(low)}", AGAINST)
    else:
        yield Reason(f"{text}; {grounds.r2_min:g} or more about every axis", FOR)


def _hardly_excited(grounds: Grounds) -> Iterator[Reason]:
    for axis in np.flatnonzero(grounds.hardly_excited):
        ours, still = grounds.rate_error(MODEL)[axis], grounds.rate_error(NOTHING_MOVES)[axis]
        text = f"{AXES[axis]} hardly moves in training: its rate is predicted with an error of {ours:.3g} rad/s"
        if not np.isfinite(ours):
            yield Reason(f"{AXES[axis]} hardly moves in training, and windows of it cannot be replayed", AGAINST)
        elif grounds.beats_nothing_moves(MODEL)[axis]:
            neither = "which is better by more than chance, but confirms no model of its torque"
            yield Reason(f"{text}, {still:.3g} if nothing moved, {neither}", NEITHER)
        else:
            yield Reason(f"{text}, {still:.3g} if nothing moved: not better by more than chance", AGAINST)


def _beside_rigid_body(grounds: Grounds) -> Iterator[Reason]:
    several = len(grounds.held_out) > 1
    for part, compared in grounds.torque.items():
        where = f" ({part})" if several else ""
        yield _compared(f"squared error of held-out torque{where}", compared)
    for part, steps in grounds.replayed.items():
        if steps.windows:
            compared = grounds.replay_beside(part, MODEL, RIGID_BODY)
            reason = _compared(f"squared error of the body rate replayed ({part})", compared)
            # What was learned from is no witness.
            yield reason if part in grounds.held_out else Reason(reason.text, NEITHER)


def _constant(grounds: Grounds) -> Iterator[Reason]:
    """Name a constant torque that is large beside the noise, and not negligible beside the torque."""
    axes = grounds.identification.axes
    constant, noise = np.abs(axes.constant), axes.torque * np.sqrt(np.clip(1.0 - axes.r2, 0.0, None))
    for axis in np.flatnonzero((constant > _LARGE_BESIDE_NOISE * noise) & (constant > _SMALL * axes.torque)):
        share = f"{100 * constant[axis] / axes.torque[axis]:.3g} % of its torque"
        text = f"{AXES[axis]}: a constant torque of {axes.constant[axis]:.3g} N m acts in training, {share}"
        yield Reason(f"{text}: no inertia makes it, and errors are compared with the rigid body's without it", NEITHER)


def _compared(what: str, found: Comparison) -> Reason:
    if not found.blocks:
        return Reason(f"{what}: nothing to compare", AGAINST)
    if found.ratio == 1:
        return Reason(f"{what}: the same as that of the rigid body", AGAINST)
    if np.isinf(found.ratio):
        return Reason(f"{what}: that of the rigid body is rounding, the model's is not", AGAINST)
    text = f"{what}: {found.ratio:.3g} times that of the rigid body"
    if found.lower or found.higher:
        return Reason(f"{text}, by more than chance over {found.blocks} blocks", FOR if found.lower else AGAINST)
    return Reason(f"{text}, which may be chance over {found.blocks} blocks", AGAINST)


def _steps(grounds: Grounds) -> Iterator[Reason]:
    steps = grounds.steps
    if not steps.windows:
        yield Reason(f"{steps.part}: no stretch without a pause or a vertical pitch to replay torques on", NEITHER)
        return
    ours, still = (
        float(np.degrees(np.linalg.norm(steps.attitude[steps.model.index(name), -1])))
        for name in (MODEL, NOTHING_MOVES)
    )
    if np.isfinite(ours):
        text = (
            f"after {steps.horizon[-1]:.3g} s of torques replayed ({steps.part}, {steps.windows} windows) the attitude"
        )
        yield Reason(
            f"{text} is off by {ours:.3g} degrees, {still:.3g} if nothing moved", FOR if ours < still else AGAINST
        )


def _lost(grounds: Grounds) -> Iterator[Reason]:
    if grounds.lost(MODEL):
        yield Reason(
            f"{grounds.lost(MODEL)} of {grounds.windows} windows replayed do not come to their end: D(q) is not "
            "positive definite there, or the model turns faster than any step of integration",
            AGAINST,
        )
