"""What is said of the package next to it: its version, its extras, and what hosts run to check it."""

import os
import re
import tomllib
from pathlib import Path

import yaml

from cpfls_cli import __version__
from cpfls_cli.logs.formats import LOG_FORMATS

ROOT = Path(__file__).parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]


def test_the_citation_is_of_this_version():
    result = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert str(result["version"]) == __version__
    assert {"cff-version", "message", "title", "authors"} <= result.keys()


def test_the_workflow_runs_what_has_to_be_green():
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8"))
    assert {"run": ".ci/run"} in workflow["jobs"]["run"]["steps"]
    assert {"run": "make oldest"} in workflow["jobs"]["oldest"]["steps"]
    assert os.access(ROOT / ".ci" / "run", os.X_OK)


def test_every_commit_is_checked_as_lint_checks():
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"][0]["hooks"]
    recipe = re.search(r"^lint:.*\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)[1]
    linters = re.findall(r"\$\(BIN\)/(.*?)(?: \.)?$", recipe, re.MULTILINE)
    assert [hook["entry"].removeprefix(".venv/bin/") for hook in hooks] == linters


def test_every_extra_that_a_message_names_exists_and_has_its_row():
    code = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "cpfls_cli").rglob("*.py"))
    named = {*re.findall(r"install_command\([\"'](\w+)", code), *(form.extra for form in LOG_FORMATS if form.extra)}
    assert {"dask", "notebook", "parquet", "rosbag"} <= named <= EXTRAS.keys()
    page = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| `([\w-]+)` \| \w", page, re.MULTILINE)) == EXTRAS.keys()
