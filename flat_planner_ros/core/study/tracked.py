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
Motions carried out by trackers.

Where model and loop are the same, and the true arms linear, many go side by side in exact steps.
Each of the others goes by itself, sample by sample; so do those in which a tracker gives up.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from math import ceil
from typing import NamedTuple

from flat_planner_ros.core.arm import (
    ArmStack,
    Drive,
    FlatPlannerError,
    FloatArray,
    JointSample,
    locked,
    PlanarArm,
)
from flat_planner_ros.core.planning import PlanSamples
from flat_planner_ros.core.plant import DriveSettings, held_steps, SimulatedArm, States
from flat_planner_ros.core.study.axes import InvalidStudy
from flat_planner_ros.core.study.case import Case
from flat_planner_ros.core.study.playing import check_end
from flat_planner_ros.core.tracking import TrackedMotion, Tracker, TrackerSettings, TrackerStack
import numpy as np

ROUNDING = 1e-6
"""Share of a step by which a time may miss the grid [-]."""

TOGETHER = 64
"""Motions that go side by side: as many again would hardly be faster, and need more memory."""

LOOPS_KEPT = 64
"""Models and loops whose gains a process remembers."""


class _Grid(NamedTuple):
    """
    When samples come and efforts act.

    Attributes
    ----------
    step
        Of the plant [s].
    per_period, late
        Steps between two samples, and until an effort acts.

    """

    step: float
    per_period: int
    late: int


@dataclass(frozen=True)
class _Model:
    """
    A model, equal to others with the same numbers.

    Attributes
    ----------
    arm
        The model.
    numbers
        All of it.

    """

    arm: PlanarArm = field(compare=False)
    numbers: tuple[bytes, ...]

    @classmethod
    def of(cls, arm: PlanarArm) -> '_Model':
        """Return a model."""
        values = (getattr(arm, each.name) for each in fields(arm))
        return cls(arm, tuple(np.asarray(value).tobytes() for value in values))


def tracked_ends(
    cases: Sequence[Case], motions: Sequence[PlanSamples], checked: Sequence[bool]
) -> list[States | FlatPlannerError]:
    """
    Return the states of the true arms when motions that trackers carry out end.

    Parameters
    ----------
    cases
        Of one template with a tracker, whose model is the planner's. It sees every angle as it is.
    motions
        One for each.
    checked
        Which of those that go side by side go again by themselves.

    Returns
    -------
    list
        One state for each, or why there is none.

    Raises
    ------
    PlantDisagrees
        A motion by itself comes to another result.

    """
    ends: dict[int, States | FlatPlannerError] = {}
    for places in _side_by_side(cases):
        found = _together([cases[place] for place in places], [motions[p] for p in places])
        for place, end in zip(places, found, strict=True):
            if end is not None:
                ends[place] = end
                if checked[place] and isinstance(end, States):
                    check_end(cases[place], tracked_end(cases[place], motions[place]), end)
    for place, (case, motion) in enumerate(zip(cases, motions, strict=True)):
        if place not in ends:
            try:
                ends[place] = tracked_end(case, motion)
            except FlatPlannerError as error:
                ends[place] = error
    return [ends[place] for place in range(len(cases))]


def tracked_end(case: Case, samples: PlanSamples) -> States:
    """
    Return the state of the true arm at the end of a motion that a tracker carries out.

    Parameters
    ----------
    case
        With a tracker, whose model is the planner's. It sees every angle as it is.
    samples
        The motion.

    Raises
    ------
    InvalidStudy
        Servos move the arm, which take no efforts.
    UncertifiedLoop
        There is no such tracker.

    """
    if case.tracker is None or case.drive is Drive.POSITION:
        raise InvalidStudy('a tracker gives efforts, and servos take positions')
    settings, period, grid = case.tracker, case.tracker.period, _grid(case, case.tracker)
    tracker, last = Tracker(case.settings.arm, settings), _periods(samples, period)
    step = grid.step
    arm = SimulatedArm(case.true, position=case.start, time=-period, step=step, drives=case.drives)
    tracker.hear(_seen(arm), arm.time)
    tracker.follow(_motion(samples), arm.time)
    coming: deque[tuple[int, FloatArray]] = deque()
    for index in range(last):
        arm.advance((index + ROUNDING) * period)
        efforts = tracker.hear(_seen(arm), arm.time)
        now = index * grid.per_period
        if efforts is not None:
            coming.append((now + grid.late, efforts))
        while coming and coming[0][0] < now + grid.per_period:
            acts, efforts = coming.popleft()
            arm.advance((acts + ROUNDING) * step)
            arm.hold(efforts)
    arm.advance((last + ROUNDING) * period)
    return States(arm.position[None], arm.velocity[None])


def _side_by_side(cases: Sequence[Case]) -> Iterable[list[int]]:
    """Return which cases may go side by side, some at a time."""
    case = cases[0]
    is_plain = replace(case.drives, servo_bandwidth=0.0) == DriveSettings()
    if case.true.n != 2 or not is_plain or case.tracker is None or not case.tracker.hold:
        return
    models: dict[_Model, list[int]] = {}
    for place, each in enumerate(cases):
        if each.true.is_linear:
            models.setdefault(_Model.of(each.settings.arm), []).append(place)
    for places in models.values():
        yield from (places[k : k + TOGETHER] for k in range(0, len(places), TOGETHER))


@lru_cache(maxsize=LOOPS_KEPT)
def _loop(model: _Model, settings: TrackerSettings) -> TrackerStack:
    """Return trackers of a model."""
    return TrackerStack(model.arm, settings)


def _together(
    cases: Sequence[Case], motions: Sequence[PlanSamples]
) -> Sequence[States | FlatPlannerError | None]:
    """Return the ends of motions side by side, None where a tracker does more than track."""
    settings = cases[0].tracker
    assert settings is not None
    try:
        loop = _loop(_Model.of(cases[0].settings.arm), settings)
    except FlatPlannerError as error:
        return [error] * len(cases)
    grid, period = _grid(cases[0], settings), settings.period
    last = np.array([_periods(samples, period) for samples in motions])
    loop.begin([_motion(samples) for samples in motions], int(last.max()))
    arms = ArmStack.of([case.true for case in cases])
    whole, rest = divmod(grid.late, grid.per_period)
    before = held_steps(arms, rest * grid.step)
    after = held_steps(arms, (grid.per_period - rest) * grid.step)
    state = np.zeros((4, len(cases)))
    state[:2] = np.column_stack([case.start for case in cases])
    coming = deque([np.zeros(len(cases))] * (whole + 1), maxlen=whole + 2)
    ends, has_left = np.empty_like(state), np.zeros(len(cases), dtype=bool)
    for index in range(1, int(last.max()) + 1):
        with np.errstate(over='ignore', invalid='ignore'):  # of arms that run away
            coming.append(loop.hear(state[:2]))
            for (transition, effect), effort in ((before, coming[0]), (after, coming[1])):
                state = (transition * state[None]).sum(axis=1) + effect * effort
        is_over = last == index
        ends[:, is_over], has_left[is_over] = state[:, is_over], loop.has_left[is_over]
    return [
        None if left else States(end[None, :2], end[None, 2:])
        for end, left in zip(ends.T, has_left.tolist(), strict=True)
    ]


def _grid(case: Case, settings: TrackerSettings) -> _Grid:
    """Return a grid on which efforts can come as late as they do."""
    period = settings.period
    steps = ceil(period / min(case.step, settings.delay or case.step) - ROUNDING)
    return _Grid(period / steps, steps, round(settings.delay * steps / period))


def _periods(samples: PlanSamples, period: float) -> int:
    """Return the number of the first joint sample at or after the end of a motion."""
    return max(1, ceil(float(samples.times[-1]) / period - ROUNDING))


def _motion(samples: PlanSamples) -> TrackedMotion:
    """Return a motion as trackers follow it."""
    return TrackedMotion(
        start=0.0,
        times=samples.times,
        positions=samples.positions,
        velocities=samples.velocities,
        accelerations=samples.accelerations,
    )


def _seen(arm: SimulatedArm) -> JointSample:
    """Return the angles as sensors without errors show them."""
    return JointSample(time=arm.time, positions=locked(np.asarray(arm.position)))
