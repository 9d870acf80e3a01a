"""What the tests of planning share: the arm of the paper and an oracle in many digits."""

from types import ModuleType

from flat_planner_ros.core.arm import PlanarArm
import pytest


@pytest.fixture(scope='session')
def oracle() -> ModuleType:
    """Return the module of the oracle; only tests that need it are skipped without mpmath."""
    pytest.importorskip('mpmath')
    import oracle

    return oracle


@pytest.fixture
def paper_arm() -> PlanarArm:
    """Return the arm of the paper's table, with its damping."""
    return PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
