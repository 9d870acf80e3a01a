# Copyright 2026 flat_planner_ros developers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Cases that are planned in arrays, where that gives what the planner would say to each alone.

Those are motions of two-joint arms from rest to rest in a prescribed time, by a strategy that is a
quadratic cost, clearly within the limits. All others go one by one.
"""

from math import nan
from typing import NamedTuple

from flat_planner_ros.core.arm import ArmStack, Drive, FloatArray, NotFlat, PlanarArm
from flat_planner_ros.core.plan_table import plan_many, PlanTable
from flat_planner_ros.core.planning import OWN_LAWS
from flat_planner_ros.core.plant import CommandTable
from flat_planner_ros.core.session import MAX_ANGLE, SessionSettings
from flat_planner_ros.core.study.case import Batch, last_links_of, with_last_links
from flat_planner_ros.core.study.planned import Clock
import numpy as np
from numpy.typing import NDArray

CLEAR = 0.99
"""Share of a limit up to which the peaks of a table, short of the true ones by 2e-3, obey it."""

ROUNDING = 1e-9
"""Excess of a spacing over the period that is forgiven, as by `Plan.sample` [-]."""


class InArrays(NamedTuple):
    """
    Plans of some cases of a batch.

    Attributes
    ----------
    places
        Which cases, shape (q,).
    rows
        Their rows in the table, shape (q,).
    table
        The plans.
    true
        Their true arms.
    factors
        Of these on the nominal ones, as for `PlanTable.residuals_on`, shape (N, 4) [-].
    seconds
        What planning took for each [s].

    """

    places: NDArray[np.intp]
    rows: NDArray[np.int64]
    table: PlanTable
    true: ArmStack
    factors: FloatArray
    seconds: float


def planned_in_arrays(batch: Batch, clock: Clock | None) -> InArrays | None:
    """Return the plans of the cases that need no other look; None if there are none."""
    template, settings = batch.template, batch.template.settings
    options = settings.options
    if template.via or settings.arm.n != 2 or settings.built is not None:
        return None
    if not _is_flat(template.true):
        return None
    if options.strategy in OWN_LAWS or options.compensate_friction or _has_positions(settings):
        return None
    places = np.flatnonzero(_is_usual(batch, settings))
    if not places.size:
        return None
    begun = nan if clock is None else clock()
    way = (batch.finals - batch.starts)[places].sum(axis=1)
    table = plan_many(
        _nominal_arms(batch, places),
        way,
        batch.durations[places],
        options,
        starts=batch.starts[places].sum(axis=1),
    )
    rows = np.flatnonzero(table.is_certified & _obeys(table, settings)).astype(np.int64)
    seconds = nan if clock is None else (clock() - begun) / len(places)
    if not rows.size:
        return None
    numbers = (batch.model, settings.arm), (batch.true, template.true)
    model, true = (_numbers(table_, arm, places) for table_, arm in numbers)
    return InArrays(
        places=places[rows],
        rows=rows,
        table=table,
        true=_stack(template.true, true[rows]),
        factors=_factors(model, true),
        seconds=seconds,
    )


def _is_flat(arm: PlanarArm) -> bool:
    """Tell whether the numbers of its last two links tell all of an arm."""
    try:
        arm.check_flat()
    except NotFlat:
        return False
    return True


def _has_positions(settings: SessionSettings) -> bool:
    """Tell whether positions are limited."""
    limits = settings.limits
    return limits is not None and bool(
        np.isfinite(limits.position_min).any() or np.isfinite(limits.position_max).any()
    )


def _is_usual(batch: Batch, settings: SessionSettings) -> NDArray[np.bool_]:
    """Tell which cases break no rule of goals and have numbers of arms, shape (m,)."""
    duration = batch.durations
    usual = (duration >= settings.min_duration) & (duration <= settings.max_duration)
    for pose in (batch.starts, batch.finals):
        usual &= (np.abs(pose) <= MAX_ANGLE).all(axis=1) & (pose[:, -1] == 0.0)
    usual &= (batch.starts != batch.finals).any(axis=1)
    for numbers in (batch.model, batch.true):
        if numbers is not None:
            both, last, stiffness, damping = numbers.T
            is_arm = (last > 0.0) & (last < both) & (stiffness > 0.0) & (damping >= 0.0)
            usual &= is_arm & np.isfinite(numbers).all(axis=1)
    return usual


def _nominal_arms(batch: Batch, places: NDArray[np.intp]) -> PlanarArm | list[PlanarArm]:
    """Return the arms that are planned for, equal ones as the same object."""
    arm = batch.template.settings.arm
    if batch.model is None:
        return arm
    distinct, which = np.unique(batch.model[places], axis=0, return_inverse=True)
    made = [with_last_links(arm, numbers) for numbers in distinct]
    return [made[place] for place in which.ravel().tolist()]


def _obeys(table: PlanTable, settings: SessionSettings) -> NDArray[np.bool_]:
    """Tell which plans obey the limits without a closer look."""
    if settings.limits is None or not settings.limits.quantities:
        return np.ones(len(table), dtype=bool)
    limits, figures = settings.limits, table.figures
    obeys = (figures.peak_effort <= CLEAR * limits.effort).all(axis=1)
    obeys &= (figures.peak_velocity <= CLEAR * limits.velocity).all(axis=1)
    return np.asarray(obeys)


def _numbers(numbers: FloatArray | None, arm: PlanarArm, places: NDArray[np.intp]) -> FloatArray:
    """Return the last links of each case's arm, shape (N, 4)."""
    return np.tile(last_links_of(arm), (len(places), 1)) if numbers is None else numbers[places]


def _factors(model: FloatArray, true: FloatArray) -> FloatArray:
    """Return factors on stiffness, damping, inertia of link n and own inertia of link n-1."""
    with np.errstate(divide='ignore', invalid='ignore'):
        damping = np.where(true[:, 3] == model[:, 3], 1.0, true[:, 3] / model[:, 3])
    own = (true[:, 0] - true[:, 1]) / (model[:, 0] - model[:, 1])
    return np.column_stack([true[:, 2] / model[:, 2], damping, true[:, 1] / model[:, 1], own])


def _stack(arm: PlanarArm, numbers: FloatArray) -> ArmStack:
    """Return arms of two joints that differ in their last links, shape (q, 4), and no more."""
    count = len(numbers)
    both, last, stiffness, damping = (np.array(column) for column in numbers.T)
    inertia = np.tile(arm.inertia, (count, 1, 1))
    inertia[:, 0, 0], inertia[:, 1, 1] = both - last, last
    return ArmStack(
        inertia=inertia,
        static_moment=np.tile(arm.static_moment, (count, 1)),
        stiffness=stiffness,
        damping=damping,
        gravity=np.full(count, arm.gravity),
        viscous_friction=np.tile(arm.viscous_friction, (count, 1)),
        coulomb_friction=np.tile(arm.coulomb_friction, (count, 1)),
    )


def commands_in_arrays(
    found: InArrays, period: float, drive: Drive, *, with_positions: bool = False
) -> CommandTable:
    """
    Return the commands of plans.

    Parameters
    ----------
    found
        The plans.
    period
        Longest spacing of the samples [s].
    drive
        Servos get positions and velocities of joint 1 in place of efforts.
    with_positions
        Whether they come besides efforts.

    """
    durations = found.table.durations[found.rows]
    intervals = np.maximum(1, np.ceil(durations / period - ROUNDING)).astype(np.int64)
    shape = (len(found.rows), int(intervals.max()) + 1, 1)
    efforts, positions, velocities = np.zeros((3, *shape))
    has_positions = with_positions or drive is Drive.POSITION
    for count in np.unique(intervals).tolist():
        (here,) = np.nonzero(intervals == count)
        points, rows = slice(count + 1), found.rows[here]
        if drive is Drive.EFFORT:
            efforts[here, points, 0] = found.table.driving(rows, count)
        if not has_positions:
            continue
        planned = found.table.planned(rows, count)[:, 0]
        velocity = found.table.arms.rows[found.table.arms.of_row[rows], 1]
        # A combination of derivatives; for the position, of those one lower.
        velocities[here, points, 0] = np.einsum('qk,qkm->qm', velocity, planned)
        positions[here, points, 0] = np.einsum('qk,qkm->qm', velocity[:, 1:], planned[:, :-1])
        # The certified ends are at rest.
        velocities[here, 0, 0] = velocities[here, count, 0] = 0.0
    if drive is Drive.EFFORT:
        # The certified ends are without effort.
        efforts[:, 0] = 0.0
        efforts[np.arange(len(intervals)), intervals] = 0.0
    return CommandTable(
        spacing=durations / intervals,
        intervals=intervals,
        efforts=efforts,
        positions=positions if has_positions else None,
        velocities=velocities if has_positions else None,
    )
