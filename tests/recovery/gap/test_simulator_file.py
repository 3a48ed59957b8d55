"""A wrong number in a simulator's own file, named and corrected from flights in gusts, and nothing else touched."""

import json

import numpy as np
import pytest

from cpfls_cli.simulators.formats import read_model
from tests.builders import command_line
from tests.builders.gusty_flights import GUSTS, SMALL, Flight, gusty_flights
from tests.builders.simulator_files import sdf_of, write_log

TRUE = SMALL._replace(drag=0.0, damping=0.0)
FLIGHTS, SECONDS = 4, 40.0


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Four flights of the true vehicle in the gusts of real nano-drone flights, with their setpoints."""
    folder = tmp_path_factory.mktemp("gusts")
    asked = [Flight(TRUE, GUSTS, path=run, draw=run, reach=3.0, swing=0.3) for run in range(FLIGHTS)]
    paths = [folder / f"flight{run}.csv" for run in range(FLIGHTS)]
    for path, flight in zip(paths, gusty_flights(asked, SECONDS), strict=True):
        write_log(path, flight)
    return paths


def corrected(folder, logs, **wrong):
    mine = folder / "mine.sdf"
    mine.write_text(sdf_of(TRUE, **wrong))
    before = mine.read_bytes()
    words = ("gap", mine, *logs[:-1], "--held-out", logs[-1], "-o", folder / "gap", "--json")
    result = command_line.run(*words)
    assert result.exit_code == 0, result.stderr
    assert mine.read_bytes() == before
    return json.loads(result.stdout), read_model(folder / "gap" / "mine.sdf")


def test_a_thrust_17_percent_too_large(tmp_path, logs):
    said, new = corrected(tmp_path, logs, thrust=1 / 0.83)
    (change,) = said["corrected"]["changes"]
    assert said["verdict"] == "NAMED"
    assert (change["element"], said["effects"][0]["name"]) == ("motorConstant", "parameter_error")
    assert change["low"] < TRUE.thrust_factor < change["high"]
    assert change["sentence"].startswith("thrust of M1 to M4 is 1")
    # What flew is predicted better by the file as corrected, and far better than if nothing moved.
    ends = said["corrected"]["flown"]["at_end"]
    assert ends["velocity"]["after"] < 0.8 * ends["velocity"]["before"]
    assert ends["position"]["after"] < min(0.8 * ends["position"]["before"], ends["position"]["without_model"])
    assert [rotor.thrust.value for rotor in new.rotors] == [change["after"]] * 4
    np.testing.assert_allclose(np.diag(new.inertia), TRUE.inertia, rtol=1e-4)


def test_an_inertia_20_percent_too_small(tmp_path, logs):
    said, new = corrected(tmp_path, logs, inertia=(1 / 1.2, 1 / 1.2, 1.0))
    changes = {change["element"]: change for change in said["corrected"]["changes"]}
    assert list(changes) == ["ixx", "iyy"]
    for change, true in zip(changes.values(), TRUE.inertia, strict=False):
        assert change["low"] < true < change["high"]
    np.testing.assert_allclose(np.diag(new.inertia)[:2], TRUE.inertia[:2], rtol=0.05)
    assert {rotor.thrust.value for rotor in new.rotors} == {TRUE.thrust_factor}


def test_a_file_that_is_right_stays(tmp_path, logs):
    said, _ = corrected(tmp_path, logs)
    assert said["corrected"]["changes"] == []
    assert (tmp_path / "gap" / "mine.sdf").read_bytes() == (tmp_path / "mine.sdf").read_bytes()
