"""The reproduction section, and sweeps of equal settings taken as one."""

import json
import re

import pytest

from tests.builders.pages import table_cells

pytestmark = pytest.mark.usefixtures("undrawn")

TIMES = "[{samples: 10, svd_s: 1.0, evaluation_s: 2.0, compiled_s: 1.0}, {samples: 20, svd_s: 2.0, evaluation_s: 4.0, \
compiled_s: 1.0}, {samples: 40, svd_s: 4.0, evaluation_s: 8.0, compiled_s: 1.0}]"


@pytest.fixture(scope="module")
def folder(cpfls, swept, tmp_path_factory):
    """The sweep whole, and in two parts."""
    folder = tmp_path_factory.mktemp("reproduction")
    (folder / "trajectory.h5").symlink_to(swept / "trajectory.h5")
    (folder / "whole.h5").symlink_to(swept / "sweep.h5")
    words = ("sweep", swept / "study.yaml", swept / "flight.h5", "-o")
    made = [
        cpfls(*words, folder / "first.h5", "--set", "sweep.seeds=1"),
        cpfls(*words, folder / "rest.h5", "--seed", "5", "--set", "sweep.seeds=2"),
    ]
    assert [result.exit_code for result in made] == [0, 0]
    return folder


@pytest.fixture
def page(cpfls, swept, folder):
    """Write a report on a study of the paper, unless another is asked for."""

    def call(*names, options=(), paper=True):
        output = folder / "r.html"
        given = [folder / name for name in names]
        options = ("--set", f"report.paper={json.dumps(paper)}", *options)
        result = cpfls("report", swept / "study.yaml", *given, "-o", output, "--force", "--json", *options)
        assert result.exit_code == 0, result.stderr
        return json.loads(result.stdout), output.read_text(encoding="utf-8")

    return call


def test_parts_of_a_sweep_stand_as_the_whole(page):
    _, whole = page("whole.h5")
    summary, parts = page("first.h5", "rest.h5")
    assert [name for name in summary["tables"] if "replicates" in name] == ["table-5-replicates-1"]
    assert table_cells(parts, "table-5-replicates-1") == table_cells(whole, "table-5-replicates-1")
    assert "first.h5 and rest.h5" in parts


def test_sweeps_that_share_a_seed_stand_apart(page):
    summary, _ = page("whole.h5", "first.h5")
    assert [n for n in summary["tables"] if "replicates" in n] == ["table-5-replicates-1", "table-5-replicates-2"]


def test_every_claim_and_every_figure_has_its_line(page):
    summary, html = page("trajectory.h5", "whole.h5", options=("--set", f"report.evaluation_times={TIMES}"))
    assert "figure-1-seesaw" in summary["figures"]
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
    assert html.count('href="#figures-of-the-paper"') == len(
        [n for n in summary["figures"] if re.match(r"figure-\d", n)]
    )


def test_only_a_study_of_the_paper_is_held_against_it(page):
    summary, html = page("trajectory.h5", paper=False)
    assert "reproduction" not in summary["sections"]
    assert "figures-of-the-paper" not in html
