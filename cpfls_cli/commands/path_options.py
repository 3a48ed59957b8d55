"""Options of the command `trajectory`, written as overrides of the config, and what makes no sense together."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from pathlib import Path

from cpfls_cli.config.study import Study
from cpfls_cli.errors import InputError


def option_overrides(
    waypoints: Path | None,
    to_tell: str | None,
    diagnosis: Path | None,
    box: str | None,
    height: float | None,
    duration: float | None,
) -> list[str]:
    """Write the options as overrides of the config, so that the artifact's config has them too."""
    settles = to_tell is not None or diagnosis is not None
    if settles and waypoints is not None:
        raise InputError(f"--waypoints {waypoints}: --to-tell and --for choose the path themselves; leave it out")
    next_flight = {
        "to_tell": None if to_tell is None else f"[{to_tell}]",
        "box_m": None if box is None else f"[{box}]",
        "height_m": None if height is None else repr(float(height)),
    }
    path = "next-flight" if settles else "waypoints" if waypoints is not None else None
    return [
        *([] if path is None else [f"trajectory.path={path}"]),
        *(f"trajectory.next_flight.{key}={value}" for key, value in next_flight.items() if value is not None),
        *([] if duration is None else [f"trajectory.duration_s={float(duration)!r}"]),
    ]


def require_no_room(box: str | None, height: float | None) -> None:
    """Refuse room for a path that is not planned for it."""
    for option, value in (("--box", box), ("--height", height)):
        if value is not None:
            raise InputError(
                f"{option} {value}: is room for the flight that --to-tell or --for plans, and this path is planned "
                "without; give one of them, or set trajectory.displacement_m and trajectory.direction"
            )


@dataclass(frozen=True)
class Added:
    """Options of repeats and excitations; None where one is not given.

    Attributes
    ----------
    axes, band : str or None
        With commas between; band in Hz.
    size : float or None
        Degrees.
    hover : float or None
        Duration at one place, s.
    """

    repeat: int | None = None
    axes: str | None = None
    signal: str | None = None
    band: str | None = None
    size: float | None = None
    hover: float | None = None

    def overrides(self, waypoints: Path | None, settles: bool, duration: float | None) -> list[str]:
        """Write the options as overrides of the config, ``section.key=value`` each."""
        others = {
            f"--waypoints {waypoints}": waypoints is not None,
            "--to-tell and --for": settles,
            f"--duration {duration or 0:g}": duration is not None,
        }
        for other, given in others.items():
            if given and self.hover is not None:
                raise InputError(f"--hover {self.hover:g}: stays at one place for so long; leave out {other}")
        values = {
            "repeat": self.repeat,
            "excite.axes": None if self.axes is None else f"[{self.axes}]",
            "excite.signal": self.signal,
            "excite.band_hz": None if self.band is None else f"[{self.band}]",
            "excite.size_rad": None if self.size is None else repr(radians(self.size)),
            "duration_s": None if self.hover is None else repr(float(self.hover)),
            "path": None if self.hover is None else "hover",
        }
        return [f"trajectory.{key}={value}" for key, value in values.items() if value is not None]

    def require_axes(self, study: Study) -> None:
        """Refuse what describes an excitation where there is none."""
        given = {"--signal": self.signal, "--band": self.band, "--size": self.size}
        for option, value in given.items():
            if value is not None and not study.trajectory.excite.axes:
                raise InputError(f"{option} {value}: describes an excitation; say which axes with --excite AXES")
