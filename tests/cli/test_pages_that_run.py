"""What README.md begins with, and the tutorials that are quick, typed as they stand; `make tutorials` runs them all."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("page", ["README.md", "docs/tutorial-gap.md", "docs/tutorial-paper.md"])
def test_commands_of_a_page_run_as_they_stand(page):
    ran = subprocess.run(
        [sys.executable, ROOT / "docs" / "run_blocks.py", ROOT / page], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stdout[-2000:] + ran.stderr
