"""A sweep of two settings with three seeds, for reports about it."""

import pytest

from tests.builders.studies import VEHICLE

TWO_SETTINGS = """\
seed: 4
trajectory: {sample_time_s: 0.2}
reduction: {size: 30, criterion: D}
identification:
  consequents: seesaw
  products: additive
  membership_functions: 3
  base: none
  population: 8
  generations: 1
  subpopulations: 2
  training_share: 0.8
  local_search: {enabled: false}
sweep:
  seeds: 3
  settings: [{name: few}, {name: all of them, set: {reduction.size: null}}]
"""


@pytest.fixture(scope="session")
def swept(cpfls, tmp_path_factory):
    """The folder of a study, its trajectory, its flight and its sweep."""
    folder = tmp_path_factory.mktemp("swept")
    config = folder / "study.yaml"
    config.write_text(TWO_SETTINGS + VEHICLE)
    made = [
        cpfls("trajectory", config, "-o", folder / "trajectory.h5"),
        cpfls("simulate", config, folder / "trajectory.h5", "-o", folder / "flight.h5"),
        cpfls("sweep", config, folder / "flight.h5", "-o", folder / "sweep.h5"),
    ]
    assert [result.exit_code for result in made] == [0, 0, 0]
    return folder
