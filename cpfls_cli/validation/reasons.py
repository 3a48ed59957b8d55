"""What speaks for a model and against it, one sentence each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cpfls_cli.identification.findings import AXES
from cpfls_cli.validation.grounds import Grounds
from cpfls_cli.validation.reason import AGAINST, FOR, NEITHER, Reason
from cpfls_cli.validation.reasons_of_errors import reasons_of_errors

# White errors fall below it once in a hundred times an axis.
_NOT_WHITE = 0.01
_SMALLEST_P = 1e-16
DEFINITE_SHARE = 0.975
"""Share of the bootstrap draws that are to be positive definite wherever training was."""


def reasons(grounds: Grounds) -> Iterator[Reason]:
    """List what speaks for a model and against it, the most important first."""
    yield from reasons_of_errors(grounds)
    sense = (_definite, _draws, _elsewhere, _fuzzy_part, _determined)
    for rule in (*sense, _band, _search, _outside, _white):
        yield from rule(grounds)


def _definite(grounds: Grounds) -> Iterator[Reason]:
    physics = grounds.physics
    if physics.cells and not grounds.impossible:
        yield Reason(
            f"D(q) is positive definite in all {physics.cells} cells of attitude that training visited; its smallest "
            f"eigenvalue is {physics.smallest_eigenvalue:.3g} kg m^2",
            FOR,
        )


def _draws(grounds: Grounds) -> Iterator[Reason]:
    share = grounds.definite
    if share is not None and not grounds.impossible:
        text = f"D(q) is positive definite in all cells clear of a vertical pitch in {100 * share:.3g} % of the draws"
        enough = share >= DEFINITE_SHARE
        yield Reason(
            text if enough else f"{text}; {100 * DEFINITE_SHARE:g} % are asked for", FOR if enough else AGAINST
        )


def _elsewhere(grounds: Grounds) -> Iterator[Reason]:
    """Where training went all round but not everywhere, a rule of all attitudes may be no body at others."""
    physics = grounds.physics
    if grounds.one_rule and not grounds.impossible and physics.indefinite_anywhere:
        text = (
            f"D(q) is not positive definite in {physics.indefinite_anywhere} of the {physics.every_cell} cells of all"
        )
        yield Reason(f"{text} roll and pitch, though in none that training visited", AGAINST)


def _fuzzy_part(grounds: Grounds) -> Iterator[Reason]:
    if grounds.fuzzy_part_off:
        text = "cross-validation switched the fuzzy part off: no evidence for an inertia that depends on attitude"
        yield Reason(text, AGAINST)


def _determined(grounds: Grounds) -> Iterator[Reason]:
    found = grounds.identification
    if grounds.fuzzy_part_off:
        return
    if grounds.determined:
        yield Reason(f"every coefficient is determined; condition number {found.system.condition_number:.3g}", FOR)
    else:
        share, weak = 100 * float(np.mean(found.excitation.determined)), int(np.sum(~found.excitation.excited))
        rules = f"{weak} of {len(found.excitation.name)} rules are not excited beyond the noise"
        yield Reason(f"{share:.3g} % of what the rules could say is determined by the flight; {rules}", AGAINST)


def _band(grounds: Grounds) -> Iterator[Reason]:
    if grounds.band is None:
        return
    widest = float(np.max(grounds.band))
    text = f"the widest 95 % band of a moment of inertia is {100 * widest:.3g} % of the inertia itself"
    # A band as wide as its value leaves open by more than a factor of two how hard the body is to turn.
    yield Reason(text, FOR if widest < 1 else AGAINST)


def _search(grounds: Grounds) -> Iterator[Reason]:
    found = grounds.identification
    if not found.complete:
        done = len(found.history.evaluations) - 1
        text = f"the search stopped before its end ({found.stop_reason}, after {done} generations)"
        yield Reason(f"{text}: better partitions may exist", AGAINST)


def _outside(grounds: Grounds) -> Iterator[Reason]:
    found = grounds.identification
    outside, samples = (sum(of[part] for part in grounds.held_out) for of in (found.outside, found.samples))
    if outside and not (grounds.fuzzy_part_off or grounds.everywhere):
        yield Reason(
            f"{100 * outside / samples:.3g} % of the held-out samples lie outside the attitudes that training visited",
            NEITHER,
        )


def _white(grounds: Grounds) -> Iterator[Reason]:
    errors = grounds.residuals
    told = np.flatnonzero(np.isfinite(errors.ljung_box))
    biased = np.flatnonzero(errors.mean_p < _NOT_WHITE)
    if len(biased):
        torques = ", ".join(f"{errors.mean[axis]:.3g} N m about {AXES[axis]}" for axis in biased)
        text = f"a constant torque is left over: {torques} ({errors.part}"
        yield Reason(f"{text}, p {_printed(float(np.min(errors.mean_p[biased])))}), which the model lacks", NEITHER)
    coloured = [AXES[axis] for axis in told if errors.ljung_box[axis] < _NOT_WHITE]
    if coloured:
        smallest = float(np.min(errors.ljung_box[told]))
        text = f"torque errors about {', '.join(coloured)} are not white ({errors.part}, p {_printed(smallest)})"
        yield Reason(f"{text}: filters of the log do that, and so does an effect that has no term", NEITHER)
    elif len(told) and not len(biased):
        text = f"torque errors are white noise as far as {errors.samples} samples of {errors.part} tell"
        yield Reason(f"{text} (p {_printed(float(np.min(errors.ljung_box[told])))})", FOR)
    elif not len(told) and np.all(errors.exact):
        yield Reason(f"the torque of {errors.part} is met to rounding", FOR)


def _printed(p_value: float) -> str:
    return f"{p_value:.2g}" if p_value > _SMALLEST_P else f"below {_SMALLEST_P:g}"
