"""What searches and sweeps share where they are to be resumed."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from cpfls_cli.artifacts.formats import MODEL, SWEEP
from cpfls_cli.artifacts.spec import ArtifactSpec, Header
from cpfls_cli.artifacts.store import format_name, read_artifact
from cpfls_cli.errors import InputError

_LONGEST = 120
_COMPLETE = {MODEL.format: "search/complete", SWEEP.format: "complete"}


def nothing_to_resume(left: Path, output: Path, spec: ArtifactSpec) -> InputError:
    """Say why there is nothing to resume.

    Parameters
    ----------
    left : Path
        What a stopped command leaves, and did not.
    output : Path
        What the command is for.
    spec : ArtifactSpec
        Of the output.
    """
    if _is_complete(output, spec):
        return InputError(f"{output}: is complete; nothing to resume")
    return InputError(f"{left}: no such file, so nothing to resume; start without --resume")


def _is_complete(output: Path, spec: ArtifactSpec) -> bool:
    if not output.is_file() or format_name(output) != spec.format:
        return False
    return bool(read_artifact(output, spec).data.get(_COMPLETE[spec.format], True))


def differences(
    then: Header, now: Header, old: Mapping[str, Any], new: Mapping[str, Any], unimportant: str | None = None
) -> Iterator[str]:
    """Name what differs between a command that was stopped and the one that is to go on from it.

    Parameters
    ----------
    old, new : mapping of str to object
        The keys that the result depends on, with dots.
    unimportant : str, optional
        What the roles of inputs begin with that the result does not depend on.
    """
    if then.version != now.version:
        yield f"written by cpfls {then.version}, this is {now.version}"
    for key in sorted(old.keys() | new.keys()):
        if old.get(key) != new.get(key):
            yield f"{key} = {_short(old.get(key))} there, {_short(new.get(key))} here"
    for role in sorted(then.inputs.keys() | now.inputs.keys()):
        files = [header.inputs.get(role) for header in (then, now)]
        first, second = (file.sha256 if file else None for file in files)
        if first != second and not (unimportant and role.startswith(unimportant)):
            names = [f"{file.name} ({file.sha256[:12]})" if file else "none" for file in files]
            yield f"{role} = {names[0]} there, {names[1]} here"


def require_same(left: Path, what: str, differing: Iterable[str]) -> None:
    """Refuse what is left of another command.

    Parameters
    ----------
    what : str
        ``search`` or ``sweep``.
    differing : iterable of str
        How they differ.

    Raises
    ------
    InputError
        If they do.
    """
    found = "; ".join(differing)
    if found:
        raise InputError(
            f"{left}: is of another {what}: {found}. Repeat the command as it was, with --resume, or start again with "
            "--force alone"
        )


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False) if isinstance(value, Mapping | list) else str(value)
    return textwrap.shorten(text, _LONGEST, placeholder=" ...")
