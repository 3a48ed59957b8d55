"""Pages of the site that are no files of docs/, and links that lead elsewhere there: a hook of mkdocs.yml."""

from __future__ import annotations

import json
import posixpath
import re
from pathlib import Path
from typing import Any

import click
import typer
from mkdocs.structure.files import File, Files

from cpfls_cli.cli.stages import app
from cpfls_cli.config.check import commented_default
from cpfls_cli.stages.info import described, formats

ROOT = Path(__file__).parents[1]
ELSEWHERE = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "docs/notebook.ipynb": "notebook.md",
}
"""Where files of the source are on the site; files of docs/ keep their names."""


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that come from elsewhere."""
    pages = {
        **{page: _relinked((ROOT / file).read_text(encoding="utf-8"), ".") for file, page in _texts()},
        "notebook.md": _relinked(_notebook(ROOT / "docs" / "notebook.ipynb"), "docs"),
        "command-line.md": _command_line(),
        "configuration.md": _configuration(),
    }
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Lead the links of a page of docs/ to where the files are on the site; that on files gets its tables."""
    if page.file.generated_by:
        return markdown
    return _relinked(markdown, "docs") + (_formats() if page.file.src_uri == "format.md" else "")


def on_post_page(output: str, **_: Any) -> str:
    """Take the one script that the theme would fetch from elsewhere from here."""
    page, count = re.subn(r'<script src="https://unpkg.com/iframe-worker/shim">', '<script src="site.js">', output)
    if not count or re.search(r'<(script|link)[^>]+(src|href)="(https?:)?//', page):
        raise click.ClickException("the theme fetches another file than docs/site_pages.py knows of")
    return page


def _texts() -> list[tuple[str, str]]:
    return [(file, page) for file, page in ELSEWHERE.items() if file.endswith(".md")]


def _relinked(text: str, folder: str) -> str:
    return re.sub(r"\[([^\]]*)\]\((?!\w+:|#)([^)#\s]+)(#[^)]*)?\)", lambda link: _link(link, folder), text)


def _link(link: re.Match[str], folder: str) -> str:
    words, target, anchor = link[1], posixpath.normpath(posixpath.join(folder, link[2])), link[3] or ""
    page = ELSEWHERE.get(target, target.removeprefix("docs/") if target.startswith("docs/") else None)
    # What the site does not hold, such as a config of the source, keeps its name alone.
    if page is None:
        return words
    return f"[{_title(target) if words.endswith('.md') else words}]({page}{anchor})"


def _title(file: str) -> str:
    """Give the heading of a page, which stands on the site where the source names the file."""
    return (ROOT / file).read_text(encoding="utf-8").split("\n", 1)[0].removeprefix("# ")


def _command_line() -> str:
    group = typer.main.get_command(app)
    top = click.Context(group, info_name="cpfls", terminal_width=92, max_content_width=92)
    lines = ["# Command line", "", "What `cpfls COMMAND --help` prints.", ""]
    for name in group.list_commands(top):
        command = group.get_command(top, name)
        context = click.Context(command, info_name=name, parent=top)
        lines += [f"## cpfls {name}", "", "```text", command.get_help(context), "```", ""]
    return "\n".join(lines)


def _configuration() -> str:
    lines = ["# Config", "", "What `cpfls config` prints: every key, what it means, and its default.", ""]
    for section in re.split(r"^(?=\w+:)", commented_default(), flags=re.MULTILINE):
        if key := re.match(r"(\w+):", section):
            lines += [f"## {key[1]}", ""]
        if section.strip():
            lines += ["```yaml", section.rstrip(), "```", ""]
    return "\n".join(lines)


def _formats() -> str:
    lines = []
    for each in map(described, formats()):
        makers = " or ".join(f"`cpfls {command}`" for command in each["commands"])
        lines += ["", f"### `{each['format']}`", "", f"Made by {makers}: {each['description']}.", ""]
        lines += ["| dataset | dimensions | units | frame | required | description |", "|---|---|---|---|---|---|"]
        for path, own in each["datasets"].items():
            required, gaps = "yes" if own["required"] else "no", "; may be not finite" if own["gaps"] else ""
            shape = " x ".join(own["dimensions"]) or "scalar"
            cells = (shape, own["units"], own["frame"], required, own["description"] + gaps)
            lines.append(f"| `/{path}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _notebook(file: Path) -> str:
    lines = []
    for cell in json.loads(file.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        lines += [source, ""] if cell["cell_type"] == "markdown" else [f"```python\n{source}\n```", ""]
        for output in cell.get("outputs", ()):
            data = output.get("data", {"text/plain": output.get("text", "")})
            if drawn := data.get("image/png"):
                lines += [f'<img alt="" src="data:image/png;base64,{"".join(drawn).strip()}">', ""]
            else:
                lines += [f"```text\n{''.join(data['text/plain']).rstrip()}\n```", ""]
    return "\n".join(lines)
