"""Simpler ways to name effects, on the same columns: forward selection by BIC, and by an F test for white noise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.stats import f as fisher

from cpfls_cli.consistency.audit import audit
from cpfls_cli.gap.balance.balance_system import system
from cpfls_cli.gap.balance.refine import refined
from cpfls_cli.gap.balance.weak_flight import weak_flight
from cpfls_cli.gap.diagnose import considered
from cpfls_cli.gap.naming.ranking import best_floor, block_index, candidates_of, score, scoring_matrix
from cpfls_cli.weak_form.resampling import folds
from cpfls_cli.weak_form.windows import common_windows


class Gain(NamedTuple):
    """A candidate fitted to all data: squares left without and with it, its numbers, rows and columns of the fit."""

    candidate: object
    before: float
    after: float
    numbers: int
    rows: int
    columns: int

    def bic(self):
        """Give the change of the Bayesian information criterion."""
        return self.rows * np.log(self.after / self.before) + self.numbers * np.log(self.rows)

    def p_value(self):
        """Give the probability of this gain if all rows were independent."""
        free = self.rows - self.columns
        return fisher.sf((self.before - self.after) / self.numbers / (self.after / free), self.numbers, free)


def baselines(recordings, settings):
    """Name effects in two simpler ways.

    Parameters
    ----------
    recordings : sequence of Recording
    settings : GapSettings

    Returns
    -------
    dict of str to list of str
        Names in the order in which they were chosen.
    """
    own = common_windows(recordings, settings)
    checked = audit([recording.signals for recording in recordings], own)
    flights = [weak_flight(r.name, checked.repaired(r.signals), own, None, settings.force) for r in recordings]
    effects = considered(settings)
    least = settings.significance / len(effects)
    return {
        "bic": _forward(flights, effects, settings, Gain.bic, 0.0),
        # Bonferroni over the effects, so that it is as strict as it can be.
        "f_test": _forward(flights, effects, settings, Gain.p_value, least),
    }


def _forward(flights, effects, settings, measure, largest):
    chosen = ()
    while len(chosen) < settings.effects_max:
        gains, floor = _gains(flights, chosen, effects, settings)
        best = min(gains, key=measure, default=None)
        if best is None or measure(best) >= largest:
            break
        chosen = refined(flights, [*chosen, best.candidate], floor).chosen
    return [candidate.effect.name for candidate in chosen]


def _gains(flights, chosen, effects, settings):
    hypothesis = system(flights, chosen)
    floor = best_floor(hypothesis)
    names = {candidate.effect.name for candidate in chosen}
    tried = [c for c in candidates_of([e for e in effects if e.name not in names]) if hypothesis.can(c)]
    arranged = scoring_matrix(hypothesis, tried, floor)
    normal = folds(arranged.matrix, hypothesis.residual / floor, block_index(hypothesis, settings), arranged.prior)
    scored, _ = score(arranged, normal.conditional_on(arranged.base), hypothesis)
    # The score is asked only which columns the bounds leave.
    admitted = [each for each in scored if np.isfinite(each.gain)]
    matrix = arranged.matrix.reshape(-1, arranged.matrix.shape[2])
    right = (hypothesis.residual / floor).reshape(-1)
    least = _Normal(matrix, right)
    rows = sum(len(flight) * int(flight.known.sum()) for flight in flights)
    columns = {candidate.key: own for candidate, own, _ in arranged.candidates}
    kept = [columns[each.candidate.key][each.coefficients != 0] for each in admitted]
    return [_gain(*pair, arranged.base, least, rows) for pair in zip(admitted, kept, strict=True)], floor


class _Normal:
    """Least squares with many subsets of columns."""

    def __init__(self, matrix, right):
        length = np.linalg.norm(matrix, axis=0)
        scaled = matrix / np.where(length > 0, length, 1.0)
        self.length, self.square = length, float(right @ right)
        self.gram, self.moment = scaled.T @ scaled, scaled.T @ right

    def left(self, columns, fixed=None):
        """Give the sum of squares left by some columns; ``fixed`` is one with the coefficient 1."""
        moment, square = self.moment, self.square
        if fixed is not None:
            moment = moment - self.gram[:, fixed] * self.length[fixed]
            square += self.length[fixed] ** 2 - 2 * self.moment[fixed] * self.length[fixed]
        own = self.gram[np.ix_(columns, columns)] + 1e-9 * np.eye(len(columns))
        return square - moment[columns] @ np.linalg.solve(own, moment[columns])


def _gain(scored, columns, base, normal, rows):
    effect = scored.candidate.effect
    if effect.unit_coefficient:
        used, after = base, normal.left(base, int(columns[0]))
    else:
        used = np.concatenate([base, columns])
        after = normal.left(used)
    # An effect without numbers of its own still is one choice more.
    numbers = max(1, len(used) - len(base) + len(effect.shapes))
    return Gain(scored.candidate, normal.left(base), after, numbers, rows, len(used))
