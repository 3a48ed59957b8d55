"""Whatever the form, a record is told in the same sentences, verdicts and numbers: each is written once."""

import re
from types import SimpleNamespace
from unittest.mock import patch

import pytest

from cpfls_cli.files import read_content
from cpfls_cli.report.content import Table, Text, unfolded
from cpfls_cli.result import plain
from cpfls_cli.stages.report import read_sources
from tests.builders.forms import blocks_in_all_forms, in_all_forms, phrases, words

FROM_COMMANDS = ("model",)
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
    }
    artifacts = {}
    for name, command in given.items():
        with patch("cpfls_cli.cli.stages.tell") as tell:
            result = cpfls(*command, "-o", paths[name])
        assert result.exit_code == 0, result.stderr
        (source,) = read_sources([paths[name]], [read_content(paths[name]).sha256])
        artifacts[name] = SimpleNamespace(source=source, outcome=tell.call_args.args[0])
    return artifacts


@pytest.fixture
def answered(told):
    """A result by its name, and the blocks that its command says."""
    return lambda name: (told[name].source, told[name].outcome.blocks)


@pytest.mark.parametrize("name", FROM_COMMANDS)
def test_every_form_writes_every_sentence_and_number_of_a_block(answered, name):
    _, blocks = answered(name)
    said = [phrase for block in blocks for phrase in phrases(block)]
    assert said
    for form, text in blocks_in_all_forms(blocks).items():
        assert [phrase for phrase in said if words(phrase) not in words(text)] == [], form


@pytest.mark.parametrize("name", FROM_COMMANDS)
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
    printed, summary = plain(told[name].outcome.summary), plain(told[name].source.record)
    known = {key: value for key, value in summary.items() if value is not None}
    assert known == {key: printed.get(key) for key in known}
