"""Print docs/api.md: the Python interface by its docstrings, read by griffe without importing anything.

python docs/api_page.py > docs/api.md
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from textwrap import fill
from typing import Any

import griffe

ROOT = Path(__file__).parents[1]
WIDTH = 120
OTHERS = ("playback.flight.State", "artifacts.gate.DatasetSpec", "flights.prediction.AlongFlight")
"""Classes that no name of the interface stands for: what `Model.state`, `Artifact.about` and `Model.predict` give."""

HEAD = """\
# The Python interface

For notebooks, and for programs that read what `cpfls` writes. [notebook.ipynb](notebook.ipynb) shows it at work:

```python
import cpfls_cli as cpfls

flight = cpfls.read("flight.h5")
flight["body_rate"]  # an array of NumPy, shape (time, 3)
flight.about("body_rate").units  # rad/s
flight.to_xarray(), flight.to_pandas()  # all of it with names and units

model = cpfls.load_model("vehicle.h5")
model.replay(flight).figures()["replay-errors-1"]  # a figure of matplotlib
after = model.step(model.state(attitude=(0.1, 0.0, 0.0)), [570, 570, 570, 570], 0.01)
model.to_c("vehicle.c")
```

Arrays are of NumPy; `to_xarray` and `to_pandas` need the extra `notebook`. What a command would note on standard error
is a Python warning. Figures show themselves after `%matplotlib inline`. `replay` gives what the command writes,
byte by byte where linear algebra has one thread (`OPENBLAS_NUM_THREADS=1`).

The names below are kept: one is renamed or removed in a major version alone, and a test lists them. All else in the
package may change with any version. This page is printed from the docstrings by `make docs/api.md`.
"""


def api_page() -> str:
    """Write the page."""
    package = griffe.load("cpfls_cli", search_paths=[ROOT], docstring_parser="numpy", try_relative_path=False)
    names = [name for name in package.exports or () if not str(name).startswith("__")]
    public = [package[str(name)].final_target for name in names]
    functions = sorted((each for each in public if each.is_function), key=lambda each: each.lineno or 0)
    classes = [each for each in public if each.is_class]
    lines = [HEAD, *(line for each in functions for line in _function(each, f"cpfls_cli.{each.name}", "##"))]
    for each in [*classes, *(package[path] for path in OTHERS)]:
        lines += _class(each)
    return "\n".join(lines).rstrip() + "\n"


def _class(described: Any) -> Iterator[str]:
    yield f"## `{described.name}`\n"
    yield from _sections(described)
    members = (member for name, member in described.members.items() if not name.startswith("_"))
    for member in sorted(members, key=lambda each: each.lineno or 0):
        if member.is_function:
            yield from _function(member, f"{described.name}.{member.name}", "###")
        elif member.docstring and "property" in member.labels:
            yield f"### `{described.name}.{member.name}`\n"
            yield from _sections(member)


def _function(described: Any, name: str, level: str) -> Iterator[str]:
    yield f"{level} `{name}({', '.join(_parameters(described))})`\n"
    yield from _sections(described)


def _parameters(described: Any) -> Iterator[str]:
    stars = {"variadic positional": "*", "variadic keyword": "**"}
    starred = False
    for each in described.parameters:
        if each.name == "self":
            continue
        kind = each.kind.value
        if kind == "keyword-only" and not starred:
            yield "*"
        starred |= kind in ("keyword-only", "variadic positional")
        default = "" if each.default is None or kind in stars else f"={each.default}"
        yield f"{stars.get(kind, '')}{each.name}{default}"


def _sections(described: Any) -> Iterator[str]:
    items: list[str] = []
    # Without its parent a docstring keeps the words of its types; with it they are read as code.
    for section in griffe.Docstring(described.docstring.value).parse("numpy"):
        match section.kind.value:
            case "text":
                yield "\n\n".join(_prose(paragraph) for paragraph in section.value.split("\n\n")) + "\n"
            case "parameters" | "attributes":
                items += [_item(f"`{each.name}`{_kind(each)}", each) for each in section.value]
            case "returns" | "raises" as kind:
                items += [_item(f"{kind.capitalize()} `{each.annotation}`", each) for each in section.value]
            case other:
                raise ValueError(f"{described.path}: no way to write the section {other}")
    if items:
        yield "\n".join(items) + "\n"


def _kind(entry: Any) -> str:
    return f" ({str(entry.annotation).removesuffix(', optional')})" if entry.annotation else ""


def _item(term: str, entry: Any) -> str:
    words = " ".join(entry.description.split())
    return _prose(f"- {term}{': ' if words else ''}{words}", "  ")


def _prose(text: str, indent: str = "") -> str:
    words = " ".join(text.replace("``", "`").split())
    return fill(words, WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


if __name__ == "__main__":
    print(api_page(), end="")
