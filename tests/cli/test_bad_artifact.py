"""Wrong artifacts: damaged, foreign, hanging, or in the place of another file. One message, and nothing is written."""

import shlex
import shutil
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest

from cpfls_cli import __version__
from tests.builders.artifacts import circular, edited, seal
from tests.builders.studies import put_file

HEADER = "t,roll,pitch,yaw,mx,my,mz\n"


@pytest.fixture
def changed(pipeline, tmp_path):
    """Copy an artifact and change it."""

    def call(stage, change):
        path = tmp_path / f"{stage}.h5"
        shutil.copy(pipeline.paths[stage], path)
        with edited(path) as file:
            change(file)
        return path

    return call


def put(path, value):
    def change(file):
        del file[path]
        file[path] = value

    return change


def drop(*paths):
    def change(file):
        for path in paths:
            del file[path]

    return change


@pytest.mark.parametrize("share", [0.0001, 0.01, 0.1, 0.5, 0.9, 0.99, 0.9999])
def test_truncated(refuse, pipeline, study, tmp_path, share):
    whole = pipeline.trajectory.read_bytes()
    cut = put_file(tmp_path / "cut.h5", whole[: int(len(whole) * share)])
    (line,) = refuse("simulate", study, cut, "-o", tmp_path / "out.h5")
    assert line.startswith(f"{cut}: cannot be read as an artifact: ")
    assert refuse("info", cut) == refuse("check", cut) == [line]


@pytest.mark.parametrize(
    ("content", "message"),
    [(b"", "is empty"), (b"t,roll\n0,1\n", "cannot be read as an artifact: not an HDF5 file, or damaged")],
)
def test_not_hdf5(refuse, study, tmp_path, content, message):
    path = put_file(tmp_path / "flight.h5", content)
    assert refuse("reduce", study, path, "-o", tmp_path / "out.h5") == [f"{path}: {message}"]


def test_foreign_hdf5(refuse, study, tmp_path):
    path = tmp_path / "foreign.h5"
    words = ("reduce", study, path, "-o", tmp_path / "out.h5")
    with h5py.File(path, "w") as file:
        file["time"] = np.arange(3.0)
    assert refuse(*words) == [
        f"{path}: is a log, and this takes what cpfls made: cpfls import CONFIG {path} -o foreign-flight.h5"
    ]
    seal(path)
    assert refuse(*words) == [f"{path}: an HDF5 file, but not made by cpfls (no root attribute 'format')"]


def test_missing_file_and_folder(refuse, study, tmp_path):
    words = ("-o", tmp_path / "out.h5")
    assert refuse("reduce", study, tmp_path / "none.h5", *words) == [f"{tmp_path / 'none.h5'}: no such file"]
    assert refuse("reduce", study, tmp_path, *words) == [
        f"{tmp_path}: is a folder, not a file; give its files: {tmp_path}/*"
    ]
    assert refuse("info", tmp_path / "none.h5") == [f"{tmp_path / 'none.h5'}: no such file"]
    assert refuse("check", tmp_path) == [f"{tmp_path}: is a folder, not an artifact"]


def test_a_flight_in_the_place_of_a_path_asks_for_its_autopilot(refuse, pipeline, study, tmp_path):
    (line,) = refuse("simulate", study, pipeline.flight, "-o", tmp_path / "out.h5")
    assert line.startswith(f"{pipeline.flight}: is no planned path (cpfls/trajectory); ")
    assert line.endswith("--autopilot px4, ardupilot, betaflight, crazyflie")


@pytest.mark.parametrize(
    ("command", "given", "needed"),
    [
        ("reduce", ["trajectory"], "cpfls/flight (made by `cpfls simulate` or `cpfls import`)"),
        ("identify", ["model"], "cpfls/flight (made by `cpfls simulate` or `cpfls import`)"),
        (
            "replay",
            ["flight", "flight"],
            "model (made by `cpfls identify`, `cpfls extend`, `cpfls gap` or `cpfls vehicle`)",
        ),
    ],
)
def test_artifact_of_another_stage(refuse, pipeline, study, tmp_path, command, given, needed):
    paths = [pipeline.paths[stage] for stage in given]
    (line,) = refuse(command, study, *paths, "-o", tmp_path / "out.h5")
    name = {"model": "identified"}.get(given[0], given[0])
    assert line == f"{paths[0]}: is a cpfls/{name}; this command needs a {needed}"


def test_selection_given_as_flight_to_identify(refuse, pipeline, study, tmp_path):
    words = ("identify", study, pipeline.flight, "--selection", pipeline.flight, "-o", tmp_path / "out.h5")
    (line,) = refuse(*words)
    assert line.startswith(f"{pipeline.flight}: is a cpfls/flight; this command needs a cpfls/selection")


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("schema_version", 99, "schema_version = 99: written by a newer cpfls; this one reads up to 4"),
        (
            "schema_version",
            "x",
            f"was written by cpfls {__version__}, whose files this version does not read; make it again with `cpfls "
            "identify`",
        ),
        ("format", "cpfls/other", "is a cpfls/other; this command needs a cpfls/identified (made by `cpfls identify`)"),
        ("seed", "x", "damaged: invalid literal for int() with base 10: 'x'"),
    ],
)
def test_header(refuse, changed, name, value, message):
    path = changed("model", lambda file: file.attrs.__setitem__(name, value))
    assert refuse("info", path) == [f"{path}: {message}"]


@pytest.mark.parametrize(
    ("command", "signal"), [("reduce", "attitude"), ("identify", "torque"), ("identify", "attitude")]
)
def test_flight_without_a_signal_that_the_stage_needs(refuse, changed, study, tmp_path, command, signal):
    path = changed("flight", drop(signal))
    (line,) = refuse(command, study, path, "-o", tmp_path / "out.h5")
    assert line.startswith(f"{path}: lacks {signal}; this stage needs time, attitude")


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("attitude", np.zeros((549, 2)), "attitude: 2 along 'axis', but 3 by its description"),
        ("attitude", np.zeros((9, 3)), "attitude: 9 along 'time', but 549 by time"),
        ("attitude", np.zeros((0, 3)), "attitude: 0 along 'time', but 549 by time"),
        ("attitude", 3.0, "attitude: has 0 axes, expected 2 ('time', 'axis')"),
        ("attitude", np.full((549, 3), b"a"), "damaged: attitude holds no float"),
        ("torque", np.full((549, 3), np.nan), "torque: 1647 of 1647 values are not finite"),
        ("time", np.zeros(549), "time: does not ascend at index 1"),
    ],
)
@pytest.mark.parametrize("dry_run", [(), ("--dry-run",)])
def test_flight_of_wrong_content(refuse, changed, study, tmp_path, path, value, message, dry_run):
    flight = changed("flight", put(path, value))
    assert refuse("identify", study, flight, "-o", tmp_path / "out.h5", *dry_run) == [f"{flight}: {message}"]


def test_model_whose_numbers_do_not_fit_its_structure(refuse, changed, pipeline, study, tmp_path):
    def shorten(file):
        values = file["model/fuzzy/coefficients"][:-1]
        del file["model/fuzzy/coefficients"]
        file["model/fuzzy/coefficients"] = values
        draws = file["uncertainty/coefficients"][:, :-1]
        del file["uncertainty/coefficients"]
        file["uncertainty/coefficients"] = draws

    model = changed("model", shorten)
    assert refuse("replay", study, model, pipeline.flight, "-o", tmp_path / "out.h5") == [
        f"{model}: model/fuzzy holds [5, 5, 5, 5, 5, 5] breakpoints and 112 coefficients; its structure "
        "needs [5, 5, 5, 5, 5, 5] and 113"
    ]


def test_selection_from_another_flight(refuse, cpfls, pipeline, study, tmp_path):
    other = tmp_path / "other.h5"
    noisy = ("--set", "simulation.relative_noise={torque: 0.05}")
    cpfls.done("simulate", study, pipeline.trajectory, "-o", other, *noisy)
    words = ("identify", study, other, "--selection", pipeline.selection, "-o", tmp_path / "out.h5")
    (line,) = refuse(*words)
    assert line.startswith(
        f"{pipeline.selection}: was made from another flight (flight.h5, sha256 differs from {other})"
    )
    assert refuse(*words, "--dry-run") == [line]


def test_training_share_changed_between_reduce_and_identify(refuse, pipeline, study, tmp_path):
    words = ("identify", study, pipeline.flight, "--selection", pipeline.selection, "-o", tmp_path / "out.h5")
    (line,) = refuse(*words, "--set", "identification.training_share=0.5")
    assert line.startswith(f"{pipeline.selection}: selects samples other than the ")
    assert "identification.training_share has changed since" in line


@pytest.mark.parametrize(
    ("first", "message"),
    [
        (-1, "indices: is below 0"),
        (1.5, "damaged: indices holds no int"),
        (3, "indices is empty or has repeats; run `cpfls reduce` again"),
    ],
)
def test_selection_with_wrong_indices(refuse, changed, pipeline, study, tmp_path, first, message):
    def change(file):
        values = file["indices"][:].astype(type(first))
        values[:2] = first
        del file["indices"]
        file["indices"] = values

    selection = changed("selection", change)
    (line,) = refuse("identify", study, pipeline.flight, "--selection", selection, "-o", tmp_path / "out.h5")
    assert line.startswith(f"{selection}: {message}")


@pytest.mark.parametrize("stage", ["flight", "model"])
def test_a_flipped_bit_anywhere_is_seen_by_all_that_read(refuse, pipeline, study, tmp_path, stage):
    path = tmp_path / f"{stage}.h5"
    good = pipeline.paths[stage].read_bytes()
    words = (study, path) if stage == "flight" else (study, path, pipeline.flight)
    read = ("reduce" if stage == "flight" else "replay", *words, "-o", tmp_path / "out.h5")
    # One in each stretch of the file: metadata, data and the checksum itself.
    for place in np.linspace(8, len(good) - 20, 12).astype(int):
        path.write_bytes(good[:place] + bytes([good[place] ^ 4]) + good[place + 1 :])
        for command in (("check", path), ("info", path), ("report", study, path, "-o", tmp_path / "r.html"), read):
            (line,) = refuse(*command)
            assert line == f"{path}: damaged: its content does not match the checksum at its end; copy or make it again"


def test_what_leads_elsewhere_is_refused(refuse, changed, pipeline):
    for link in (h5py.SoftLink("/attitude"), h5py.ExternalLink(str(pipeline.flight), "/torque")):
        path = changed("flight", put("torque", link))
        assert refuse("check", path) == [
            f"{path}: damaged: torque is a {type(link).__name__}; an artifact must hold all that it refers to"
        ]
    raw = (str(pipeline.flight), 0, h5py.h5f.UNLIMITED)
    path = changed("flight", lambda file: file.create_dataset("voltage", (1,), float, external=[raw]))
    assert refuse("check", path) == [
        f"{path}: damaged: voltage lies in another file; an artifact must hold all that it refers to"
    ]


@pytest.mark.parametrize("packing", [{}, {"compression": "gzip"}])
@pytest.mark.parametrize("command", ["check", "reduce"])
def test_a_shape_that_the_file_cannot_hold_is_refused_before_it_is_read(
    cpfls, study, changed, tmp_path, command, packing
):
    """Nothing was ever written of it, and HDF5 would make a number for each place of a billion."""

    def huge(file):
        shape = (10**9, *file["body_rate"].shape[1:])
        del file["body_rate"]
        file.create_dataset("body_rate", shape, "f8", chunks=(8192, *shape[1:]), fillvalue=1.0, **packing)

    flight = changed("flight", huge)
    words = (flight,) if command == "check" else (study, flight, "-o", tmp_path / "out.h5")
    result = cpfls(command, *words)
    assert result.exit_code == 2
    assert "damaged: body_rate declares 2.4e+10 bytes, and the file holds 0 of them at most" in result.stderr


SOON = """
import sys
from cpfls_cli.artifacts import patience

patience.longest_read_s = lambda size: 1.0
from cpfls_cli.cli.main import run

run()
"""

TOLD = """
import h5py

opened = h5py.File

def told(*words):
    print("reads", flush=True)
    return opened(*words)

h5py.File = told
from cpfls_cli.artifacts import patience
from cpfls_cli.cli.main import run

patience._GRACE_S = 0.5

run()
"""


@pytest.fixture
def looping(tmp_path):
    return circular(tmp_path / "loop.h5")


def test_what_never_ends_is_ended_with_a_message(looping):
    words = [sys.executable, "-c", SOON, "info", str(looping)]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 2 if sys.platform == "linux" else ended.returncode
    assert ended.stdout == ""
    assert ended.stderr == f"cpfls: error: {looping}: damaged: HDF5 did not finish reading it within 1 s\n"


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_signal_ends_it_too(looping):
    words = [sys.executable, "-c", TOLD, "check", str(looping)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "reads\n"
        time.sleep(0.2)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == -signal.SIGKILL
    assert said == f"cpfls: error: {looping}: interrupted while HDF5 was reading it\n"


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "log.csv"
    rows = (f"{0.02 * i:.2f},{i % 7},{i % 5 / 10},{i % 3},{i % 11},{i % 13},{i % 17}\n" for i in range(200))
    path.write_text(HEADER + "".join(rows))
    return path


def test_a_log_before_the_config_is_answered_with_the_command_that_works(cpfls, refuse, log, log_study, tmp_path):
    output = tmp_path / "flight.h5"
    (line,) = refuse("import", log, log_study, "-o", output)
    said, command = line.split(": is a log, and the config comes first: ")
    assert said == str(log)
    assert shlex.split(command) == ["cpfls", "import", str(log_study), str(log), "-o", str(output)]
    cpfls.done(*shlex.split(command)[1:])


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("vehicle", "LOG", "CONFIG"), "vehicle CONFIG LOG"),
        (("compare", "LOG", "LOG", "CONFIG"), "compare CONFIG LOG LOG"),
        (("replay", "LOG", "vehicle", "CONFIG"), "replay CONFIG vehicle LOG"),
        (("identify", "FLIGHT", "CONFIG"), "identify CONFIG FLIGHT"),
        (("report", "FLIGHT", "CONFIG"), "report CONFIG FLIGHT"),
        (("gap", "LOG", "SIMULATOR"), "gap SIMULATOR LOG"),
    ],
)
def test_of_all_commands_with_a_config(refuse, pipeline, log, log_study, tmp_path, words, meant):
    simulator = put_file(tmp_path / "uav.sdf", b'<sdf version="1.9"></sdf>')
    files = {"LOG": log, "CONFIG": log_study, "FLIGHT": pipeline.flight, "SIMULATOR": simulator}
    (line,) = refuse(*(files.get(word, word) for word in words), "-o", tmp_path / "out")
    for word, path in files.items():
        line = line.replace(str(path), word)
    assert line.endswith(f"and the config comes first: cpfls {meant} -o {tmp_path / 'out'}")


def test_a_flight_before_its_model_is_answered_with_the_command_that_works(refuse, pipeline, log, log_study, tmp_path):
    (line,) = refuse("replay", log_study, log, pipeline.model, "-o", tmp_path / "out.h5")
    meant = f"cpfls replay {log_study} {pipeline.model} {log} -o {tmp_path / 'out.h5'}"
    assert line == f"{log}: is a log, and the model comes before it: {meant}"


@pytest.mark.parametrize("command", ["look", "init"])
def test_what_is_no_log_is_named_where_a_log_belongs(refuse, pipeline, log, log_study, tmp_path, command):
    simulator = put_file(tmp_path / "uav.sdf", b'<sdf version="1.9"></sdf>')
    shows = f": it needs no import; `cpfls info {pipeline.flight}` shows it"
    for path, what in (
        (pipeline.flight, f"a cpfls/flight, not a log{shows}"),
        (log_study, "a config, not a log"),
        (simulator, "a simulator's file, not a log"),
    ):
        assert refuse(command, log, path, "-o", tmp_path / "out") == [f"{path}: is {what}"]


def test_a_log_where_no_config_was_given(refuse, log, tmp_path):
    for words in (("config", log), ("import", log, log, "-o", tmp_path / "flight.h5")):
        (line,) = refuse(*words)
        assert line.startswith(
            f"{log}: is a log, not a config (YAML); `cpfls init {log} -o study.yaml` writes one for it"
        )


@pytest.mark.parametrize("command", ["info", "check", "export", "report", "replay", "identify", "reduce"])
def test_a_log_where_an_artifact_belongs(refuse, log, study, tmp_path, command):
    given = {"info": (log,), "check": (log,), "export": (log,), "replay": (study, log, log)}
    output = () if command in ("info", "check") else ("-o", tmp_path / "out.h5")
    output = ("-o", tmp_path / "out.json") if command in ("export", "report") else output
    (line,) = refuse(command, *given.get(command, (study, log)), *output)
    assert line == f"{log}: is a log, and this takes what cpfls made: cpfls import CONFIG {log} -o log.h5"


def test_a_name_with_spaces_can_be_pasted(refuse, log, tmp_path):
    spaced = put_file(tmp_path / "my log.csv", log.read_bytes())
    (line,) = refuse("info", spaced)
    assert line.endswith(f": cpfls import CONFIG '{spaced}' -o 'my log.h5'")


def test_what_needs_no_import_is_said_so(refuse, pipeline, study, log_study, tmp_path):
    assert refuse("import", log_study, pipeline.flight, "-o", tmp_path / "out.h5") == [
        f"{pipeline.flight}: is a cpfls/flight, not a log: it needs no import; `cpfls info {pipeline.flight}` shows it"
    ]
    (line,) = refuse("import", log_study, study, "-o", tmp_path / "out.h5")
    assert line == f"{study}: is a config, not a log"


def test_a_flight_where_no_config_was_given(refuse, pipeline):
    assert refuse("config", pipeline.flight) == [
        f"{pipeline.flight}: is a cpfls/flight, not a config (YAML); `cpfls config` prints a commented default"
    ]
