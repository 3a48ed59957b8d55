"""``-v``: what is read, what is written, how large it is and how long it took, for every stage command."""

import re

import pytest

LOG = "t,p,q,r,roll,pitch,yaw\n" + "".join(
    f"{row / 100},0.1,0.2,0.3,{row % 7},{row % 5},{row % 3}\n" for row in range(400)
)
SIGNALS = "{body_rate: {columns: [p, q, r], unit: rad/s}, body_torque: {columns: [roll, pitch, yaw], unit: N m}}"


@pytest.fixture
def words(pipeline, tmp_path):
    """Arguments of each stage command, inputs first."""
    log = tmp_path / "log.csv"
    log.write_text(LOG)
    return {
        "trajectory": ([], []),
        "simulate": ([pipeline.trajectory], []),
        "import": ([log], ["--set", "import.time_column=t", "--set", f"import.signals={SIGNALS}"]),
        "reduce": ([pipeline.flight], []),
        "identify": ([pipeline.flight], []),
        "report": ([pipeline.trajectory, pipeline.selection], []),
    }


COMMANDS = ("trajectory", "simulate", "import", "reduce", "identify", "report")


@pytest.mark.parametrize("command", COMMANDS)
def test_verbose_names_what_is_read_and_written(cpfls, words, study, tmp_path, command):
    inputs, options = words[command]
    output = tmp_path / "out"
    result = cpfls.done(command, study, *inputs, "-o", output, "-v", *options)
    said = [line for line in result.stderr.splitlines() if re.match(rf"{command}: (reads|wrote) ", line)]
    sizes = r" \([\d.]+ (bytes|kB|MB)\)"
    patterns = [rf"{command}: reads {re.escape(str(path))}{sizes}" for path in [study, *inputs]]
    patterns.append(rf"{command}: wrote {re.escape(str(output))}{sizes} in \d+\.\d\d s")
    assert len(said) == len(patterns)
    assert all(re.fullmatch(pattern, line) for pattern, line in zip(patterns, said, strict=True)), said


def test_size_is_that_of_the_file(cpfls, study, tmp_path):
    result = cpfls("trajectory", study, "-o", tmp_path / "t.h5", "-v")
    assert f"({(tmp_path / 't.h5').stat().st_size / 1000:.1f} kB)" in result.stderr


@pytest.mark.parametrize("options", [(), ("-q",), ("-q", "-v")], ids=" ".join)
def test_nothing_is_said_unasked(cpfls, study, tmp_path, options):
    assert cpfls("trajectory", study, "-o", tmp_path / "t.h5", *options).stderr == ""


def test_a_dry_run_writes_nothing_and_says_so(cpfls, study, tmp_path):
    result = cpfls("trajectory", study, "-o", tmp_path / "t.h5", "-v", "--dry-run")
    assert "reads" in result.stderr
    assert "wrote" not in result.stderr
