"""The reproduction section, and sweeps of equal settings taken as one."""

import json
import re
from html import unescape

import pytest

pytestmark = pytest.mark.usefixtures("undrawn")

CONFIG = """\
seed: 4
trajectory: {sample_time_s: 0.2}
reduction: {size: 30, criterion: D}
identification:
  consequents: seesaw
  products: additive
  membership_functions: 3
  base: none
  population: 8
  generations: 1
  subpopulations: 2
  local_search: {enabled: false}
sweep:
  seeds: 3
  settings: [{name: few}, {name: all of them, set: {reduction.size: null}}]
report: {paper: true}
"""
TIMES = "[{samples: 10, svd_s: 1.0, evaluation_s: 2.0, compiled_s: 1.0}, {samples: 20, svd_s: 2.0, evaluation_s: 4.0, \
compiled_s: 1.0}, {samples: 40, svd_s: 4.0, evaluation_s: 8.0, compiled_s: 1.0}]"


@pytest.fixture(scope="module")
def folder(cpfls, tmp_path_factory):
    folder = tmp_path_factory.mktemp("reproduction")
    config, flight = folder / "study.yaml", folder / "flight.h5"
    config.write_text(CONFIG)
    made = [
        cpfls("trajectory", config, "-o", folder / "trajectory.h5"),
        cpfls("simulate", config, folder / "trajectory.h5", "-o", flight),
        cpfls("sweep", config, flight, "-o", folder / "whole.h5"),
        cpfls("sweep", config, flight, "-o", folder / "first.h5", "--set", "sweep.seeds=1"),
        cpfls("sweep", config, flight, "-o", folder / "rest.h5", "--seed", "5", "--set", "sweep.seeds=2"),
    ]
    assert [result.exit_code for result in made] == [0] * 5
    return folder


def page(cpfls, folder, *names, options=()):
    output = folder / "r.html"
    given = [folder / name for name in names]
    result = cpfls("report", folder / "study.yaml", *given, "-o", output, "--force", "--json", *options)
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout), output.read_text(encoding="utf-8")


def table(html, name):
    found = re.search(rf'<table id="{name}".*?</table>', html, re.DOTALL)[0]
    rows = re.findall(r"<tr>(.*?)</tr>", found, re.DOTALL)
    return [
        [unescape(re.sub("<.*?>", "", c)).strip() for c in re.findall(r"<t[hd].*?</t[hd]>", row, re.S)] for row in rows
    ]


def test_parts_of_a_sweep_stand_as_the_whole(cpfls, folder):
    _, whole = page(cpfls, folder, "whole.h5")
    summary, parts = page(cpfls, folder, "first.h5", "rest.h5")
    assert [name for name in summary["tables"] if "replicates" in name] == ["table-5-replicates-1"]
    assert table(parts, "table-5-replicates-1") == table(whole, "table-5-replicates-1")
    assert "first.h5 and rest.h5" in parts


def test_sweeps_that_share_a_seed_stand_apart(cpfls, folder):
    summary, _ = page(cpfls, folder, "whole.h5", "first.h5")
    assert [n for n in summary["tables"] if "replicates" in n] == ["table-5-replicates-1", "table-5-replicates-2"]


def test_every_claim_and_every_figure_has_its_line(cpfls, folder):
    summary, html = page(
        cpfls, folder, "trajectory.h5", "whole.h5", options=("--set", f"report.evaluation_times={TIMES}")
    )
    assert "figure-1-seesaw" in summary["figures"]
    rows = table(html, "claims")[1:]
    verdicts = [row[1] for row in rows]
    assert set(verdicts) <= {"PASS", "FAIL", "UNDECIDED", "NOT MEASURED"}
    for row in rows:
        assert ("Made by: " in row[4]) == (row[1] == "NOT MEASURED") == (row[2] == "—")
    assert [row[1] for row in rows if row[0].startswith("Time of an evaluation: ")] == ["PASS"]
    assert [row[0] for row in table(html, "claim-rules")[1:]] == [row[0].split(": “")[0] for row in rows]
    assert [row[0].split(":")[0] for row in table(html, "figures-of-the-paper")[1:]] == [
        f"Figure {number}" for number in range(1, 8)
    ]
    assert html.count('href="#figures-of-the-paper"') == len(
        [n for n in summary["figures"] if re.match(r"figure-\d", n)]
    )


def test_only_a_study_of_the_paper_is_held_against_it(cpfls, folder):
    summary, html = page(cpfls, folder, "trajectory.h5", options=("--set", "report.paper=false"))
    assert "reproduction" not in summary["sections"]
    assert "figures-of-the-paper" not in html
