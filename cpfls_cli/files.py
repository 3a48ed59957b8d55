"""Files before anything parses them: the checksum that ends an artifact, and whether it fits what precedes it."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import hashlib
    import io

    from typing_extensions import Buffer

_HDF5 = b"\x89HDF\r\n\x1a\n"
_SEAL = b"cpfls sha256 "
_SEAL_BYTES = len(_SEAL) + 64 + 1
_BLOCK = 1 << 20
_LEAST_S, _BYTES_PER_SECOND = 10.0, 5e6
_PLAIN, _TIMES = 1 << 27, 200
"""Bytes of numbers that a log may hold whatever its size, and in sizes of it beyond: signals hardly compress."""


class Content(NamedTuple):
    """What is known of a file whose bytes were all read: its hash, and whether it ends in a seal that fits."""

    sha256: str
    intact: bool


def is_hdf5(path: Path) -> bool:
    """Tell whether a file begins as HDF5 does."""
    with path.open("rb") as stream:
        return stream.read(len(_HDF5)) == _HDF5


def longest_read_s(size: int) -> float:
    """Say how long to read a file of so many bytes may take, s, before it is taken to have no end."""
    return _LEAST_S + size / _BYTES_PER_SECOND


def most_held(size: int) -> int:
    """Say how many bytes of numbers, of eight each, a log of so many bytes may hold before it is taken for no log."""
    return max(_PLAIN, _TIMES * size)


def is_sealed(path: Path) -> bool:
    """Tell whether a file ends in a seal, whatever it seals."""
    with path.open("rb") as stream:
        stream.seek(max(0, os.fstat(stream.fileno()).st_size - _SEAL_BYTES))
        end = stream.read(_SEAL_BYTES + 1)
    return len(end) == _SEAL_BYTES and end.startswith(_SEAL) and end.endswith(b"\n")


def seal_of(content: Buffer) -> bytes:
    """Make the line that an artifact ends in: the SHA-256 of all that precedes it."""
    return _line(_sha256(content).hexdigest())


def seal_of_file(file: io.FileIO) -> bytes:
    """Make the line that a file ends in, some of its bytes at a time."""
    import hashlib

    file.seek(0)
    return _line(hashlib.file_digest(file, "sha256").hexdigest())


def read_content(path: Path) -> Content:
    """Hash a file and compare it with its seal, in one pass; a file that stayed as it was is read once only."""
    return _read_content(state_of(path))


class FileState(NamedTuple):
    """A file as it lies there: whatever changes it changes one of these too."""

    path: Path
    inode: int
    size: int
    modified_ns: int
    changed_ns: int


def state_of(path: Path) -> FileState:
    """Take note of a file, so that what was found in it need not be looked for again."""
    known = path.stat()
    return FileState(path.absolute(), known.st_ino, known.st_size, known.st_mtime_ns, known.st_ctime_ns)


@lru_cache(maxsize=256)
def _read_content(state: FileState) -> Content:
    digest, left, block = _sha256(), max(0, state.size - _SEAL_BYTES), memoryview(bytearray(_BLOCK))
    with state.path.open("rb", buffering=0) as stream:
        while left and (count := stream.readinto(block[: min(left, _BLOCK)])):
            digest.update(block[:count])
            left -= count
        sealed = digest.hexdigest()
        end = stream.read(_SEAL_BYTES)
        digest.update(end)
        # What has grown since is hashed too: it is no seal then.
        while count := stream.readinto(block):
            digest.update(block[:count])
            end = b""
    return Content(digest.hexdigest(), end == _line(sealed))


def text_sha256(text: str) -> str:
    """Hash a text.

    Returns
    -------
    str
        Hexadecimal SHA-256 of its UTF-8 bytes.
    """
    return _sha256(text.encode()).hexdigest()


def _sha256(content: Buffer = b"") -> hashlib._Hash:
    # The command line knows this module before it knows whether there is anything to hash, and OpenSSL loads slowly.
    import hashlib

    return hashlib.sha256(content)


def _line(sha256: str) -> bytes:
    return _SEAL + sha256.encode() + b"\n"
