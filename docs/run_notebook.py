"""Print docs/notebook.ipynb with what its cells give now, without what differs from run to run.

python docs/run_notebook.py > new.ipynb
"""

import os
from pathlib import Path

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).parents[1]
LONGEST_S = 300


def executed() -> nbformat.NotebookNode:
    """Run all cells, with the package of this folder."""
    os.environ["PYTHONPATH"] = str(ROOT)
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    notebook = nbformat.read(ROOT / "docs" / "notebook.ipynb", as_version=4)
    NotebookClient(notebook, timeout=LONGEST_S, kernel_name="python3", record_timing=False).execute()
    for cell in notebook.cells:
        for output in cell.get("outputs", ()):
            # Tables as HTML hold identifiers drawn at random; the same tables stand beside them as text.
            output.get("data", {}).pop("text/html", None)
    notebook.metadata["language_info"] = {"name": "python"}
    return notebook


if __name__ == "__main__":
    print(nbformat.writes(executed()))
