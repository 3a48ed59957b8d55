"""Text from files of strangers stays text."""

import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.export.text import checked_identifier, comment_lines, comment_text, identifier, literal_text


@pytest.mark.parametrize(
    ("text", "safe"),
    [
        ("a */ b", "a * / b"),
        ("a /* b", "a / * b"),
        ("*/*/*", "* / * / *"),
        ("what??/", "what?/"),
        ("one\ntwo\rthree\0", "one?two?three?"),
        ("Größe \u202e", "Gr?e ?"),
        ("C:\\flights", "C:|flights"),
        ("N m/s, 3 * 4", "N m/s, 3 * 4"),
    ],
)
def test_comment_text(text, safe):
    assert comment_text(text) == safe


def test_comment_lines_are_short_and_keep_empty_paragraphs():
    lines = comment_lines(["word " * 100, "", "x" * 300])
    assert "" in lines
    assert all(len(line) <= 115 for line in lines)
    assert all(line == "" or line.startswith(" ") for line in lines)


def test_literals_hold_no_quotes_and_no_escapes():
    assert literal_text('good" "\\n%s??/') == "good_ __n_s___"


@pytest.mark.parametrize(
    ("stem", "name"),
    [
        ("model", "model"),
        ("my model-2", "my_model_2"),
        ("2nd", "model_2nd"),
        ("_x", "x"),
        ("模型", "model"),
        ("...", "model"),
        ("é1", "model_1"),
    ],
)
def test_identifier(stem, name):
    assert identifier(stem) == name
    assert checked_identifier(name) == name


@pytest.mark.parametrize("name", ["", "2x", "_x", "a b", "a-b", "é", "a;b", "a\n"])
def test_a_name_that_is_no_identifier_is_refused(name):
    with pytest.raises(InputError, match="not an identifier; use letters, digits and underscores"):
        checked_identifier(name)


def test_a_name_is_no_longer_than_compilers_tell_names_apart():
    assert checked_identifier(identifier("a" * 5000)) == "a" * 48
    with pytest.raises(InputError, match=r"--name aaaaaaaa\.\.\.: has 5000 letters; at most 48"):
        checked_identifier("a" * 5000)
