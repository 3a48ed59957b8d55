"""The address of a scheduler."""

from __future__ import annotations

from urllib.parse import urlsplit

from cpfls_cli.errors import InputError

_SCHEMES = ("tcp", "tls")


def require_address(address: str) -> None:
    """Require that a text is an address.

    Raises
    ------
    InputError
        If it is not of the form tcp://host:port, or tls://host:port.
    """
    try:
        parts = urlsplit(address)
        complete = parts.scheme in _SCHEMES and bool(parts.hostname) and bool(parts.port)
    except ValueError:
        complete = False
    if not complete:
        raise InputError(
            f"scheduler = {address}: not an address; expected tcp://host:port, such as tcp://10.0.0.1:8786"
        )
