import json
import re
import shutil
import subprocess
from html.parser import HTMLParser
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from benchmarks.paper.report import paper_page
from cpfls_cli.artifacts.identified import IdentifiedModel
from cpfls_cli.store import read
from tests.builders.artifacts import read_result, with_fields
from tests.builders.command_line import drawn, run
from tests.builders.studies import IDENTIFICATION, VEHICLE, put_file

CONFIG = f"""
seed: 3
trajectory: {{sample_time_s: 0.2}}
reduction: {{size: 60}}
{IDENTIFICATION.replace("functions: 5", "functions: 3")}\
  subpopulations: 2
  training_share: 0.7
  validation: {{enabled: false}}
report: {{title: "<script>alert(1)</script> & a study"}}
"""
HOSTILE = "<img src=x onerror=alert(1)>&'$a$\x07.h5"
SECTIONS = [
    "summary", "comparison", "identify", "identify-2", "stated-vehicle", "trajectory", "simulate", "simulate-2",
    "reduce", "provenance",
]  # fmt: skip
VOID = {"meta", "link", "br", "img", "input", "hr"}


class Page(HTMLParser):
    """Collects what a browser would see: elements, attributes, text."""

    def __init__(self, html):
        super().__init__()
        self.elements, self.open, self.text = [], [], ""
        self.feed(html)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "style" not in self.open:
            self.text += data

    def ids(self, tag):
        return [attributes["id"] for name, attributes in self.elements if name == tag and "id" in attributes]


def cpfls(*arguments, code=0):
    result = run(*arguments)
    assert result.exit_code == code, result.output
    return result


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    config = put_file(folder / "study.yaml", CONFIG + VEHICLE)
    names = ("trajectory", "flight", "selection", "model", "ridge", "noisy")
    files = SimpleNamespace(folder=folder, config=config, **{name: folder / f"{name}.h5" for name in names})
    cpfls("trajectory", config, "-o", files.trajectory)
    cpfls("simulate", config, files.trajectory, "-o", files.flight)
    cpfls("simulate", config, files.trajectory, "-o", files.noisy, "--set", "simulation.relative_noise.torque=0.05")
    cpfls("reduce", config, files.flight, "-o", files.selection)
    cpfls("identify", config, files.flight, "--selection", files.selection, "-o", files.model)
    based = ("--set", "identification.base=rigid-body", "--set", "identification.ridge.count=3")
    cpfls("identify", config, files.noisy, "-o", files.ridge, *based)
    return files


@pytest.fixture(scope="module")
def full(study):
    given = (study.trajectory, study.flight, study.noisy, study.selection, study.model, study.ridge)
    output = study.folder / "report.html"
    with drawn():
        summary = json.loads(cpfls("report", study.config, *given, "-o", output, "--json").stdout)
    html = output.read_text(encoding="utf-8")
    return SimpleNamespace(output=output, summary=summary, html=html, page=Page(html), given=given)


def report(study, tmp_path, *artifacts, options=()):
    output = tmp_path / "out.html"
    result = cpfls("report", study.config, *artifacts, "-o", output, "--json", *options)
    return json.loads(result.stdout), output.read_text(encoding="utf-8"), result


def test_everything_given_everything_shown(full):
    assert full.summary["sections"] == SECTIONS == full.page.ids("section")
    assert full.summary["figures"] == full.page.ids("figure")
    assert full.summary["tables"] == full.page.ids("table")
    assert full.summary["missing"] == []
    assert full.summary["bytes"] == full.output.stat().st_size < 3_000_000
    kinds = {re.sub(r"-\d+$", "", name) for name in full.summary["figures"]}
    assert kinds == {
        "trajectory-1-derivatives", "trajectory-1-attitude", "simulate-1-attitude", "simulate-1-torque",
        "simulate-2-attitude", "simulate-2-torque", "reduce-1-figure",
        "identify-1-convergence", "identify-1-pareto-front",
        "identify-1-figure", "identify-2-convergence", "identify-2-pareto-front", "identify-2-ridge-curve",
    }  # fmt: skip


def test_no_id_stands_twice_and_every_element_is_closed(full):
    ids = [attributes["id"] for _, attributes in full.page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert full.page.open == []


def test_a_single_artifact_says_what_is_missing_and_what_makes_it(study, tmp_path):
    summary, html, _ = report(study, tmp_path, study.noisy)
    assert summary["sections"] == ["summary", "stated-vehicle", "simulate", "provenance"]
    assert summary["missing"] == ["trajectory", "selection", "model"]
    for command in ("trajectory CONFIG", "reduce CONFIG", "identify CONFIG"):
        assert f"cpfls {command}" in html
    assert "cpfls simulate CONFIG" not in html


def test_the_page_needs_nothing_from_outside(full):
    assert "@import" not in full.html
    assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", full.html))
    for tag, attributes in full.page.elements:
        assert tag not in {"script", "iframe", "object", "embed", "base", "img"}
        for key in ("src", "srcset", "href", "xlink:href", "data", "action", "poster"):
            assert attributes.get(key, "#").startswith(("#", "data:,")), (tag, attributes)


def test_every_figure_is_well_formed_and_described(full):
    pictures = re.findall(r"<svg.*?</svg>", full.html, re.DOTALL)
    assert len(pictures) == len(full.summary["figures"])
    for picture in pictures:
        root = ElementTree.fromstring(picture)
        assert root.get("aria-label")
        assert root.get("viewBox")


def test_hostile_titles_and_file_names_stay_text(study, tmp_path):
    hostile = tmp_path / HOSTILE
    shutil.copy(study.model, hostile)
    selection = tmp_path / "a$b$c.h5"
    shutil.copy(study.selection, selection)
    _, html, _ = report(study, tmp_path, hostile, selection)
    page = Page(html)
    assert not [tag for tag, _ in page.elements if tag in {"script", "img"}]
    assert not [attributes for _, attributes in page.elements if any(key.startswith("on") for key in attributes)]
    assert "<script>alert(1)</script> & a study" in page.text
    assert HOSTILE.replace("\x07", "\N{REPLACEMENT CHARACTER}") in page.text
    assert "a$b$c.h5" in page.text
    assert str(tmp_path) not in html


def test_the_headline_says_who_wins_and_on_what(study, full):
    assert "the rigid body is better about every axis" in full.page.text
    assert "simulated without noise" in full.page.text
    model, ridge = (read(path, IdentifiedModel)[0] for path in (study.model, study.ridge))
    assert "On the held-out rest" in full.page.text
    worst = 100 * float(np.max(model.judged.relative_error[0, 0]))
    assert f"{worst:.3g} %" in full.page.text
    for finding in model.findings + ridge.findings:
        assert finding[1:] in full.page.text


def test_the_tables_show_the_numbers_of_the_artifacts(study, full):
    selection = read_result(study.selection)
    for number in (selection.condition_number, selection.condition_number_full):
        assert f"{number:.5g}" in full.page.text


def test_the_paper_s_numbers_stand_next_to_those_of_its_own_report_alone(study, full):
    text = Page(paper_page(study.config, full.given).text).text
    for printed in ("56254", "59771", "+22.54 %", "5506.4", "0.1531", "121.5 × 10⁻⁶", "Paper"):
        assert printed in text
    for printed in ("56254", "5506.4", "Paper"):
        assert printed not in full.page.text


def test_a_rank_deficient_selection_is_called_so(study, tmp_path):
    rank = read_result(study.selection).rank_full - 2
    broken = tmp_path / "broken.h5"
    with_fields(study.selection, broken, rank=rank, condition_number=7.0)
    _, html, _ = report(study, tmp_path, broken)
    text = Page(html).text
    assert f"rank deficient: rank {rank}" in text
    assert "not comparable" in text
    assert "better conditioned" not in text


def test_selections_from_one_flight_have_a_section_each(study, tmp_path):
    smaller = tmp_path / "smaller.h5"
    cpfls("reduce", study.config, study.flight, "-o", smaller, "--set", "reduction.size=40")
    summary, html, _ = report(study, tmp_path, study.selection, smaller)
    assert Page(html).text.count("flight.h5, full set") == 2
    assert [name for name in summary["sections"] if name.startswith("reduce")] == ["reduce", "reduce-2"]
    assert [name for name in summary["figures"] if "figure-5" in name] == ["reduce-1-figure-5", "reduce-2-figure-5"]


def test_the_provenance_names_hashes_and_no_folder(study, full):
    for path in full.given:
        assert subprocess.check_output(["sha256sum", path], text=True)[:64] in full.page.text
    assert str(study.folder) not in full.html
    assert read(study.model, IdentifiedModel)[1].config in full.page.text


def test_a_file_given_twice_counts_once_and_equal_names_are_distinguished(study, tmp_path):
    (tmp_path / "other").mkdir()
    copy, other = tmp_path / "copy.h5", tmp_path / "other" / "flight.h5"
    shutil.copy(study.flight, copy)
    shutil.copy(study.noisy, other)
    summary, html, result = report(study, tmp_path, study.flight, copy, other)
    assert len([name for name in summary["figures"] if name.endswith("-torque")]) == 2
    assert "shown once" in result.stderr
    assert {f"{path.parent.name}/flight.h5" for path in (study.flight, other)} <= set(
        re.findall(r"\w+/flight\.h5", html)
    )


def test_another_vehicle_is_pointed_out(study, tmp_path):
    _, html, _ = report(study, tmp_path, study.flight, options=("--set", "vehicle.mass_kg=7.0"))
    assert "another vehicle than this one: flight.h5" in html


def test_where_there_is_nothing_to_search_for_no_search_is_shown(study, tmp_path):
    model = tmp_path / "single.h5"
    single = ("--set", "identification.membership_functions=1", "--set", "identification.base=rigid-body")
    cpfls("identify", study.config, study.noisy, "-o", model, *single, "--set", "identification.ridge.count=3")
    summary, html, _ = report(study, tmp_path, model)
    text = Page(html).text
    assert not [name for name in summary["figures"] if name.endswith(("convergence", "pareto-front"))]
    assert "identify-1-ridge-curve" in summary["figures"]
    assert text.count("no search: one chromosome") == 1
    assert "No search: one chromosome. single.h5 has one rule per input" in text
    assert "population 10" not in text
    table = html[html.index("Table 5. Results") :]
    assert table[: table.index("</table>")].count(">no search<") == 2


def test_the_search_is_labelled_by_the_error_that_it_minimised(study, full):
    for section, model, error, other in (
        ("identify", study.model, "mean squared error, (N m)²", "cross-validated error"),
        ("identify-2", study.ridge, "cross-validated error, scaled torque²", "mean squared error against"),
    ):
        html = full.html[full.html.index(f'<section id="{section}"') :].split("</section>")[0]
        assert error in html
        assert other not in html
        assert f"smallest {error.split(',')[0]}" in html
        assert f"Pareto front of {model.name}, " in html
        assert f"{error.split(',')[0]} against condition number, as the search saw them" in html
