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

"""Whether a motion has brought the joints where it should have."""

from typing import NamedTuple

from flat_planner_ros.core.monitor.course import Course
from flat_planner_ros.core.monitor.motion_record import PlannedMotion
from flat_planner_ros.core.monitor.settings import Level, MonitorSettings

OFF = 2.0
"""Error of a joint that was to go no way worth a comparison, relative to that way [-]."""


class Arrival(NamedTuple):
    """Level of what the joints have missed, and a clause on it, empty if they have arrived."""

    level: Level
    remark: str


def judge_arrival(
    motion: PlannedMotion,
    final_error: tuple[float, ...],
    course: Course | None,
    settings: MonitorSettings,
) -> Arrival:
    """
    Judge where the joints have come to and how.

    Parameters
    ----------
    motion
        The motion.
    final_error
        Measured minus final position of the joints to be judged [rad], the first ones of the
        motion; fewer where less is known.
    course
        How it was carried out, ``None`` if too little of it was seen.
    settings
        Bounds of the final error.

    """
    if course is not None and course.is_in_degrees:
        return Arrival(Level.ERROR, course.remark)
    levels = [_level(abs(error), settings) for error in final_error]
    remarks = [
        _missed(motion, joint, final_error[joint], settings)
        for joint, level in enumerate(levels)
        if level is not Level.OK
    ]
    if course is not None and course.remark:
        is_severe = course.is_still and course.planned > settings.final_error
        levels.append(Level.ERROR if is_severe else Level.WARN)
        remarks.insert(0, course.remark)
    return Arrival(Level.worst(levels), '; '.join(remarks))


def _level(error: float, settings: MonitorSettings) -> Level:
    """Return how severe a final error is [rad]."""
    if error <= settings.final_ok:
        return Level.OK
    return Level.WARN if error <= settings.final_error else Level.ERROR


def _missed(motion: PlannedMotion, joint: int, error: float, settings: MonitorSettings) -> str:
    """Return by how much a joint has missed its goal, and what share of its way it went."""
    name = motion.joint_names[joint]
    is_error = abs(error) > settings.final_error
    bound = f'above {settings.final_error if is_error else settings.final_ok:.3g} rad'
    way = float(motion.positions[-1, joint] - motion.positions[0, joint])
    if abs(error) > OFF * abs(way):
        return f'{name} is {abs(error):.3g} rad off its goal, {bound}'
    side = 'short of' if error * way < 0.0 else 'beyond'
    return (
        f'{name} stopped {abs(error):.3g} rad {side} its goal, {bound}: it travelled '
        f'{1.0 + error / way:.3g} of the planned {abs(way):.3g} rad'
    )
