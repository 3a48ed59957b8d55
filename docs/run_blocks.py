"""Run the blocks ```sh and ```python of pages as they stand, each page in an empty folder of its own.

python docs/run_blocks.py README.md docs/tutorial-gap.md
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

RUN = {"sh": ["bash", "-euo", "pipefail", "-c"], "python": ["python", "-c"]}
"""What a reader pastes a block into."""


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    """Give language and text of every block of a page that is run."""
    for language, text in re.findall(r"^```(\w+)\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S):
        if language in RUN:
            yield language, text


def run_page(page: Path, programs: Path) -> None:
    """Run the blocks of a page one after the other; the first that fails ends it with an error."""
    path = os.pathsep.join([str(programs), os.environ["PATH"]])
    with tempfile.TemporaryDirectory() as folder:
        for language, text in blocks(page):
            print(f"{page.name}: {text.splitlines()[0]} ...", flush=True)
            begin = time.monotonic()
            subprocess.run([*RUN[language], text], cwd=folder, env={**os.environ, "PATH": path}, check=True)
            print(f"{page.name}: {time.monotonic() - begin:.0f} s", flush=True)


if __name__ == "__main__":
    for name in sys.argv[1:]:
        run_page(Path(name), Path(sys.executable).parent)
