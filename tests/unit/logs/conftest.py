"""A log of some content, read: text or bytes, or variables of MATLAB or NumPy."""

import numpy as np
import pytest
import scipy.io

from cpfls_cli.logs.formats import log_contents
from tests.builders.studies import put_file


@pytest.fixture
def read(request, tmp_path):
    def call(content, name=None, wanted=None):
        path = tmp_path / (name or request.module.NAME)
        if path.suffix == ".mat" and isinstance(content, dict):
            scipy.io.savemat(path, content)
        elif path.suffix == ".npz" and isinstance(content, dict):
            np.savez(path, **content)
        else:
            put_file(path, content)
        return log_contents(path, wanted)

    return call
