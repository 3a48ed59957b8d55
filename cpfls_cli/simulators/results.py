"""What a correction of a simulator's file comes to, as the result of `gap` holds it."""

from __future__ import annotations

from cpfls_cli.gap.before_after import PlaybackChange
from cpfls_cli.result import about, part, result


@result
class Change:
    """A number of the file that the flights contradict."""

    file: str = about("name of the corrected file that it is in")
    element: str = about("name of the element or attribute")
    where: str = about("file, line and element, first of all that change alike")
    before: float = about("as stated, in the unit of the file")
    after: float = about("as found, in the unit of the file")
    low: float = about("lower end of the 95 % interval", gaps=True)
    high: float = about("upper end of the 95 % interval", gaps=True)
    sentence: str = about("what it means")


@result
class InSimulator:
    """Held-out flights flown in the simulator itself, by its file as given and as corrected."""

    program: str = about("the simulator, with its version where it is installed")
    why_not: str = about("why they were not flown there; empty where they were")
    refused: bool = about("whether the simulator is installed and failed to load or fly a file")
    flown: PlaybackChange | None = part()


@result
class Corrected:
    """A simulator's own file with what flights found put into it, and what it cannot hold."""

    files: tuple[str, ...] = about("files written: those given, corrected", "file")
    changes: tuple[Change, ...] = part()
    unchanged: tuple[str, ...] = about("what was found and is not put in, with the reason", "kept")
    elsewhere: tuple[str, ...] = about("what the format cannot hold, with what would do it", "missing")
    diff: str = about("unified diff of the files as given and as corrected")
    flown: PlaybackChange | None = part(default=None)
    """Held-out flights played back in the vehicle of the file, as given and as corrected."""
    in_simulator: InSimulator | None = part(default=None)
