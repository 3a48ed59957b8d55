"""Regions in words, worked by hand: cells of 5 degrees from -180 on."""

import numpy as np
import pytest

from cpfls_cli.validation.verdict import region_in_words


def visited(roll, pitch):
    cells = np.zeros((72, 72), dtype=bool)
    cells[np.ix_(roll, pitch)] = True
    return cells


@pytest.mark.parametrize(
    ("roll", "pitch", "words"),
    [
        (range(32, 40), range(36, 37), "roll -20 to 20 degrees, pitch 0 to 5 degrees (0.154 %"),
        ([70, 71, 0, 1], range(72), "roll 170 to 190 degrees, pitch all round (5.56 %"),
        ([10, 20, 60], [71], "roll 120 to 285 degrees, pitch 175 to 180 degrees (0.0579 %"),
        (range(72), range(72), "roll all round, pitch all round (100 %"),
        ([], [], "roll nowhere, pitch nowhere (0 %"),
    ],
)
def test_ranges(roll, pitch, words):
    assert region_in_words(visited(list(roll), list(pitch))).startswith(words)
