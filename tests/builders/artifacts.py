"""Artifacts that were changed by another program, and sealed again as if it had been cpfls."""

import struct
from contextlib import contextmanager
from dataclasses import replace

import h5py
import numpy as np

from cpfls_cli import store
from cpfls_cli.files import seal_of
from cpfls_cli.stage import loaded


def read_result(path):
    """Read what a stage wrote."""
    return store.read(path, loaded(store.stage_of(path)).kind)[0]


def with_fields(path, output, **fields):
    """Write what a stage wrote again, with other values for some of its fields."""
    given, origin = store.read(path, loaded(store.stage_of(path)).kind)
    store.write(output, replace(given, **fields), origin)


@contextmanager
def edited(path, mode="r+"):
    """Open an artifact to change it; a good seal stands at its end again afterwards."""
    with h5py.File(path, mode) as file:
        yield file
    seal(path)


def seal(path):
    """End a file that HDF5 has closed in the seal that fits it; HDF5 has cut off the one of before."""
    path.write_bytes((content := path.read_bytes()) + seal_of(content))


def circular(path):
    """Let the list of free space in the heap of names, by which HDF5 finds the root group, lead to itself; and seal."""
    with h5py.File(path, "w") as file:
        file.attrs["format"] = "cpfls/flight"
        file["time"] = np.arange(3.0)
    content = bytearray(path.read_bytes())
    heap = content.index(b"HEAP")
    _, head, names = struct.unpack("<QQQ", content[heap + 8 : heap + 32])
    content[names + head : names + head + 8] = struct.pack("<Q", head)
    path.write_bytes(content + seal_of(content))
    return path
