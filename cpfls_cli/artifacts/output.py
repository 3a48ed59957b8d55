"""Outputs, files and folders: refused before anything is computed, locked, and written whole or not at all."""

from __future__ import annotations

import glob
import io
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from cpfls_cli.errors import InputError, OutputError
from cpfls_cli.files import seal_of_file

if TYPE_CHECKING:
    from typing_extensions import Buffer

try:
    import fcntl
except ImportError:
    # A system without such locks.
    fcntl = None  # type: ignore[assignment]

_BESIDE = ("", ".checkpoint", ".partial")
"""What the names of files add to that of the output next to which a command writes them."""

_NEW: set[str] = set()
"""Outputs of which there was no file when the command began: one that is there in the end is somebody else's."""

_LOCKED_BY = b"cpfls"
"""How a lock begins."""


@contextmanager
def locked(path: Path, title: str) -> Iterator[None]:
    """Keep other commands from the same output, and remove what a killed one left half-written of it.

    The system frees the lock of a process that ends, however it ends. Where it has none, or the folder cannot be
    written, nothing is locked.
    """
    path = Path(os.path.abspath(path))
    lock = path.parent / f".{path.name}.lock"
    handle = _locked(lock, path, title)
    try:
        if handle is not None:
            _tidy(path)
        yield
    finally:
        if handle is not None:
            lock.unlink(missing_ok=True)
            os.close(handle)


def _locked(lock: Path, path: Path, title: str) -> int | None:
    while fcntl is not None:
        try:
            # What is behind a link is the user's.
            handle = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        except OSError:
            return None
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # Whoever held it before may have removed the file between the two calls.
            if lock.exists() and os.fstat(handle).st_ino == lock.stat().st_ino:
                if not (os.read(handle, len(_LOCKED_BY)) or _LOCKED_BY).startswith(_LOCKED_BY):
                    # A file of the user that happens to have this name.
                    os.close(handle)
                    return None
                os.ftruncate(handle, 0)
                os.pwrite(handle, _LOCKED_BY + f" {title}, process {os.getpid()}".encode(), 0)
                return handle
        except BlockingIOError:
            holder = os.read(handle, 200).decode(errors="replace") or "another command"
            os.close(handle)
            raise InputError(f"{path}: is being written by {holder}; wait for it, or name another output") from None
        except OSError:
            os.close(handle)
            return None
        os.close(handle)
    return None


def _tidy(path: Path) -> None:
    for name in (f".{path.name}{addition}." for addition in _BESIDE):
        for part in path.parent.glob(f"{glob.escape(name)}????????.part"):
            if part.is_dir():
                shutil.rmtree(part, ignore_errors=True)
            else:
                part.unlink(missing_ok=True)


def check_output(path: Path, force: bool, inputs: Iterable[Path] = ()) -> None:
    """Refuse an output that cannot or must not be written, such as an input, before anything is computed."""
    refuse_inputs(path, inputs)
    if os.path.islink(path):
        raise InputError(f"{path}: is a symbolic link to {os.readlink(path)}; -o names the file itself")
    with _asked_for(path):
        if path.is_dir():
            raise InputError(f"{path}: is a folder; -o names a file")
        if path.exists() and not path.is_file():
            raise InputError(f"{path}: is a device or a pipe; -o names a file")
        if path.exists() and not force:
            raise InputError(f"{path}: exists already; --force replaces it")
    _expect([path], new=not force)


def _expect(paths: Iterable[Path], *, new: bool) -> None:
    """Take note of outputs that may be made, and not replaced; or of those that may be."""
    names = {os.path.abspath(path) for path in paths}
    _NEW.difference_update(names)
    _NEW.update(names if new else ())


def _refuse_appeared(paths: Iterable[Path]) -> None:
    for path in paths:
        if os.path.abspath(path) in _NEW and os.path.lexists(path):
            raise OutputError(
                f"{path}: appeared while the command was running, and is kept; move it away and run the command again"
            )


def _move(temporary: Path, path: Path) -> None:
    """Put a complete file in its place; the command may then write it again."""
    _refuse_appeared([path])
    os.replace(temporary, path)
    _expect([path], new=False)


def refuse_inputs(output: Path, inputs: Iterable[Path]) -> None:
    """Refuse an output that is one of the files that the command reads."""
    # Unlike a method of a path, this takes a name that the system does not as one of no file.
    if os.path.exists(output) and any(path.exists() and path.samefile(output) for path in inputs):
        raise InputError(f"{output}: is an input of this command; -o must name another file")


def refuse_own(path: Path, output: Path) -> None:
    """Refuse a further output where the command writes its first one, or what it keeps next to that."""
    if os.path.realpath(path) in {os.path.realpath(f"{output}{addition}") for addition in _BESIDE}:
        raise InputError(f"{path}: is what the command writes for -o {output}; name another file")


@contextmanager
def _asked_for(path: Path) -> Iterator[None]:
    """Make sure that the folder can be written; before anything is computed it is the option that is wrong."""
    try:
        with atomic_path(path):
            yield
    except OutputError as error:
        raise InputError(str(error)) from None


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Give a temporary name next to a file, to be moved there by `os.replace`; what is left of it is removed."""
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    except OSError as error:
        raise OutputError(f"{path}: cannot write into the folder {path.parent}: {error.strerror}") from None
    temporary = Path(name)
    try:
        os.close(handle)
        # mkstemp makes private files; an artifact gets the permissions any new file would.
        mask = os.umask(0)
        os.umask(mask)
        # What is replaced keeps its own.
        temporary.chmod(path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~mask)
        yield temporary
    finally:
        temporary.unlink(missing_ok=True)


class EnduringFile(io.RawIOBase):
    """A file that keeps a failure to write for `require_written`: HDF5 crashes the program where a disk fills up.

    What is written after a failure is lost, and read as zeros.
    """

    def __init__(self, file: io.FileIO) -> None:
        """Take a file without a buffer."""
        self._file, self._at, self._end = file, 0, 0
        self._failure: OSError | None = None

    def write(self, content: Buffer) -> int:
        """Write all of it, as far as can be seen."""
        view = memoryview(content).cast("B")
        self._attempt(lambda: self._write(view))
        self._at += len(view)
        self._end = max(self._end, self._at)
        return len(view)

    def readinto(self, content: Buffer) -> int:
        """Read up to the end."""
        view = memoryview(content).cast("B")[: max(0, self._end - self._at)]
        self._file.seek(self._at)
        count = self._file.readinto(view) or 0
        view[count:] = bytes(len(view) - count)
        self._at += len(view)
        return len(view)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to another place."""
        self._at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._at, os.SEEK_END: self._end}[whence]
        return self._at

    def truncate(self, size: int | None = None) -> int:
        """Cut the file off, or lengthen it."""
        self._end = self._at if size is None else size
        self._attempt(lambda: self._file.truncate(self._end))
        return self._end

    def require_written(self) -> None:
        """Make sure that all has been written."""
        if self._failure is not None:
            raise self._failure

    def _write(self, view: memoryview) -> None:
        self._file.seek(self._at)
        while view:
            view = view[self._file.write(view) :]

    def _attempt(self, work: Callable[[], object]) -> None:
        if self._failure is None:
            try:
                work()
            except OSError as error:
                self._failure = error


@contextmanager
def sealed_output(path: Path) -> Iterator[EnduringFile]:
    """Give a file to write under a temporary name; in the end it gets its seal and is moved in place."""
    with atomic_path(path) as temporary, _writing(path), temporary.open("r+b", buffering=0) as raw:
        file = EnduringFile(raw)
        try:
            yield file
        finally:
            # What went wrong first is said, whatever HDF5 made of it.
            file.require_written()
        seal = seal_of_file(raw)
        file.seek(0, os.SEEK_END)
        file.write(seal)
        file.require_written()
        os.fsync(raw.fileno())
        _move(temporary, path)


def write_text(path: Path, text: str) -> None:
    """Write a text file, as `write_files`."""
    write_files({path: text})


def write_files(contents: Mapping[Path, str | bytes]) -> None:
    """Write files of text or bytes under temporary names, then move them in place when all of them are complete.

    What is no character, such as a byte of a file name that is not UTF-8, is written as a question mark.
    """
    with ExitStack() as stack:
        written = {}
        for path, content in contents.items():
            written[path] = temporary = stack.enter_context(atomic_path(path))
            with _writing(path), temporary.open("wb") as file:
                file.write(content if isinstance(content, bytes) else content.encode("utf-8", "replace"))
                file.flush()
                os.fsync(file.fileno())
        _refuse_appeared(written)
        for path, temporary in written.items():
            with _writing(path):
                _move(temporary, path)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from None


def check_folder(folder: Path, force: bool, names: Sequence[str], kept: str = "") -> None:
    """Refuse a folder that cannot or must not be filled with files of these names; what is kept may be there."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; -o names a folder")
    if folder.exists() and any(own.name != kept for own in folder.iterdir()) and not force:
        raise InputError(f"{folder}: exists already and is not empty; --force replaces what is in it")
    if not folder.absolute().parent.is_dir():
        raise InputError(f"{folder}: cannot be made: there is no folder {folder.parent}")
    for name in names:
        if (folder / name).is_dir():
            raise InputError(f"{folder / name}: is a folder, but a file of this name must be written; move it away")
    for place in (folder.resolve().parent, folder.resolve()):
        if place.is_dir() and not os.access(place, os.W_OK | os.X_OK):
            raise InputError(f"{folder}: cannot write into the folder {place}; change its permissions")
    _expect((folder.resolve() / name for name in names), new=not force)


@contextmanager
def filled_folder(folder: Path, names: Sequence[str]) -> Iterator[Path]:
    """Give a temporary folder next to a folder, and move its files in place at the end.

    Of the names, files of an earlier run that are not written again are removed; a link to a folder is followed.
    """
    folder = folder.resolve()
    try:
        temporary = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}.", suffix=".part"))
    except OSError as error:
        raise InputError(f"{folder}: cannot write next to it: {error.strerror}") from None
    try:
        yield temporary
        folder.mkdir(exist_ok=True)
        _refuse_appeared(folder / name for name in names if (temporary / name).exists())
        for name in names:
            if (temporary / name).exists():
                _move(temporary / name, folder / name)
            elif os.path.abspath(folder / name) not in _NEW:
                (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error}") from None
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
