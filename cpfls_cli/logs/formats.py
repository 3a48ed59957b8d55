"""The formats of flight logs: one table, and all that names a format follows from it.

A new format is one reader, a module with a function ``contents(path, wanted)``, and one row here. The
command line lists the formats in its help, so nothing heavy is imported here: a reader, and the package it needs, is
loaded when the first file of its format is read.
"""

import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from importlib import import_module
from math import nan
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Final, NamedTuple

from cpfls_cli.errors import InputError, about, install_command

if TYPE_CHECKING:
    from cpfls_cli.arrays import Array
    from cpfls_cli.flightlog.settings import ImportSettings

ULOG_MAGIC = b"ULog\x01\x12\x35"
_ENCRYPTED_MAGIC = b"ULogEnc"
DATAFLASH_MAGIC = b"\xa3\x95\x80\x80"
SDLOG2_MAGIC = b"\xa3\x95\x80"
DATAFLASH_TEXT_MAGIC = b"FMT, 128, "
BLACKBOX_MAGIC = b"H Product:Blackbox flight data recorder"
ROS1_MAGIC = b"#ROSBAG V"
USD_MAGIC = b"\xbc"
GZIP_MAGIC = b"\x1f\x8b"
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
_LONGEST_LINE = 16384
MOST_LISTED = 20


@dataclass(frozen=True)
class LogContents:
    """What a log holds."""

    # Shape (sample,); the fields that were wanted; others may be there by name only, as empty arrays, so that a
    # message can suggest them. A topic has its stamps in the field ``timestamp``, in s from the beginning of the log.
    # A flat log, whose columns share one clock, is one topic with an empty name.
    topics: dict[str, dict[str, "Array"]]
    # By column; units that the log itself states, by ``topic.field``, in a flat log by column. Stamps that have one
    # are in s.
    units: dict[str, str] = field(default_factory=dict)
    # What the log knows of the vehicle: parameters of the autopilot, lines of a header.
    parameters: dict[str, float | str] = field(default_factory=dict)
    system: str = ""  # What wrote the log and its version, such as ``PX4 1.14.0``; empty where that is not known.
    warnings: tuple[str, ...] = ()  # Faults of the file as a whole.
    flown_at: float = nan  # When it begins, s since 1970 began (UTC); NaN where the log does not say.
    # By column; stamp on the log's own clock, s, at 0 of a column of stamps that the reader has made to begin there;
    # an empty name is that of all stamps.
    begins: dict[str, float] = field(default_factory=dict)
    # Messages of the autopilot to its pilot: when, s, how bad, empty where that is not
    # said, and the text.
    messages: tuple[tuple[float, str, str], ...] = ()


@dataclass(frozen=True)
class LogColumns:
    """Columns of a log that a config maps, all on one clock."""

    # Shape (sample,); the mapped ones; the others by name only, as empty arrays, so that a message can suggest them.
    columns: dict[str, "Array"]
    # The section `import` as it suits the log: of columns that stand in for each other, those that the log has.
    settings: "ImportSettings"
    warnings: tuple[str, ...] = ()
    flown_at: float = nan
    begins: float = 0.0  # Stamp on the log's own clock at 0 of the column that is the clock, s.
    parameters: dict[str, float | str] = field(default_factory=dict)  # As in `LogContents`.
    system: str = ""
    # How often a second signals were logged that have stamps of their own.
    stamped_hz: dict[str, float] = field(default_factory=dict)


class LogFormat(NamedTuple):
    """One format of flight logs."""

    suffix: str  # End of a file's name, in lower case; empty where such files have none.
    name: str
    content: str  # What a file that begins in this way holds, in messages.
    magic: bytes  # First bytes of every such file; none for text, which begins with a line of column names.
    reader: str  # Module with ``contents(path, wanted)``, which returns `LogContents`.
    # Modules of the optional package that the reader needs, and the extra of this program that installs it.
    packages: tuple[str, ...] = ()
    extra: str = ""
    # Whether artifacts of this program end so too; ``is_log(path)`` of the reader distinguishes them.
    shared: bool = False

    @property
    def by_content(self) -> bool:
        """Whether a file is known by its first bytes, whatever its name ends in; what a gzip holds they do not say."""
        return bool(self.magic) and self.magic != GZIP_MAGIC

    def begins(self, line: bytes) -> bool:
        """Tell whether the first line of a file is that of a log in this format."""
        return line.startswith(self.magic) if self.magic else _is_header(line)


# A count of names, and the first of them with the letter of its type.
_OLDER_USD = re.compile(rb"[\x01-\xff][A-Za-z]\w*(\.\w+)*\([BbHhIifd]\),")
_READERS: Final = "cpfls_cli.logs."
_PYARROW: Final = (("pyarrow", "pyarrow.parquet"), "parquet")
_ROSBAGS: Final = (("rosbags",), "rosbag")
NAME_COLUMNS: Final = "put a line above it that names each column, such as time,roll,pitch,yaw,p,q,r,m1,m2,m3,m4"
TABLE_ENDS: Final = "a table with a line of column names has to end in .csv"
LOG_FORMATS = (
    LogFormat(".csv", "CSV", "CSV", b"", f"{_READERS}csv_log"),
    LogFormat(".csv.gz", "CSV", "gzip-compressed data", GZIP_MAGIC, f"{_READERS}csv_log"),
    LogFormat(".parquet", "Parquet", "Parquet", b"PAR1", f"{_READERS}parquet_log", *_PYARROW),
    LogFormat(".ulg", "ULog", "ULog", ULOG_MAGIC, f"{_READERS}ulog"),
    LogFormat(".bin", "ArduPilot DataFlash", "a DataFlash log", DATAFLASH_MAGIC, f"{_READERS}dataflash"),
    LogFormat(".px4log", "PX4 sdlog2", "a log of PX4 before ULog (sdlog2)", SDLOG2_MAGIC, f"{_READERS}dataflash"),
    LogFormat(".log", "ArduPilot DataFlash", "a DataFlash log in text", DATAFLASH_TEXT_MAGIC, f"{_READERS}dataflash"),
    LogFormat(".bbl", "Betaflight blackbox", "a blackbox log", BLACKBOX_MAGIC, f"{_READERS}blackbox"),
    LogFormat(".bfl", "Betaflight blackbox", "a blackbox log", BLACKBOX_MAGIC, f"{_READERS}blackbox"),
    LogFormat("", "Crazyflie uSD", "a log of a Crazyflie's uSD card", USD_MAGIC, f"{_READERS}crazyflie_usd"),
    LogFormat(".bag", "ROS 1 bag", "a bag of ROS 1", ROS1_MAGIC, f"{_READERS}rosbag", *_ROSBAGS),
    LogFormat(".db3", "ROS 2 bag", "SQLite", b"SQLite format 3\x00", f"{_READERS}rosbag", *_ROSBAGS),
    LogFormat(".mcap", "ROS 2 bag", "MCAP", b"\x89MCAP", f"{_READERS}rosbag", *_ROSBAGS),
    LogFormat(".h5", "HDF5", "HDF5", HDF5_MAGIC, f"{_READERS}matrices", shared=True),
    LogFormat(".hdf5", "HDF5", "HDF5", HDF5_MAGIC, f"{_READERS}matrices", shared=True),
    LogFormat(".mat", "MATLAB", "MATLAB", b"MATLAB ", f"{_READERS}matrices"),
    LogFormat(".npz", "NumPy", "arrays of NumPy", b"", f"{_READERS}matrices"),
    LogFormat(".json", "JSON", "JSON", b"", f"{_READERS}json_log"),
    LogFormat(".jsonl", "JSON", "JSON", b"", f"{_READERS}json_log"),
)
"""The formats in the order in which messages list them."""


def suffixes_in_words() -> str:
    """List the suffixes of logs as a sentence does, ``.csv, .csv.gz or .ulg``; what has none by its format."""
    *others, last = (form.suffix or form.name for form in LOG_FORMATS)
    return f"{', '.join(others)} or {last}"


def formats_in_words() -> str:
    """List the names of the formats, each once."""
    return ", ".join(dict.fromkeys(form.name for form in LOG_FORMATS))


def is_log(path: Path) -> bool:
    """Tell whether a file is a log: by its name, and by its first bytes where the name cannot tell."""
    form = _format_of(path)
    return form is not None and (not form.shared or bool(import_module(form.reader).is_log(path)))


def log_contents(path: Path, wanted: Collection[str] | None = None) -> LogContents:
    """Read the wanted columns of a log, flat or ``topic.field``, as numbers; if none is named, all that are numbers."""
    own = None if wanted is None else {*wanted, *(part for name in wanted for part in _nanoseconds_of(name))}
    return _with_fractions(_reader(path).contents(path, own))


def log_flights(path: Path) -> list[LogContents]:
    """Read all columns that are numbers, of each flight that a file holds."""
    reader = _reader(path)
    return reader.flights(path) if hasattr(reader, "flights") else [_with_fractions(reader.contents(path, None))]


def _nanoseconds_of(name: str) -> list[str]:
    """Name the columns that may hold what whole seconds lack, as in stamps of ROS."""
    own = re.fullmatch(r"(.*?)secs?", name)
    return [f"{own[1]}{rest}" for rest in ("nanosec", "nsec", "nsecs", "nanosecs")] if own else []


def _with_fractions(contents: LogContents) -> LogContents:
    """Add nanoseconds to the whole seconds of a flat log."""
    fields = contents.topics.get("", {})
    pairs = [(name, part) for name in fields for part in _nanoseconds_of(name) if part in fields]
    added = {name: fields[name] + 1e-9 * fields[part] for name, part in pairs if len(fields[name]) == len(fields[part])}
    units = contents.units | dict.fromkeys(added, "s")
    return replace(contents, topics=contents.topics | {"": fields | added}, units=units) if added else contents


@contextmanager
def about_flight(path: Path) -> Iterator[None]:
    """Say in front of why a log has no flight to look at which log it is, and if by its name it is one topic of PX4."""
    try:
        yield
    except InputError as error:
        why = str(error).removeprefix(f"{path.name}: ")
        topics = "|".join(import_module("cpfls_cli.flightlog.vocabulary").TOPICS_OF_PX4)
        if topic := re.search(rf"(?:^|_)({topics})_\d+\.csv(?:\.gz)?$", path.name):
            why = (
                f"by its name {topic[1]} alone, one topic of a log of PX4 as ulog2csv writes them: give the log itself"
                f" (.ulg), which holds all of them; if it is a whole log: {why}"
            )
        raise InputError(f"{path}: {why}") from None


def _reader(path: Path) -> ModuleType:
    """Load what reads a log, and refuse what none does."""
    form, first = _format_of(path), _first_line(path)
    if first.startswith(_ENCRYPTED_MAGIC):
        raise InputError(f"{path}: is encrypted: decrypt it first, as PX4's Tools/decrypt_ulog.py does")
    if form is None and _OLDER_USD.match(first):
        raise InputError(
            f"{path}: a log of a Crazyflie's uSD card in its older format, which is not read; make a CSV of it"
            " with the script of that firmware, and of a quaternion in one number four columns"
        )
    foreign = foreign_file(path, form)
    if foreign is not None:
        raise InputError(f"{path}: {foreign}")
    if form is None:
        named = ", ".join(form.suffix for form in LOG_FORMATS if form.suffix)
        free = ", ".join(dict.fromkeys(form.name for form in LOG_FORMATS if form.by_content))
        must = f"its name must end in one of {named}, or it must hold one of {free}"
        raise InputError(f"{path}: not a log: {must}, or a line of column names above numbers")
    alike = [other for other in LOG_FORMATS if other.begins(first)]
    if alike and form not in alike:
        remedy = f"rename it to end in {alike[0].suffix}" if alike[0].suffix else "rename it without an ending"
        raise InputError(f"{path}: seems to hold {alike[0].content}, unlike the ending of its name; {remedy}")
    for module in form.packages:
        try:
            import_module(module)
        except ImportError:
            package = f"needs the package {module.partition('.')[0]}; {install_command(form.extra)}"
            raise InputError(f"{path}: reading {path.suffix} {package}") from None
    return import_module(form.reader)


def read_log(path: Path, settings: "ImportSettings") -> LogColumns:
    """Read the columns of a log that a config maps, on one clock."""
    # Who asks for the name of a format alone does not wait for these.
    clocks = import_module("cpfls_cli.flightlog.topics")
    stated = import_module("cpfls_cli.flightlog.stated_vehicle")
    rebuilds = any(column.startswith(f"{clocks.REBUILT}.") for column in settings.mapped_columns)
    contents = log_contents(path, None if rebuilds else settings.mapped_columns)
    topics, notes = contents.topics, ()
    with about(path, InputError):
        stated.refuse_other_vehicle(topics, contents.parameters, contents.system)
        if rebuilds:
            with_topic = import_module("cpfls_cli.flightlog.rebuilt").with_topic
            topics, notes = with_topic(topics, contents.parameters, contents.system, settings)
        columns, chosen, warnings = clocks.on_one_clock(topics, contents.units, settings)
    begins = contents.begins.get(str(chosen.time_column), contents.begins.get("", 0.0))
    return LogColumns(
        columns,
        chosen,
        (*contents.warnings, *notes, *warnings),
        contents.flown_at,
        begins,
        contents.parameters,
        contents.system,
        clocks.stamped_rates(topics, chosen),
    )


def foreign_file(path: Path, form: LogFormat | None = None) -> str | None:
    """Say what a file is that no reader reads, and how to get a log from it; None for a log, and for what is unknown.

    The format is what its name or its content says.
    """
    first = _first_line(path)
    known = any(other.magic and other.begins(first) for other in LOG_FORMATS)
    if form is not None and (known or not (first or form.magic or form.content == "JSON")):
        return None
    try:
        with path.open("rb") as stream:
            first = stream.read(_FIRST_BYTES)
            # Some logs have as many bytes before they begin.
            zeros = not (first + stream.read(_BEGINS_WITHIN)).strip(bytes(1))
    except OSError:
        return None
    if not first:
        return "an empty file: nothing was logged, or the copy failed"
    if zeros:
        return "a file that begins with zeros, and no log: its writing was cut short; take it from the device again"
    found = _by_bytes(first, path.suffix.lower())
    if found is None or (form is not None and form.content == found[0]):
        return None
    return f"{found[0]}, and no log that can be read: {found[1]}"


def _format_of(path: Path) -> LogFormat | None:
    name, first = path.name.lower(), _first_line(path)
    named = next((form for form in LOG_FORMATS if form.suffix and name.endswith(form.suffix)), None)
    if named is not None and named.begins(first):
        return named
    table = LOG_FORMATS[0] if named is None and _is_table(path) else named
    return next((form for form in LOG_FORMATS if form.by_content and form.begins(first)), table)


def _is_table(path: Path) -> bool:
    """Check whether a line of column names comes first, and numbers in the next."""
    try:
        with path.open("rb") as stream:
            names, numbers = stream.readline(_LONGEST_LINE), stream.readline(_LONGEST_LINE)
    except OSError:
        return False
    return _is_header(names) and not _NUMBERS_FIRST.match(names) and bool(_NUMBERS_FIRST.match(numbers))


def _first_line(path: Path) -> bytes:
    """Read the first bytes of a file, up to the first line; none where the reader will say that it cannot be read."""
    try:
        with path.open("rb") as stream:
            # Flash that nothing was written to reads so, and a log may begin behind it.
            return stream.readline(_LONGEST_LINE).lstrip(b"\xff")
    except OSError:
        return b""


def _is_header(line: bytes) -> bool:
    """Tell whether a line is text with a separator of columns in it."""
    text = line.rstrip(b"\r\n")
    printable = all(byte >= 0x20 or byte == 0x09 for byte in text)
    # What begins with a remark may be any text.
    return (
        line.endswith(b"\n")
        and printable
        and not text.startswith((b"#", b"%", b"//"))
        and any(separator in text for separator in b",;\t")
    )


_FIRST_BYTES, _BEGINS_WITHIN = 1024, 1 << 16
_UNPACK: Final = "unpack it first, and give the log inside"
_CONVERT_TLOG: Final = (
    "telemetry is too slow for a model; give the log that the autopilot writes itself (.bin of ArduPilot, .ulg of PX4)"
)
_SLOW: Final = (
    "it comes twice a second or so, which is too slow; give the log that the flight controller writes itself (.bbl,"
    " .bin, .ulg)"
)
# What a file begins with, at which place, what it is called, and the way to a log.
_FOREIGN: Final = (
    (b"PK\x03\x04", 0, "a zip archive", _UNPACK),
    (b"\x1f\x8b", 0, "data compressed by gzip", _UNPACK),
    (b"BZh", 0, "data compressed by bzip2", _UNPACK),
    (b"\xfd7zXZ\x00", 0, "data compressed by xz", _UNPACK),
    (b"7z\xbc\xaf\x27\x1c", 0, "a 7z archive", _UNPACK),
    (b"Rar!", 0, "a rar archive", _UNPACK),
    (b"\x28\xb5\x2f\xfd", 0, "data compressed by zstd", _UNPACK),
    (b"ustar", 257, "a tar archive", _UNPACK),
    (b"\x93NUMPY", 0, "an array of NumPy", "write it as .npz or CSV, with a name for each column"),
    (
        (b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05", b"(lp", b"(dp", b"ccopy_reg\n", b"cnumpy"),
        0,
        "a pickle of Python",
        "reading it could run any code; save its numbers as .npz or CSV, with a name for each column",
    ),
    (b"version https://git-lfs", 0, "a pointer of Git LFS", "fetch it with `git lfs pull`"),
    (b"BUILD", 16, "a .DAT of DJI", "convert it to CSV with DatCon or its like"),
    (b"%PDF", 0, "a PDF", "give the log that it shows"),
    (b"\x89PNG", 0, "a picture", "give the log that it shows"),
    (b"\xff\xd8\xff", 0, "a picture", "give the log that it shows"),
)
_TRACK: Final = "a track of positions holds no motion of the body; give the log of the autopilot"
_AS_CSV: Final = "write its numbers as CSV, with a line of column names"
_AS_BAG: Final = "record a bag (`ros2 bag record`), which has the stamps of its messages"
_NUMBER: Final = rb"[-+]?\d[\d.]*+(e[-+]?\d+)?+([-+]\d[\d.]*+(e[-+]?\d+)?+[ij])?+"
# A mapping, or a list of anything; a number alone in brackets is a stamp.
_JSON: Final = rb"\{\s*\"|\[\s*([\"{\[]|%b\s*,)" % _NUMBER
_TEXTS: Final = (
    # What the first letters of a text hold, of markup anywhere.
    (rb"(?s:<.*)?<gpx\b", "a GPX track", _TRACK),
    (rb"(?s:<.*)?<kml\b", "a KML track", _TRACK),
    (rb"<!doctype html|<html\b", "a web page", "the download gave a page in the place of the log; save the log itself"),
    (rb"<\?xml", "XML", _AS_CSV),
    # After the stamp of a table comes a number, or nothing but its zone.
    (
        rb"\[\d{4}-\d\d-\d\d[ t]|\d{4}-\d\d-\d\d[ t][\d:]+([.,]\d+)?\]?[ \t][^\d,;]*[a-z]+[\s:\])-]",
        "text with a stamp before each line",
        _AS_CSV,
    ),
    (_JSON, "JSON", "let its name end in .json"),
    (rb"\d+\.\d+ \d+ [a-z_0-9]+ ", "a log of Paparazzi", _AS_CSV),
    (rb"(?ms:[\w/]+:( [^\n,;]*)?\r?\n.*^---\s*^[\w/]+:)", "YAML, as `ros2 topic echo` prints messages", _AS_BAG),
    # At its beginning words suffice; later, a line of three numbers.
    (rb"([ -{}~]+ \|){3}|(?ms:.*?^)\|?([ \t]*%b[ \t]*\|){3}" % _NUMBER, "text whose columns are parted by |", _AS_CSV),
    (rb"time \(s\),esc ", "a log of a thrust stand", "a rotor alone flies nothing; give the log of a flight with it"),
    (rb"date,time,.*\b(1rss|rssi|rqly|trss)\b", "telemetry that a radio logs", _SLOW),
    (rb"#dronedeploy\b", "a log of an app that plans flights", "give the log that the autopilot writes itself"),
)
# A line of three numbers or more, or its beginning, also as Python prints a tuple; or two lines of two numbers. No
# match is tried again in parts, which took seconds where text goes on otherwise.
_NUMBERS: Final = re.compile(
    rb"\(?(%b[ \t,;]++){2}[-+]?\d[-+\d.eij \t,;]*+\)?[ \t]*(\r?\n|\Z)|(%b[ \t,;]++%b[ \t]*\r?\n[ \t]*){2}"
    % ((_NUMBER,) * 3)
)
_NUMBERS_FIRST: Final = re.compile(rb"[ \t]*(%b[ \t]*[,;\t][ \t]*){2}[-+]?\d" % _NUMBER)
# A line that says before each of its numbers, or of some in brackets, what it is: `Yaw= 261.9 Roll= 2.2 Place: (1, 2)`.
_NAMED_NUMBERS: Final = re.compile(rb"([a-z_][\w. \t]*[=:][ \t]*+[(\[]?(%b[ \t,;]*+)++[)\]]?[ \t,;]*+){3}" % _NUMBER)
_SPREADSHEET, _NPY = (b"xl/", b"[Content_Types].xml"), b".npy"
# A MAVLink frame begins with one of these; before it a telemetry log has its stamp in eight bytes, of 2001 to 2100.
_TELEMETRY: Final = (".tlog", ".rlog", ".raw", ".mavlink")
_MAVLINK, _STAMP_BYTES, _STAMPS_US = b"\xfe\xfd", 8, (10**15, 4 * 10**15)


def _by_bytes(first: bytes, suffix: str) -> tuple[str, str] | None:
    if first.startswith(b"PK\x03\x04") and (suffix in (".xlsx", ".ods") or any(own in first for own in _SPREADSHEET)):
        return "a spreadsheet", "save its table as CSV, with a line of column names"
    if first.startswith(b"PK\x03\x04") and _NPY in first:
        return "arrays of NumPy", "let its name end in .npz"
    known = next(((what, way) for begins, at, what, way in _FOREIGN if first.startswith(begins, at)), None)
    if known is not None:
        return known
    stamped = _STAMPS_US[0] < int.from_bytes(first[:_STAMP_BYTES], "big") < _STAMPS_US[1]
    frame = first[_STAMP_BYTES : _STAMP_BYTES + 1] if stamped else first[:1] if suffix in _TELEMETRY else b""
    if frame and frame in _MAVLINK:
        return "telemetry of MAVLink", _CONVERT_TLOG
    text = first.lstrip(b"\xef\xbb\xbf \t\r\n").lower()
    *remarks, numbers = re.findall(rb"[#%][^\n]*\n\s*|.+", text, re.DOTALL) or [b""]
    if suffix != ".csv" and _NUMBERS.match(numbers):
        if remarks and len(remarks[-1].lstrip(b"#% ").split()) == len(numbers.partition(b"\n")[0].split()) > 2:
            return "a table whose names stand in a remark", "let its name end in .csv"
        # Where some numbers are whole, rows have fewer commas.
        if b"." not in numbers and len({line.count(b",") for line in numbers.rpartition(b"\n")[0].splitlines()}) > 1:
            return (
                "a table whose rows have different numbers of commas, as with commas for decimal points",
                f"write points in numbers, {NAME_COLUMNS}",
            )
        bare = "take the brackets around each line away, " if numbers.startswith(b"(") else ""
        return "a table of numbers without names", f"{bare}{NAME_COLUMNS}, and let its name end in .csv"
    if suffix != ".csv" and not re.match(_JSON, text) and _NAMED_NUMBERS.search(numbers.partition(b"\n")[0]):
        return "text that names each number in each line", _AS_CSV
    return next(((what, way) for pattern, what, way in _TEXTS if re.match(pattern, text)), None)
