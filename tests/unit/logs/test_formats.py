"""The table of log formats: every row has a reader, and what names the formats follows from it."""

import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import h5py
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
            assert not form.suffix or not other.suffix.endswith(form.suffix)
            assert form.reader == other.reader or not form.magic or not other.magic.startswith(form.magic)


@pytest.mark.parametrize("name", ["a.csv", "a.CSV.GZ", "b/a.parquet", "a.b.ULG", "a.BIN", "a.mat"])
def test_a_log_is_told_by_its_name(name):
    assert is_log(Path(name))


@pytest.mark.parametrize("name", ["a.h5", "a.gz", "csv", "a.csv.zip", ""])
def test_other_names_are_no_logs(name):
    assert not is_log(Path(name))


@pytest.mark.parametrize("first", [b"\xbc\x02\x00", b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n"])
def test_binary_logs_are_told_by_their_first_bytes_whatever_their_name(tmp_path, first):
    for name in ("log00", "LOG.TXT", "log.tar.gz", "study.h5", "log.ulg", "log.csv"):
        (tmp_path / name).write_bytes(first)
        assert is_log(tmp_path / name)
    (tmp_path / "other").write_bytes(b"t,roll\n0,1\n")
    assert not is_log(tmp_path / "other")


def test_an_hdf5_file_is_a_log_if_it_is_not_of_this_program(tmp_path):
    for name, attributes, is_one in (
        ("a.h5", {}, True),
        ("b.hdf5", {"format": 2}, True),
        ("c.h5", {"format": "cpfls/flight"}, False),
    ):
        with h5py.File(tmp_path / name, "w") as file:
            file.attrs.update(attributes)
        assert is_log(tmp_path / name) == is_one


def test_the_page_on_import_describes_every_format():
    page = (ROOT / "docs" / "import.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:-1] for line in page.splitlines() if line.startswith("|")]
    for form in LOG_FORMATS:
        (row,) = [row for row in rows if (f"`{form.suffix}`" if form.suffix else "none") in row[0]]
        assert form.name in row[1]
        assert (f'`pip install "cpfls[{form.extra}]"`' if form.extra else " ") in row[3]


def test_words():
    suffixes = ".csv, .csv.gz, .parquet, .ulg, .bin, .log, .bbl, .bfl, Crazyflie uSD, .db3, .mcap, .h5, .hdf5 or .mat"
    assert suffixes_in_words() == suffixes
    formats = "CSV, Parquet, ULog, ArduPilot DataFlash, Betaflight blackbox, Crazyflie uSD, ROS 2 bag, HDF5, MATLAB"
    assert formats_in_words() == formats


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
