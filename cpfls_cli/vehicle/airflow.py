"""What is learned and has no name: torque and force over the direction of the airflow, by a periodic fuzzy system."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import pi

from cpfls_cli.arrays import Array
from cpfls_cli.vehicle.motion import Instant, Numbers, Wrench
from cpfls_cli.vehicle.values import Functions, Value, dot, minus, plus, times


def learned_wrench(
    breakpoints: Array, order: int, rows: Sequence[int], coefficients: Array
) -> Callable[[Instant, Numbers], Wrench]:
    """Make an effect of a fuzzy system over the direction of the airflow in the rotor plane.

    Parameters
    ----------
    breakpoints : array, shape (rules + 1,)
        Peaks of the membership functions, share of a turn.
    order : int
        Of the harmonics in each consequent; 0 for the seesaw.
    rows : sequence of int
        Which of torque (0 to 2) and force (3 to 5) it adds to.
    coefficients : array, shape (row, rule times feature, 2)
        By speed in the rotor plane times mean rotor speed, and by that speed squared, SI.
    """
    rules = max(len(breakpoints) - 1, 1)

    def acts(see: Instant, _p: Numbers) -> Wrench:
        functions, (x, y, _) = see.functions, see.air_velocity
        speed, angle = functions.sqrt(x**2 + y**2), functions.arctan2(y, x)
        mean = functions.total(see.rotor_speed) * (1 / len(see.vehicle.rotors))
        features = _features(angle, order, functions)
        turn = angle * (0.5 / pi)
        turn = turn - functions.floor(turn)
        total: list[Value] = [0] * 6
        for row, own in zip(rows, coefficients.tolist(), strict=True):
            powers = []
            for power in (0, 1):
                by_column = [each[power] for each in own]
                count = len(features)
                by_rule = [dot(features, by_column[count * rule : count * (rule + 1)]) for rule in range(rules)]
                powers.append(_blended(by_rule, breakpoints.tolist(), turn, functions))
            total[row] = plus(times(speed * mean, powers[0]), times(speed**2, powers[1]))
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
    """Blend the two rules that fire, by the copy of `cpfls_cli.fuzzy.membership.z_function`."""
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
