"""The formats are well formed, and docs/format.md says what the code says."""

from pathlib import Path

import pytest

from cpfls_cli.artifacts.formats import format_tables, record_of_format, records
from cpfls_cli.artifacts.spec import SCHEMA_VERSION

PAGE = (Path(__file__).parents[3] / "docs" / "format.md").read_text()


def test_tables_on_the_page_are_those_of_the_code():
    start = PAGE.index("### `")
    assert PAGE[start:] == format_tables(), "run python -m cpfls_cli.artifacts.formats and put its output on the page"


def test_page_names_the_schema_version_and_every_root_attribute():
    assert f"| `schema_version` | version of this page; {SCHEMA_VERSION} |" in PAGE
    assert all(f"| `{name}` |" in PAGE for name in ("format", "kind", "cpfls_version", "seed", "config_sha256"))


@pytest.mark.parametrize("spec", [record.spec() for record in records()], ids=lambda spec: spec.name)
def test_every_dataset_is_described(spec):
    assert record_of_format(spec.name, spec.kind).spec() is spec
    assert len({dataset.path for dataset in spec.datasets}) == len(spec.datasets)
    assert {"config", "inputs"}.isdisjoint(dataset.path.split("/")[0] for dataset in spec.datasets)
    for dataset in spec.datasets:
        assert dataset.units
        assert dataset.frame
        assert dataset.description
        assert "|" not in dataset.description


def test_unknown_format():
    assert record_of_format("cpfls/other") is None
