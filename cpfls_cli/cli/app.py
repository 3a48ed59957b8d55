"""The program: its commands, which are the stages, and the options that stand before them."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from cpfls_cli.cli.options import Commands, sheet
from cpfls_cli.cli.stages import stage_commands
from cpfls_cli.cli.terminal import messages_for_errors
from cpfls_cli.version import __version__


class AllCommands(Commands):
    """The commands of all stages."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given | {"commands": stage_commands()})


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


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Take the options that stand before a command."""
