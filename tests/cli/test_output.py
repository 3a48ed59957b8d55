"""Where results go: nothing is replaced, half written or written in a dry run unless it was asked for."""

import os
import subprocess
import sys

import pytest

from cpfls_cli.artifacts.output import locked
from tests.builders.studies import put_file


def test_existing_output_needs_force(cpfls, refuse, study, tmp_path):
    output = put_file(tmp_path / "trajectory.h5", "precious")
    assert refuse("trajectory", study, "-o", output) == [f"{output}: exists already; --force replaces it"]
    assert refuse("trajectory", study, "-o", output, "--dry-run") == [f"{output}: exists already; --force replaces it"]
    cpfls.done("trajectory", study, "-o", output, "--force")
    assert output.read_bytes().startswith(b"\x89HDF")
    assert [path.name for path in tmp_path.iterdir()] == ["trajectory.h5"]


def test_an_input_is_never_the_output(refuse, pipeline, study, tmp_path):
    message = "is an input of this command; -o must name another file"
    link = tmp_path / "link.h5"
    link.symlink_to(pipeline.flight)
    words = ("reduce", study, pipeline.flight, "--force", "-o")
    assert refuse(*words, pipeline.flight) == [f"{pipeline.flight}: {message}"]
    assert refuse(*words, link) == [f"{link}: is a symbolic link to {pipeline.flight}; -o names the file itself"]
    words = ("identify", study, pipeline.flight, "--selection", pipeline.selection, "-o", pipeline.selection, "--force")
    assert refuse(*words) == [f"{pipeline.selection}: {message}"]


@pytest.mark.parametrize("force", [(), ("--force",)])
def test_output_that_cannot_be_a_file(refuse, study, tmp_path, force):
    (tmp_path / "plain.txt").write_text("")
    (tmp_path / "folder").mkdir()
    for output, message in {
        tmp_path / "none" / "out.h5": f"cannot write into the folder {tmp_path / 'none'}: No such file or directory",
        tmp_path / "plain.txt" / "out.h5": f"cannot write into the folder {tmp_path / 'plain.txt'}: Not a directory",
        tmp_path / ("x" * 300): f"cannot write into the folder {tmp_path}: File name too long",
        tmp_path / "folder": "is a folder; -o names a file",
    }.items():
        assert refuse("trajectory", study, "-o", output, *force) == [f"{output}: {message}"]


def test_a_name_that_promises_another_file_is_refused(refuse, pipeline, study, tmp_path):
    for suffix in (".csv", ".json"):
        output = tmp_path / f"path{suffix}"
        (line,) = refuse("trajectory", study, "-o", output)
        assert line == f"{output}: the result is an HDF5 file; let its name end in .h5"
    output = tmp_path / "page.pdf"
    (line,) = refuse("report", study, pipeline.trajectory, "-o", output)
    forms = ".html, .htm, .md, .markdown or .json"
    assert line == f"{output}: its suffix names no form: {forms}; else give --format"


def test_folder_without_permission(refuse, study, tmp_path, monkeypatch):
    # Root may write anywhere, so the refusal of the system is put in its place.
    def refuse_to_make(**_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.mkstemp", refuse_to_make)
    (line,) = refuse("trajectory", study, "-o", tmp_path / "out.h5")
    assert line == f"{tmp_path / 'out.h5'}: cannot write into the folder {tmp_path}: Permission denied"


def test_devices_and_pipes_are_not_replaced(refuse, study, tmp_path):
    # A pipe of its own: a command that wrongly replaces a device would as root leave the machine without it.
    os.mkfifo(tmp_path / "pipe")
    assert refuse("trajectory", study, "-o", tmp_path / "pipe", "--force") == [
        f"{tmp_path / 'pipe'}: is a device or a pipe; -o names a file"
    ]
    assert (tmp_path / "pipe").is_fifo()


def test_failure_while_computing_leaves_the_old_output(refuse, pipeline, study, tmp_path):
    output = put_file(tmp_path / "flight.h5", "precious")
    # A rotor this slow cannot carry the vehicle, which only the computation finds out.
    weak = ("--set", "vehicle.rotor_speed_max_rad_s=150")
    lines = refuse("simulate", study, pipeline.trajectory, "-o", output, "--force", *weak, code=1)
    assert lines[-1].startswith(f"{pipeline.trajectory}: no flight was written; ")


def test_full_disk_leaves_the_old_output(refuse, study, tmp_path, monkeypatch):
    output = put_file(tmp_path / "trajectory.h5", "precious")

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", fail)
    (line,) = refuse("trajectory", study, "-o", output, "--force", code=1)
    assert line == f"{output}: cannot be written: No space left on device"


@pytest.mark.parametrize(("command", "limit"), [("trajectory", 100), ("simulate", 60_000)])
def test_output_larger_than_the_system_allows(pipeline, study, tmp_path, command, limit):
    """A real refusal by the system, in the first and in a later block; HDF5 must not crash when the program ends."""
    # The limit is for all files: of a module compiled anew Python would keep what fits, and fail to load it ever after.
    limited = "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, ({0}, {0})); "
    code = limited.format(limit) + "from cpfls_cli.cli.main import run; sys.argv[0] = 'cpfls'; run()"
    inputs = (pipeline.trajectory,) if command == "simulate" else ()
    words = [command, study, *inputs, "-o", tmp_path / "out.h5"]
    result = subprocess.run([sys.executable, "-B", "-c", code, *map(str, words)], capture_output=True, text=True)
    assert (result.returncode, result.stdout) == (1, "")
    assert result.stderr == f"cpfls: error: {tmp_path / 'out.h5'}: cannot be written: File too large\n"
    assert list(tmp_path.iterdir()) == []


def test_no_file_that_a_command_reads_is_its_output(refuse, pipeline, study, tmp_path):
    message = "is an input of this command; -o must name another file"
    own = put_file(tmp_path / "own.yaml", study.read_bytes())
    assert refuse("trajectory", own, "-o", own, "--force") == [f"{own}: {message}"]
    header = put_file(tmp_path / "model.h", pipeline.model.read_bytes())
    assert refuse("export", header, "-o", tmp_path / "model.c", "--force") == [f"{header}: {message}"]


def test_two_commands_on_one_output(refuse, study, tmp_path):
    output = tmp_path / "trajectory.h5"
    with locked(output, "trajectory"):
        said = f"{output}: is being written by cpfls trajectory, process {os.getpid()}; "
        assert refuse("trajectory", study, "-o", output, "--force") == [f"{said}wait for it, or name another output"]
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_command_left_half_written_goes(cpfls, study, tmp_path):
    (tmp_path / ".trajectory.h5.lock").write_text("cpfls trajectory, process 1")
    (tmp_path / ".trajectory.h5.ab_12xyz.part").write_text("half")
    folder = tmp_path / ".trajectory.h5.ab_12xyy.part"
    folder.mkdir()
    (folder / "half").write_text("half")
    cpfls.done("trajectory", study, "-o", tmp_path / "trajectory.h5")
    assert [path.name for path in tmp_path.iterdir()] == ["trajectory.h5"]


@pytest.mark.parametrize("linked", [True, False])
def test_a_file_of_the_user_with_the_name_of_the_lock_is_left_alone(cpfls, study, tmp_path, linked):
    lock, precious = tmp_path / ".trajectory.h5.lock", tmp_path / "precious"
    (precious if linked else lock).write_text("precious")
    if linked:
        lock.symlink_to(precious)
    cpfls.done("trajectory", study, "-o", tmp_path / "trajectory.h5")
    assert lock.read_text() == "precious"


def test_links_are_no_outputs(refuse, study, tmp_path):
    link = tmp_path / "link.h5"
    for target in (tmp_path / "nowhere.h5", tmp_path / "file.h5"):
        link.unlink(missing_ok=True)
        link.symlink_to(target)
        for force in ((), ("--force",)):
            (line,) = refuse("trajectory", study, "-o", link, *force)
            assert line == f"{link}: is a symbolic link to {target}; -o names the file itself"
        (tmp_path / "file.h5").write_text("precious")


def test_a_replaced_file_keeps_its_permissions(cpfls, study, tmp_path):
    output = put_file(tmp_path / "trajectory.h5", "private")
    output.chmod(0o600)
    cpfls.done("trajectory", study, "-o", output, "--force")
    assert output.stat().st_mode & 0o777 == 0o600


def test_names_that_are_not_text(cpfls, pipeline, study, tmp_path):
    flight = put_file(tmp_path / os.fsdecode(b"fl\xffight.h5"), pipeline.flight.read_bytes())
    output = cpfls.made("reduce", study, flight, at=tmp_path / os.fsdecode(b"selec\xfetion.h5"))
    assert cpfls.summary("info", output)["inputs"]["flight"]["name"] == "fl\ufffdight.h5"
    cpfls.done("report", study, output, "-o", tmp_path / os.fsdecode(b"\xfd.html"))
