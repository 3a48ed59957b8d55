"""Hostile configs, artifacts and logs made at random from good ones, and what a command may do with them.

`KINDS` makes one case of each kind; `tried` runs it and judges. A property test and ``make fuzz`` share them.
"""

from __future__ import annotations

import json
import struct
import sys
import tempfile
import traceback
import zlib
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import h5py
import numpy as np
import pyarrow
from pyarrow import parquet

from cpfls_cli.errors import visible
from tests.builders import blackbox_logs, ulogs
from tests.builders.artifacts import seal
from tests.builders.command_line import invoked, run
from tests.builders.dataflash_logs import dataflash
from tests.builders.studies import LOG_STUDY, TINY, VEHICLE, put_file, stages
from tests.builders.usd_logs import usd

FAULTS = ("traceback", "hang", "wrong exit code", "file left", "accepted nonsense", "terminal orders", "memory")
MOST_BYTES = 2 << 30
"""Of memory that a command may take for a small file."""
SCALARS = (
    *("", "~", "true", "-1", "0", "1e308", "-1e308", "1e-320", ".nan", ".inf", "-.inf", "1" + 40 * "0", "0x10", "'1'"),
    *("[]", "{}", "[1, 2]", "{a: 1}", "text", "&a [1]", "*a", "!!int ''", "!!float x", "!!binary aGk=", "<<", "ASK"),
    *('"\\ud800"', "\U0001f4a5", "$\\frac{$", "'" + 300 * "x" + "'", "[[[[[[1]]]]]]", "1e", "@", "2001-01-01", "|"),
)
NUMBERS = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e308, -1e308, 1e-320, 1e18, 0.5, 2.0**53 + 1, 1e5)
FIELDS = (
    *("", "nan", "inf", "-inf", "1e308", "-1e308", "9e18", "1e-320", "1e400", "0", "-1", "1_000", "\uff11", "x", '"'),
    *("'", "1,5", "0x1", "\x00", "\ud7ff", "1;2", " 1 ", "--1", "1e", "+", "1" * 400, "TRUE", "12:30:01", '"1\n2"'),
)
NAMES = ("\x1b[2J", "\x1b]0;x\x07", "\x9b31m", "\u202e", "a\rb", "a\nb", 5000 * "a", "", "-o", "{x}", "$\\frac{$")
PLACES = (0.0, 0.0, 0.3, -0.3, 1e-9, 1e3)
COLUMNS = ("t", "roll", "pitch", "yaw", "mx", "my", "mz")
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
        taken = most_taken()
        result = invoked(*words)
        if most_taken() > max(MOST_BYTES, taken):
            return "memory", f"{words[0]}: {most_taken() / 1e9:.2g} GB: {result.output[-300:]}"
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            last = "".join(traceback.format_exception(result.exception)[-3:])
            return "traceback", f"{words[0]}: {last}"
        said = [line for line in result.stderr.splitlines() if line.startswith("cpfls: error: ")]
        fails = result.exit_code != 0
        is_finding = words[0] == "check" and result.exit_code == 1 and result.stdout
        if result.exit_code not in (0, 1, 2) or (not is_finding and fails != bool(said)):
            return "wrong exit code", f"{words[0]}: {result.exit_code}: {result.output[-300:]}"
        if visible(result.output) != result.output:
            return "terminal orders", f"{words[0]}: {result.output[-300:]!r}"
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


def most_taken():
    """Give the most memory, bytes, that this process or one that it waited for has ever held; 0 where not known."""
    if sys.platform != "linux":
        return 0
    import resource

    return 1024 * max(resource.getrusage(whose).ru_maxrss for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


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
    path = put_file(good.folder / "hostile.yaml", _bytes_changed(rng, content) if rng.random() < 0.2 else content)
    return Case(path, (("config", path), ("trajectory", path, "-o", good.folder / "out.h5", "--dry-run")))


def structure_case(rng, good):
    """Change datasets and attributes of an artifact, and seal it again, as only who means it does."""
    stage = str(rng.choice(list(good.artifacts)))
    path = put_file(good.folder / "hostile.h5", good.artifacts[stage].read_bytes())
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
        file.attrs[str(rng.choice(["format", "schema_version", "cpfls_version", "seed", "config_sha256"]))] = (
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
        "model": ("replay", good.study, path, flight, *output, "--every", "100"),
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


def sealed_case(rng, good):
    """Damage an artifact and seal it again, so that the damage is read."""
    case = bytes_case(rng, good)
    seal(case.path)
    return Case(case.path, case.commands)


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
    text = "\n".join(str(rng.choice([",", ",", ",", ";", "\t", " ", "\n# "])).join(line) for line in table) + "\n"
    content = text.encode("utf-8", "replace")
    path = put_file(good.folder / "hostile.csv", _bytes_changed(rng, content) if rng.random() < 0.2 else content)
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


def nested_case(rng, good):
    """Describe topics of a ULog by each other: within themselves, by the thousand, without an end."""
    names = [f"m{number}" for number in range(int(rng.integers(1, 6)))]
    kinds = [*names, *names, "float", "char", "uint8_t", "none"]
    counts = ("", "", "[3]", "[1000]", "[100000000]", "[-1]", "[x]")
    formats = {
        name: "uint64_t timestamp;"
        + ";".join(f"{rng.choice(kinds)}{rng.choice(counts)} f{number}" for number in range(rng.integers(1, 4)))
        for name in names
    }
    sent = [(20_000 * number, int(rng.integers(0, len(names))), rng.random(12)) for number in range(60)]
    return _imported(put_file(good.folder / "hostile.ulg", ulogs.ulog(sent, formats)), good, ULOG_STUDY, rng)


def names_case(rng, good):
    """Give a config keys that nobody knows, and a config, a log, its columns and an export names that no one has."""
    name = str(rng.choice(NAMES))
    place = name if len(name) < 100 else "hostile"
    ending = str(rng.choice([".csv", ".h5", ".parquet", ".ulg"]))
    config, path = good.folder / f"{place}.yaml", good.folder / f"{place}{ending}"
    quoted = json.dumps(name)
    keys = (
        f"{quoted}: 1",
        f"report: {{title: {quoted}, {quoted}: 1}}",
        f"import: {{time_column: {quoted}, torque_source: null, signals: {{attitude: {{columns: [{quoted}, a, b], unit:"
        f" rad}}}}}}",
        f"import: {{time_column: t, signals: {{{quoted}: {{columns: [{quoted}], unit: {quoted}}}}}}}",
        f"seed: {quoted}",
    )
    text = good.study.read_text() if rng.random() < 0.5 else VEHICLE
    config.write_text(f"{rng.choice(keys)}\n{text}")
    columns = dict(zip((name, "a", "b", f"{name}x"), _rows(rng).T, strict=False))
    if ending == ".csv":
        rows = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
        path.write_text("\n".join(rows))
    elif ending == ".parquet":
        parquet.write_table(pyarrow.table(columns), path)
    elif ending == ".h5":
        with h5py.File(path, "w") as file:
            for own, values in columns.items():
                file[own.replace("\0", "") or "t"] = values
    else:
        fields = {f"{name}": f"uint64_t timestamp;float {name}"}
        path.write_bytes(ulogs.ulog([(20_000 * row, 0, [0.1]) for row in range(60)], fields, {"sys_name": name}))
    exported = ("export", good.artifacts["model"], "-o", good.folder / "out.json", "--name", name)
    imported = ("import", config, path, "-o", good.folder / "out.h5")
    return Case(path, (("config", config), imported, ("init", path, "-o", good.folder / "out.yaml"), exported))


def rotors_case(rng, good):
    """Put rotors in one place, in a line, or where none can be."""
    places = [[float(rng.choice(PLACES)) for _ in range(3)] for _ in range(2)]
    rotors = [
        {
            "position_m": places[int(rng.integers(0, 2))] if rng.random() < 0.8 else rng.normal(size=3).tolist(),
            "spin": int(rng.choice([-1, 1])),
            "thrust_factor_n_s2": float(rng.choice([1e-5, 1e-5, 1e-5, 0.0, 1e-30])),
            "drag_factor_n_m_s2": 2e-7,
        }
        for _ in range(rng.choice([1, 4, 4, 4, 6]))
    ]
    count = len(rotors)
    config, path = good.folder / "log-study.yaml", good.folder / "hostile.csv"
    speeds = [f"r{number}" for number in range(count)]
    mapped = {"attitude": (["roll", "pitch", "yaw"], "rad"), "rotor_speed": (speeds, "rad/s")}
    signals = {name: {"columns": columns, "unit": unit} for name, (columns, unit) in mapped.items()}
    study = {
        "import": {"time_column": "t", "torque_source": None, "signals": signals},
        "vehicle": {
            "mass_kg": 1.0,
            "inertia_kg_m2": [0.01, 0.01, 0.02],
            "rotor_speed_max_rad_s": 1000.0,
            "rotors": rotors,
        },
    }
    config.write_text(json.dumps(study))
    time = 0.02 * np.arange(400)
    table = np.column_stack([time, 0.2 * np.sin(np.outer(time, [2, 3, 4])), rng.uniform(400, 500, (400, count))])
    np.savetxt(path, table, "%.6g", ",", header=",".join(["t", "roll", "pitch", "yaw", *speeds]), comments="")
    simulated = ("simulate", config, good.artifacts["trajectory"], "-o", good.folder / "out.h5")
    return Case(path, (("config", config), simulated, ("compare", config, path, "-o", good.folder / "out.h5")))


def bomb_case(rng, good):
    """Let a small log declare, or compress, more than it can mean."""
    count = int(2 ** rng.uniform(16, 29))
    write, ending = BOMBS[int(rng.integers(0, len(BOMBS)))]
    path = good.folder / f"hostile{ending}"
    write(path, count, rng)
    return _imported(path, good, LOG_STUDY, rng)


def _declared(path, count, rng):
    kind = str(rng.choice(["u1", "i2", "f4", "f8"]))
    with h5py.File(path, "w") as file:
        for name in COLUMNS[: int(rng.integers(1, 8))]:
            own = file.create_dataset(name, (int(count * 4 ** rng.integers(0, 3)),), kind, chunks=(1 << 16,))
            own[:100] = np.arange(100)


def _inflated_matrix(path, count, rng):
    # A matrix of doubles, stored in a byte each, as MATLAB stores whole numbers.
    flags = struct.pack("<IIII", 6, 8, 6, 0)
    shape = struct.pack("<IIii", 5, 8, *((count, 1) if rng.random() < 0.8 else rng.integers(-1, 1 << 31, 2)))
    inside = flags + shape + struct.pack("<HH4s", 1, 1, b"t") + struct.pack("<II", 2, count)
    packed = _packed(zlib.compressobj(1), struct.pack("<II", 14, len(inside) + count) + inside, bytes(1 << 20), count)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H2s", 0x100, b"IM")
    path.write_bytes(head + struct.pack("<II", 15, len(packed)) + packed)


def _inflated_text(path, count, rng):
    head = ",".join(COLUMNS).encode() + b"\n"
    begin, part = [(b"", b"a" * 1024), (b"", b",a" * 512), (head, b"0," * 512), (head, b"1,0,0,0,0,0,0\n" * 64)][
        int(rng.integers(0, 4))
    ]
    path.write_bytes(_packed(zlib.compressobj(1, zlib.DEFLATED, zlib.MAX_WBITS | 16), begin, part * 1024, count))


def _packed(packing, begin, part, count):
    parts = [packing.compress(begin), *(packing.compress(part) for _ in range(count // len(part)))]
    return b"".join([*parts, packing.compress(part[: count % len(part)]), packing.flush()])


BOMBS = ((_declared, ".h5"), (_inflated_matrix, ".mat"), (_inflated_text, ".csv.gz"))


def damaged_case(rng, good, *, kind):
    """Damage a good log of a binary format."""
    ending, study = DAMAGED[kind]
    path = put_file(good.folder / f"hostile{ending}", _bytes_changed(rng, _good_log(kind)))
    return _imported(path, good, study, rng)


@cache
def _good_log(kind):
    rows = _rows(np.random.default_rng(1))
    if kind.startswith("DataFlash"):
        sent = [("FLT", (int(1e6 * abs(row[0])), *map(float, row[1:]))) for row in rows]
        kinds, stated = {"FLT": ("Qffffff", "TimeUS,R,P,Y,X,V,W")}, {"MOT_PWM_MAX": 2000.0}
        return dataflash(kinds, sent, stated, ("on",), {}, text=kind.endswith("text"))
    if kind == "uSD":
        events = {"fixed": {f"log.{name}": "f" for name in COLUMNS[1:]}}
        return usd(events, [("fixed", int(1e6 * abs(row[0])), row[1:]) for row in rows])
    if kind == "Betaflight":
        return blackbox_logs.header() + b"".join(blackbox_logs.frames(blackbox_logs.flight()))
    # The builder of bags needs a package that is left out at times.
    from tests.builders.ros_bags import BEGIN_NS, imu, write_bag

    stamps = [BEGIN_NS + 20_000_000 * number for number in range(60)]
    with tempfile.TemporaryDirectory() as folder:
        sent = [("/imu", stamp, imu(stamp, (0.1, 0.2, 0.3), (0.0, 0.1, 9.8))) for stamp in stamps]
        return write_bag(Path(folder) / "bag", ".mcap", sent).read_bytes()


def _mapped(time, signal, columns, unit):
    mapped = {"time_column": time, "torque_source": None, "signals": {signal: {"columns": columns, "unit": unit}}}
    return f"import: {json.dumps(mapped)}\n"


DAMAGED = {
    "MCAP": (
        ".mcap",
        _mapped("/imu.timestamp", "body_rate", [f"/imu.angular_velocity.{axis}" for axis in "xyz"], "rad/s"),
    ),
    "Betaflight": (".bbl", _mapped("time", "attitude", [f"axisI[{axis}]" for axis in range(3)], "deg")),
    "DataFlash": (".bin", _mapped("FLT.timestamp", "attitude", ["FLT.R", "FLT.P", "FLT.Y"], "rad")),
    "DataFlash text": (".log", _mapped("FLT.timestamp", "attitude", ["FLT.R", "FLT.P", "FLT.Y"], "rad")),
    "uSD": ("", _mapped("fixed.timestamp", "attitude", [f"fixed.log.{name}" for name in COLUMNS[1:4]], "rad")),
}


def _rows(rng):
    time = 0.02 * np.arange(60.0)
    angles = [0.2 * np.sin((2 + axis) * time) for axis in range(3)]
    values = np.column_stack([time, *angles, *(0.1 * np.cos((3 + axis) * time) for axis in range(3))])
    if rng.random() < 0.3:
        values[:, 0] *= rng.choice([1e-9, 1e9, -1.0, 0.0])
    return values


def _imported(path, good, section, rng):
    config = put_file(good.folder / "log-study.yaml", section + VEHICLE)
    proposed = (("init", path, "-o", good.folder / "out.yaml"),) if rng.random() < 0.1 else ()
    return Case(path, (("import", config, path, "-o", good.folder / "out.h5"), *proposed))


KINDS = {
    "HDF5 structure": structure_case,
    "YAML": yaml_case,
    "HDF5 bytes": bytes_case,
    "CSV": csv_case,
    "Parquet": parquet_case,
    "ULog": ulog_case,
    "names": names_case,
    "rotors": rotors_case,
    "ULog nested": nested_case,
    "bombs": bomb_case,
    **{kind: partial(damaged_case, kind=kind) for kind in DAMAGED},
    "sealed": sealed_case,
}
