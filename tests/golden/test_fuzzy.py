"""Partitions and tables of rules as the paper prints them."""

import numpy as np
import pytest

from cpfls_cli.fuzzy.basis import antecedent, basis, breakpoints, features, input_range, map_input, seesaw
from cpfls_cli.identification.evaluator import decode
from cpfls_cli.regressor.structure import StructureSettings, model_structure

CHROMOSOME = """
    3157 31387 59087 34526   61856 23999 31983 5100    21985 53525 13592 15164
    41416 52669 17091 8246   27195 36846 42384 27934   32215 55957 57320 24610
"""
LAST_DIGIT = 1e-5
PRINTED = {
    "D13(pitch)": (0.024633, 0.26954, 0.7306),
    "D22(roll)": (0.50315, 0.69836, 0.95851),
    "D23(roll)": (0.21085, 0.72421, 0.85457),
    "D23(pitch)": (0.34681, 0.78784, 0.93095),
    "D33(roll)": (0.20241, 0.47664, 0.79209),
    "D33(pitch)": (0.18939, 0.51835, 0.85532),
}


@pytest.fixture
def decoded():
    structure = model_structure(StructureSettings(consequents="seesaw", products="additive", membership_functions=5))
    weights = np.array(CHROMOSOME.split(), dtype=float)
    names = [partition.name for partition in structure.partitions]
    return dict(zip(names, decode(structure, weights), strict=True))


def test_printed_chromosome_decodes_to_the_printed_breakpoints(decoded):
    assert list(decoded) == list(PRINTED)
    for name, printed in PRINTED.items():
        np.testing.assert_allclose(decoded[name][1:-1], printed, rtol=0, atol=LAST_DIGIT, err_msg=name)
    # This value is printed with one digit more.
    np.testing.assert_allclose(decoded["D13(pitch)"][1], 0.024633, rtol=0, atol=0.1 * LAST_DIGIT)


WEIGHTS = np.array([3157.0, 31387, 59087, 34526]), np.array([61856.0, 23999, 31983, 5100])
TRIPLETS = np.random.default_rng(4).standard_normal((17, 3))
"""Consequents c_1 to c_16 = (c_0, c_1, c_2); row 0 is not used."""

TABLE_1 = [[1, 2, 3, 4, 1], [5, 6, 7, 8, 5], [9, 10, 11, 12, 9], [13, 14, 15, 16, 13], [1, 2, 3, 4, 1]]
TABLE_2 = [row[:4] for row in TABLE_1[:4]]


def z(x, b1, b2):
    u = (x - b1) / (b2 - b1)
    return np.select([x <= b1, x <= (b1 + b2) / 2, x <= b2], [1.0, 1 - 2 * u**2, 2 * (1 - u) ** 2], 0.0)


def s(x, b1, b2):
    return 1 - z(x, b1, b2)


def pi(x, b1, b2, b3):
    return np.where(x <= b2, s(x, b1, b2), z(x, b2, b3))


def five_functions(angle, weights):
    """mu_z1, mu_pi2, mu_pi3, mu_pi4, mu_s5 of an angle scaled to one turn."""
    x = np.mod(angle, 2 * np.pi) / (2 * np.pi)
    b0, b1, b2, b3, b4 = 0.0, *np.cumsum(weights[:3]) / weights.sum(), 1.0
    return [z(x, b0, b1), pi(x, b0, b1, b2), pi(x, b1, b2, b3), pi(x, b2, b3, b4), s(x, b3, b4)]


def sum_of_rules(table, columns, rows, first, second):
    """Equation (9): the first input runs along a row of the table, the second one down."""
    triplet = np.stack([np.ones_like(first), seesaw(first)[0], seesaw(second)[0]])
    return sum(
        columns[i] * rows[j] * (TRIPLETS[number] @ triplet)
        for j, row in enumerate(table)
        for i, number in enumerate(row)
    )


def program_output(first, second):
    mapped = [map_input(a, "full-circle", True, input_range(a, True)) for a in (first, second)]
    rules = [antecedent(m, breakpoints(a), True) for m, a in zip(mapped, WEIGHTS, strict=True)]
    evaluated = basis(rules, features([first, second], mapped, "seesaw", 1, "additive"))
    # The rule index of the second input runs fastest, so the table is read column by column.
    return evaluated.value @ TRIPLETS[np.array(TABLE_2).T.ravel()].ravel()


@pytest.fixture
def angles():
    random = np.random.default_rng(6).uniform(-7, 7, (2, 2000))
    on_axes = np.array(np.meshgrid(np.arange(5) * np.pi / 2, np.arange(5) * np.pi / 2)).reshape(2, -1)
    return np.hstack([random, on_axes])


def test_25_rules_and_16_rules_and_the_program_agree(angles):
    columns, rows = (five_functions(a, weights) for a, weights in zip(angles, WEIGHTS, strict=True))
    classic = sum_of_rules(TABLE_1, columns, rows, *angles)
    joined_columns, joined_rows = ([mu[0] + mu[4], *mu[1:4]] for mu in (columns, rows))
    np.testing.assert_allclose(classic, sum_of_rules(TABLE_2, joined_columns, joined_rows, *angles), atol=1e-13)
    np.testing.assert_allclose(program_output(*angles), classic, atol=1e-13)
