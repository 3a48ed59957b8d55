"""Exported source stays the source it was, and no file makes a command end in a traceback, whatever is in it."""

import ast
import json
import re

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cpfls_cli.export.json_form import json_text
from cpfls_cli.export.source import c_source, python_source
from cpfls_cli.export.text import checked_identifier, comment_text, identifier, number
from tests.builders.command_line import drawn
from tests.builders.exported_models import CASES, model_of, sheet_of, verdict_of
from tests.builders.hostile_files import DAMAGED, KINDS, Good, tried

MODEL = model_of(CASES["seesaw, one function"])
REFERENCES = sheet_of(MODEL).references

nasty = st.lists(
    st.one_of(
        st.sampled_from(["*/", "/*", "//", "??/", "\\", "\n", '"', "'", '"""', "#endif", "*", "/", "?"]), st.text()
    ),
    max_size=8,
).map("".join)


@given(nasty)
def test_no_comment_ends_or_begins_within_a_comment(text):
    safe = comment_text(text)
    assert not re.search(r"\*/|/\*|\?\?|\\|[^ -~]", safe)
    # Broken into lines it stands behind a star.
    assert "*/" not in f" * {safe}"


@given(nasty)
def test_any_file_name_gives_an_identifier(text):
    assert checked_identifier(identifier(text))


def without_comments(code):
    """C with its comments and literals taken out, as the compiler sees it."""
    assert "??" not in code
    return re.sub(r'"[^"\n]*"', '""', re.sub(r"/\*.*?\*/", "", code, flags=re.DOTALL))


def hostile(*texts):
    verdict = verdict_of(texts[0], texts[1], (texts[2], -1))
    sheet = sheet_of(
        MODEL, file=texts[3], source=texts[4], findings=texts[:2], stop_reason=texts[5], complete=False, verdict=verdict
    )
    # No text changes what the model gives.
    vars(sheet)["references"] = REFERENCES
    return sheet


plain = c_source(hostile(*["x"] * 6), "vehicle")
plain_python = ast.parse(python_source(hostile(*["x"] * 6), "x", "jax")).body
# Why a search stopped is said only of one that did.
texts = st.tuples(*[nasty] * 5, nasty.filter(bool))
few = settings(max_examples=25, deadline=None)


@few
@given(texts)
def test_the_code_of_c_is_the_same_whatever_the_text(given_texts):
    source = c_source(hostile(*given_texts), "vehicle")
    assert without_comments(source.source) == without_comments(plain.source)
    assert without_comments(source.header) == without_comments(plain.header)


@few
@given(texts)
def test_python_still_parses_to_the_same_statements(given_texts):
    code = python_source(hostile(*given_texts), given_texts[3], "jax")
    assert code.isascii()
    body = ast.parse(code).body
    verdicts = [node for node in body if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "VERDICT"]
    assert ast.literal_eval(verdicts[0].value) == given_texts[0]
    rest, same = ([ast.dump(node) for node in tree if node not in verdicts] for tree in (body, plain_python))
    same = [line for line in same if "id='VERDICT'" not in line]
    assert rest == same


@few
@given(texts)
def test_json_gives_the_text_back(given_texts):
    document = json.loads(json_text(hostile(*given_texts)))
    assert document["findings"] == list(given_texts[:2])
    assert document["provenance"]["model"]["name"] == given_texts[3]


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_come_back(value):
    assert float(number(value)) == value
    assert re.fullmatch(r"-?\d+(\.\d+)?(e[+-]\d+)?", number(value))
    assert re.search(r"[.e]", number(value))


# `make fuzz` tries ten thousand of each, with all figures drawn.
EXAMPLES = {"YAML": 20, "HDF5 structure": 12, "HDF5 bytes": 15, "CSV": 25, "Parquet": 25, "ULog": 25}
EXAMPLES |= {"names": 20, "rotors": 12, "ULog nested": 20, "bombs": 5, **dict.fromkeys(DAMAGED, 12)}


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return Good.made(tmp_path_factory.mktemp("good"))


# What is damaged and sealed again may keep HDF5 busy for ever, which only a process of its own survives.
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "sealed"])
def test_no_file_hurts(good, kind):
    @settings(
        max_examples=EXAMPLES[kind],
        deadline=None,
        derandomize=True,
        suppress_health_check=[HealthCheck.too_slow],
        database=None,
    )
    @given(seed=st.integers(0, 2**32))
    def holds(seed):
        with drawn(shown=False):
            assert tried(good.case(kind, seed)) is None

    holds()
