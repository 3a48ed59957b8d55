"""Hostile configs, artifacts and logs made at random from good ones, and what a command may do with them.

`KINDS` makes one case of each kind; `tried` runs it and judges. A property test and ``make fuzz`` share them.
"""

from __future__ import annotations

import struct
import traceback
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import pyarrow
from pyarrow import parquet

from tests.builders import ulogs
from tests.builders.artifacts import seal
from tests.builders.command_line import invoked, run
from tests.builders.studies import TINY, VEHICLE, stages

FAULTS = ("traceback", "hang", "wrong exit code", "file left", "accepted nonsense")
SCALARS = (
    *("", "~", "true", "-1", "0", "1e308", "-1e308", "1e-320", ".nan", ".inf", "-.inf", "1" + 40 * "0", "0x10", "'1'"),
    *("[]", "{}", "[1, 2]", "{a: 1}", "text", "&a [1]", "*a", "!!int ''", "!!float x", "!!binary aGk=", "<<", "ASK"),
    *('"\\ud800"', "\U0001f4a5", "$\\frac{$", "'" + 300 * "x" + "'", "[[[[[[1]]]]]]", "1e", "@", "2001-01-01", "|"),
)
NUMBERS = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e308, -1e308, 1e-320, 1e18, 0.5, 2.0**53 + 1, 1e5)
FIELDS = (
    *(
        "",
        "nan",
        "inf",
        "-inf",
        "1e308",
        "-1e308",
        "9e18",
        "1e-320",
        "1e400",
        "0",
        "-1",
        "1_000",
        "\uff11",
        "x",
        '"',
        "'",
    ),
    *("1,5", "0x1", "\x00", "\ud7ff", "1;2", " 1 ", "--1", "1e", "+", "1" * 400, "TRUE", "12:30:01", '"1\n2"'),
)
COLUMNS = ("t", "roll", "pitch", "yaw", "mx", "my", "mz")
LOG_STUDY = """\
import:
  time_column: t
  signals:
    attitude: {columns: [roll, pitch, yaw], unit: rad}
    body_torque: {columns: [mx, my, mz], unit: N m}
"""
ULOG_STUDY = """\
import:
  time_column: rates.timestamp
  signals:
    quaternion: {columns: ["attitude.q[0]", "attitude.q[1]", "attitude.q[2]", "attitude.q[3]"], unit: "1"}
    body_rate: {columns: ["rates.xyz[0]", "rates.xyz[1]", "rates.xyz[2]"], unit: rad/s}
  torque_source: null
"""


@dataclass(frozen=True)
class Good:
    """What hostile files are made from: a folder to work in, a study, and artifacts of it by stage."""

    folder: Path
    study: Path
    artifacts: dict[str, Path]

    @classmethod
    def made(cls, folder):
        """Take a tiny study through every stage."""
        study, work = folder / "tiny.yaml", folder / "work"
        study.write_text(TINY + VEHICLE)
        work.mkdir()
        paths, commands = stages(study, folder)
        for stage, words in commands.items():
            assert run(*words, "-o", paths[stage]).exit_code == 0
        return cls(work, study, paths)

    def case(self, kind, seed):
        """Make one case, the same for the same seed, in an empty folder."""
        for path in self.folder.iterdir():
            path.unlink()
        return KINDS[kind](np.random.default_rng(seed), self)


@dataclass(frozen=True)
class Case:
    """Commands that read a hostile file; what they write is called ``out`` with some ending."""

    path: Path
    commands: tuple[tuple[object, ...], ...]
    must_fail: bool = False


def tried(case):
    """Run the commands of a case; give the kind of fault and what it was, or None where it was met well."""
    folder = case.path.parent
    before = set(folder.iterdir())
    for words in case.commands:
        result = invoked(*words)
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            last = "".join(traceback.format_exception(result.exception)[-3:])
            return "traceback", f"{words[0]}: {last}"
        said = [line for line in result.stderr.splitlines() if line.startswith("cpfls: error: ")]
        fails = result.exit_code != 0
        is_finding = words[0] == "check" and result.exit_code == 1 and result.stdout
        if result.exit_code not in (0, 1, 2) or (not is_finding and fails != bool(said)):
            return "wrong exit code", f"{words[0]}: {result.exit_code}: {result.output[-300:]}"
        if not fails and case.must_fail:
            return "accepted nonsense", f"{words[0]}: took {case.path.name}"
        written = set(folder.iterdir()) - before
        if any(fails or not path.name.startswith("out.") for path in written):
            return "file left", f"{words[0]}: {[path.name for path in written]}"
        for path in written:
            checked = invoked("check", path) if path.suffix == ".h5" else None
            if checked is not None and checked.exit_code:
                return "accepted nonsense", f"{words[0]}: {checked.output[-300:]}"
            path.unlink()
    return None


def yaml_case(rng, good):
    """Change lines of a good config."""
    lines = good.study.read_text().splitlines()
    for _ in range(rng.integers(1, 4)):
        place, other = rng.integers(0, len(lines), 2)
        key, colon, _ = lines[place].partition(":")
        change = rng.integers(0, 8)
        if change < 4:
            lines[place] = f"{key}{colon or ':'} {rng.choice(SCALARS)}"
        elif change == 4:
            lines.insert(place, lines[other])
        elif change == 5:
            lines[place], lines[other] = lines[other], lines[place]
        elif change == 6:
            lines[place] = " " * int(rng.integers(0, 6)) + lines[place].lstrip()
        elif len(lines) > 2:
            del lines[place]
    content = "\n".join(lines).encode("utf-8", "replace") + b"\n"
    path = good.folder / "hostile.yaml"
    path.write_bytes(_bytes_changed(rng, content) if rng.random() < 0.2 else content)
    return Case(path, (("config", path), ("trajectory", path, "-o", good.folder / "out.h5", "--dry-run")))


def structure_case(rng, good):
    """Change datasets and attributes of an artifact, and seal it again, as only who means it does."""
    stage = str(rng.choice(list(good.artifacts)))
    path = good.folder / "hostile.h5"
    path.write_bytes(good.artifacts[stage].read_bytes())
    with h5py.File(path, "r+") as file:
        names: list[str] = []
        file.visit(names.append)
        for _ in range(rng.integers(1, 3)):
            _change_structure(rng, file, str(rng.choice(names)))
    seal(path)
    return Case(path, _readers(stage, path, good))


def _change_structure(rng, file, name):
    change = rng.integers(0, 9)
    try:
        there = file[name]
    except (KeyError, OSError):
        # The change before this one made it, or what it lies in, a link that leads nowhere.
        return
    if change == 0:
        del file[name]
        return
    if change == 1:
        root = str(rng.choice(["format", "schema_version", "cpfls_version", "seed", "config_sha256"]))
        file.attrs[root] = (
            rng.choice([-5, 0, 10**9, 1]) if rng.random() < 0.7 else str(rng.choice(["", "x", "cpfls/model"]))
        )
        return
    was = np.asarray(there[()] if isinstance(there, h5py.Dataset) else np.zeros(3))
    was = np.zeros(3) if was.dtype.kind == "O" else was
    del file[name]
    if change == 2:
        file[name] = h5py.SoftLink("/time") if rng.random() < 0.5 else h5py.ExternalLink("/dev/null", "/x")
    elif change == 3:
        file[name] = h5py.Empty("f8")
    elif change == 4:
        file.create_group(name)
    elif change == 5:
        file[name] = was[..., None] if rng.random() < 0.5 else np.ravel(was)[:0]
    elif change == 6:
        file[name] = str(rng.choice(["", "$\\frac{$", "x" * 500, "<b>&", "\u202e"]))
    elif change == 7 and was.dtype.kind in "iuf" and was.size:
        values = np.array(was, dtype=float)
        values.flat[rng.integers(0, values.size)] = rng.choice(NUMBERS)
        file[name] = values
    else:
        text = np.bytes_(str(rng.choice(["$\\frac{$", "_x", "", "<script>", "a" * 80])).encode())
        file[name] = np.full(was.shape, text if was.dtype.kind == "S" else 7)


def _readers(stage, path, good):
    """Give the commands that read an artifact of a stage."""
    output = ("-o", good.folder / "out.h5")
    flight = good.artifacts["flight"]
    reading = {
        "trajectory": ("simulate", good.study, path, *output, "--dry-run"),
        "flight": ("reduce", good.study, path, *output),
        "selection": ("identify", good.study, flight, "--selection", path, *output, "--dry-run"),
        "model": ("predict", good.study, path, flight, *output),
        "prediction": ("info", path, "--json"),
    }
    export = (("export", path, "-o", good.folder / "out.json"),) if stage == "model" else ()
    report = ("report", good.study, path, "-o", good.folder / "out.html")
    return (("check", path), ("info", path), report, reading[stage], *export)


def bytes_case(rng, good):
    """Damage an artifact, as disks, networks and killed copies do."""
    stage = str(rng.choice(list(good.artifacts)))
    path = good.folder / "hostile.h5"
    content = good.artifacts[stage].read_bytes()
    path.write_bytes(damaged := _bytes_changed(rng, content))
    return Case(path, _readers(stage, path, good), must_fail=damaged != content)


def _bytes_changed(rng, content):
    changed = bytearray(content)
    for _ in range(rng.integers(1, 4)):
        first = int(rng.integers(0, max(1, len(changed))))
        last = first + int(rng.integers(1, 300))
        change = rng.integers(0, 6)
        if change < 2 and first < len(changed):
            changed[first] ^= 1 << int(rng.integers(0, 8))
        elif change == 2:
            changed[first:last] = bytes(len(changed[first:last]))
        elif change == 3:
            changed[first:last] = rng.bytes(len(changed[first:last]))
        elif change == 4:
            del changed[first:last]
        else:
            changed[first:first] = changed[first:last]
    return bytes(changed)


def csv_case(rng, good):
    """Change fields, rows and columns of a good log."""
    table = [list(COLUMNS), *([f"{value:.6g}" for value in row] for row in _rows(rng))]
    for _ in range(rng.integers(1, 4)):
        row, column = int(rng.integers(0, len(table))), int(rng.integers(0, len(COLUMNS)))
        change = rng.integers(0, 9)
        field = str(rng.choice(FIELDS))
        if change < 3:
            table[row][column % len(table[row])] = field
        elif change == 3:
            for line in table[1:]:
                line[column % len(line)] = field
        elif change == 4:
            del table[row : row + int(rng.integers(1, 60))]
        elif change == 5:
            table[row:row] = table[: int(rng.integers(1, 30))]
        elif change == 6:
            table[1:] = sorted(table[1:], key=lambda line: line[column % len(line)], reverse=True)
        elif change == 7:
            table = [[*line[:column], *line[column + 1 :]] for line in table]
        else:
            table = [[*line, field] for line in table]
        table = [line for line in table if line] or [[""]]
    text = "\n".join(str(rng.choice([",", ",", ",", ";", "\t"])).join(line) for line in table) + "\n"
    content = text.encode("utf-8", "replace")
    path = good.folder / "hostile.csv"
    path.write_bytes(_bytes_changed(rng, content) if rng.random() < 0.2 else content)
    return _imported(path, good, LOG_STUDY, rng)


def parquet_case(rng, good):
    """Give columns of a good log types and values that no log has, or damage the file."""
    columns = dict(zip(COLUMNS, _rows(rng).T.tolist(), strict=True))
    for name in rng.choice(COLUMNS, rng.integers(0, 4), replace=False):
        values = columns.get(name, [0.0] * 3)
        change = rng.integers(0, 8)
        if change == 0:
            columns.pop(name, None)
        elif change == 1:
            columns[name] = [str(value) for value in values]
        elif change == 2:
            columns[name] = [[value] for value in values]
        elif change == 3:
            columns[name] = pyarrow.array(list(range(len(values))), pyarrow.timestamp(str(rng.choice(["s", "ns"]))))
        elif change == 4:
            columns[name] = [None] * len(values)
        elif change == 5:
            columns[name] = pyarrow.array([{"a": 1}] * len(values))
        elif change == 6:
            columns[name] = pyarrow.array([2**63 + 5] * len(values), pyarrow.uint64())
        else:
            columns[name] = [float(rng.choice(NUMBERS)) if rng.random() < 0.1 else value for value in values]
    rows = int(rng.choice([0, 1, 2, 60, 60, 60]))
    path = good.folder / "hostile.parquet"
    parquet.write_table(pyarrow.table({name: pyarrow.array(values)[:rows] for name, values in columns.items()}), path)
    if rng.random() < 0.4:
        path.write_bytes(_bytes_changed(rng, path.read_bytes()))
    return _imported(path, good, LOG_STUDY, rng)


def ulog_case(rng, good):
    """Send hostile values in a ULog, or damage it."""
    sent = []
    for number in range(60):
        turn = 0.01 * number
        values = [np.array([np.cos(turn), 0.0, 0.0, np.sin(turn)]), np.array([0.0, 0.1, 2.0 + 0.01 * number])]
        for topic in (0, 1):
            if rng.random() < 0.02:
                values[topic][int(rng.integers(0, 3))] = np.clip(rng.choice(NUMBERS), -3e38, 3e38)
            sent.append((int(20_000 * number * (0 if rng.random() < 0.01 else 1)), topic, values[topic]))
    fields = {"attitude": "uint64_t timestamp;float[4] q", "rates": "uint64_t timestamp;float[3] xyz"}
    path = good.folder / "hostile.ulg"
    content = ulogs.ulog(sent, fields)
    if rng.random() < 0.2:
        # A length that no message has.
        place = int(rng.integers(16, len(content) - 2))
        content = content[:place] + struct.pack("<H", int(rng.integers(0, 65536))) + content[place + 2 :]
    path.write_bytes(_bytes_changed(rng, content) if rng.random() < 0.7 else content)
    return _imported(path, good, ULOG_STUDY, rng)


def _rows(rng):
    time = 0.02 * np.arange(60.0)
    angles = [0.2 * np.sin((2 + axis) * time) for axis in range(3)]
    values = np.column_stack([time, *angles, *(0.1 * np.cos((3 + axis) * time) for axis in range(3))])
    if rng.random() < 0.3:
        values[:, 0] *= rng.choice([1e-9, 1e9, -1.0, 0.0])
    return values


def _imported(path, good, section, rng):
    config = good.folder / "log-study.yaml"
    config.write_text(section + VEHICLE)
    proposed = (("init", path, "-o", good.folder / "out.yaml"),) if rng.random() < 0.1 else ()
    return Case(path, (("import", config, path, "-o", good.folder / "out.h5"), *proposed))


KINDS = {
    "HDF5 structure": structure_case,
    "YAML": yaml_case,
    "HDF5 bytes": bytes_case,
    "CSV": csv_case,
    "Parquet": parquet_case,
    "ULog": ulog_case,
}
