"""The benchmarks start and print their tables; what they print at full size is published in the docs."""

import runpy
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def test_judging_on_the_tiny_study(pipeline, study):
    command = [sys.executable, BENCHMARKS / "judging.py", study, pipeline.flight, pipeline.selection]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    header, _, *rows = done.stdout.splitlines()
    assert header.startswith("| judged on | members of the front |")
    assert [row.split("|")[1].strip() for row in rows] == ["selected samples", "whole training part"]
    assert all(0 <= int(row.split("|")[3]) <= int(row.split("|")[2]) for row in rows)


def test_a_benchmark_without_its_files_says_how_to_call_it():
    done = subprocess.run(
        [sys.executable, BENCHMARKS / "judging.py"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1
    assert "python benchmarks/judging.py configs/paper-gentle.yaml" in done.stderr


OF_THE_EXTRA = {"anfis_toolbox", "apricot", "cma", "distributed", "pyfume", "pymoo", "ruckig", "skmatter"}


@pytest.mark.parametrize("path", sorted(BENCHMARKS.glob("*.py")), ids=lambda path: path.stem)
def test_every_benchmark_finds_what_it_imports(path):
    try:
        names = runpy.run_path(str(path), run_name="benchmark")
    except ModuleNotFoundError as missing:
        if missing.name not in OF_THE_EXTRA:
            raise
        pytest.skip(f"{missing.name} comes with the extra bench")
    assert callable(names["main"])
