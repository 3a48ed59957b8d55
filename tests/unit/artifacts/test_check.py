"""The rules of `check_artifact`, each broken alone."""

from typing import ClassVar

import numpy as np
import pytest

from cpfls_cli.artifacts.check import check_artifact
from cpfls_cli.artifacts.spec import Format, Header, Record, dataset, group, record
from cpfls_cli.artifacts.store import Artifact


@record
class Quality:
    """What was found."""

    warning: tuple[str, ...] = dataset("what to know", "warning")
    delay: float = dataset("of motion", units="s")


@record
class Flown(Record):
    """A flight."""

    FORMAT: ClassVar = Format("cpfls/flown", "a flight", "import")

    time: np.ndarray = dataset("time", "time", units="s")
    attitude: np.ndarray = dataset("angles", "time", "axis", units="rad")
    rotor_speed: np.ndarray = dataset("speeds", "time", "rotor", gaps=True)
    rotor_command: np.ndarray = dataset("commands", "time", "rotor")
    quality: Quality = group()


FLIGHT = Flown.spec()


def findings(spec=FLIGHT, **data):
    return check_artifact(Artifact(spec, Header("1", 1, ""), {k.replace("__", "/"): v for k, v in data.items()}))


def datasets(**changes):
    return {"time": np.arange(4.0), "attitude": np.zeros((4, 3)), "rotor_speed": np.zeros((4, 6))} | changes


def test_good():
    assert findings(**datasets()) == []


@pytest.mark.parametrize(
    ("changes", "finding"),
    [
        ({"attitude": np.zeros((4, 2))}, "attitude: 2 along 'axis', but 3 by the format"),
        ({"attitude": np.zeros((5, 3))}, "attitude: 5 along 'time', but 4 by time"),
        ({"attitude": np.zeros(4)}, "attitude: has 1 dimensions, expected 2 ('time', 'axis')"),
        ({"attitude": np.float64(1)}, "attitude: has 0 dimensions, expected 2 ('time', 'axis')"),
        ({"rotor_command": np.zeros((4, 5))}, "rotor_command: 5 along 'rotor', but 6 by rotor_speed"),
        ({"attitude": np.full((4, 3), "x")}, "attitude: holds text, expected numbers"),
        ({"attitude": np.zeros((4, 3), complex)}, "attitude: holds complex128, expected numbers"),
        ({"quality__warning": np.zeros(1)}, "quality/warning: holds numbers, expected text"),
        ({"quality__delay": np.nan}, "quality/delay: 1 samples are not finite, the first at index 0"),
        ({"time": np.array([0.0, 1, 1, 2])}, "time: does not ascend at index 2"),
        ({"time": np.array([0.0, 3, 2, 1])}, "time: does not ascend at index 2"),
    ],
)
def test_one_rule_broken(changes, finding):
    assert findings(**datasets(**changes)) == [finding]


def test_not_finite_counts_samples_and_names_the_first():
    attitude = np.zeros((4, 3))
    attitude[2, 1], attitude[3] = np.nan, np.inf
    assert findings(**datasets(attitude=attitude)) == ["attitude: 2 samples are not finite, the first at index 2"]


def test_gaps_are_allowed_where_the_format_says_so():
    assert findings(**datasets(rotor_speed=np.full((4, 6), np.nan))) == []


def test_empty_datasets_are_not_an_error_of_the_rules_but_time_has_two_samples():
    assert findings(attitude=np.zeros((0, 3))) == []
    assert findings(time=np.zeros(1)) == ["time: holds 1 samples; at least two are needed"]


def test_numbers_that_nothing_comes_near_are_told():
    attitude = np.zeros((4, 3))
    attitude[1, 2] = 1e308
    assert findings(**datasets(attitude=attitude)) == ["attitude: 1 samples are beyond 1e+150, the first at index 1"]
