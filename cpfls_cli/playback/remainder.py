"""What a model has no name for: torque and force over the direction of the airflow, learned."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi
from typing import Any, NamedTuple

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.result import about, result
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.values import Functions, Value, dot, minus, plus, times


class Airflow(NamedTuple):
    """Terms of a learned remainder over the direction of the airflow; empty without rules.

    `breakpoints`: peaks of the membership functions, shares of a turn, shape (rules + 1,); `order`: of the harmonics in
    each consequent, 0 for the seesaw.
    """

    breakpoints: Array
    order: int

    @property
    def columns(self) -> int:
        """Count the columns of the system; none without rules."""
        features = 1 + (2 * self.order if self.order else 1)
        return max(len(self.breakpoints) - 1, 1) * features if len(self.breakpoints) else 0


@result
class Remainder:
    """What has no name: torque and force over the direction of the airflow, by a periodic fuzzy system.

    Each column of the system enters with the speed in the rotor plane times the mean rotor speed, and with its square.
    """

    breakpoints: Array = about(
        "peaks of the membership functions over the direction, share of a turn", "breakpoint", brief=False
    )
    harmonic_order: int = about("of the consequents; 0 for the seesaw")
    rows: IntArray = about("which of torque (0 to 2) and force (3 to 5) it adds to", "row")
    coefficients: Array = about(
        "of each column: by speed in the rotor plane times mean rotor speed, and by that speed squared",
        "row",
        "column",
        "2",
        unit="SI",
        brief=False,
    )


def learned_wrench(learned: Remainder, coefficients: Any = None) -> Callable[[Instant, Numbers], Wrench]:
    """Make of a remainder what acts on a vehicle as an effect does.

    `coefficients`, shape (row, column, 2), take the place of its own, with derivatives.
    """
    rules, order, peaks = max(len(learned.breakpoints) - 1, 1), learned.harmonic_order, learned.breakpoints.tolist()
    given = learned.coefficients if coefficients is None else coefficients

    def acts(see: Instant, _p: Numbers) -> Wrench:
        functions, (x, y, _) = see.functions, see.air_velocity
        speed, angle = functions.sqrt(x**2 + y**2), functions.arctan2(y, x)
        mean = functions.total(see.rotor_speed) * (1 / len(see.vehicle.rotors))
        features = _features(angle, order, functions)
        turn = angle * (0.5 / pi)
        turn = turn - functions.floor(turn)
        total: list[Value] = [0] * 6
        for row, by_column in zip(learned.rows.tolist(), given, strict=True):
            by_power = by_column.T.reshape(2, rules, len(features)).tolist()
            slow, fast = (
                _blended([dot(features, rule) for rule in by_rule], peaks, turn, functions) for by_rule in by_power
            )
            total[row] = plus(times(speed * mean, slow), times(speed**2, fast))
        return Wrench(tuple(total[:3]), tuple(total[3:]))

    return acts


def _features(angle: Value, order: int, functions: Functions) -> list[Value]:
    """Evaluate the consequent features: 1, and a seesaw or harmonics of the angle."""
    if order:
        multiples = [k * angle for k in range(1, order + 1)]
        return [1, *map(functions.sin, multiples), *map(functions.cos, multiples)]
    end = functions.where(angle > 0.0, pi, -pi)
    return [1, functions.where(functions.absolute(angle) > 0.5 * pi, end - angle, angle) * (2 / pi)]


def _blended(by_rule: Sequence[Value], breakpoints: Sequence[float], turn: Value, functions: Functions) -> Value:
    """Blend the two rules that fire, by the copy of `cpfls_cli.fuzzy.basis.z_function`."""
    rules = len(by_rule)
    # Rules between equal peaks never fire.
    wide = [rule for rule in range(rules) if breakpoints[rule + 1] > breakpoints[rule]] if rules > 1 else []
    blended: list[Value] = []
    for rule in wide:
        start, end, after = breakpoints[rule], breakpoints[rule + 1], by_rule[(rule + 1) % rules]
        u = (turn - start) * (1 / (end - start))
        falling = functions.where(u < 0.5, 1.0 - 2.0 * u**2, 2.0 * (1.0 - u) ** 2)
        blended.append(plus(after, times(falling, minus(by_rule[rule], after))))
    total = blended.pop() if blended else by_rule[0]
    for rule, here in reversed(list(zip(wide, blended, strict=False))):
        total = functions.where(turn < breakpoints[rule + 1], here, total)
    return total
