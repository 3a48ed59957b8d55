"""What commands print: one JSON object, warnings apart, nothing when quiet."""

import json

import numpy as np
import pytest

from tests.builders.studies import VEHICLE

KEYS = {
    "trajectory": {"samples", "duration_s", "dt_s", "max"},
    "flight": {"samples", "max_torque"},
    "selection": {"candidates", "selected", "criterion", "rank", "condition_number", "condition_number_full"},
    "model": {
        "mse",
        "max_error",
        "relative_error",
        "condition_number",
        "rank",
        "parameters",
        "generations",
        "evaluations",
        "baselines",
        "held_out",
        "seconds",
    },
}


@pytest.mark.parametrize("stage", KEYS)
def test_json_is_one_object_on_one_line_with_the_promised_keys(pipeline, stage):
    assert pipeline.printed[stage].count("\n") == 1
    assert KEYS[stage] <= set(pipeline.summaries[stage])


def test_figures_of_the_tiny_study(pipeline):
    trajectory, flight, selection, model = (pipeline.summaries[stage] for stage in KEYS)
    # Rows of 54.86 s at 0.1 s, counted from 0; and the selection that the config asks for.
    assert trajectory["samples"] == flight["samples"] == 549
    assert trajectory["dt_s"] == 0.1
    assert len(flight["max_torque"]) == 3
    assert (selection["candidates"], selection["selected"], selection["rank"]) == (549, 60, 113)
    assert (model["parameters"], model["rank"], model["generations"]) == (113, 113, 1)
    assert model["evaluations"] >= 10
    assert {"rigid-body", "constant-inertia", "torque-zero"} <= set(model["baselines"])
    assert model["baselines"]["rigid-body"]["mse"] < 1e-20 < model["mse"]
    assert model["held_out"] == {}


def test_held_out_part_and_other_flights_are_judged_by_name(cpfls, pipeline, study, tmp_path):
    path, other = tmp_path / "path.h5", tmp_path / "other.h5"
    cpfls("trajectory", study, "-o", path, "--set", "trajectory.sample_time_s=0.2")
    cpfls("simulate", study, path, "-o", other)
    words = ("identify", study, pipeline.flight, "--validate", other, "-o", tmp_path / "m.h5", "--json")
    result = cpfls(*words, "--set", "identification.training_share=0.6")
    held_out = json.loads(result.stdout)["held_out"]
    assert set(held_out) == {"held-out rest", "other.h5"}
    assert held_out["other.h5"]["samples"] == 275
    assert {"mse", "relative_error", "baselines"} <= set(held_out["held-out rest"])


def test_an_import_tells_in_json_and_in_lines_what_it_read_and_what_it_did_about_it(cpfls, tmp_path):
    time = np.delete(np.arange(0.0, 4.0, 0.02), [50, 51, 52])
    angles = [0.2 * np.sin((2 + axis) * time) for axis in range(3)]
    angles[1][120] += 1
    log, config = tmp_path / "log.csv", tmp_path / "study.yaml"
    np.savetxt(log, np.column_stack([time, *angles]), delimiter=",", header="t,roll,pitch,yaw", comments="")
    signals = "signals: {attitude: {columns: [roll, pitch, yaw], unit: rad}}"
    config.write_text(f"import: {{{signals}, torque_source: null, crop_s: [0, 3.5]}}\n{VEHICLE}")
    result = cpfls("import", config, log, "-o", tmp_path / "flight.h5", "--json")
    assert (result.exit_code, result.stdout.count("\n")) == (0, 1)
    summary = json.loads(result.stdout)
    assert summary["samples"] == 176
    assert summary["rate_hz"] == summary["log_rate_hz"] == pytest.approx(50)
    assert summary["dropped"] == {"crop": 24}
    assert (summary["gaps"], summary["longest_gap_s"]) == (1, pytest.approx(0.08))
    assert summary["span_s"] == pytest.approx([0, 3.5])
    assert (summary["lowpass_hz"], summary["spikes"], summary["suspected_spikes"]) == (None, {}, {"pitch": 1})
    assert {"samples_read", "missing", "saturated", "delay_s", "delay_r2", "signals"} <= set(summary)
    assert "1 suspected spike in column pitch" in result.stderr
    repaired = cpfls("import", config, log, "-o", tmp_path / "f.h5", "--set", "import.spike_deviations=10", "-v")
    assert [line.rsplit(maxsplit=1) for line in repaired.stdout.splitlines()[-3:]] == [
        ["outside import.crop_s: rows dropped", "24"],
        ["gaps in the time stamps, up to 0.08 s: interpolated", "1"],
        ["spikes: values interpolated", "1"],
    ]
    assert "What was found in the log of f.h5." in repaired.stdout.splitlines()
    assert "spike" not in repaired.stderr
