"""Artifacts that were changed by another program, and sealed again as if it had been cpfls."""

from contextlib import contextmanager

import h5py

from cpfls_cli.files import seal_of


@contextmanager
def edited(path, mode="r+"):
    """Open an artifact to change it; a good seal stands at its end again afterwards."""
    with h5py.File(path, mode) as file:
        yield file
    seal(path)


def seal(path):
    """End a file that HDF5 has closed in the seal that fits it; HDF5 has cut off the one of before."""
    path.write_bytes((content := path.read_bytes()) + seal_of(content))
