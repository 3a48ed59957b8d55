"""What the paper prints in Table 5."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PrintedColumn:
    """One column of Table 5 as printed.

    Attributes
    ----------
    structure : str
        As the config calls it.
    mse, max_error, condition_number : str
        Of the selected model.
    mse_of_runs, max_error_of_runs, condition_number_of_runs : tuple of (str, str)
        Mean and "variance" of ten runs.
    """

    system: str
    structure: str
    samples: int
    population: int
    generations: int
    mse: str
    max_error: str
    condition_number: str
    mse_of_runs: tuple[str, str]
    max_error_of_runs: tuple[str, str]
    condition_number_of_runs: tuple[str, str]


def _column(
    system: str, samples: int, size: tuple[int, int], selected: tuple[str, str, str], *runs: tuple[str, str]
) -> PrintedColumn:
    structure = "cpfls" if system == "cpFLS" else "fls"
    return PrintedColumn(system, structure, samples, *size, *selected, *runs)


_FULL = (500, 200)
PRINTED = (
    _column(
        "FLS [14]", 5487, _FULL, ("0.0007", "0.1531", "2707.1"),
        ("0.0008", "0.0001"), ("0.1845", "0.0324"), ("3815.5", "1701.2"),
    ),
    _column(
        "cpFLS", 5487, _FULL, ("0.0008", "0.1771", "5506.4"),
        ("0.0009", "0.0001"), ("0.1977", "0.0330"), ("7342.8", "8493.5"),
    ),
    _column(
        "cpFLS", 2743, _FULL, ("0.0009", "0.1786", "3399.4"),
        ("0.0010", "0.0001"), ("0.2912", "0.2568"), ("5651.6", "5259.3"),
    ),
    _column(
        "cpFLS", 1170, _FULL, ("0.0009", "0.1648", "4145.9"),
        ("0.0010", "0.0002"), ("0.2329", "0.0540"), ("6953.7", "5274.6"),
    ),
    _column(
        "cpFLS", 685, _FULL, ("0.0008", "0.1952", "4262.2"),
        ("0.0012", "0.0003"), ("0.2968", "0.1020"), ("5368.1", "2434.5"),
    ),
    _column(
        "cpFLS", 685, (75, 25), ("0.0008", "0.2080", "3032.0"),
        ("0.0011", "0.0002"), ("0.2408", "0.0382"), ("5202.9", "2039.3"),
    ),
)  # fmt: skip
"""Table 5 of the paper, column by column."""

RELATIVE_ERROR = "< 10 %"
"""What the text says of the relative error of all columns."""

SMALLEST_MAX_ERROR = 0.1531
"""In N m; with a relative error below a tenth it tells how large the torques are at least."""
