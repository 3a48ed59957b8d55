"""The table of log formats: every row has a reader, and what names the formats follows from it."""

import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

from cpfls_cli.logs.formats import LOG_FORMATS, formats_in_words, is_log, suffixes_in_words

ROOT = Path(__file__).parents[3]


def test_each_row_has_a_reader_and_an_extra_that_installs_its_package():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    for form in LOG_FORMATS:
        assert callable(import_module(form.reader).contents)
        installed = [requirement.partition(">")[0] for requirement in extras.get(form.extra, ())]
        assert {module.partition(".")[0] for module in form.packages} == set(installed)


def test_no_format_hides_another():
    """The first suffix that fits decides, and so do the first bytes."""
    for number, form in enumerate(LOG_FORMATS):
        for other in LOG_FORMATS[number + 1 :]:
            assert not other.suffix.endswith(form.suffix)
            assert not form.magic or not other.magic.startswith(form.magic)


@pytest.mark.parametrize("name", ["a.csv", "a.CSV.GZ", "b/a.parquet", "a.b.ULG"])
def test_a_log_is_told_by_its_name(name):
    assert is_log(Path(name))


@pytest.mark.parametrize("name", ["a.h5", "a.gz", "csv", "a.csv.zip", ""])
def test_other_names_are_no_logs(name):
    assert not is_log(Path(name))


def test_the_page_on_import_describes_every_format():
    page = (ROOT / "docs" / "import.md").read_text(encoding="utf-8")
    assert [form.suffix for form in LOG_FORMATS if f"`{form.suffix}`" not in page] == []


def test_words():
    assert suffixes_in_words() == ".csv, .csv.gz, .parquet or .ulg"
    assert formats_in_words() == "CSV, Parquet, ULog"


def test_a_reader_and_its_package_are_loaded_only_when_used(tmp_path):
    (tmp_path / "log.csv").write_text("t,roll\n0,1\n1,2\n")
    code = (
        "import sys\n"
        "from pathlib import Path\n"
        "from cpfls_cli.logs.formats import read_log\n"
        "assert 'numpy' not in sys.modules\n"
        "from cpfls_cli.flightlog.settings import ImportSettings\n"
        f"print(read_log(Path({str(tmp_path / 'log.csv')!r}), ImportSettings()).columns['t'].tolist())\n"
        "assert not {'pyarrow', 'pyulog', 'cpfls_cli.logs.parquet_log', 'cpfls_cli.logs.ulog'} & sys.modules.keys()\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "[0.0, 1.0]\n"
