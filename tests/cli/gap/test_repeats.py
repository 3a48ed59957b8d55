"""`cpfls gap` on flights that repeat a path in gusts: the repeatable part leads page, terminal and JSON."""

import json
from dataclasses import asdict
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from cpfls_cli.artifacts.diagnosis import Diagnosis
from cpfls_cli.rotations import euler_angles
from cpfls_cli.store import read
from tests.builders.gusty_flights import GUSTS, SMALL, Flight, gusty_flights
from tests.builders.studies import put_file

COLUMNS = {
    "attitude": (["phi", "theta", "psi"], "rad"),
    "body_rate": (["wx", "wy", "wz"], "rad/s"),
    "velocity": (["vx", "vy", "vz"], "m/s"),
    "rotor_speed": (["m1", "m2", "m3", "m4"], "rad/s"),
}


def config():
    """The vehicle without its drag, and without its damping."""
    signals = {name: {"columns": columns, "unit": unit} for name, (columns, unit) in COLUMNS.items()}
    return {
        "vehicle": asdict(SMALL.vehicle),
        "import": {"signals": signals, "torque_source": None},
        "gap": {"shifts": 39, "horizon_s": 0.1, "effects_max": 1},
    }


@pytest.fixture(scope="module")
def found(cpfls, tmp_path_factory):
    folder = tmp_path_factory.mktemp("repeats")
    paths = [folder / f"run-{draw}.csv" for draw in range(3)]
    truth = SMALL._replace(drag=0.1)
    for path, flown in zip(paths, gusty_flights([Flight(truth, GUSTS, 0, n) for n in range(3)], 24.0), strict=True):
        motion = flown.motion
        time = motion.period * np.arange(len(flown))
        parts = (time, euler_angles(motion.rotation), motion.rate, motion.velocity, flown.speed)
        header = ",".join(["t", *(name for names, _ in COLUMNS.values() for name in names)])
        np.savetxt(path, np.column_stack(parts), delimiter=",", header=header, comments="", fmt="%.9g")
    study = put_file(folder / "study.yaml", yaml.safe_dump(config()))
    result = cpfls.done("gap", study, *paths, "-o", folder / "gap", "-v")
    summary = json.loads((folder / "gap" / "gap.json").read_text())
    return SimpleNamespace(folder=folder / "gap", stdout=result.stdout, summary=summary)


def test_what_is_repeatable_is_written_after_the_verdict(found):
    (said,) = (line for line in found.stdout.splitlines() if line.startswith("REPEATS: "))
    assert said.startswith("REPEATS: Of the gap in the force along")
    assert "is repeatable: the model as given lacks an effect there." in said
    assert "Torque about x (roll): nothing is repeatable" in found.stdout
    assert "--repeat" not in found.stdout


def test_machines_read_the_same_of_all_flights_and_of_pairs_with_the_held_out_one(found):
    compared, before = found.summary["disagreement"]["repeatability"], found.summary["repeatability"]["before"]
    assert (compared["runs"], compared["paths"], before["runs"]) == (3, 1, 3)
    for answer in (compared, before):
        assert answer["channels"]["force x"]["share"][0] > 0.7
        assert all(answer["channels"]["force x"]["repeatable"][:5])
        assert not any(answer["channels"]["torque x"]["repeatable"])
    diagnosed, _ = read(found.folder / "diagnosis.h5", Diagnosis)
    assert diagnosed.repeatability_before.share[3, 0] == pytest.approx(before["channels"]["force x"]["share"][0])


def test_the_report_shows_it_in_a_picture(found):
    page = (found.folder / "report.html").read_text()
    assert "diagnose-1-repeatable" in page
    assert "compare-1-repeatable" in page
    assert page.index("REPEATS") < page.index("band by band")
