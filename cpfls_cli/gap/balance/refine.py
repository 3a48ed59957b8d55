"""Fits of a hypothesis: linear coefficients, derivatives by shapes, and refinement of the shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy.optimize import lsq_linear, minimize_scalar

from cpfls_cli.arrays import Array, BoolArray
from cpfls_cli.effects.catalogue.parameter_error import Change, physical, too_light
from cpfls_cli.effects.effect import Shape
from cpfls_cli.effects.registry import CATALOGUE
from cpfls_cli.gap.balance.balance_system import System, has_force, is_free, system
from cpfls_cli.gap.balance.weak_flight import Candidate, WeakFlight
from cpfls_cli.gap.settings import VISIBLE
from cpfls_cli.rounding import ROUNDING, at_most, levelled, smallest

_MOST_NOISE = 0.5
"""Share of the squares of any combination of columns that is believed to be noise at most: beyond it, the rest is
uncertain."""
_SETTLED = 1e-2
"""Change of the sum of squares, in variances, below which a fit has converged: a tenth of a standard error; and share
of a step, or of what it takes off, below which it is none."""


def refined(flights: Sequence[WeakFlight], chosen: Sequence[Candidate], floor: Array) -> System:
    """Refine the shapes of the chosen effects by minimising the squared residual.

    The newest shapes first, one by one between the points of their grids; then, where there are several, all together
    (`refitted`), because a lag and a delay, say, trade with each other.

    `floor`: shape (6,).
    """
    best = list(_exact(system(flights, chosen), floor).chosen)
    rotor_wrench = system(flights).rotor_wrench
    # Numbers of the vehicle alone, such as its mass, can be all that is named.
    for shape in best[-1].effect.shapes if best else ():
        if shape.valley is not None:
            best[-1] = _in_deepest_valley(flights, best, shape, floor)
    # What took the place of a linear effect has no place on a grid.
    indices = [index for index, candidate in enumerate(best) if candidate.effect is chosen[-1].effect]
    newest = [(index, shape) for index in indices for shape in best[index].effect.shapes if shape.follows is None]
    # A second round where there are several: the best length of a cable depends on its damping.
    rounds = 2 if len(newest) > 1 else 1
    for index, shape in rounds * newest:
        best[index] = _improved(flights, best, index, shape, floor, rotor_wrench)
    hypothesis = system(flights, best)
    return refitted(hypothesis, floor) if len(hypothesis.shapes) > 1 else hypothesis


@dataclass(frozen=True)
class Equations:
    """Weighted rows of columns and of their right side, and noise like that in them.

    Noise in a column shrinks its coefficient, and what goes with it takes the rest: noisy rates and rotor speeds made
    Izz and the inertia of the rotors 4 % too small, both. So what noise adds is taken off the normal equations.

    `columns`: shape (row, column).
    `right`: shape (row,).
    `noise`, shape (row, column + 1): that of the right side in the last column.
    Reference: Fuller 1987, Measurement Error Models, section 2.2 (method of moments).
    """

    columns: Array
    right: Array
    noise: Array

    @cached_property
    def _apart(self) -> tuple[Array, Array, Array, Array]:
        """Separate signal from noise: root of the squares of all rows, its inverse, shares of noise, and their axes."""
        length = np.linalg.norm(self.columns, axis=0)
        scale = np.where(length > 0, length, 1.0)
        triangle = np.asarray(np.linalg.qr(self.columns / scale, mode="r"))
        inverse = np.linalg.pinv(triangle, rcond=ROUNDING) / scale[:, None]
        noise = self.noise[:, :-1] @ inverse
        share, axes = np.linalg.eigh(noise.T @ noise)
        return triangle * scale, inverse, np.maximum(share, 0.0), axes

    @property
    def trusted(self) -> float:
        """Share of the noise that is taken off."""
        largest = self._apart[2].max(initial=0.0)
        return 1.0 if largest <= _MOST_NOISE else float(_MOST_NOISE / largest)

    @cached_property
    def root(self) -> tuple[Array, Array]:
        """Columns and a right side whose least squares are those of rows without noise in their columns.

        Of shape (column, column) and (column,).
        """
        triangle, inverse, share, axes = self._apart
        kept = np.sqrt(1.0 - self.trusted * share)
        right = inverse.T @ (self.columns.T @ self.right - self.trusted * (self.noise[:, :-1].T @ self.noise[:, -1]))
        return kept[:, None] * (axes.T @ triangle), axes.T @ right / kept

    @property
    def errors(self) -> Array:
        """Standard errors of the coefficients, shape (column,)."""
        return np.asarray(np.linalg.norm(self._apart[1], axis=1))

    def around(self, linear: Array, kept: BoolArray, moving: Array) -> Equations:
        """Subtract what coefficients explain, keep the columns of some, and add weighted columns without noise.

        `linear`: shape (column,); `kept`: shape (column,); `moving`: shape (..., column + shape), as `number_columns`.
        """
        more, added = np.split(moving.reshape(len(self.right), -1), [len(linear)], axis=1)
        left = self.noise[:, -1] - self.noise[:, :-1] @ linear
        noise = np.column_stack([self.noise[:, :-1][:, kept], np.zeros_like(added), left])
        columns = np.column_stack([(self.columns + more)[:, kept], added])
        return Equations(columns, self.right - self.columns @ linear, noise)

    def solve(self) -> Array:
        """Fit all columns, shape (column,)."""
        return least_squares(*self.root)


def equations(hypothesis: System, weight: Array) -> Equations:
    """Weigh the rows of a hypothesis.

    `weight`, shape (6,) or (window, 6), N m and N: standard deviation of each channel.
    """
    columns, noise = (rows / weight[..., None] for rows in (hypothesis.base, hypothesis.noise))
    right = (hypothesis.residual / weight).reshape(-1)
    return Equations(columns.reshape(len(right), -1), right, noise.reshape(len(right), -1))


def fit(hypothesis: System, floor: Array) -> Array:
    """Fit all free columns by weighted least squares, which shrink numbers whose columns are noisy.

    `floor`: shape (6,) or (window, 6); Result: shape (column,).
    """
    matrix = (hypothesis.base / floor[..., None]).reshape(-1, hypothesis.base.shape[2])
    return least_squares(matrix, (hypothesis.residual / floor).reshape(-1))


def least_squares(matrix: Array, right: Array) -> Array:
    """Solve for one or several right sides; columns are brought to one length, and one of zeros gets 0."""
    length = np.linalg.norm(matrix, axis=0)
    scale = np.where(length > 0, 1.0, 0.0) / np.where(length > 0, length, 1.0)
    return np.asarray((np.linalg.lstsq(matrix * scale, right, rcond=ROUNDING)[0].T * scale).T)


def fit_within_bounds(hypothesis: System, weight: Array, *, of_vehicle: bool = False) -> tuple[Array, BoolArray]:
    """Fit all free columns by weighted least squares under the bounds of their coefficients.

    `weight`, shape (6,) or (window, 6), N m and N: standard deviation of each channel.
    `of_vehicle`: whether the vehicle's own numbers are bounded too; else one that no vehicle has says that the log is
    wrong.
    Result `linear`: shape (column,).
    Result `held`, shape (column,): coefficients on a bound, and those that nothing shows, which are 0.
    """
    rows = equations(hypothesis, weight)
    linear = rows.solve()
    length = np.linalg.norm(rows.columns, axis=0)
    least = np.zeros(3, dtype=bool) if of_vehicle else None
    change = _change(hypothesis, length > 0, least)
    at = np.linalg.lstsq(change.matrix, linear - change.offset, rcond=None)[0]
    out = _unseen(hypothesis, change, length)
    within = ((at >= change.low) & (at <= change.high)).all()
    if within and not out.any() and not _without_lever(hypothesis, linear, rows.errors).any():
        return linear, np.zeros(len(linear), dtype=bool)
    columns, right = rows.root
    while True:
        at, linear = _bounded(columns, right, change, out)
        leverless = _without_lever(hypothesis, linear, rows.errors)
        light = np.zeros(3, dtype=bool) if least is None else too_light(linear) & ~least
        if not (leverless.any() or light.any()):
            return linear, out | _held(change, at, least)
        out, least = out | leverless, None if least is None else least | light
        change = _change(hypothesis, length > 0, least)


def _unseen(hypothesis: System, change: Change, length: Array) -> BoolArray:
    """Mark coefficients of effects that even on a bound would move all windows together by nothing that shows."""
    most = np.maximum(np.abs(change.low), np.abs(change.high))
    unseen = np.where(np.isfinite(most), most, 1.0) * length < VISIBLE
    unseen[hypothesis.places[0][1]] = False
    return np.asarray(unseen & np.isfinite(most) & (length > 0))


def _bounded(root: Array, right: Array, change: Change, out: BoolArray) -> tuple[Array, Array]:
    """Fit the numbers behind the coefficients within their bounds; give both."""
    columns = root @ change.matrix
    length = np.linalg.norm(columns, axis=0)
    free = (length > 0) & ~out
    bounds = (change.low[free] * length[free], change.high[free] * length[free])
    at = np.zeros(len(out))
    behind = right - root @ change.offset
    at[free] = lsq_linear(columns[:, free] / length[free], behind, bounds=bounds, method="bvls").x / length[free]
    return at, np.asarray(change.offset + change.matrix @ at)


def _held(change: Change, at: Array, least: BoolArray | None) -> BoolArray:
    """Mark coefficients on a bound; on one of an axis' two bounds it is its coupling that gives way."""
    held = change.matrix.any(axis=0) & (at_most(at, change.low) | at_most(change.high, at))
    if least is not None:
        moments, couplings = held[:3], held[3:6]
        held[:6] = np.concatenate([moments & couplings | least, moments | couplings | least])
    return held


def _change(hypothesis: System, shown: BoolArray, least: BoolArray | None) -> Change:
    """Give the bounds of coefficients, none where physical numbers are others, or of the vehicle without `least`."""
    vehicle = hypothesis.vehicle
    pairs: list[tuple[float, float]] = []
    for candidate, place in hypothesis.places:
        known, width = candidate.effect.coefficients, place.stop - place.start
        bounded = is_free(candidate) and candidate.effect.physical is None and len(known) == width
        pairs += [each.bounds(vehicle) for each in known] if bounded else [(-np.inf, np.inf)] * width
    low, high = np.array(pairs).T
    change = Change(np.zeros(len(low)), np.eye(len(low)), low, high)
    if least is not None:
        own, place = physical(vehicle, shown[:3], least), hypothesis.places[0][1]
        change.offset[place], change.matrix[place, place] = own.offset, own.matrix
        change.low[place], change.high[place] = own.low, own.high
    return change


def _without_lever(hypothesis: System, linear: Array, errors: Array) -> BoolArray:
    """Mark torques that are surely impossible with the force of their effect."""
    out = np.zeros(len(linear), dtype=bool)
    for candidate, place in hypothesis.places if has_force(hypothesis.flights) else ():
        if candidate.effect.lever is not None:
            own, of_force = linear[place], hypothesis.columns(candidate)[:, 3:].any(axis=(0, 1))
            error = np.where(of_force, 0.0, errors[place])
            out[place] = ~candidate.effect.lever(own, error, hypothesis.vehicle) & (own != 0)
    return out


def refitted(hypothesis: System, weight: Array) -> System:
    """Move the shapes of all effects, together with all coefficients, to their least squares by Gauss-Newton steps.

    The last fit of a hypothesis that is believed: it ends where the same linear system that gives the intervals asks
    for no further step. As in the search, less torque with less inertia explains nothing (`torque_loss_ratio`).

    `weight`, shape (6,) or (window, 6), N m and N: standard deviation of each channel.
    """
    hypothesis = _exact(hypothesis, weight)
    if not hypothesis.shapes:
        return hypothesis
    rotor_wrench = system(hypothesis.flights).rotor_wrench
    low, high = np.array([shape.bounds(hypothesis.vehicle) for shape in hypothesis.shapes]).T

    def fitted(there: System) -> tuple[float, tuple[Array, Array, BoolArray]]:
        """Compute the squares that are left, and weights, coefficients and those on bounds."""
        own = weight / torque_loss_ratio(rotor_wrench, there.rotor_wrench)
        linear, held = fit_within_bounds(there, own)
        return float(((there.residual_at(linear) / own) ** 2).sum()), (own, linear, held)

    error, (own, linear, held) = fitted(hypothesis)
    free = np.isnan(said := hypothesis.following(linear))
    # Coefficients move with the shapes that follow them, by a share as far: a few rounds leave less than errors are.
    for _ in range(0 if free.all() else 4):
        hypothesis = hypothesis.with_shapes(np.where(np.isnan(said), hypothesis.shape_values, said))
        error, (own, linear, held) = fitted(hypothesis)
        said = hypothesis.following(linear)
    while True:
        # The change of the shapes jointly with the coefficients that no bound holds, and what it takes off the squares
        # where the residual is linear in them.
        moving = number_columns(hypothesis, linear, rotor_wrench)
        rows = equations(hypothesis, own).around(linear, ~held, moving / own[..., None])
        solved, (columns, right) = rows.solve(), rows.root
        step, gain = np.where(free, solved[len(solved) - len(free) :], 0.0), float(right @ columns @ solved)
        # Half of a step that goes too far. Where a hundredth of what the linear system asks for is too far yet, it
        # holds for no step: a filter and a lag that nothing separates would creep along with no end in sight.
        least = max(_SETTLED, _SETTLED * gain)
        while gain >= least:
            moved, said = np.clip(hypothesis.shape_values + step, low, high), hypothesis.following(linear)
            # Of a load whose mass has gone nothing says how deep its hook is: it stays.
            ahead = hypothesis.with_shapes(np.where(free | np.isnan(said), moved, said))
            left, there = fitted(ahead)
            if error - left >= _SETTLED:
                break
            step, gain = step / 2, gain / 2
        else:
            return hypothesis
        hypothesis, error, (own, linear, held) = ahead, left, there


def _exact(hypothesis: System, weight: Array) -> System:
    """Exchange effects for what takes their place once they are chosen."""
    linear, chosen = fit(hypothesis, weight), {each.effect.name: each for each in hypothesis.chosen}
    for candidate, place in hypothesis.places:
        effect, exact = candidate.effect, candidate.effect.exact
        if exact is not None:
            # Shapes start at what the linear coefficients say.
            numbers = linear[place] if effect.physical is None else np.nan_to_num(effect.physical.of(linear[place]))
            values = {known.name: float(value) for known, value in zip(effect.coefficients, numbers, strict=True)}
            shapes = {s.name: float(np.clip(values[s.name], s.grid[0], s.grid[-1])) for s in exact.shapes}
            chosen[effect.name] = Candidate(exact, shapes)
    there = system(hypothesis.flights, tuple(chosen.values()))
    for candidate, place in there.places:
        plain = CATALOGUE.get(candidate.effect.name, candidate.effect)
        added = slice(place.start + len(plain.coefficients), place.stop)
        # A number of the exact form alone that ends on a bound is noise, or the loop's: the effect goes without it.
        if added.start < added.stop and fit_within_bounds(there, weight)[1][added].any():
            chosen[plain.name] = candidate._replace(effect=plain)
    listed = tuple(chosen.values())
    return hypothesis if listed == hypothesis.chosen else system(hypothesis.flights, listed)


def _improved(
    flights: Sequence[WeakFlight],
    chosen: Sequence[Candidate],
    index: int,
    shape: Shape,
    floor: Array,
    rotor_wrench: Array,
) -> Candidate:
    candidate = chosen[index]

    def error(value: float) -> float:
        hypothesis = system(flights, [*chosen[:index], candidate.at({shape.name: float(value)}), *chosen[index + 1 :]])
        weight = torque_loss_ratio(rotor_wrench, hypothesis.rotor_wrench) / floor
        return float(((hypothesis.residual_at(fit(hypothesis, floor)) * weight) ** 2).sum())

    value = candidate.shape[shape.name]
    bracket = _bracket(_steps(shape, value), value)
    between = minimize_scalar(error, bounds=bracket, method="bounded", options={"xatol": 1e-3 * np.ptp(bracket)})
    # It comes near the ends of the bracket, where a bound may be, and never there.
    return candidate.at({shape.name: smallest((float(between.x), *bracket), error)})


def _in_deepest_valley(
    flights: Sequence[WeakFlight], chosen: Sequence[Candidate], shape: Shape, floor: Array
) -> Candidate:
    """Try one shape of the newest effect in steps of its valleys, with all that the grids of its others hold."""
    newest = chosen[-1]
    # Where valleys are narrower than the steps of the grid, the best point of that lies next to its deepest one.
    low, high = _bracket(shape.grid, newest.shape[shape.name])
    low, high = _bracket(shape.grid, low)[0], _bracket(shape.grid, high)[1]
    values = [value for value in _steps(shape, newest.shape[shape.name]) if low <= value <= high]
    grids = [values if each is shape else each.grid for each in newest.effect.shapes]
    names = [each.name for each in newest.effect.shapes]

    def error(tried: Candidate) -> float:
        hypothesis = system(flights, [*chosen[:-1], tried])
        return float(((hypothesis.residual_at(fit(hypothesis, floor)) / floor) ** 2).sum())

    tried = (Candidate(newest.effect, dict(zip(names, values, strict=True))) for values in product(*grids))
    return smallest(tried, error)


def _steps(shape: Shape, value: float) -> list[float]:
    """Divide the range of a shape by its grid, or by its valleys from a value on."""
    if shape.valley is None:
        return list(shape.grid)
    down, up = (int(np.log(ratio) / shape.valley) for ratio in (value / shape.grid[0], shape.grid[-1] / value))
    return [float(value * np.exp(step * shape.valley)) for step in range(-down, up + 1)]


def _bracket(grid: Sequence[float], value: float) -> tuple[float, float]:
    """Find the neighbours of a value on its grid."""
    nearest = int(np.argmin(levelled(np.abs(np.asarray(grid) - value))))
    return float(grid[max(0, nearest - 1)]), float(grid[min(len(grid) - 1, nearest + 1)])


def number_columns(hypothesis: System, linear: Array, rotor_wrench: Array | None = None) -> Array:
    """Differentiate what the hypothesis explains by its shapes, by central differences.

    `linear`, shape (column,): coefficients of the base.
    `rotor_wrench`, shape (window, 6), N m and N: of the rotors without effects on the actuation, for which a change of
    the rotor torque is compensated.
    Result: shape (window, 6, column + shape): what the base lacks of derivatives by coefficients, which some shapes
    follow; then those by the other shapes.
    """
    values = hypothesis.shape_values
    columns, slopes = np.zeros((*hypothesis.residual.shape, len(values))), np.zeros((len(values), len(linear)))

    def residual_at(shapes: Array) -> Array:
        there = hypothesis.with_shapes(shapes)
        left = there.residual_at(linear)
        if rotor_wrench is None:
            return left
        before, after = (torque_loss_ratio(rotor_wrench, each.rotor_wrench) for each in (hypothesis, there))
        return left * after / before

    for number, step in enumerate(_steps_about(values)):
        ahead, behind = (residual_at(values + change) for change in (step, -step))
        columns[..., number] = (behind - ahead) / (2 * step[number])
    follow = ~np.isnan(hypothesis.following(linear))
    for number, step in enumerate(_steps_about(linear)) if follow.any() else ():
        ahead, behind = (hypothesis.following(linear + change) for change in (step, -step))
        slopes[:, number] = np.nan_to_num((ahead - behind) / (2 * step[number]))
    return np.concatenate([columns @ slopes, np.where(follow, 0.0, columns)], axis=2)


def _steps_about(values: Array) -> Array:
    """Give steps, a row for each value: central differences are off by their square, and by rounding over them."""
    return np.diag(np.finfo(float).eps ** (1 / 3) * np.where(values == 0, 1.0, np.abs(values)))


def torque_loss_ratio(before: Array, after: Array) -> Array:
    """Weigh the channels by how much an actuator effect reduces their rotor torque.

    Inertia is free in every fit. Where motion follows the torque only in part, a torque half as large with half the
    inertia leaves half of the residual and explains nothing: a lag would look better the longer it is. With residuals
    times this factor, what counts is the share of the torque that the motion does not follow. A torque that grows, and
    the inertia with it, leaves the residual as it was and explains nothing either.

    `before`, `after`, shape (window, 6), N m and N: wrench of the rotors without and with the effect.
    Result: shape (6,); ratio of the standard deviations, at least 1; 1 for the forces, where weight and mass hold the
    scale.
    """
    factor = np.ones(before.shape[1])
    spread, shrunk = before[:, :3].std(axis=0), after[:, :3].std(axis=0)
    moving = (spread > 0) & (shrunk > 0)
    factor[:3][moving] = np.maximum(spread[moving] / shrunk[moving], 1.0)
    return factor
