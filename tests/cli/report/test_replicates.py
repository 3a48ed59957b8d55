"""The tables of the report from a sweep."""

import json
import re

import numpy as np

from cpfls_cli.identification.replicates import Sweep
from cpfls_cli.report.numbers import number
from cpfls_cli.store import read
from tests.builders.pages import table_cells


def page(cpfls, swept, *options, sweep="sweep.h5"):
    result = cpfls("report", swept / "study.yaml", swept / sweep, "-o", swept / "r.html", "--force", "--json", *options)
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout), (swept / "r.html").read_text(encoding="utf-8")


def test_table_shows_means_and_deviations_of_the_runs(cpfls, swept):
    summary, html = page(cpfls, swept)
    assert "sweep-1-table-2" in summary["tables"]
    rows = table_cells(html, "sweep-1-table-2")
    settings = read(swept / "sweep.h5", Sweep)[0].settings
    assert rows[0] == ["Quantity", "few", "all of them"]
    shown = {row[0].replace("\N{NO-BREAK SPACE}", " "): row[1:] for row in rows}
    groups = [own.of("mse") for own in settings]
    assert shown["runs"] == ["3", "3"]
    assert shown["best run: MSE, (N m)²"] == [number(min(group), 3) for group in groups]
    assert shown["mean MSE, (N m)²"] == [number(sum(group) / 3, 3) for group in groups]
    after = rows[[row[0].startswith("mean MSE") for row in rows].index(True) + 1]
    assert after[0].replace("\N{NO-BREAK SPACE}", " ") == "standard deviation of the MSE, (N m)²"
    assert after[1:] == [number(float(np.std(group, ddof=1)), 2) for group in groups]
    assert len(shown) == len(rows)
    assert "the variance is the square of the standard deviation shown" in " ".join(html.split())


def test_held_out_part_has_its_table(cpfls, swept):
    _, html = page(cpfls, swept)
    rows = table_cells(html, "sweep-1-table-3")
    assert [row[:2] for row in rows[1:]] == [["few", "3"], ["all of them", "3"]]
    few = read(swept / "sweep.h5", Sweep)[0].settings[0].of("mse", 1)
    assert rows[1][2] == f"{number(float(np.mean(few)), 3)} ± {number(float(np.std(few, ddof=1)), 2)}"


def test_unfinished_sweep_says_so(cpfls, swept, monkeypatch):
    from cpfls_cli.search.resumable import Watch

    stops = iter([None] * 9 + ["time-limit"] * 9)
    monkeypatch.setattr(Watch, "should_stop", lambda _: next(stops))
    words = ("sweep", swept / "study.yaml", swept / "flight.h5", "-o", swept / "unfinished.h5")
    assert cpfls(*words).exit_code == 0
    assert not read(swept / "unfinished.h5", Sweep)[0].complete
    _, html = page(cpfls, swept, sweep="unfinished.h5")
    assert re.search(r"Unfinished: \d of 6 runs of unfinished\.h5", html)
