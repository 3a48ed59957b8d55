"""Linear and nonlinear parameters, counted in the paper (section 5) and in method.md (section 5)."""

import numpy as np
import pytest

from cpfls_cli.errors import SettingError
from cpfls_cli.regressor.regressor import Motion, Regressor, data_ranges, uniform_breakpoints
from cpfls_cli.regressor.structure import StructureSettings, model_structure

PAPER = {"consequents": "seesaw", "products": "additive"}
ADDITIVE = {"consequents": "harmonic", "harmonic_order": 1, "products": "additive"}
TENSOR = {"consequents": "harmonic", "products": "tensor"}


@pytest.mark.parametrize(
    ("settings", "parameters", "genes"),
    [
        ({**PAPER, "membership_functions": 5}, 113, 24),
        # 5 rules per input and 25 for two: 1 + 2 (5 x 2) + 2 (25 x 3).
        ({**PAPER, "membership_functions": 5, "structure": "fls"}, 171, 24),
        ({**ADDITIVE, "membership_functions": 5}, 185, 24),
        ({**ADDITIVE, "membership_functions": 7}, 397, 36),
        ({**ADDITIVE, "membership_functions": 9}, 689, 48),
        ({**TENSOR, "harmonic_order": 1, "membership_functions": 3}, 85, 12),
        ({**TENSOR, "harmonic_order": 2, "membership_functions": 1}, 61, 0),
        # By hand: D13 1x2, D22 2x2, D23 3x4x3, D33 5x6x3.
        ({**PAPER, "membership_functions": (2, 3, 4, 5, 6, 7)}, 1 + 2 + 4 + 36 + 90, 21),
    ],
)
def test_counts(settings, parameters, genes):
    structure = model_structure(StructureSettings(**settings))
    assert (structure.parameters, structure.genes) == (parameters, genes)
    state = np.random.default_rng(0).standard_normal((3, 4, 3))
    regressor = Regressor(structure, Motion(*state), data_ranges(structure, state[0]))
    assert regressor.matrix(uniform_breakpoints(structure)).shape == (4, 3, parameters)


def test_partitions_stand_in_the_order_of_the_genes():
    structure = model_structure(StructureSettings(membership_functions=(2, 3, 4, 5, 6, 7)))
    names = [partition.name for partition in structure.partitions]
    assert names == ["D13(pitch)", "D22(roll)", "D23(roll)", "D23(pitch)", "D33(roll)", "D33(pitch)"]
    assert [part.stop - part.start for part in structure.weight_slices()] == [1, 2, 3, 4, 5, 6]
    stops = [0, *(block.columns.stop for block in structure.blocks)]
    assert [block.columns.start for block in structure.blocks] == stops[:-1]


def test_the_classic_system_has_no_harmonics():
    with pytest.raises(SettingError) as caught:
        StructureSettings(structure="fls", consequents="harmonic")
    assert caught.value.key == "consequents"
