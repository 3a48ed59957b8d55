"""The commands: parse, load, one call, print. Numerics are imported only by the command that needs them."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cpfls_cli.arguments import (
    ArtifactsArgument,
    ExportAnywayOption,
    ExportedArgument,
    ExportFormat,
    FileArgument,
    LogsArgument,
    moments,
)
from cpfls_cli.cli.interrupts import deferred_interrupts
from cpfls_cli.cli.options import (
    Common,
    ConfigArgument,
    OutputOption,
    sheet,
    with_common,
)
from cpfls_cli.cli.stages import AllCommands, noted
from cpfls_cli.cli.terminal import Narration, messages_for_errors, progress_bar, tell
from cpfls_cli.errors import InputError
from cpfls_cli.report.forms import Form
from cpfls_cli.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable

    from typer.core import TyperCommand

    from cpfls_cli.artifacts.job import Job
    from cpfls_cli.config.study import Study
    from cpfls_cli.report.outcome import Outcome

app = typer.Typer(
    name="cpfls",
    cls=AllCommands,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    # Lines behind a backspace stay as they are.
    help=f"From flight logs: what a model of a multirotor misses, and how far to trust it.\n\n\b\n{sheet()}",
)


def _version(asked: bool) -> None:
    if asked:
        with messages_for_errors():
            print(f"cpfls {__version__}", flush=True)
        raise typer.Exit


def _command(
    name: str | None = None, kind: type[TyperCommand] | None = None
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a function a command with the options that every command takes."""
    return lambda function: app.command(name, cls=kind)(with_common(function))


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Take the options that stand before a command."""


@_command()
def init(
    logs: LogsArgument,
    output: OutputOption,
    mass: Annotated[
        float | None, typer.Option("--mass", metavar="KG", min=1e-6, help="Mass as it flew, with battery, kg.")
    ] = None,
    arm: Annotated[
        float | None,
        typer.Option("--arm", metavar="M", min=1e-6, help="Middle to a rotor's axis, m."),
    ] = None,
    scale_to_arm: Annotated[
        bool, typer.Option("--scale-to-arm", help="Scale places of rotors that a log states to --arm.")
    ] = False,
    inertia: Annotated[
        Any,  # Of a tuple typer takes three words.
        typer.Option(
            "--inertia",
            metavar="IXX,IYY,IZZ",
            parser=moments,
            help="Moments of inertia where they are known, from CAD, a swing test or an earlier study, kg m^2.",
        ),
    ] = None,
    thrust_factor: Annotated[
        float | None,
        typer.Option(
            "--thrust-factor",
            metavar="N_S2",
            min=1e-12,
            help="Thrust of a rotor over its squared speed in rad/s, N s^2, where a data sheet gives it.",
        ),
    ] = None,
    drag_factor: Annotated[
        float | None,
        typer.Option("--drag-factor", metavar="N_M_S2", min=1e-15, help="Torque of its drag over the same, N m s^2."),
    ] = None,
    *,
    common: Common,
) -> None:
    """Look into logs of one vehicle and write a config for them, with the reason of every guess."""

    def call(command: Any, job: Job) -> Any:
        stated = command.Stated(mass, arm, inertia, thrust_factor, drag_factor, scale_to_arm)
        return command.run(job, logs, stated)

    _run_without_config("init", output, common, call)


@_command()
def report(
    config: ConfigArgument,
    artifacts: ArtifactsArgument,
    output: OutputOption,
    form: Annotated[
        Form | None,
        typer.Option("--format", help="Form of the report; default: by the suffix of FILE (.md, .json), else html."),
    ] = None,
    *,
    common: Common,
) -> None:
    """Write one self-contained page about artifacts (html, md or json); models that are given together are compared."""
    _run("report", config, output, common, lambda command, job: command.run(job, artifacts, form))


@_command()
def export(
    model: ExportedArgument,
    output: OutputOption,
    form: Annotated[
        ExportFormat | None,
        typer.Option(
            "--format",
            help="json: every parameter, with names and units; c: C99 source and header, no dependencies; "
            "sdf (Gazebo), px4 (its Gazebo, with the airframe), mjcf (MuJoCo), urdf "
            "(gym-pybullet-drones, Isaac), crazyflow (and drone-models), ardupilot (a frame of its SITL), rotorpy, "
            "casadi, jax: the vehicle for a simulator or a library; mcap (Foxglove), csv (PlotJuggler): what a "
            "flight, prediction, replay, gap or response holds, on the log's own clock; default: by the suffix of "
            "FILE (.json, .c, .py, .xml, .sdf, .urdf, .toml, .mcap, .csv).",
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(
            "--name",
            metavar="NAME",
            help="Prefix of the names in C, name in JSON and XML; default: from the name of FILE.",
        ),
    ] = None,
    anyway: ExportAnywayOption = False,
    *,
    common: Common,
) -> None:
    """Write a model as code or for a simulator; flights, replays, gaps and others for Foxglove or PlotJuggler."""
    chosen = form and form.value

    def call(command: Any, job: Job) -> Any:
        return command.run(job, model, chosen, name, anyway=anyway)

    _run_without_config("export", output, common, call)


@_command()
def spread(
    model: Annotated[Path, typer.Argument(metavar="VEHICLE", help="Made by `cpfls vehicle`.")],
    output: OutputOption,
    count: Annotated[int, typer.Option("-n", "--count", metavar="N", min=2, help="Vehicles to draw.")] = 1000,
    seed: Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Of the draws.")] = 1,
    anyway: ExportAnywayOption = False,
    *,
    common: Common,
) -> None:
    """Draw vehicles from what the flights of one tell, for simulators that fly many: .yaml, .json or .npz."""

    def call(command: Any, job: Job) -> Any:
        return command.run(job, model, count, seed, anyway=anyway)

    _run_without_config("spread", output, common, call)


@_command()
def info(
    file: Annotated[Path | None, typer.Argument(metavar="[FILE]", help="Any artifact.")] = None,
    name: Annotated[
        str | None, typer.Option("--format", metavar="NAME", help="Describe the datasets of a format, such as flight.")
    ] = None,
    *,
    common: Common,
) -> None:
    """Show what the command that wrote an artifact answered, what it holds and where it comes from.

    Without FILE, list all formats, or describe one.
    """
    with messages_for_errors():
        if file is None:
            tell(_of("formats").run(name), common)
        elif name is None:
            tell(_of("show").info(file), common)
        else:
            raise InputError("--format describes files of a format in general: leave out FILE or --format")


@_command()
def check(file: FileArgument, *, common: Common) -> None:
    """Check an artifact against its format; exit code 1 where it does not keep to it."""
    with messages_for_errors():
        tell(_of("show").check(file), common)


@_command("config")
def config_(
    config: Annotated[Path | None, typer.Argument(metavar="[CONFIG]", help="Study config (YAML).")] = None,
    section: Annotated[
        list[str] | None, typer.Option("--section", help="Only this section, or section.key; may be repeated.")
    ] = None,
    *,
    common: Common,
) -> None:
    """Print the resolved config; without CONFIG, a commented default."""
    with messages_for_errors():
        tell(_of("config").run(config, section or [], common.overrides or [], common.seed), common)


@_command()
def effects(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="An effect, such as rotor_drag; without it, all are listed.")
    ] = None,
    *,
    common: Common,
) -> None:
    """Show the effects that a model can miss, and the flights that tell them apart."""
    with messages_for_errors():
        tell(_of("effects").run(name), common)


def _of(title: str) -> Any:
    """Load the module of a command."""
    return import_module(f"cpfls_cli.commands.{title.replace('-', '_')}")


def _run(title: str, config: Path, output: Path, common: Common, call: Callable[[Any, Job], Outcome]) -> None:
    """Load the study, run one command, given as its module, with a progress bar, and print what it says."""
    with messages_for_errors():
        narration = _narration(title, common)
        study = common.study(config)
        narration.reads(config)

        def with_numbers(command: Any, job: Job) -> Outcome:
            from cpfls_cli.artifacts.job import require_numbers

            if common.numbers is not None:
                job = import_module("cpfls_cli.commands.numbers").with_numbers_of(job, common.numbers)
            require_numbers(job, title)
            return call(command, job)

        _run_with(study, title, [config], output, common, narration, with_numbers)


def _run_without_config(title: str, output: Path, common: Common, call: Callable[[Any, Job], Outcome]) -> None:
    """Run one command that needs no study."""
    with messages_for_errors():
        from cpfls_cli.config.load import validate

        _run_with(validate({}, "default"), title, [], output, common, _narration(title, common), call)


def _narration(title: str, common: Common) -> Narration:
    return Narration(title, common.verbose and not common.quiet)


def _run_with(
    study: Study,
    title: str,
    inputs: list[Path],
    output: Path,
    common: Common,
    narration: Narration,
    call: Callable[[Any, Job], Outcome],
) -> None:
    from cpfls_cli.artifacts.job import Job
    from cpfls_cli.artifacts.output import locked
    from cpfls_cli.report.outcome import cautioned

    with progress_bar(title, common) as progress:
        job = Job(
            study,
            output,
            common.force,
            common.dry_run,
            progress,
            narration.reads,
            deferred_interrupts,
            inputs,
            open_numbers="guessed" if common.accept_guesses else "refused",
        )
        job = replace(job, config=inputs[0]) if inputs else job
        with nullcontext() if common.dry_run else locked(output, title), noted(job):
            outcome = cautioned(call(_of(title), job), job)
    if not common.dry_run:
        narration.wrote(output)
        outcome = replace(outcome, written=output)
    tell(outcome, common)
