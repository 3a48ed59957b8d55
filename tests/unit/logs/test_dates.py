"""When a flight was flown, as far as its log tells."""

import struct
from math import isnan

import pytest

from cpfls_cli.logs.formats import log_contents
from tests.builders import blackbox_logs, ulogs
from tests.builders.dataflash_logs import dataflash
from tests.builders.ros_bags import BEGIN_NS, imu, write_bag

AT = 1_683_108_000.0
"""2023-05-03 10:00 UTC."""


@pytest.fixture
def flown(tmp_path):
    def call(name, content):
        path = tmp_path / name
        path.write_bytes(content)
        return log_contents(path).flown_at

    return call


@pytest.mark.parametrize(("told", "at"), [([0, 5], AT), ([0], None)])
def test_of_px4_by_its_receiver_once_that_knows(flown, told, at):
    fields = {"sensor_gps": "uint64_t timestamp;uint64_t time_utc_usec"}
    rows = [
        ulogs.message("D", struct.pack("<HQQ", 0, ulogs.BEGIN + since * 10**6, int(AT + since) * 10**6 if since else 0))
        for since in told
    ]
    begins = flown("log.ulg", ulogs.ulog([], fields) + b"".join(rows))
    assert begins == at if at else isnan(begins)


@pytest.mark.parametrize("names", [("TimeUS,GWk,GMS", "QHI"), ("TimeUS,Week,TimeMS", "QHI")])
def test_of_ardupilot_by_weeks_of_gps(flown, names):
    columns, letters = names
    # GPS counts leap seconds, 18 of them since it began.
    week, second = divmod(AT + 18 - 315_964_800, 604_800)
    rows = [("GPS", (1_000_000, 0, 0)), ("GPS", (3_000_000, int(week), int(1000 * (second + 2))))]
    assert flown("log.bin", dataflash({"GPS": (letters, columns)}, rows)) == pytest.approx(AT, abs=1e-5)


@pytest.mark.parametrize("said", ["2023-05-03T10:00:00.000+00:00", "2023-05-03T12:00:00.000+02:00", "2023-05-03T10:00"])
def test_of_betaflight_by_its_header(flown, said):
    lines = blackbox_logs.header() + f"H Log start datetime:{said}\n".encode()
    assert flown("log.bbl", lines + b"".join(blackbox_logs.frames(blackbox_logs.flight()))) == AT


@pytest.mark.parametrize("said", ["0000-01-01T00:00:00.000+00:00", "1970-01-01T00:00:00.000+00:00", "soon"])
def test_a_clock_that_was_never_set_tells_none(flown, said):
    lines = blackbox_logs.header() + f"H Log start datetime:{said}\n".encode()
    assert isnan(flown("log.bbl", lines + b"".join(blackbox_logs.frames(blackbox_logs.flight()))))


def test_of_a_bag_by_the_recorder(tmp_path):
    sent = [("/imu/data", BEGIN_NS + 10**7 * row, imu(BEGIN_NS, (0, 0, 0), (0, 0, 9.8))) for row in range(3)]
    assert log_contents(write_bag(tmp_path / "bag", ".mcap", sent)).flown_at == pytest.approx(1e-9 * BEGIN_NS)


def test_of_a_table_by_nothing(flown):
    assert isnan(flown("log.csv", b"t,a\n0,1\n1,2\n"))
