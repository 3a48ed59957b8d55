"""The pages: links lead somewhere, menus hold them all, commands exist, and nothing is left to be filled in."""

import re
from pathlib import Path

import pytest
import typer

from cpfls_cli.cli.stages import ORDER, app
from cpfls_cli.config.check import commented_default
from cpfls_cli.config.load import parse_config, validate

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
DEFAULT = parse_config(commented_default(), "the default config")
EXAMPLES = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "import.md").read_text(encoding="utf-8"), re.DOTALL)


def anchors(page):
    """Anchors of the headings of a page, as hosts of repositories make them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_relative_link_leads_somewhere(page):
    links = re.findall(r"\]\((?!https?:)([^)#\s]*)(?:#([^)]+))?\)", page.read_text(encoding="utf-8"))
    for file, anchor in links:
        target = (page.parent / file) if file else page
        assert target.exists(), f"{page.name} links to {file}"
        assert not anchor or anchor in anchors(target), f"{page.name} links to {file}#{anchor}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_nothing_is_left_to_be_filled_in(page):
    assert not re.findall(r"@@\w*|TODO|FIXME", page.read_text(encoding="utf-8"))


def test_the_page_of_commands_has_all_of_them():
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    assert [name for name in ORDER if not re.search(rf"\bcpfls {name}\b", page)] == []


def prose(page):
    """Lines of a page outside code, tables, figures and headings, which Markdown cannot fold."""
    fenced = False
    for line in page.read_text(encoding="utf-8").splitlines():
        fenced ^= line.lstrip().startswith("```")
        if not fenced and not line.startswith(("|", "    ", "![", "#", "<")):
            yield line


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_lines_of_prose_have_at_most_120_characters(page):
    # A link in one piece may be longer.
    assert [line for line in prose(page) if len(line) > 120 and " " in line.strip()] == []


def test_the_menus_of_the_site_hold_every_page_once():
    """`make site` holds it too, with links and anchors, where its packages can be had."""
    pages = re.findall(r"^ +- .*: ([\w-]+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.MULTILINE)
    made = {"index.md", "changelog.md", "contributing.md", "command-line.md", "configuration.md", "notebook.md"}
    assert sorted(pages) == sorted({page.name for page in (ROOT / "docs").glob("*.md")} | made)


COMMANDS = typer.main.get_command(app).commands
OPTIONS = {
    name: {option for each in command.params for option in [*each.opts, *each.secondary_opts]} | {"--help", "-h"}
    for name, command in COMMANDS.items()
}


def commands(page):
    """Commands in the code of a page, with the options that stand next to them."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    blocks = re.findall(r"^```(?:sh)?\n(.*?)^```|^((?:    .*\n)+)", text, re.MULTILINE | re.DOTALL)
    lines = [line for block in blocks for line in "".join(block).splitlines() if line.strip().startswith("cpfls ")]
    spans = [span.replace("\n", " ") for span in re.findall(r"(?<!`)`(cpfls [^`]*)`(?!`)", text)]
    for words in [*lines, *spans]:
        for name, rest in re.findall(r"(?<![\w/.-])cpfls +([a-z][a-z-]*\b)(?!\d)((?:(?!cpfls ).)*)", words):
            yield name, re.findall(r"(?<![\w-])--?[a-z][a-z-]*", rest)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_and_their_options_exist(page):
    for name, options in commands(page):
        assert name in OPTIONS, f"{page.name}: cpfls {name}"
        assert set(options) <= OPTIONS[name], f"{page.name}: cpfls {name} {set(options) - OPTIONS[name]}"


def is_key(name):
    """Whether a config has a key; what stands below one that is empty by default is free."""
    node = DEFAULT
    for part in name.split("."):
        if not isinstance(node, dict) or not node:
            return node in ({}, None)
        if part not in node:
            return False
        node = node[part]
    return True


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_keys_that_are_set_exist(page):
    keys = re.findall(r"--set\s+[\"']?([\w.]+)=", page.read_text(encoding="utf-8"))
    assert [key for key in keys if key not in ("section.key", "KEY") and not is_key(key)] == []


@pytest.mark.parametrize("example", EXAMPLES, ids=range(len(EXAMPLES)))
def test_examples_of_the_page_on_import_are_valid(example):
    assert validate(parse_config(example, "import.md"), "import.md").import_.signals
