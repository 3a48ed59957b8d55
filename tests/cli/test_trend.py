"""`cpfls trend`: small logs of a vehicle that hovers, one of whose rotors pulls less at the end."""

import csv
import json
import pickle
import shutil
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cpfls_cli import store
from cpfls_cli.changes.numbers import FlightNumbers
from cpfls_cli.stages import trend as command
from cpfls_cli.workers.workforce import Serial
from tests.builders.studies import VEHICLE

CONFIG = """
import:
  signals:
    acceleration: {columns: [fx, fy, fz], unit: m/s^2}
    rotor_command: {columns: [c1, c2, c3, c4], unit: rad/s}
    voltage: {columns: [volts], unit: V}
  acceleration_frame: body-specific-force
  torque_source: null
"""
HEADER = "t,fx,fy,fz,c1,c2,c3,c4,volts"
HOVER = np.sqrt(6 * 9.81 / 4 / 121.5e-6)
DAYS = 86400.0


def write_log(path, seed, lacks=0.0):
    """Write a flight of eight seconds; M3 is said to make up for what it lacks."""
    rng = np.random.default_rng(seed)
    time = np.arange(800) / 100
    force = np.array([0, 0, 9.81]) + rng.normal(0, 0.3, (800, 3))
    share = np.exp(rng.normal(0, 0.01, 4)) / np.array([1, 1, 1 - lacks, 1])
    answer = HOVER * np.sqrt(share) * (1 + rng.normal(0, 0.01, (800, 4)))
    table = np.column_stack([time, force, answer, np.full(800, 15.0)])
    np.savetxt(path, table, fmt="%.5f", delimiter=",", header=HEADER, comments="")


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Ten flights as they were and three with a weak M3, whose names are not in the order of text."""
    folder = tmp_path_factory.mktemp("flights")
    (folder / "study.yaml").write_text(CONFIG + VEHICLE)
    (folder / "logs").mkdir()
    for number in range(1, 14):
        write_log(folder / "logs" / f"log{number}.csv", number, 0.2 if number > 10 else 0.0)
    return folder


@pytest.fixture(scope="module")
def answer(cpfls, logs):
    """The trend of the first twelve, and of all with one that cannot be read."""
    out = logs / "trend"
    twelve = [logs / "logs" / f"log{number}.csv" for number in range(1, 13)]
    first = cpfls("trend", logs / "study.yaml", *reversed(twelve), "-o", out, "--json")
    (logs / "logs" / "log14.csv").write_text("t,fx\n0,1\n")
    shutil.copy(logs / "logs" / "log3.csv", logs / "logs" / "log15.csv")
    second = cpfls("trend", logs / "study.yaml", logs / "logs", "-o", out)
    assert first.exit_code == 0, first.stderr
    assert second.exit_code == 0, second.stderr
    return SimpleNamespace(first=json.loads(first.stdout), second=second, out=out)


def test_a_rotor_is_named_since_its_flight(answer):
    (shift,) = answer.first["shifts"]
    assert (shift["since"], shift["flight"]) == ("log11.csv", 11)
    (cause,) = shift["causes"]
    assert (cause["name"], cause["named"]) == ("rotor M3", True)
    assert cause["sizes"][0]["low"] < 0.2 < cause["sizes"][0]["high"]
    assert answer.first["reference_flights"] == [f"log{number}.csv" for number in range(1, 7)]
    assert answer.first["order"] == "name"
    assert answer.first["new"] == 12


def test_the_first_screen(answer):
    lines = answer.second.stdout.splitlines()
    assert lines[0].startswith("CHANGED: Since log11.csv (flight 11 of 13): rotor M3 pulls ")
    assert len(lines) <= 15
    assert "13 in the order of their names; the first 6 are the reference." in answer.second.stdout
    assert "look at its propeller" in answer.second.stdout.lower()


def test_a_second_call_reads_what_is_new_and_names_what_cannot_be_read(answer):
    assert "1 of 13 flights were new, the others kept" in answer.second.stdout
    assert "left out, 1 flight: " in answer.second.stderr
    assert "log14.csv" in answer.second.stderr
    assert "log15.csv" in (answer.out / "trend.json").read_text()
    assert len(list((answer.out / "flights").iterdir())) == 13


def test_what_the_folder_holds(cpfls, answer):
    assert {path.name for path in answer.out.iterdir()} == {
        "trend.h5",
        "report.html",
        "trend.json",
        "trend.csv",
        "flights",
    }
    rows = list(csv.DictReader((answer.out / "trend.csv").read_text().splitlines()))
    assert [row["flight"] for row in rows] == [f"log{number}.csv" for number in range(1, 14)]
    assert [row["part"] for row in rows] == ["1"] * 10 + ["2"] * 3
    assert float(rows[-1]["thrust M3"]) - float(rows[0]["thrust M3"]) == pytest.approx(-np.log(0.8), abs=0.1)
    summary = json.loads((answer.out / "trend.json").read_text())
    assert [row["flight"] for row in summary["flights"]] == [row["flight"] for row in rows]
    cpfls.done("check", answer.out / "trend.h5")
    assert "Since log11.csv" in cpfls("info", answer.out / "trend.h5").stdout


def test_dates_of_all_logs_order_them(cpfls, logs, answer, tmp_path):
    out = tmp_path / "trend"
    shutil.copytree(answer.out / "flights", out / "flights")
    for path in (out / "flights").iterdir():
        kept, origin = store.read(path, FlightNumbers)
        number = int(kept.name.removeprefix("log").removesuffix(".csv"))
        path.unlink()
        # The last was flown first.
        store.write(path, replace(kept, flown_at_s=1.7e9 - number * DAYS), origin)
    words = ("trend", logs / "study.yaml", logs / "logs", "-o", out)
    by_date, by_name = (cpfls(*words, *order, "--json") for order in ((), ("--order", "name")))
    dated, named = (json.loads(each.stdout) for each in (by_date, by_name))
    assert (dated["order"], named["order"]) == ("date", "name")
    (shift,) = dated["shifts"]
    assert (shift["since"], shift["flight"], shift["flown_at_s"]) == ("log10.csv", 4, 1.7e9 - 10 * DAYS)
    assert shift["causes"][0]["sizes"][0]["value"] < 0
    assert (out / "trend.csv").read_text().splitlines()[1].startswith("log1.csv,2023-11-13T22:13:20+00:00,")


def test_workers_read_the_same(cpfls, logs, answer, tmp_path, monkeypatch):
    def employed(reading, *, count, scheduler):
        assert (count, scheduler) == (2, None)
        return nullcontext(Serial(pickle.loads(pickle.dumps(reading))))

    monkeypatch.setattr(command, "employ", employed)
    five = [logs / "logs" / f"log{number}.csv" for number in range(1, 6)]
    result = cpfls.done("trend", logs / "study.yaml", *five, "-o", tmp_path / "trend", "--workers", 2)
    assert result.stdout.startswith("NO CHANGE: over 5 flights")
    for path in (tmp_path / "trend" / "flights").iterdir():
        assert path.read_bytes() == (answer.out / "flights" / path.name).read_bytes()


def test_an_interrupt_loses_nothing_that_was_read(cpfls, logs, tmp_path, monkeypatch):
    read, kept_numbers = [], command.kept_numbers

    def interrupted(flight, *words):
        if len(read) == 2:
            raise KeyboardInterrupt
        read.append(flight)
        return kept_numbers(flight, *words)

    monkeypatch.setattr(command, "kept_numbers", interrupted)
    words = ("trend", logs / "study.yaml", *(logs / "logs" / f"log{number}.csv" for number in range(1, 6)))
    stopped = cpfls(*words, "-o", tmp_path / "trend")
    assert stopped.exit_code == 130
    assert f"what was read is kept in {tmp_path / 'trend' / 'flights'}" in stopped.stderr
    monkeypatch.setattr(command, "kept_numbers", kept_numbers)
    assert cpfls.summary(*words, "-o", tmp_path / "trend")["new"] == 3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["log1.csv", "log2.csv"], "flights with the same numbers: 2, and a trend needs 4 at least"),
        (["log1.csv", "log2.csv", "log3.csv", "log4.csv", "--order", "date"], "no log says when it was flown"),
        (["log14.csv"], "log14.csv"),
        (["empty"], "holds no flight and no log"),
    ],
)
def test_what_is_refused(cpfls, logs, answer, tmp_path, words, message):  # noqa: ARG001
    (logs / "logs" / "empty").mkdir(exist_ok=True)
    given = [logs / "logs" / word if word[0] in "le" else word for word in words]
    result = cpfls("trend", logs / "study.yaml", *given, "-o", tmp_path / "trend")
    assert result.exit_code == 2
    assert message in result.stderr
