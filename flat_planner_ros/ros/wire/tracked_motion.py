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

"""The planner's command as a motion for the feedback of all joints."""

from collections.abc import Sequence

from flat_planner_ros.core.arm import InvalidCommand, InvalidRequest
from flat_planner_ros.core.monitor import joint_indices
from flat_planner_ros.core.tracking import TrackedMotion
from flat_planner_ros.ros.wire.point_reader import PointTable


def tracked_motion(points: PointTable, joints: Sequence[str], now: float) -> TrackedMotion:
    """
    Return the motion that a trajectory states, for the feedback of all joints.

    Parameters
    ----------
    points
        All joints in any order, with velocities; efforts are not used. Stamp 0 means now.
    joints
        The arm's joints, the passive one last.
    now
        Present time [s].

    Raises
    ------
    InvalidCommand
        A joint or its velocities are missing, or it is no motion to rest.

    """
    names = list(points.joint_names)
    if sorted(names) != sorted(joints):
        raise InvalidCommand(
            f'joints are {names}, expected {list(joints)}: tracking needs all of them '
            '(command.include_passive_joint of the planner)'
        )
    order = joint_indices(names, joints)
    try:
        positions, velocities = points.table('positions'), points.table('velocities')
        accelerations = points.optional_table('accelerations')
    except InvalidRequest as error:
        raise InvalidCommand(str(error)) from error
    return TrackedMotion(
        start=points.stamp or now,
        times=points.times,
        positions=positions[:, order],
        velocities=velocities[:, order],
        accelerations=None if accelerations is None else accelerations[:, order],
    )
