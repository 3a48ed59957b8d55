"""The benchmarks start and print their tables; what they print at full size is published in the docs."""

import runpy
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def judging(monkeypatch, capsys):
    """Run a benchmark as a program, in this process; give how it ended and what it printed."""

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["judging.py", *map(str, words)])
        ended = None
        try:
            runpy.run_path(str(BENCHMARKS / "judging.py"), run_name="__main__")
        except SystemExit as end:
            ended = end.code
        return ended, capsys.readouterr().out

    return call


def test_judging_on_the_tiny_study(judging, pipeline, study):
    ended, printed = judging(study, pipeline.flight, pipeline.selection)
    assert ended is None
    header, _, *rows = printed.splitlines()
    assert header.startswith("| judged on | members of the front |")
    assert [row.split("|")[1].strip() for row in rows] == ["selected samples", "whole training part"]
    assert all(0 <= int(row.split("|")[3]) <= int(row.split("|")[2]) for row in rows)


def test_a_benchmark_without_its_files_says_how_to_call_it(judging):
    ended, _ = judging()
    # The code of a program that ends with words is 1, and Python prints them.
    assert "python benchmarks/judging.py configs/paper-gentle.yaml" in ended


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
