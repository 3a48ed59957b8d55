"""Logs of a Crazyflie's uSD card, written byte by byte, whole and broken."""

import pytest

from cpfls_cli.errors import InputError
from cpfls_cli.logs.formats import log_contents
from tests.builders.studies import put_file
from tests.builders.usd_logs import text, usd

VARIABLES = {"gyro.x": "f", "motor.m1": "H", "acc.z": "e", "pm.state": "b"}
SAMPLES = [
    ("fixedFrequency", 1_000_000, (0.5, 40_000, 1.5, -2)),
    ("tick", 1_001_000, ()),
    ("fixedFrequency", 1_002_000, (0.75, 41_000, 1.25, 3)),
]


def log(version=2, whole=True):
    return usd({"fixedFrequency": VARIABLES, "tick": {}}, SAMPLES, version, whole)


NAME = "log00"


@pytest.mark.parametrize(("version", "step"), [(1, 2.0), (2, 0.002)])
def test_events_become_topics_with_stamps_of_milli_or_microseconds(read, version, step):
    contents = read(log(version))
    listed = {name: {each: values.tolist() for each, values in own.items()} for name, own in contents.topics.items()}
    assert listed == {
        "fixedFrequency": {
            "timestamp": [0, step],
            "gyro.x": [0.5, 0.75],
            "motor.m1": [40_000, 41_000],
            "acc.z": [1.5, 1.25],
            "pm.state": [-2, 3],
        },
        "tick": {"timestamp": [step / 2]},
    }
    assert (contents.system, contents.warnings) == ("Crazyflie uSD", ())


def test_stamps_beyond_half_of_their_range_are_read_exactly(read):
    samples = [("tick", 2**64 - 3_000 + each, ()) for each in (0, 1_000, 2_000)]
    assert read(usd({"tick": {}}, samples)).topics["tick"]["timestamp"].tolist() == [0, 0.001, 0.002]


@pytest.mark.parametrize("broken", [log()[:-6], log(whole=False), log()[:-4] + b"\xff\xff" + log()[-4:]])
def test_a_check_sum_that_is_wrong_is_warned_of_and_what_is_whole_is_read(read, broken):
    contents = read(broken)
    assert contents.topics["fixedFrequency"]["gyro.x"].tolist()[:1] == [0.5]
    (warning,) = contents.warnings
    assert warning.startswith("the checksum is wrong: the file is cut off or damaged")


def test_an_older_card_is_named_and_not_read(tmp_path):
    """A count of names, the names with their types, the samples."""
    path = put_file(tmp_path / "cf50_04", b"#tick(I),stateEstimateZ.x(h),stateEstimateZ.quat(I),*P\x0e")
    with pytest.raises(InputError, match="cf50_04: a log of a Crazyflie's uSD card in its older format, which is not"):
        log_contents(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (log(3), "a log of a Crazyflie's uSD card of version 3; only 1 and 2 can be read"),
        (log()[:40], "a broken log of a Crazyflie's uSD card: its header: "),
        (log()[:3], "a broken log of a Crazyflie's uSD card: its header: "),
        (log().replace(b"(f)", b"(x)"), "a broken log of a Crazyflie's uSD card: its header: "),
        (log()[: log().rindex(text("tick")) + 7], "holds no samples"),
    ],
    ids=["version", "names", "short", "type", "none"],
)
def test_what_is_no_log(read, content, message):
    with pytest.raises(InputError) as caught:
        read(content)
    assert f"log00: {message}" in str(caught.value)


@pytest.mark.parametrize("letter", ["F", "a", "O", "g", "x", " "])
def test_a_letter_of_no_number_is_a_broken_header_without_a_warning(read, letter):
    """NumPy takes some of them for types: complex numbers, text of old, objects."""
    content = usd({"fixed": {"log.x": "f"}}, [("fixed", 0, [1.0])])
    with pytest.raises(InputError, match="a broken log of a Crazyflie's uSD card: its header: the type"):
        read(content.replace(b"log.x(f)", f"log.x({letter})".encode()))
