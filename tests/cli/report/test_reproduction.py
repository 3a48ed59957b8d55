"""Searches of equal settings taken as one, and the section of the reproduction."""

import json
import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest

from benchmarks.paper import searches
from benchmarks.paper.claims import EvaluationTime
from benchmarks.paper.replicates import Sweep
from benchmarks.paper.report import paper_page
from cpfls_cli.search import Watch
from cpfls_cli.store import read, write
from tests.builders.studies import VEHICLE
from tests.builders.sweeps import searched

STUDY = """\
trajectory: {sample_time_s: 0.2}
reduction: {criterion: D}
identification: {consequents: seesaw, products: additive, membership_functions: 3, base: none, subpopulations: 2,
  local_search: {enabled: false}, validation: {enabled: false}}
"""
SIZE = ("--set", "identification.population=8", "--set", "identification.generations=2")
TIMES = [EvaluationTime(samples=n, svd_s=n / 10, evaluation_s=n / 5, compiled_s=1.0) for n in (10, 20, 40)]


@pytest.fixture(scope="module")
def folder(cpfls, tmp_path_factory):
    folder = tmp_path_factory.mktemp("searches")
    (folder / "study.yaml").write_text(STUDY + VEHICLE)
    cpfls.done("trajectory", folder / "study.yaml", "-o", folder / "path.h5")
    cpfls.done("simulate", folder / "study.yaml", folder / "path.h5", "-o", folder / "flight.h5")
    return folder


def search(folder, output, seeds=2):
    given = (folder / "study.yaml", folder / "flight.h5", searches.Compared.READINGS, output)
    searches.main(*given, seed=1, seeds=seeds, population=8, generations=2, samples=[30])
    return read(output, Sweep)[0]


@pytest.fixture(scope="module")
def found(folder):
    return search(folder, folder / "whole.h5")


def test_a_run_is_that_of_reduce_and_identify(cpfls, folder, found, tmp_path):
    assert found.complete
    assert [setting.runs for setting in found.settings] == [2] * 10
    setting = next(own for own in found.settings if own.name == "cpFLS, 30 samples by sigma_min, judged on learned")
    rule = ("--set", "reduction.size=30", "--set", "reduction.criterion=sigma_min")
    cpfls.done("reduce", folder / "study.yaml", folder / "flight.h5", *rule, "-o", tmp_path / "few.h5")
    words = ("--selection", tmp_path / "few.h5", "--seed", "2", *SIZE, "--set", "identification.judged_on=learned")
    alone = cpfls.summary("identify", folder / "study.yaml", folder / "flight.h5", *words, "-o", tmp_path / "m.h5")
    run = setting.replicates[1]
    assert (run.seed, setting.samples) == (2, 30)
    assert alone["errors"]["mse"] == pytest.approx(run.mse[0], rel=1e-9)


def test_stopped_it_goes_on_to_the_same_end(folder, found, tmp_path, monkeypatch):
    stops = iter([None] * 40 + ["time-limit"] * 99)
    with monkeypatch.context() as patch:
        patch.setattr(Watch, "should_stop", lambda _: next(stops))
        with pytest.raises(SystemExit):
            search(folder, tmp_path / "s.h5")
    partial = tmp_path / "s.h5.partial"
    kept = read(partial, Sweep)[0].runs
    assert 0 < kept < 20
    assert not (tmp_path / "s.h5").exists()
    ran = []
    monkeypatch.setattr(searches, "run", lambda *given, own=searches.run: ran.append(given[2]) or own(*given))
    again = search(folder, tmp_path / "s.h5")
    assert len(ran) == 20 - kept
    assert not partial.exists()
    for one, two in zip(found.settings, again.settings, strict=True):
        assert [run.chromosome for run in one.replicates] == [run.chromosome for run in two.replicates]
        np.testing.assert_array_equal(one.errors, two.errors)


def table_cells(html, name):
    """Give the rows of a table as lists of text."""
    found = re.search(rf'<table id="{name}".*?</table>', html, re.DOTALL)[0]
    rows = re.findall(r"<tr>(.*?)</tr>", found, re.DOTALL)
    return [
        [unescape(re.sub("<.*?>", "", c)).strip() for c in re.findall(r"<t[hd].*?</t[hd]>", row, re.S)] for row in rows
    ]


@pytest.fixture(scope="module")
def parted(swept):
    """Searches whole, and in two parts."""
    searched(swept, "first.h5", 4, 1)
    searched(swept, "rest.h5", 5, 1)
    return swept


def page(parted, *names, times=()):
    """Write a report on the paper."""
    made = paper_page(parted / "study.yaml", [parted / name for name in ("trajectory.h5", *names)], times)
    return made, made.text


def test_parts_of_searches_stand_as_the_whole(parted):
    _, whole = page(parted, "whole.h5")
    summary, parts = page(parted, "first.h5", "rest.h5")
    assert [name for name in summary.tables if name.startswith("searches")] == ["searches-1-table"]
    assert table_cells(parts, "searches-1-table") == table_cells(whole, "searches-1-table")
    assert "first.h5 and rest.h5" in parts


def test_searches_that_share_a_seed_stand_apart(parted):
    summary, _ = page(parted, "whole.h5", "first.h5")
    assert {name for name in summary.tables if name.startswith("searches")} == {f"searches-{n}-table" for n in (1, 2)}


def test_every_claim_and_every_figure_has_its_line(parted):
    summary, html = page(parted, "whole.h5", times=TIMES)
    assert "figure-1-seesaw" in summary.figures
    rows = table_cells(html, "claims")[1:]
    assert {row[1] for row in rows} <= {"PASS", "FAIL", "UNDECIDED", "NOT MEASURED"}
    for row in rows:
        assert ("Made by: " in row[4]) == (row[1] == "NOT MEASURED") == (row[2] == "—")
    assert [row[1] for row in rows if row[0].startswith("Time of an evaluation: ")] == ["PASS"]
    assert [row[0] for row in table_cells(html, "claim-rules")[1:]] == [row[0].split(": “")[0] for row in rows]
    assert [row[0].split(":")[0] for row in table_cells(html, "figures-of-the-paper")[1:]] == [
        f"Figure {number}" for number in range(1, 8)
    ]
    assert html.count('href="#figures-of-the-paper"') == len(re.findall(r"<figcaption>Figure \d", html)) >= 3


def test_a_report_of_the_package_holds_nothing_against_the_paper(cpfls, parted):
    output = parted / "r.html"
    result = cpfls("report", parted / "study.yaml", parted / "trajectory.h5", "-o", output, "--json")
    html = output.read_text(encoding="utf-8")
    assert "reproduction" not in json.loads(result.stdout)["sections"]
    assert "figures-of-the-paper" not in html
    assert "· paper" not in html


def with_settings(parted, name, **values):
    """Write searches that claim other settings."""
    sweep, origin = read(parted / "whole.h5", Sweep)
    rows = (dict(zip(values, each, strict=True)) for each in zip(*values.values(), strict=True))
    settings = tuple(replace(own, **given) for own, given in zip(sweep.settings, rows, strict=True))
    write(parted / name, replace(sweep, settings=settings), origin)
    return name


def test_paper_stands_next_to_settings_of_equal_structure_and_samples(parted):
    _, html = page(parted, with_settings(parted, "paper.h5", samples=[685, 5487], structure=["cpfls", "fls"]))
    rows = table_cells(html, "searches-1-table")
    places = {row[0].replace("\N{NO-BREAK SPACE}", " "): place for place, row in enumerate(rows)}
    assert rows[places["best run: MSE, (N m)²"] + 1] == ["· paper", "0.0008", "0.0007"]
    assert rows[places["best run: largest error, N m"] + 1] == ["· paper", "0.1952", "0.1531"]
    assert rows[places["mean condition number"] + 1] == ["· paper", "5368.1", "3815.5"]
    assert rows[places["mean condition number"] + 3] == ["· paper", "2434.5", "1701.2"]
    assert "standard deviation: a variance" in html


def test_other_settings_stand_alone(parted):
    _, html = page(parted, "whole.h5")
    assert "· paper" not in [row[0] for row in table_cells(html, "searches-1-table")]
