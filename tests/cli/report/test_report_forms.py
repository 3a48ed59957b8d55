"""The same report as HTML, Markdown and JSON."""

import json
import re

import pytest

from cpfls_cli.artifacts.gate import read_origin
from cpfls_cli.pages.page import written
from cpfls_cli.report.content import Form, Listing, Section
from tests.builders.command_line import drawn

HOSTILE = "a|b <script>alert(1)</script> `x` [y](http://z) *w* \\ & #1 $m$"


@pytest.fixture(scope="module")
def report(cpfls, pipeline, study, tmp_path_factory):
    """Write a report of the tiny study to a file of this name, and read it; a little one is of one selection."""

    def write(name, *options, little=False):
        output = tmp_path_factory.mktemp("report") / name
        given = [pipeline.selection] if little else pipeline.paths.values()
        with drawn(shown=False):
            result = cpfls("report", study, *given, "-o", output, "--json", *options)
        assert result.exit_code == 0, result.stderr
        return output.read_text(encoding="utf-8"), json.loads(result.stdout)

    return write


@pytest.fixture(scope="module")
def as_json(report):
    text, summary = report("all.json")
    return json.loads(text), summary


def unfolded(given):
    """Blocks with those folded away in their place."""
    for block in given:
        yield from unfolded(block["blocks"]) if block["kind"] == "folded" else (block,)


def blocks(page, kind):
    shown = (block for section in page["sections"] for block in unfolded(section["blocks"]))
    return [block for block in shown if block["kind"] == kind]


def test_the_suffix_chooses_the_form_and_the_option_has_the_last_word(report):
    assert report("a.html", little=True)[0].startswith("<!DOCTYPE html>")
    assert report("a.txt", "--format", "md", little=True)[0].startswith("# ")
    assert report("a.md", little=True)[0].startswith("# ")
    assert report("a.MD", "--format", "json", little=True)[0].startswith("{")
    assert report("a.json", "--format", "html", little=True)[0].startswith("<!DOCTYPE html>")


def test_an_unknown_form_is_refused(cpfls, pipeline, study, tmp_path):
    result = cpfls("report", study, pipeline.flight, "-o", tmp_path / "a.html", "--format", "pdf")
    assert result.exit_code == 2
    assert "pdf" in result.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.md", "a.json"])
def test_equal_artifacts_give_equal_text(report, name):
    assert report(name, little=True)[0] == report(name, little=True)[0]


def test_all_forms_hold_the_same_sections_figures_and_tables(report, as_json):
    page, summary = as_json
    html, markdown = report("a.html")[0], report("a.md")[0]
    assert [section["name"] for section in page["sections"]] == summary["sections"]
    assert re.findall(r'<section id="([^"]+)"', html) == summary["sections"]
    assert re.findall(r'^<a id="([^"]+)"></a>\n\n## ', markdown, re.MULTILINE) == summary["sections"]
    assert [figure["name"] for figure in blocks(page, "figure")] == summary["figures"]
    assert len(re.findall(r"^\*Figure.*\*$", markdown, re.MULTILINE)) == len(summary["figures"])
    assert sorted(table["name"] for table in blocks(page, "table")) == sorted(summary["tables"])
    assert html.count("<summary>Numbers</summary>") == len(summary["figures"])


def test_the_json_form_says_where_everything_comes_from(as_json, pipeline):
    page, _ = as_json
    given = {artifact["file"]: artifact for artifact in page["artifacts"]}
    assert set(given) == {path.name for path in pipeline.paths.values()}
    model = given["model.h5"]
    assert model["inputs"]["flight"]["sha256"] == given["flight.h5"]["sha256"]
    assert model["config"] == read_origin(pipeline.model).config


def test_every_row_of_a_markdown_table_has_as_many_cells_as_its_header(report):
    text = report("a.md", "--set", f"report.title={json.dumps(HOSTILE)}")[0]
    rows = re.findall(r"(?:^\|.*\|$\n?)+", text, re.MULTILINE)
    assert len(rows) > 5
    for table in rows:
        assert len({len(re.findall(r"(?<!\\)\|", line)) for line in table.splitlines()}) == 1


def test_hostile_words_stay_words_in_markdown(report):
    notes = json.dumps([HOSTILE, "1. no list", "# no heading", "> no quote", "one\n\ntwo"])
    text = report(
        "a.md", "--set", f"report.title={json.dumps(HOSTILE)}", "--set", f"report.notes={notes}", little=True
    )[0]
    assert not re.search(r"(?<!\\)<script", text)
    heading = text.splitlines()[0]
    assert heading.startswith(r"# a\|b \<script\>alert(1)\</script\> \`x\` \[y\](http://z) \*w\* \\ \& \#1 $m$")
    for line in (r"1\. no list", r"\# no heading", r"\> no quote", "one two"):
        assert f"\n{line}\n" in text


def test_a_listing_cannot_end_its_own_fence():
    page = written("T", "1", [Section("a", "A", [Listing("``` ````\n# c")])], [], Form.MARKDOWN)
    assert page.count("`````text\n``` ````\n# c\n`````\n") == 1
