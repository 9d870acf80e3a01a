"""What the fuzz tests need: the oracle in many digits."""

from types import ModuleType

import pytest


@pytest.fixture(scope='session')
def oracle() -> ModuleType:
    """Return the module of the oracle."""
    pytest.importorskip('mpmath')
    import oracle

    return oracle
