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
Serialised goals, read without a message: building one takes longer than to plan a known motion.

Whatever is not exactly of the usual form is left to the middleware.
"""

from struct import unpack_from

from flat_planner_ros.core.session import Goal, GoalPoint, MAX_POINTS
from flat_planner_ros.ros.wire.cdr_front import Front, Unusual
from flat_planner_ros.ros.wire.point_writer import ARRAYS


def read_goal(data: bytes) -> Goal | None:
    """
    Return the goal that a serialised trajectory states; None if only the middleware can tell.

    Parameters
    ----------
    data
        A trajectory_msgs/JointTrajectory with its encapsulation, as in `read_points`; its points
        may have arrays of any lengths.

    """
    try:
        front = Front(data)
        stamp, names, count = front.trajectory()
        if count > MAX_POINTS:
            return None
        points = tuple([_point(front, data) for _ in range(count)])
    except Unusual:
        return None
    return Goal(joint_names=names, points=points, stamp=stamp or None)


def _point(front: Front, data: bytes) -> GoalPoint:
    """Return the point that comes next."""
    positions, velocities, accelerations, effort = (
        unpack_from(f'{front.order}{width}d', data, begin)
        for begin, width in front.numbers(ARRAYS)
    )
    return GoalPoint(
        time=front.stamp(),
        positions=positions,
        velocities=velocities,
        accelerations=accelerations,
        effort=effort,
    )
