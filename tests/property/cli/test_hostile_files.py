"""No file makes a command end in a traceback, leave something behind, take nonsense, or end with a wrong exit code."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.builders.command_line import drawn
from tests.builders.hostile_files import DAMAGED, KINDS, Good, tried

# `make fuzz` tries ten thousand of each, with all figures drawn.
EXAMPLES = {"YAML": 20, "HDF5 structure": 12, "HDF5 bytes": 15, "CSV": 25, "Parquet": 25, "ULog": 25}
EXAMPLES |= {"names": 20, "rotors": 12, "ULog nested": 20, "bombs": 5, **dict.fromkeys(DAMAGED, 12)}


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return Good.made(tmp_path_factory.mktemp("good"))


# What is damaged and sealed again may keep HDF5 busy for ever, which only a process of its own survives.
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "sealed"])
def test_no_file_hurts(good, kind):
    @settings(
        max_examples=EXAMPLES[kind],
        deadline=None,
        derandomize=True,
        suppress_health_check=[HealthCheck.too_slow],
        database=None,
    )
    @given(seed=st.integers(0, 2**32))
    def holds(seed):
        with drawn(shown=False):
            assert tried(good.case(kind, seed)) is None

    holds()
