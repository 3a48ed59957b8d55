"""What goes on from a vehicle that was found, by how far to trust it."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from cpfls_cli.artifacts.job import Job
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.logs.formats import DATAFLASH_MAGIC
from cpfls_cli.report.content import command_line
from cpfls_cli.stages._numbers import to_fly
from cpfls_cli.stages.vehicle import next_commands
from cpfls_cli.validation.trust import Trust
from tests.builders.vehicle_search import CONFIG


@pytest.mark.parametrize("trust", Trust)
def test_a_vehicle_that_nobody_should_use_is_flown_for_and_not_handed_over(trust):
    study = validate(parse_config(CONFIG, "config"), "config")
    job = Job(study, Path("own/found.h5"), False, False, lambda *_: None, lambda _: None, config=Path("c.yaml"))
    record = SimpleNamespace(complete=True, trust=trust, logged_slowly=False)
    page, (_, command, *words) = next_commands(job, record, [Path("f.h5")], ())
    assert page[:2] == ("cpfls", "report")
    poor = trust in (Trust.LACKING, Trust.NOT_DETERMINED, Trust.LOOP, Trust.DO_NOT_USE)
    assert command == ("trajectory" if poor else "export")
    assert words[-1] == (Path("own/found-mission.h5") if poor else Path("own/found.c"))
    coarse = replace(job, study=study.model_copy(update={"trajectory": replace(study.trajectory, sample_time_s=0.1)}))
    record.trust = Trust.LOOP
    _, (*mission, _) = next_commands(coarse, record, [Path("f.h5")], ())
    assert "trajectory.sample_time_s=0.02" in mission
    # No flight shows more before its log is faster.
    slow = SimpleNamespace(complete=True, trust=trust, logged_slowly=True)
    assert next_commands(job, slow, [Path("f.h5")], ()) == (page,)


def test_logs_of_ardupilot_are_followed_by_sweeps_of_its_own(tmp_path):
    (log := tmp_path / "one.BIN").write_bytes(DATAFLASH_MAGIC)
    study = validate(parse_config(CONFIG, "config"), "config")
    job = Job(study, tmp_path / "found.h5", False, False, lambda *_: None, lambda _: None, inputs=[tmp_path / "c.yaml"])
    assert "ardupilot" not in to_fly(job)
    assert to_fly(replace(job, inputs=[*job.inputs, log]))[-4:-1] == ("--format", "ardupilot", "-o")


def test_logs_whose_autopilot_flies_no_mission_are_followed_by_sticks(tmp_path):
    (log := tmp_path / "fpv.bbl").write_bytes(b"H Product:Blackbox")
    study = validate(parse_config(CONFIG, "config"), "config")
    job = Job(study, tmp_path / "found.h5", False, False, lambda *_: None, lambda _: None, inputs=[log])
    assert command_line(to_fly(job)).startswith("fly by hand, stick left and right")
    assert command_line(to_fly(replace(job, inputs=[]))).startswith("cpfls trajectory ")
