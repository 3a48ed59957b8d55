"""The reproduction section, and searches of equal settings taken as one."""

import json
import re
from dataclasses import replace
from html import unescape

import pytest

from benchmarks.paper.claims import EvaluationTime
from benchmarks.paper.replicates import Sweep
from benchmarks.paper.report import paper_page
from cpfls_cli.store import read, write
from tests.builders.sweeps import searched


def table_cells(html, name):
    """Give the rows of a table as lists of text."""
    found = re.search(rf'<table id="{name}".*?</table>', html, re.DOTALL)[0]
    rows = re.findall(r"<tr>(.*?)</tr>", found, re.DOTALL)
    return [
        [unescape(re.sub("<.*?>", "", c)).strip() for c in re.findall(r"<t[hd].*?</t[hd]>", row, re.S)] for row in rows
    ]


TIMES = [EvaluationTime(samples=n, svd_s=n / 10, evaluation_s=n / 5, compiled_s=1.0) for n in (10, 20, 40)]


@pytest.fixture(scope="module")
def folder(swept):
    """Searches whole, and in two parts."""
    searched(swept, "first.h5", 4, 1)
    searched(swept, "rest.h5", 5, 1)
    return swept


def page(folder, *names, times=()):
    """Write a report on the paper."""
    made = paper_page(folder / "study.yaml", [folder / name for name in ("trajectory.h5", *names)], times)
    return made, made.text


def test_parts_of_searches_stand_as_the_whole(folder):
    _, whole = page(folder, "whole.h5")
    summary, parts = page(folder, "first.h5", "rest.h5")
    assert [name for name in summary.tables if name.startswith("searches")] == ["searches-1-table"]
    assert table_cells(parts, "searches-1-table") == table_cells(whole, "searches-1-table")
    assert "first.h5 and rest.h5" in parts


def test_searches_that_share_a_seed_stand_apart(folder):
    summary, _ = page(folder, "whole.h5", "first.h5")
    assert {name for name in summary.tables if name.startswith("searches")} == {f"searches-{n}-table" for n in (1, 2)}


def test_every_claim_and_every_figure_has_its_line(folder):
    summary, html = page(folder, "whole.h5", times=TIMES)
    assert "figure-1-seesaw" in summary.figures
    rows = table_cells(html, "claims")[1:]
    verdicts = [row[1] for row in rows]
    assert set(verdicts) <= {"PASS", "FAIL", "UNDECIDED", "NOT MEASURED"}
    for row in rows:
        assert ("Made by: " in row[4]) == (row[1] == "NOT MEASURED") == (row[2] == "—")
    assert [row[1] for row in rows if row[0].startswith("Time of an evaluation: ")] == ["PASS"]
    assert [row[0] for row in table_cells(html, "claim-rules")[1:]] == [row[0].split(": “")[0] for row in rows]
    assert [row[0].split(":")[0] for row in table_cells(html, "figures-of-the-paper")[1:]] == [
        f"Figure {number}" for number in range(1, 8)
    ]
    assert html.count('href="#figures-of-the-paper"') == len(re.findall(r"<figcaption>Figure \d", html)) >= 3


def test_a_report_of_the_package_holds_nothing_against_the_paper(cpfls, folder):
    output = folder / "r.html"
    given = [folder / "trajectory.h5"]
    result = cpfls("report", folder / "study.yaml", *given, "-o", output, "--json")
    html = output.read_text(encoding="utf-8")
    assert "reproduction" not in json.loads(result.stdout)["sections"]
    assert "figures-of-the-paper" not in html
    assert "· paper" not in html


def with_settings(folder, name, **values):
    """Write searches that claim other settings."""
    sweep, origin = read(folder / "whole.h5", Sweep)
    rows = (dict(zip(values, each, strict=True)) for each in zip(*values.values(), strict=True))
    settings = tuple(replace(own, **given) for own, given in zip(sweep.settings, rows, strict=True))
    write(folder / name, replace(sweep, settings=settings), origin)
    return name


def test_paper_stands_beside_settings_of_equal_structure_and_samples(folder):
    claimed = with_settings(folder, "paper.h5", samples=[685, 5487], structure=["cpfls", "fls"])
    _, html = page(folder, claimed)
    rows = table_cells(html, "searches-1-table")
    places = {row[0].replace("\N{NO-BREAK SPACE}", " "): place for place, row in enumerate(rows)}
    assert rows[places["best run: MSE, (N m)²"] + 1] == ["· paper", "0.0008", "0.0007"]
    assert rows[places["best run: largest error, N m"] + 1] == ["· paper", "0.1952", "0.1531"]
    assert rows[places["mean condition number"] + 1] == ["· paper", "5368.1", "3815.5"]
    assert rows[places["mean condition number"] + 3] == ["· paper", "2434.5", "1701.2"]
    assert "standard deviation: a variance" in html


def test_other_settings_stand_alone(folder):
    _, html = page(folder, "whole.h5")
    assert "· paper" not in [row[0] for row in table_cells(html, "searches-1-table")]
