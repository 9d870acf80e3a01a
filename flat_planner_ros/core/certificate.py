"""Certificate: the residuals that every returned law must keep to."""

from flat_planner_ros.core.errors import UncertifiedPlan

BOUNDARY_TOLERANCE = 1e-9
"""Largest miss of a prescribed value or derivative, relative to that derivative's peak [-]."""

OPTIMALITY_TOLERANCE = 1e-9
"""Largest miss of a condition of optimality, relative to its terms [-]."""


def certify(quantity: str, residual: float, tolerance: float) -> None:
    """Refuse a residual above its tolerance, or none at all (NaN)."""
    if not residual <= tolerance:
        raise UncertifiedPlan(quantity, residual, tolerance)
