"""Whatever the form, a record is told in the same sentences, verdicts and numbers: each is written once."""

import re
from types import SimpleNamespace
from unittest.mock import patch

import pytest

from cpfls_cli.artifacts.extended import ExtendedRecord
from cpfls_cli.artifacts.formats import records
from cpfls_cli.artifacts.store import file_sha256, read_any
from cpfls_cli.config.load import parse_config, validate
from cpfls_cli.config.study import resolved
from cpfls_cli.pages import model
from cpfls_cli.pages.source import Source
from cpfls_cli.regressor.structure import model_structure
from cpfls_cli.report.content import Table, Text, unfolded
from cpfls_cli.report.outcome import as_json
from tests.builders import gap_artifacts
from tests.builders.forms import blocks_in_all_forms, in_all_forms, phrases, words

FROM_COMMANDS = ("model", "sweep")
FORMATS = (*FROM_COMMANDS, "extended")
NUMBER = re.compile(r"\d+(?:\.\d+)?(?: × 10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?")


@pytest.fixture(scope="session")
def told(cpfls, study, tmp_path_factory):
    """Every artifact of the tiny study, and what its command said of it."""
    folder = tmp_path_factory.mktemp("told")
    paths = {name: folder / f"{name}.h5" for name in ("trajectory", "flight", *FROM_COMMANDS)}
    assert cpfls("trajectory", study, "-o", paths["trajectory"]).exit_code == 0
    assert cpfls("simulate", study, paths["trajectory"], "-o", paths["flight"]).exit_code == 0
    given = {
        "model": ("identify", study, paths["flight"]),
        "sweep": ("sweep", study, paths["flight"], "--set", "sweep.seeds=2"),
    }
    artifacts = {}
    for name, command in given.items():
        with patch("cpfls_cli.cli.app.tell") as tell:
            result = cpfls(*command, "-o", paths[name])
        assert result.exit_code == 0, result.stderr
        source = source_of(read_any(paths[name]), f"{name}.h5", file_sha256(paths[name]))
        artifacts[name] = SimpleNamespace(source=source, outcome=tell.call_args.args[0])
    return artifacts


def source_of(record, label, sha256="f" * 64):
    study = validate(parse_config(record.origin.config, "/config"), "/config")
    parameters = model_structure(study.identification).parameters
    return Source(label, sha256, record, resolved(study), study.vehicle, parameters)


@pytest.fixture
def answered(told):
    """A record by its format, and the blocks that its command says."""

    def of(name):
        if name in told:
            return told[name].source, told[name].outcome.blocks
        made = gap_artifacts.extended()
        source = source_of(ExtendedRecord.of_data(made.header, made.data), f"{name}.h5")
        return source, tuple(model.answer(source))

    return of


@pytest.mark.parametrize("name", FORMATS)
def test_every_form_writes_every_sentence_and_number_of_a_block(answered, name):
    _, blocks = answered(name)
    said = [phrase for block in blocks for phrase in phrases(block)]
    assert said
    for form, text in blocks_in_all_forms(blocks).items():
        assert [phrase for phrase in said if words(phrase) not in words(text)] == [], form


@pytest.mark.parametrize("name", FORMATS)
def test_the_report_says_what_the_command_says(answered, name):
    """Each sentence stands on the page of the same record in every form, and each number of a table."""
    source, given = answered(name)
    blocks = tuple(unfolded(given))
    said = [phrase for block in blocks if not isinstance(block, Table) for phrase in phrases(block)]
    cells = [cell.text for block in blocks if isinstance(block, Table) for row in block.cells for cell in row]
    numbers = [number for cell in cells for number in NUMBER.findall(cell)]
    for form, text in in_all_forms(source, blocks).items():
        warned = [block.text for block in blocks if isinstance(block, Text) and block.tone == "warning"]
        assert [p for p in said if words(p) not in words(text) and (form != "terminal" or p not in warned)] == [], form
        assert [number for number in numbers if number not in text] == [], form


@pytest.mark.parametrize("name", FROM_COMMANDS)
def test_what_json_prints_is_the_summary_of_the_record(told, name):
    """A command adds what is no fact of the record, such as how long it took."""
    printed, summary = as_json(told[name].outcome.summary), as_json(told[name].source.record.summary)
    known = {key: value for key, value in summary.items() if value is not None}
    assert known == {key: printed.get(key) for key in known}


def test_every_format_with_a_page_is_here():
    words = {"identified": "model"}
    formats = {
        words.get(record.FORMAT.kind, record.FORMAT.kind) or record.FORMAT.name.removeprefix("cpfls/")
        for record in records()
    }
    assert formats - {"checkpoint", "vehicle-checkpoint"} == set(FORMATS)
