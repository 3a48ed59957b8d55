"""Searches of two settings with two seeds, for reports about them."""

import pytest

from tests.builders.studies import VEHICLE, put_file
from tests.builders.sweeps import searched

STUDY = """\
seed: 4
trajectory: {sample_time_s: 0.2}
reduction: {criterion: D}
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
"""


@pytest.fixture(scope="session")
def swept(cpfls, tmp_path_factory):
    """The folder of a study, its trajectory, its flight and its searches."""
    folder = tmp_path_factory.mktemp("swept")
    config = put_file(folder / "study.yaml", STUDY + VEHICLE)
    made = [
        cpfls("trajectory", config, "-o", folder / "trajectory.h5"),
        cpfls("simulate", config, folder / "trajectory.h5", "-o", folder / "flight.h5"),
    ]
    assert [result.exit_code for result in made] == [0, 0]
    searched(folder, "whole.h5", 4, 2)
    return folder
