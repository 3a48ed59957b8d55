"""A sweep of three small settings with two seeds each."""

import pytest

from tests.builders.studies import VEHICLE

SWEEP = """\
seed: 5
trajectory: {sample_time_s: 0.2}
reduction: {size: 60, criterion: D}
identification:
  consequents: seesaw
  products: additive
  membership_functions: 3
  base: none
  population: 10
  generations: 2
  subpopulations: 2
  local_search: {enabled: false}
sweep:
  seeds: 2
  set: {identification.population: 8}
  settings:
    - {name: "classic, all samples", set: {identification.structure: fls, reduction.size: null}}
    - {name: "fewer samples", set: {reduction.size: 40}}
    - {name: "more functions", set: {identification.membership_functions: 4, identification.population: 12}}
"""


@pytest.fixture(scope="session")
def sweep(tmp_path_factory):
    path = tmp_path_factory.mktemp("sweep") / "sweep.yaml"
    path.write_text(SWEEP + VEHICLE)
    return path


@pytest.fixture(scope="session")
def sweep_flight(cpfls, sweep):
    """A flight of the study."""
    trajectory, flight = sweep.with_name("trajectory.h5"), sweep.with_name("flight.h5")
    cpfls.done("trajectory", sweep, "-o", trajectory)
    cpfls.done("simulate", sweep, trajectory, "-o", flight)
    return flight


@pytest.fixture(scope="session")
def words(sweep, sweep_flight):
    """The command, without its output."""
    return ("sweep", sweep, sweep_flight)


@pytest.fixture(scope="session")
def whole(cpfls, words, tmp_path_factory):
    """A sweep that nobody stopped."""
    output = tmp_path_factory.mktemp("whole") / "sweep.h5"
    cpfls.done(*words, "-o", output)
    assert [path.name for path in output.parent.iterdir()] == ["sweep.h5"]
    return output
