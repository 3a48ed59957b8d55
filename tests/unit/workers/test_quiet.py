import logging

import pytest

from cpfls_cli.workers.quiet import quiet


@pytest.mark.parametrize("name", ["distributed.core", "distributed.client", "tornado.application", "asyncio"])
def test_nothing_is_logged_within_and_all_is_as_before_after(name):
    logger = logging.getLogger(name)
    before = logger.getEffectiveLevel()
    with quiet():
        assert not logger.isEnabledFor(logging.CRITICAL)
    assert logger.isEnabledFor(logging.CRITICAL)
    assert logger.getEffectiveLevel() == before
