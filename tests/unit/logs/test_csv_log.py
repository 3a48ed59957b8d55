"""CSV as programs, spreadsheets and people write it."""

from pathlib import Path

import numpy as np
import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.logs.csv_log import contents, row_lines

ROWS = [[0.0, 1.5, -2.0], [0.5, 2.5, 3e-3], [1.0, 3.5, 4.0]]


def _written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def _rows(separator: str, decimal: str = ".") -> str:
    return "".join(separator.join(str(x).replace(".", decimal) for x in row) + "\n" for row in ROWS)


@pytest.mark.parametrize(
    "text",
    [
        "time,p,q\n" + _rows(","),
        "time;p;q\n" + _rows(";"),
        "time;p;q\n" + _rows(";", ","),
        "time\tp\tq\n" + _rows("\t", ","),
        "time p q\n" + _rows("  "),
        "# a flight, on a windy day\n// of 2024\ntime,p,q\n" + _rows(","),
        "# time,p,q\n" + _rows(","),
        "# time p q\n" + _rows(" "),
        "# a flight\n# time,p,q\n" + _rows(" "),
        "% time\tp\tq\n" + _rows("\t"),
    ],
    ids=lambda text: text[:12].replace("\n", " "),
)
def test_separators_decimal_commas_and_remarks(tmp_path: Path, text: str) -> None:
    own = contents(_written(tmp_path / "log.csv", text))
    assert list(own.topics[""]) == ["time", "p", "q"]
    np.testing.assert_array_equal(np.column_stack(list(own.topics[""].values())), ROWS)


def test_names_with_spaces_are_of_commas(tmp_path: Path) -> None:
    own = contents(_written(tmp_path / "log.csv", "time (us), gyroADC[0], vbat latest (V)\n1, 2, 3\n"))
    assert list(own.topics[""]) == ["time (us)", "gyroADC[0]", "vbat latest (V)"]


@pytest.mark.parametrize("first", ["2024-05-01T12:00:59.5Z", "2024-05-01 12:00:59.5", "12:00:59.5"])
def test_dates_and_times_of_day_are_stamps_in_seconds(tmp_path: Path, first: str) -> None:
    second = first.replace("00:59.5", "01:00.75")
    own = contents(_written(tmp_path / "log.csv", f"time,p\n{first},1\n{second},2\n"))
    assert own.units == {"time": "s"}
    assert np.diff(own.topics[""]["time"]) == pytest.approx(1.25)


def test_a_log_without_names_says_where_they_go(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"has no line of column names, line 1 holds 3 numbers: put a line above it"):
        contents(_written(tmp_path / "log.csv", _rows(",")))
    with pytest.raises(InputError, match="line 1 holds 3 numbers"):
        contents(_written(tmp_path / "log.csv", "1008.24,10901,acc.z,0.01\n1008.25,10902,acc.z,0.02\n"))


def test_lines_are_counted_past_remarks_and_empty_lines(tmp_path: Path) -> None:
    path = _written(tmp_path / "log.csv", "# remark\ntime,p\n0,1\n\n1,2\n")
    assert row_lines(path) == [3, 5]
    path.write_text("# remark\ntime,p\n0,1\n\n1,x\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"log\.csv:5: column 'p' = 'x': not a number"):
        contents(path, {"time", "p"})
