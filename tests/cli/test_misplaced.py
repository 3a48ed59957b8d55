"""Files in the place of others: each is told what it is, and what was meant is given as a command that runs."""

import shlex

import pytest

HEADER = "t,roll,pitch,yaw,mx,my,mz\n"


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
    ],
)
def test_of_all_commands_with_a_config(refuse, pipeline, log, log_study, tmp_path, words, meant):
    files = {"LOG": log, "CONFIG": log_study, "FLIGHT": pipeline.flight}
    (line,) = refuse(*(files.get(word, word) for word in words), "-o", tmp_path / "out")
    for word, path in files.items():
        line = line.replace(str(path), word)
    assert line.endswith(f"and the config comes first: cpfls {meant} -o {tmp_path / 'out'}")


def test_a_log_where_no_config_was_given(refuse, log, tmp_path):
    for words in (("config", log), ("import", log, log, "-o", tmp_path / "flight.h5")):
        (line,) = refuse(*words)
        assert line.startswith(
            f"{log}: is a log, not a config (YAML); `cpfls init {log} -o study.yaml` writes one for it"
        )


@pytest.mark.parametrize("command", ["info", "check", "export", "report", "replay", "identify", "reduce"])
def test_a_log_where_an_artifact_belongs(refuse, log, study, tmp_path, command):
    given = {
        "info": (log,),
        "check": (log,),
        "export": (log,),
        "replay": (study, log, log),
    }
    output = () if command in ("info", "check") else ("-o", tmp_path / "out.json")
    (line,) = refuse(command, *given.get(command, (study, log)), *output)
    assert line == f"{log}: is a log, and this takes what cpfls made: cpfls import CONFIG {log} -o log.h5"


def test_a_name_with_spaces_can_be_pasted(refuse, log, tmp_path):
    spaced = tmp_path / "my log.csv"
    spaced.write_bytes(log.read_bytes())
    (line,) = refuse("info", spaced)
    assert line.endswith(f": cpfls import CONFIG '{spaced}' -o 'my log.h5'")


def test_what_needs_no_import_is_told_so(refuse, pipeline, study, log_study, tmp_path):
    (line,) = refuse("import", log_study, pipeline.flight, "-o", tmp_path / "out.h5")
    assert line == (
        f"{pipeline.flight}: is a cpfls/flight, not a log: it needs no import; `cpfls info {pipeline.flight}` shows it"
    )
    (line,) = refuse("import", log_study, study, "-o", tmp_path / "out.h5")
    assert line == f"{study}: is a config, not a log; first the config, then the log"


def test_a_flight_where_no_config_was_given(refuse, pipeline):
    (line,) = refuse("config", pipeline.flight)
    assert (
        line == f"{pipeline.flight}: is a cpfls/flight, not a config (YAML); `cpfls config` prints a commented default"
    )
