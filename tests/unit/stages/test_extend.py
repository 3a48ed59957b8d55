"""What `extend` adds, and the axes that get worse with it."""

from dataclasses import replace

import numpy as np
import pytest

from cpfls_cli.errors import ComputationError
from cpfls_cli.gap.naming.results import GapVerdict
from cpfls_cli.stages.extend import named_effects
from tests.builders import gap_artifacts as made


@pytest.mark.parametrize("verdict", [GapVerdict.UNEXPLAINED, GapVerdict.NO_GAP, GapVerdict.NOT_EXCITED])
def test_only_names_are_added(verdict):
    found = made.diagnosis()
    with pytest.raises(ComputationError, match=f"the diagnosis is {verdict} and names no effect"):
        named_effects(replace(found, verdict=verdict))
    with pytest.raises(ComputationError, match="names no effect"):
        named_effects(replace(found, effects=(), closest=found.effects))
    for good in (GapVerdict.NAMED, GapVerdict.PARTIAL, GapVerdict.AMBIGUOUS):
        assert named_effects(replace(found, verdict=good)) == found.effects


def test_axes_that_get_worse_are_warned_of():
    before, gap = np.array([2.0, 1.4, 10.0, 3.0, np.nan, 1.0]), made.extended().gap
    for factor, axes in ((1.3, [0, 2]), (1.1, [])):
        grown = replace(made.extended(), gap=replace(gap, before_floors=before, after_floors=factor * before))
        assert grown.gap.worse_axes == axes
        assert len(grown.warnings) == len(axes)
