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

"""One goal of an arm at rest that nobody executes, as `flat_plan` and studies ask for it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from flat_planner_ros.core.arm import InvalidRequest
from flat_planner_ros.core.session.goal import Goal, GoalPoint
from flat_planner_ros.core.session.session import PlannerSession
from flat_planner_ros.core.session.settings import SessionSettings, StartSource


def single_goal(
    settings: SessionSettings, poses: Sequence[Mapping[str, float]], times: Sequence[float]
) -> tuple[PlannerSession, Goal]:
    """
    Return a planner at rest at the first of some poses, and the goal that leads through the rest.

    Parameters
    ----------
    settings
        Of the planner; where motions start does not matter.
    poses
        Start, via points and final pose: angles by joint, of all joints at the start [rad].
    times
        When all but the first are passed [s], the last one the duration; zeros for the planner to
        choose.

    Raises
    ------
    InvalidRequest
        Some via points have times and others do not.

    """
    start, *passed = poses
    *between, duration = times
    is_timed = any(between)
    if is_timed and not all(times):
        raise InvalidRequest(
            f'via points at {list(between)} s of a motion of {duration:g} s: give each of them a '
            'time, and a duration, or none a time'
        )
    chosen = replace(
        settings,
        start_source=StartSource.PARAMETER,
        start_position=tuple(start[name] for name in settings.joints),
        execute=False,
    )
    if between and not is_timed:
        # The planner chooses when the points are passed; that is asked for without any time.
        chosen = replace(chosen, default_duration=duration or settings.default_duration)
        duration = 0.0
    names = tuple(passed[-1])
    points = tuple(
        GoalPoint(time=time, positions=tuple(pose.get(name, 0.0) for name in names))
        for pose, time in zip(passed, [*between, duration], strict=True)
    )
    return PlannerSession(chosen), Goal(joint_names=names, points=points)
