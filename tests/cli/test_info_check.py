"""`cpfls info` and `cpfls check` on every kind of artifact."""

import hashlib
import json
import math
import shutil
import subprocess
import sys
import zlib
from fnmatch import fnmatchcase
from pathlib import Path

import h5py
import pytest

import cpfls_cli
from cpfls_cli.flightlog.results import Flight
from tests.builders.artifacts import edited
from tests.builders.studies import stages

STAGES = ("trajectory", "flight", "selection", "model")


def format_of(stage):
    return f"cpfls/{'identified' if stage == 'model' else stage}"


def datasets_of(file):
    """Give all datasets of a file by path, but the config."""
    found = {}
    file.visititems(lambda name, item: found.update({name: item}) if isinstance(item, h5py.Dataset) else None)
    del found["config"]
    return found


def described_as(name, paths):
    """List which of the paths describe a dataset: `*` is any name, and lines of a table have no path of their own."""
    place, _, last = name.rpartition("/")
    known = [name, place] if last in {"row", "name", "value", "values"} else [name]
    # Arrays of several lengths have a table of their own.
    known += [place.rpartition("/")[0]] if place.endswith("/values") else []
    return [path for path in paths if any(fnmatchcase(each, path) for each in known)]


@pytest.mark.parametrize("stage", STAGES)
def test_check_finds_nothing_in_what_the_program_writes(cpfls, pipeline, stage):
    summary = cpfls.summary("check", pipeline.paths[stage])
    assert (summary["format"], summary["good"], summary["findings"]) == (format_of(stage), True, [])


@pytest.mark.parametrize("stage", STAGES)
def test_info_shows_origin_and_content(cpfls, pipeline, stage):
    path = pipeline.paths[stage]
    summary = cpfls.summary("info", path)
    assert (summary["format"], summary["seed"]) == (format_of(stage), 1)
    assert summary["cpfls_version"] == cpfls_cli.__version__
    lines = cpfls("info", path, "-v").stdout
    with h5py.File(path) as file:
        for name in datasets_of(file):
            assert described_as(name, lines.split())
    printed = pipeline.summaries[stage]
    assert summary["result"] == {key: printed[key] for key in summary["result"]}


@pytest.mark.usefixtures("pipeline")
@pytest.mark.parametrize("stage", ["trajectory", "selection", "model"])
def test_info_says_what_the_command_answered(cpfls, study, tmp_path, stage):
    """Nothing is computed again to read it."""
    _, commands = stages(study, study.parent)
    answered = cpfls.done(*commands[stage], "-o", tmp_path / f"{stage}.h5", "-v")
    lines = answered.stdout.partition("next:")[0].splitlines()
    assert len(lines) > 1
    answer = cpfls("info", tmp_path / f"{stage}.h5", "-v").stdout.splitlines()
    assert [line for line in lines if line not in answer] == []
    # Without -v the first part of it, and what is folded away by name.
    first = cpfls("info", tmp_path / f"{stage}.h5").stdout.splitlines()
    assert set(first) & set(lines)
    assert "where it comes from; what its" in first[-1]


@pytest.mark.parametrize(
    ("stage", "roles"),
    [
        ("trajectory", {}),
        ("flight", {"trajectory": "trajectory"}),
        ("selection", {"flight": "flight"}),
        ("model", {"flight": "flight", "selection": "selection"}),
    ],
)
def test_inputs_are_named_by_role_and_hash(cpfls, pipeline, stage, roles):
    assert cpfls.summary("info", pipeline.paths[stage])["inputs"] == {
        role: {
            "name": f"{source}.h5",
            "sha256": hashlib.sha256(pipeline.paths[source].read_bytes()).hexdigest(),
            "format": format_of(source),
        }
        for role, source in roles.items()
    }


def test_check_says_what_is_wrong_and_ends_with_1(cpfls, pipeline, tmp_path):
    path, finding = tmp_path / "flight.h5", "time: does not ascend at index 1"
    shutil.copy(pipeline.flight, path)
    with edited(path) as file:
        file["time"][1] = file["time"][0]
    result = cpfls("check", path)
    assert (result.exit_code, result.stdout) == (1, f"{path}: {finding}\n")
    summary = json.loads(cpfls("check", path, "--json").stdout)
    assert (summary["good"], summary["findings"]) == (False, [finding])
    quiet = cpfls("check", path, "-q")
    assert (quiet.exit_code, quiet.output) == (1, "")


# What a process has held at most since it began; what wait() shows of it counts its parent's memory as well.
PEAK = """
import atexit, runpy, sys
atexit.register(lambda: print("peak", open("/proc/self/status").read().split("VmHWM:")[1].split()[0]))
runpy.run_module("cpfls_cli", run_name="__main__", alter_sys=True)
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="this system does not tell what a process held")
@pytest.mark.parametrize(("command", "exit_code"), [("info", 2), ("check", 1)])
def test_a_flight_larger_than_memory_may_be(pipeline, tmp_path, command, exit_code):
    path = tmp_path / "flight.h5"
    shutil.copy(pipeline.flight, path)
    with edited(path) as file:
        for name in [name for name in Flight.about_signals() if name in file]:
            kept = file[name]
            if kept.ndim and kept.dims[0].label == "time":
                del file[name]
                # Little in the file: 8 MB of zeros for each column to those who read it.
                chunk = (1 << 14, *kept.shape[1:])
                zeros = file.create_dataset(name, (10**6, *chunk[1:]), "f8", chunks=chunk, compression="gzip")
                packed = zlib.compress(bytes(8 * math.prod(chunk)))
                for start in range(0, 10**6, chunk[0]):
                    zeros.id.write_direct_chunk((start, *(0 for _ in chunk[1:])), packed)
    words = [sys.executable, "-c", PEAK, command, str(path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    *said, peak = (done.stderr + done.stdout).splitlines()
    assert done.returncode == exit_code
    assert any("time: does not ascend at index 1" in line for line in said)
    assert int(peak.removeprefix("peak ")) < 200e3


@pytest.mark.parametrize("option", [("--set", "vehicle.mass_kg=99"), ("--seed", "3")])
@pytest.mark.parametrize("command", ["info", "check", "export"])
def test_what_overrides_a_config_is_refused_where_none_is_read(refuse, pipeline, tmp_path, command, option):
    output = ("-o", tmp_path / "model.json") if command == "export" else ()
    (line,) = refuse(command, pipeline.model, *output, *option)
    assert line == f"{' '.join(option)}: this command reads no config; leave {option[0]} out"
