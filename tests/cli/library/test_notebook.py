"""The notebook of the docs runs, and gives what it shows."""

import json
import re
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).parents[3] / "docs"


def told(notebook):
    """What its cells print and give as text, cell by cell; hashes and numbers of versions stay out."""
    for cell in notebook["cells"]:
        texts = [output.get("text") or output["data"]["text/plain"] for output in cell.get("outputs", ())]
        yield re.sub(r"sha256 \w+|cpfls [\d.]+", "", "".join("".join(text) for text in texts))


def test_it_gives_what_it_shows():
    shown = json.loads((DOCS / "notebook.ipynb").read_text(encoding="utf-8"))
    printed = subprocess.run([sys.executable, DOCS / "run_notebook.py"], capture_output=True, text=True)
    assert printed.returncode == 0, printed.stderr
    run = json.loads(printed.stdout)
    assert list(told(run)) == list(told(shown)), "make docs/notebook.ipynb"
    pictures = [
        output for cell in run["cells"] for output in cell.get("outputs", ()) if "image/png" in output.get("data", {})
    ]
    assert len(pictures) == 1
