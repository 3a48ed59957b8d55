"""Reader of blackbox logs, as Betaflight, INAV and their kin write them: a header in text, then packed frames."""

import re
import struct
from bisect import bisect_left
from collections.abc import Collection, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from math import nan, pi
from pathlib import Path
from typing import Final

import numpy as np

from cpfls_cli.arrays import Array, IntArray
from cpfls_cli.errors import InputError
from cpfls_cli.logs.blackbox_frames import ENCODINGS, KINDS, ROLLOVER, Constants, Field, decode
from cpfls_cli.logs.formats import BLACKBOX_MAGIC, LogContents
from cpfls_cli.logs.records import bytes_of, date

_LARGEST_SHORT = 0x7FFF
_DEGREES = 180 / pi
# Cells of a battery, and the largest voltage of one, as the header has it, from which on it is in hundredths.
_MOST_CELLS, _HUNDREDTHS = 15, 100
# What the log viewer calls lines of the header in what it exports, where it is no name that any version has, and how
# many numbers a line of a PID has without those that it adds.
_EXPORTED: Final = {
    "dterm_lpf_dyn_hz": "dterm_lowpass_dyn_hz",
    "dterm_lpf2_hz": "dterm_lowpass2_hz",
    "pidSumLimit": "pidsum_limit",
    "pidSumLimitYaw": "pidsum_limit_yaw",
}
_CELLS, _OF_PID = ("vbatmincellvoltage", "vbatwarningcellvoltage", "vbatmaxcellvoltage"), 3
_WRITERS = ("Betaflight", "INAV", "Cleanflight", "EmuFlight", "Rotorflight")


def contents(path: Path, wanted: Collection[str] | None = None) -> LogContents:
    """Read the fields of the longest flight in a file on one clock, ``time``, what changes slowly held in between."""
    del wanted
    every = flights(path)
    lasts = [own.topics[""]["time"][-1] for own in every]
    longest = max(range(len(every)), key=lambda number: len(every[number].topics[""]["time"]))
    several = (
        f"holds {len(every)} flights; the longest, number {longest + 1}, is read: {lasts[longest]:.0f} s; `cpfls look` "
        "looks at each"
    )
    own = every[longest]
    return replace(own, warnings=(several, *own.warnings)) if len(every) > 1 else own


def flights(path: Path) -> list[LogContents]:
    """Read all flights in a file, those without readable frames left out."""
    content = bytes_of(path)
    begins = [found.start() for found in re.finditer(re.escape(BLACKBOX_MAGIC), content)]
    if not begins:
        raise InputError(f"{path}: not a blackbox log: it does not start like one")
    try:
        found = [
            _of_frames(*_flight(content[begin:end])) for begin, end in zip(begins, [*begins[1:], None], strict=True)
        ]
    except KeyError as error:
        raise InputError(f"{path}: a broken blackbox log: its header lacks the line {error}") from None
    except (ValueError, OverflowError) as error:
        raise InputError(f"{path}: a broken blackbox log: its header: {error}") from None
    whole = [own for own in found if len(own.topics[""]["time"]) > 1]
    if not whole:
        raise InputError(f"{path}: a blackbox log without readable frames")
    return whole


def of_export(stated: Mapping[str, str], names: list[str], rows: Array) -> LogContents:
    """Read a flight that Betaflight's log viewer exported: lines of the header by the viewer's names, raw numbers."""
    if names[:2] != ["loopIteration", "time"]:
        raise ValueError("no columns loopIteration and time")
    header = {_EXPORTED.get(name, name): value for name, value in stated.items()}
    if "gyroScale" in header:
        # In rad and a microsecond, of whatever the log has it in.
        scale = struct.pack(">f", 1e6 * _DEGREES * float(header["gyroScale"]))
        header["gyro_scale"] = f"0x{scale.hex()}"
    cells = [header[name] for name in _CELLS if name in header]
    header |= {"vbatcellvoltage": ",".join(cells)} if cells else {}
    gains = [header.get(f"{axis}PID", "").split(",") for axis in ("roll", "pitch", "yaw")]
    if all(len(own) > _OF_PID for own in gains):
        fast = "d_max" if re.match(r"Betaflight 20", header.get("Firmware revision", "")) else "d_min"
        header[fast] = ",".join(own[_OF_PID] or "0" for own in gains)
        header |= {
            f"{axis}PID": ",".join(own[:_OF_PID]) for axis, own in zip(("roll", "pitch", "yaw"), gains, strict=True)
        }
    header["Firmware type"] = header.get("Firmware revision", "").partition(" ")[0]
    # What is logged as it changes is unknown before it first does.
    known = np.isfinite(rows)
    rows = np.where(known, rows, rows[known.argmax(axis=0), range(len(names))])
    return _of_frames(header | {"Field I name": ",".join(names)}, rows, np.empty((0, 1), dtype=np.int64), 0)


def _of_frames(header: Mapping[str, str], rows: IntArray | Array, slow: IntArray, broken: int) -> LogContents:
    columns, units = _scaled_columns(header, rows)
    if len(slow):
        # What is logged as it changes, such as modes, at each main frame.
        latest = np.maximum(np.searchsorted(slow[:, 0], np.arange(len(rows)), side="right") - 1, 0)
        names = header["Field S name"].split(",")
        held = {name: slow[latest, 1 + place].astype(float) for place, name in enumerate(names)}
        columns |= {name: own for name, own in held.items() if name not in columns}
    kept, twice = _in_order(columns["time"]), int((np.diff(columns["time"]) == 0).sum())
    if len(kept) < len(rows):
        broken += max(0, len(rows) - len(kept) - twice)
        columns = {name: values[kept] for name, values in columns.items()}
    notes = {
        f"{broken} frames are broken; everything up to the next whole frame is missing": broken,
        f"{twice} rows repeat the stamp of the one before: the first of each is used": twice,
    }
    # Lines that are not about the log itself.
    stated = {key: value for key, value in header.items() if not re.match(r"Product|Data version|Field|[IP] ", key)}
    parameters = {key: float(own) if re.fullmatch(r"-?\d+(\.\d+)?", own) else own for key, own in stated.items()}
    system, first = header.get("Firmware revision", ""), {"": 1e-6 * float(rows[0, 1])} if len(rows) else {}
    if _is_kin(header) and re.match(r"\w+ \d+\.\d+", system) and not system.startswith(_WRITERS):
        # A fork under a name of its own. By the comma its parameters are not taken for those of Betaflight
        # (`Firmware.wrote`).
        system = f"Betaflight, as {system}"
    elif re.fullmatch(r"[0-9a-f]{7,}", system):
        # Before 2.1 Cleanflight wrote no version, but a commit.
        system = f"{header.get('Firmware type', '')} {system}".strip()
    said = tuple(note for note, count in notes.items() if count)
    return LogContents({"": columns}, units, parameters, system, said, _flown_at(header), first)


def _is_kin(header: Mapping[str, str]) -> bool:
    """Tell whether a log is of Betaflight, which called itself Cleanflight before 4.6, or a fork of it.

    They alone have this parameter.
    """
    return header.get("Firmware type") in ("Cleanflight", "Betaflight") and "pid_process_denom" in header


def _in_order(time: Array) -> IntArray:
    """Give the rows of the longest series whose stamps rise: damaged frames may have any."""
    if (np.diff(time) > 0).all():
        return np.arange(len(time))
    least, at, before = list[float](), list[int](), np.full(len(time), -1)
    for row, stamp in enumerate(time.tolist()):
        place = bisect_left(least, stamp)
        least[place : place + 1], at[place : place + 1] = [stamp], [row]
        before[row] = at[place - 1] if place else -1
    kept = at[-1:]
    while kept and before[kept[-1]] >= 0:
        kept.append(int(before[kept[-1]]))
    return np.array(kept[::-1], dtype=np.int64)


def _flown_at(header: Mapping[str, str]) -> float:
    """Read the date at which the log begins; without a clock the autopilot writes one of the year 0."""
    try:
        begins = datetime.fromisoformat(header.get("Log start datetime", ""))
    except ValueError:
        return nan
    return date(begins.replace(tzinfo=begins.tzinfo or UTC).timestamp())


def _flight(content: bytes) -> tuple[dict[str, str], IntArray, IntArray, int]:
    """Read one flight: the lines of its header, values by frame of main and of slow fields, and count broken frames."""
    header, begin = {}, 0
    while content.startswith(b"H ", begin) and (end := content.find(b"\n", begin)) > 0:
        key, _, value = content[begin + 2 : end].decode("latin-1").partition(":")
        header[key] = value
        begin = end + 1
    if header.get("Data version") != "2":
        raise ValueError(f"Data version {header.get('Data version', 'missing')}, not 2")
    fields, names = _fields(header), header["Field I name"].split(",")
    throttle = header.get("minthrottle", "1150")
    stated = (throttle, header.get("motorOutput", throttle), header.get("vbatref", "4095"))
    least, motor, battery = (int(own.partition(",")[0]) for own in stated)
    constants = Constants(least, motor, battery, names.index("motor[0]") if "motor[0]" in names else -1)
    return header, *decode(content, begin, fields, constants)


def _integers(header: Mapping[str, str], key: str, count: int) -> list[int]:
    numbers = [int(word) for word in header[key].split(",")]
    if len(numbers) not in (1, count):
        raise ValueError(f"{key} has {len(numbers)} numbers for {count} fields")
    return numbers * (count // len(numbers))


def _fields(header: Mapping[str, str]) -> dict[str, list[Field]]:
    """Read how the fields of each kind of frame are written; frames of kind P have the fields of those of kind I."""
    if header["Field I name"].split(",")[1:2] != ["time"]:
        raise ValueError("the second field is not time")
    fields: dict[str, list[Field]] = {}
    for kind in KINDS:
        known, named = kind == "I" or f"Field {kind} encoding" in header, "I" if kind == "P" else kind
        ways = (f"Field {kind} encoding", f"Field {kind} predictor", f"Field {named} signed") if known else ()
        count = len(header[f"Field {named} name"].split(",")) if known else 0
        columns = [_integers(header, key, count) for key in ways]
        fields[kind] = [Field(*own) for own in zip(*columns, strict=True)]
        unknown = {field.encoding for field in fields[kind]} - {*ENCODINGS}
        if unknown:
            raise ValueError(f"fields of kind {kind} in the encoding {min(unknown)}")
    return fields


def _scaled_columns(header: Mapping[str, str], rows: IntArray | Array) -> tuple[dict[str, Array], dict[str, str]]:
    """Name the columns, and give those whose unit the header states in that unit."""
    names = header["Field I name"].split(",")
    # A small step back is that of a damaged frame.
    stamps = rows[:, 1] + ROLLOVER * np.cumsum(np.diff(rows[:, 1], prepend=rows[:1, 1]) < -ROLLOVER // 2)
    # The number of a frame follows from which frames are left out, which nothing here needs.
    columns = {name: rows[:, place].astype(float) for place, name in enumerate(names) if name != "loopIteration"}
    columns["time"] = 1e-6 * (stamps - stamps[:1])
    units = {"time": "s"}
    for name, (prefix, factor, unit) in ((name, each) for name in names for each in _scales(header)):
        if name.startswith(prefix):
            columns[name] = factor * columns[name]
            units |= {name: unit} if unit else {}
    for name in [name for name in units if name.startswith("eRPM[")]:
        # The name would be a lie now.
        turned = f"rpm{name.removeprefix('eRPM')}"
        columns[turned], units[turned] = columns.pop(name), units.pop(name)
    if "imuQuaternion[0]" in units:
        # Its sign is such that the real part, which is not written, is positive.
        imaginary = sum(columns[f"imuQuaternion[{axis}]"] ** 2 for axis in range(3))
        columns["imuQuaternion[w]"] = np.sqrt(np.maximum(1 - imaginary, 0.0))
        units["imuQuaternion[w]"] = "1"
    return columns, units


def _scales(header: Mapping[str, str]) -> list[tuple[str, float, str]]:
    """List beginnings of names, factors and units, as far as the header states them; sticks have none."""
    # Betaflight 2.8 to 3.0 write it with a dot.
    stated = header.get("gyro_scale", header.get("gyro.scale", "0x0"))
    (gyro,) = struct.unpack(">f", int(stated, 16).to_bytes(4, "big"))
    system = re.match(r"(\w+) (\d+)\.(\d+)", header.get("Firmware revision", ""))
    version = (system[1], (int(system[2]), int(system[3]))) if system else ("", (0, 0))
    finer = 10 if header.get("blackbox_high_resolution") == "1" else 1
    scales = [("rcCommand[", 1 / finer, "")]
    if gyro > 0:
        # Betaflight scales to deg/s, and to tenths of it where asked to, others to rad in a microsecond.
        scales += [("gyro", gyro / finer if gyro > 1e-5 else 1e6 * gyro * _DEGREES, "deg/s")]
    if int(header.get("acc_1G", "0")) > 0:
        scales += [("accSmooth[", 1 / int(header["acc_1G"]), "g")]
    # A fork counts its versions from wherever it likes.
    fork = _is_kin(header) and version[0] not in _WRITERS
    if fork or (version[0] not in ("INAV", "Cleanflight") and version[1] >= (3, 1)):
        scales += [(f"setpoint[{axis}]", 1 / finer, "deg/s") for axis in range(3)]
        scales += [("imuQuaternion[", 1 / _LARGEST_SHORT, "1")]
    cells = max(map(int, header.get("vbatcellvoltage", "0").split(",")))
    hundredths = cells >= _HUNDREDTHS if cells else version[1] >= (4, 0)
    # In the unit of a cell; before 2017 it is what the converter reads.
    known = int(header.get("vbatref", "0")) < _MOST_CELLS * cells
    if known if cells else version[0] == "Betaflight" and version[1] >= (3, 1):
        scales += [("vbatLatest", 0.01 if hundredths else 0.1, "V")]
    if version[0] == "INAV":
        scales += [("vbat", 0.01, "V"), ("attitude[", 0.1, "deg")]
    if int(header.get("motor_poles", "0")) > 0:
        # Hundreds of electrical turns, of which each pair of poles takes one.
        scales += [("eRPM[", 200 / int(header["motor_poles"]), "rpm")]
    return scales
