"""One record told in every form, as lines of plain text: terminal, and a report in HTML, Markdown and JSON."""

import json
import re
from html import unescape

from cpfls_cli.config.study import Study
from cpfls_cli.pages.page import report_page
from cpfls_cli.report.content import Box, Facts, Folded, Form, Table, Text
from cpfls_cli.report.source import Sources
from cpfls_cli.report.terminal import terminal_lines


def phrases(block):
    """List what a block says: sentences, rows of tables, facts."""
    match block:
        case Box():
            return [block.title, *block.sentences]
        case Table():
            return [" ".join(cell.text for cell in row) for row in block.cells]
        case Facts():
            return [value for _, value in block.rows]
        case Text():
            return [block.text]
        case Folded():
            return [phrase for inner in block.blocks for phrase in phrases(inner)]
    return []


def words(text):
    """Let case, spaces, the marks of what is code and the end of a sentence be."""
    return " ".join(text.replace("`", "").split()).lower().rstrip(".")


def in_all_forms(source, blocks, beside=()):
    """Tell a record on a page; give the text of each form, one line for each row of a table.

    Parameters
    ----------
    blocks : iterable of Block
        The answer of its command.
    beside : iterable of Source
        On the same page.
    """
    sources = Sources([source, *beside], source.vehicle, Study().report)
    pages = {form: report_page(sources, "0", form).text for form in (Form.HTML, Form.MARKDOWN, Form.JSON)}
    return _plain({"terminal": "\n".join(terminal_lines(blocks, whole=True)), **pages})


def _plain(pages):
    texts = {
        "terminal": pages["terminal"],
        "html": _of_html(pages[Form.HTML]),
        "markdown": _of_markdown(pages[Form.MARKDOWN]),
        "json": "\n".join(_of_json(json.loads(pages[Form.JSON]))),
    }
    return {form: "\n".join(" ".join(line.split()) for line in text.splitlines()) for form, text in texts.items()}


def _of_html(page):
    body = re.sub(r"<style>.*?</style>|<svg.*?</svg>", "", page, flags=re.DOTALL)
    rows = re.sub(r"\s*\n\s*", " ", body)
    return unescape(re.sub(r"<[^>]+>", " ", re.sub(r"</(tr|p|div|li|dd|h\d|caption|figcaption|thead)>", "\n", rows)))


def _of_markdown(page):
    plain = re.sub(r"^> ", "", page, flags=re.MULTILINE)
    plain = plain.replace("**", "").replace(" | ", " ").replace("| ", "").replace(" |", "")
    return unescape(re.sub(r"\\(.)", r"\1", plain))


def _of_json(value):
    """List all text, the cells of a row on one line."""
    if isinstance(value, dict):
        for item in value.values():
            yield from _of_json(item)
    elif isinstance(value, list) and value and all(isinstance(item, str) for item in value):
        yield " ".join(value)
    elif isinstance(value, list):
        for item in value:
            yield from _of_json(item)
    elif isinstance(value, str):
        yield value
