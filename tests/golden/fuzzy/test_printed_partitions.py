"""Section 10 of the paper prints a chromosome and its breakpoints; its rule (10) must give those digits.

Four of the eighteen printed values differ from the exact quotients by up to one unit of their last digit, in both
directions, as if it had been made from weights before they were rounded to integers. So one unit is the bound.
"""

import numpy as np
import pytest

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


def test_every_partition_reaches_from_0_to_1(decoded):
    assert {(b[0], b[-1], len(b)) for b in decoded.values()} == {(0.0, 1.0, 5)}
