"""The page about fitting: what its code says it gives, it gives."""

import re
from pathlib import Path

import numpy as np
import pytest

PAGE = (Path(__file__).parents[3] / "docs" / "fuzzy.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture
def names():
    """What a reader of the page has: samples of a periodic function, with noise."""
    rng = np.random.default_rng(0)
    angles = rng.uniform(-np.pi, np.pi, (5000, 2))
    roll, pitch = angles.T
    values = np.sin(roll) * np.cos(pitch) + 0.5 * np.sin(2 * roll + pitch) + 0.2 * np.cos(3 * roll)
    return {"angles": angles, "values": values + 0.01 * rng.standard_normal(5000), "truth": values}


def test_the_three_lines_fit(names):
    assert len([line for line in BLOCKS[0].splitlines() if line.strip()]) == 3
    exec(BLOCKS[0], names)
    np.testing.assert_allclose(names["fitted"], names["truth"], atol=0.03)
    assert np.sqrt(np.mean((names["fitted"] - names["truth"]) ** 2)) < 0.01


def test_the_rest_runs_after_them(names):
    assert len(BLOCKS) > 1
    for block in BLOCKS:
        exec(block, names)
