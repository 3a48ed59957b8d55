"""Which flights a model with effects learned from: in its file, and said wherever it is judged."""

import pytest

from tests.builders.artifacts import read_result


@pytest.fixture(scope="module")
def two_models(cpfls, gap_config, pipeline, with_attitude, tmp_path_factory):
    """What is put into an identified model from the first two thirds of one flight."""
    folder = tmp_path_factory.mktemp("seen") / "gap"
    cpfls.done("gap", gap_config, with_attitude[0], "--model", pipeline.model, "-o", folder)
    return folder / "extended.h5"


def learned(path):
    return [(flight.name, flight.samples, flight.of) for flight in read_result(path).learned_from]


def test_the_file_says_what_the_effects_and_what_the_base_learned_from(extended, two_models, pipeline):
    assert learned(extended) == [("flight_1.csv", 2400, 2400), ("flight_2.csv", 2400, 2400)]
    (base,) = learned(pipeline.model)
    assert learned(two_models) == [("flight_4.csv", 1600, 2400), base]


def test_stages_hand_the_flights_on(cpfls, gap_config, two_models, tmp_path):
    """Another model to extend brings its own flights."""
    diagnosis = two_models.with_name("diagnosis.h5")
    again = tmp_path / "again.h5"
    cpfls.done("extend", gap_config, diagnosis, "-o", again)
    assert learned(again) == learned(two_models)


def test_replay_and_compare_warn_of_flights_seen(
    cpfls, gap_config, two_models, extended, shifted, with_attitude, tmp_path
):
    fast = ("--every", "400")
    result = cpfls("replay", gap_config, extended, shifted[1], shifted[2], "-o", tmp_path / "r.h5", *fast)
    whole = "flight_2.csv: extended.h5 has learned from it, so it says nothing about unseen flights"
    assert whole in result.stderr
    assert "flight_3.csv: extended.h5" not in result.stderr
    result = cpfls("compare", gap_config, *with_attitude, "--model", two_models, "-o", tmp_path / "d.h5", "--json")
    part = "flight_4.csv: extended.h5 has learned from its first 1600 of 2400 samples, so that says nothing"
    assert part in result.stdout
    assert "flight_5.csv: extended.h5" not in result.stdout
