"""The map names every room of the package, in the order of the import contract, and only modules that exist."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "cpfls_cli"
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
ROOMS = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").exists()}
MODULES = {path.stem for path in PACKAGE.glob("*.py")} - {"__init__", "__main__"}


def test_every_room_has_its_row():
    rows = re.findall(r"^\| (`[^|]+`) \|", PAGE, flags=re.MULTILINE)
    named = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    assert sorted(named) == sorted(ROOMS | MODULES)


def test_the_picture_is_the_import_contract():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = next(contract["layers"] for contract in contracts if contract["name"] == "Imports go down only")
    picture = re.findall(r"^    ([a-z]\w*(?: \| \w+)*)(?:  |$)", PAGE, flags=re.MULTILINE)
    assert [set(line.split(" | ")) for line in picture] == [set(layer.split(" | ")) for layer in layers]


def test_every_module_that_it_names_exists():
    named = set(re.findall(r"`(\w+(?:/\w+)*\.py)`", PAGE))
    assert len(named) > 30
    assert [name for name in sorted(named) if not (PACKAGE / name).exists() and not (ROOT / name).exists()] == []
