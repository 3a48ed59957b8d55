import numpy as np
import pytest

from cpfls_cli.artifacts.gap_effects import worse_axes
from cpfls_cli.commands.extend import require_named
from cpfls_cli.errors import ComputationError
from cpfls_cli.gap.naming.results import GapVerdict
from tests.builders.gap_artifacts import named_effect

OFFSET = named_effect("com_offset", linear=[0.01], p_value=1e-9, share=0.998, sentence="Off centre.")


@pytest.mark.parametrize("verdict", [GapVerdict.UNEXPLAINED, GapVerdict.NO_GAP, GapVerdict.NOT_EXCITED])
def test_only_names_are_added(verdict):
    with pytest.raises(ComputationError, match=f"the diagnosis is {verdict} and names no effect"):
        require_named(verdict, [OFFSET])
    with pytest.raises(ComputationError, match="names no effect"):
        require_named(GapVerdict.NAMED, [])
    for good in (GapVerdict.NAMED, GapVerdict.PARTIAL, GapVerdict.AMBIGUOUS):
        require_named(good, [OFFSET])


def test_axes_that_get_worse():
    before = np.array([2.0, 1.4, 10.0, 3.0, np.nan, 1.0])
    assert worse_axes(before, 1.3 * before) == [0, 2]
    assert worse_axes(before, 1.1 * before) == []
