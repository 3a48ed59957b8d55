"""The names of the Python interface, which are kept, and its page."""

import subprocess
import sys
from pathlib import Path

import cpfls_cli

ROOT = Path(__file__).parents[3]
NAMES = {
    "Artifact": "about config figures format get items keys path summary to_pandas to_xarray values write",
    "Model": "export fly formats predict replay state step",
}


def test_names_are_kept():
    """Who takes a name away breaks somebody's notebook: it is a change for a new major version."""
    given = ["Artifact", "CpflsError", "Model", "__version__", "load_model", "read", "run", "stated_vehicle"]
    assert cpfls_cli.__all__ == given
    for kind, names in NAMES.items():
        assert [name for name in dir(getattr(cpfls_cli, kind)) if not name.startswith("_")] == names.split()


def test_the_page_is_what_the_docstrings_say():
    printed = subprocess.check_output([sys.executable, ROOT / "docs" / "api_page.py"], text=True)
    assert printed == (ROOT / "docs" / "api.md").read_text(encoding="utf-8"), "make docs/api.md"
