"""Names of the library as documented, and the notebook of the docs."""

import json
import re
import runpy
import subprocess
import sys
from pathlib import Path

import cpfls_cli

ROOT = Path(__file__).parents[3]
NAMES = {
    "Artifact": "about config figures format get items keys path summary to_pandas to_xarray values write",
    "Model": "export fly formats predict replay state step",
}
DOCS = Path(__file__).parents[3] / "docs"


def test_names_are_kept():
    """Who takes a name away breaks somebody's notebook: it is a change for a new major version."""
    given = ["Artifact", "CpflsError", "Model", "__version__", "load_model", "read", "run", "stated_vehicle"]
    assert cpfls_cli.__all__ == given
    for kind, names in NAMES.items():
        assert [name for name in dir(getattr(cpfls_cli, kind)) if not name.startswith("_")] == names.split()


def test_the_page_is_what_the_docstrings_say(capsys):
    runpy.run_path(str(ROOT / "docs" / "api_page.py"), run_name="__main__")
    assert capsys.readouterr().out == (ROOT / "docs" / "api.md").read_text(encoding="utf-8"), "make docs/api.md"


def summary(notebook):
    """What its cells print and give as text, cell by cell; hashes and numbers of versions stay out."""
    for cell in notebook["cells"]:
        texts = [output.get("text") or output["data"]["text/plain"] for output in cell.get("outputs", ())]
        yield re.sub(r"sha256 \w+|cpfls [\d.]+", "", "".join("".join(text) for text in texts))


def test_it_gives_what_it_shows():
    shown = json.loads((DOCS / "notebook.ipynb").read_text(encoding="utf-8"))
    printed = subprocess.run([sys.executable, DOCS / "run_notebook.py"], capture_output=True, text=True)
    assert printed.returncode == 0, printed.stderr
    run = json.loads(printed.stdout)
    assert list(summary(run)) == list(summary(shown)), "make docs/notebook.ipynb"
    pictures = [
        output for cell in run["cells"] for output in cell.get("outputs", ()) if "image/png" in output.get("data", {})
    ]
    assert len(pictures) == 1
