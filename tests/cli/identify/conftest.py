"""A search of several generations, and ways to end it too early."""

import pytest

from tests.builders.studies import VEHICLE, put_file

SEARCH = """\
trajectory: {sample_time_s: 0.1}
identification:
  consequents: seesaw
  products: additive
  membership_functions: 5
  base: none
  population: 16
  generations: 6
  subpopulations: 2
  local_search: {enabled: false}
  validation: {structures: false, draws: 20, windows: 20, horizon_samples: 4}
"""


@pytest.fixture(scope="session")
def search(tmp_path_factory):
    return put_file(tmp_path_factory.mktemp("search") / "search.yaml", SEARCH + VEHICLE)


@pytest.fixture(scope="session")
def words(search, pipeline):
    """The command, without its output."""
    return ("identify", search, pipeline.flight, "--selection", pipeline.selection)


@pytest.fixture(scope="session")
def ended(cpfls, words, tmp_path_factory):
    """The model of a search that nobody stopped, and what it said."""
    output = tmp_path_factory.mktemp("whole") / "model.h5"
    said = cpfls.done(*words, "-o", output, "-v").stdout
    assert [path.name for path in output.parent.iterdir()] == ["model.h5"]
    return output, said


@pytest.fixture(scope="session")
def whole(ended):
    return ended[0]
