"""Whatever the form, a record is told in the same sentences, verdicts and numbers: each is written once."""

import importlib
import json
import re
from html import unescape

import numpy as np
import pytest

from cpfls_cli.artifacts.formats import RECORDS, record_of_format
from cpfls_cli.artifacts.store import file_sha256, read_any
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.config.study import ReportSettings, resolved
from cpfls_cli.pages.page import report_page
from cpfls_cli.pages.source import Source, Sources
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.report.content import Box, Document, Facts, Heading, Section, Table, Text
from cpfls_cli.report.forms import Form
from cpfls_cli.report.html import html_page
from cpfls_cli.report.json_page import json_page
from cpfls_cli.report.markdown import markdown_page
from cpfls_cli.report.outcome import plain
from cpfls_cli.report.terminal import terminal_lines, warnings_of
from cpfls_cli.vehicle.settings import VehicleSettings
from tests.builders import gap_artifacts

FROM_PIPELINE = ("trajectory", "flight", "selection", "model", "prediction")
FROM_NUMBERS = ("disagreement", "diagnosis", "extended")
UNCONVERTED = {"trajectory", "prediction"}
FORMATS = [
    pytest.param(name, marks=pytest.mark.xfail(strict=True, reason="no page yet") if name in UNCONVERTED else ())
    for name in (*FROM_PIPELINE, "sweep", *FROM_NUMBERS)
]
NUMBER = re.compile(r"\d+(?:\.\d+)?(?: × 10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?")


@pytest.fixture(scope="session")
def records(cpfls, pipeline, study):
    """A record of every format that has a page: of the tiny study, or with numbers made up."""
    sweep = study.with_name("sweep.h5")
    result = cpfls("sweep", study, pipeline.flight, "-o", sweep, "--set", "sweep.seeds=2")
    assert result.exit_code == 0, result.stderr
    paths = {**pipeline.paths, "sweep": sweep}
    read = {name: (read_any(path), file_sha256(path)) for name, path in paths.items()}
    for name in FROM_NUMBERS:
        made = getattr(gap_artifacts, name)()
        read[name] = record_of_format(made.spec.format).of_data(made.header, made.data), "f" * 64
    return read


@pytest.fixture
def source(records):
    """Name a record for a page."""

    def named(name):
        record, sha256 = records[name]
        study = validate(parse_config(record.origin.config, "/config"), "/config")
        parameters = model_structure(study.identification).parameters
        return Source.of(f"{name}.h5", sha256, record, resolved(study), study.vehicle, parameters)

    return named


def answer(source):
    """What the command says of its record."""
    page = importlib.import_module(f"cpfls_cli.pages.{source.format.removeprefix('cpfls/')}")
    return tuple(page.answer(source))


def sentences(blocks):
    """Everything in words: sentences, verdicts, terms with their values."""
    for block in blocks:
        match block:
            case Text() | Heading():
                yield block.text
            case Box():
                yield from (block.label, block.title, *block.sentences)
            case Facts():
                yield from (text for row in block.rows for text in row)


def cells(blocks):
    """Every cell of a table, and its header."""
    for block in blocks:
        if isinstance(block, Table):
            yield from block.header
            yield from (cell.text for row in block.cells for cell in row)


def on_terminal(blocks):
    return "\n".join([*terminal_lines(blocks), *warnings_of(blocks)])


def in_html(page):
    return unescape(re.sub(r"<[^>]+>", " ", page))


def in_markdown(page):
    return unescape(re.sub(r"\\(.)", r"\1", page))


def in_json(page):
    def texts(value):
        if isinstance(value, str):
            yield value
        elif isinstance(value, dict | list):
            for item in value.values() if isinstance(value, dict) else value:
                yield from texts(item)

    return "\n".join(texts(json.loads(page)))


PAGES = {"html": (html_page, in_html), "markdown": (markdown_page, in_markdown), "json": (json_page, in_json)}


def plainly(text):
    """Leave out what only a form adds: marks, spaces, a capital and a full stop."""
    return " ".join(text.replace("**", "").split()).casefold().rstrip(".")


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("form", ["terminal", *PAGES])
def test_every_form_holds_every_sentence_and_number_of_the_answer(source, name, form):
    blocks = answer(source(name))
    if form == "terminal":
        written = on_terminal(blocks)
    else:
        write, read = PAGES[form]
        written = read(write(Document("Title", "1", [Section("answer", "Answer", blocks)], [])))
    words = [*sentences(blocks), *cells(blocks)]
    assert words
    assert [text for text in words if plainly(text) not in plainly(written)] == []


@pytest.mark.parametrize("name", FORMATS)
def test_the_report_says_what_the_command_says(source, name):
    """Each sentence of the answer stands on the page of the same record, and each number of its tables."""
    given = source(name)
    sources = Sources([given], VehicleSettings(), ReportSettings())
    page = plainly(in_json(report_page(sources, "1", Form.JSON).text))
    blocks = answer(given)
    assert [text for text in sentences(blocks) if plainly(text) not in page] == []
    numbers = [number for text in cells(blocks) for number in NUMBER.findall(text)]
    assert [number for number in numbers if number not in page] == []


@pytest.mark.parametrize("name", FROM_PIPELINE)
def test_what_json_prints_is_the_summary_of_the_record(records, pipeline, name):
    """A command adds what is no fact of the record, such as how long it took."""
    record, _ = records[name]
    if not hasattr(record, "summary"):
        pytest.xfail("no record yet")
    summary = {key: value for key, value in plain(record.summary).items() if value is not None}
    printed = pipeline.summaries[name]
    assert summary == {key: printed.get(key) for key in summary}


def test_every_format_with_a_page_is_here():
    formats = {record.FORMAT.name.removeprefix("cpfls/") for record in RECORDS}
    assert formats - {"checkpoint"} == {*FROM_PIPELINE, "sweep", *FROM_NUMBERS}
    assert np.all([name in formats for name in UNCONVERTED])
