"""The scripts of examples/ that need no other program."""

import runpy
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_control_with_a_model_follows_closer_than_feedback_alone(cpfls, study, pipeline, tmp_path, capsys):
    path = tmp_path / "path.h5"
    cpfls.done("trajectory", study, "-o", path, "--set", "trajectory.sample_time_s=0.05")
    runpy.run_path(str(EXAMPLES / "computed_torque.py"))["main"](study, path, pipeline.model)
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    errors = {name: [float(size) for size in sizes] for name, *sizes in lines}
    assert all(own < other for own, other in zip(errors["model"], errors["feedback"], strict=True))
