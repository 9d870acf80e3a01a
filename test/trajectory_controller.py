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
What joint_trajectory_controller of ROS 2 Jazzy (ros2_controllers 4.42) asks of a trajectory.

`REFUSALS` are the checks after which it drops a message, in its order; `PRECAUTIONS` are what it
takes for granted, where a message that breaks the rule is played wrongly or worse.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from trajectory_msgs.msg import JointTrajectory

FIELDS = ('positions', 'velocities', 'accelerations', 'effort')

INTERFACES = ('position', 'velocity', 'acceleration', 'effort')


@dataclass(frozen=True, kw_only=True)
class Controller:
    """The parameters that the checks depend on, with the controller's defaults."""

    joints: Sequence[str]
    command_interfaces: Sequence[str]
    state_interfaces: Sequence[str]
    command_joints: Sequence[str] = ()
    allow_partial_joints_goal: bool = False
    allow_nonzero_velocity_at_trajectory_end: bool = False
    allow_integration_in_goal_trajectories: bool = False
    has_weight: bool = False  # of the arm: the last effort holds it

    @classmethod
    def of(cls, parameters: Mapping[str, Any]) -> 'Controller':
        """Return what a parameter file says."""
        known = cls.__dataclass_fields__
        return cls(**{name: value for name, value in parameters.items() if name in known})

    def faults(self) -> list[str]:
        """Return what keeps the controller from being configured."""
        commands, states = set(self.command_interfaces), set(self.state_interfaces)
        joints, driven = set(self.joints), set(self.command_joints)
        with_effort = ({'effort'}, {'effort', 'position'})
        orders = [set(INTERFACES[:count]) for count in (1, 2, 3)]
        rules = {
            'joints must be unique and at least one': len(joints) == len(self.joints) > 0,
            'command_joints must be a subset of joints': driven <= joints,
            'command_interfaces must be known': commands and commands <= set(INTERFACES),
            'velocity goes alone or with position': 'velocity' not in commands
            or len(commands) == 1
            or 'position' in commands,
            'acceleration needs velocity or position': 'acceleration' not in commands
            or commands & {'velocity', 'position'},
            'effort goes alone or with position': 'effort' not in commands
            or commands in with_effort,
            'effort or velocity alone need both states': commands
            not in (*with_effort, {'velocity'})
            or states >= {'position', 'velocity'},
            'states go position, velocity, acceleration': states in orders,
        }
        return [rule for rule, holds in rules.items() if not holds]


class Rule(NamedTuple):
    """A rule, why it is there, and the check: controller, message, present time [s]."""

    name: str
    reason: str
    holds: Callable[[Controller, JointTrajectory, float], bool]


def seconds(time: Any) -> float:
    """Return a stamp or a duration [s]."""
    return time.sec + 1e-9 * time.nanosec


def nanoseconds(time: Any) -> int:
    """Return a stamp or a duration [ns]."""
    return time.sec * 1_000_000_000 + time.nanosec


def _fits(msg: JointTrajectory, field: str, *, or_empty: bool) -> bool:
    """Return whether every point has an entry of a field for each joint, or none."""
    sizes = {len(getattr(point, field)) for point in msg.points}
    return sizes <= ({len(msg.joint_names), 0} if or_empty else {len(msg.joint_names)})


def _has_motion(controller: Controller, msg: JointTrajectory) -> bool:
    """Return whether positions are there, or what the controller may integrate."""
    if not controller.allow_integration_in_goal_trajectories:
        return _fits(msg, 'positions', or_empty=False)
    return _fits(msg, 'positions', or_empty=True) and all(
        len(p.positions) or len(p.velocities) or len(p.accelerations) for p in msg.points
    )


def _ends_slowly(controller: Controller, msg: JointTrajectory) -> bool:
    """Return whether the last velocities count as zero."""
    if controller.allow_nonzero_velocity_at_trajectory_end:
        return True
    return bool(np.all(np.abs(msg.points[-1].velocities) <= np.finfo(np.float32).eps))


def _ends_later(msg: JointTrajectory, now: float) -> bool:
    """Return whether the end is still to come; a stamp of zero means on arrival."""
    start = nanoseconds(msg.header.stamp)
    return start == 0 or start + nanoseconds(msg.points[-1].time_from_start) >= round(now * 1e9)


def _times(msg: JointTrajectory) -> list[int]:
    """Return the times of the points [ns]."""
    return [nanoseconds(point.time_from_start) for point in msg.points]


def _arrays(msg: JointTrajectory) -> list[Sequence[float]]:
    """Return all arrays of all points."""
    return [getattr(point, field) for point in msg.points for field in FIELDS]


REFUSALS = (
    Rule(
        'all joints',
        'without allow_partial_joints_goal the message must have as many joints as the controller',
        lambda c, m, now: c.allow_partial_joints_goal or len(m.joint_names) == len(c.joints),
    ),
    Rule('some joints', 'joint_names must not be empty', lambda c, m, now: bool(m.joint_names)),
    Rule('some points', 'points must not be empty', lambda c, m, now: bool(m.points)),
    Rule(
        'known joints',
        "each joint must be one of the controller's",
        lambda c, m, now: set(m.joint_names) <= set(c.joints),
    ),
    Rule(
        'rest at the end',
        'velocities of the last point beyond the epsilon of a float are refused',
        lambda c, m, now: _ends_slowly(c, m),
    ),
    Rule(
        'end in the future',
        'a stamped trajectory that has ended already is refused',
        lambda c, m, now: _ends_later(m, now),
    ),
    Rule(
        'increasing times',
        'time_from_start must increase strictly, in whole nanoseconds',
        lambda c, m, now: all(a < b for a, b in pairwise(_times(m))),
    ),
    Rule(
        'positions',
        'each point needs a position for each joint, unless the controller integrates',
        lambda c, m, now: _has_motion(c, m),
    ),
    Rule(
        'velocities',
        'velocities are as many as joints, or none',
        lambda c, m, now: _fits(m, 'velocities', or_empty=True),
    ),
    Rule(
        'accelerations',
        'accelerations are as many as joints, or none',
        lambda c, m, now: _fits(m, 'accelerations', or_empty=True),
    ),
    Rule(
        'effort interface',
        'efforts are refused by a controller without effort interface',
        lambda c, m, now: (
            'effort' in c.command_interfaces or not any(len(p.effort) for p in m.points)
        ),
    ),
)
"""After any of these the controller drops the message, with an error in its log."""

PRECAUTIONS = (
    Rule(
        'unique joints',
        'a joint named twice passes the check of names, but leaves another one without values',
        lambda c, m, now: len(set(m.joint_names)) == len(m.joint_names),
    ),
    Rule(
        'effort size',
        'the size of effort is not checked, yet one entry per joint is read',
        lambda c, m, now: _fits(m, 'effort', or_empty=True),
    ),
    Rule(
        'same fields',
        'the degree of a segment follows from the fields that both its points have',
        lambda c, m, now: (
            len({tuple(len(getattr(p, field)) for field in FIELDS) for p in m.points}) <= 1
        ),
    ),
    Rule(
        'finite',
        'a NaN goes straight to the hardware',
        lambda c, m, now: all(isfinite(x) for array in _arrays(m) for x in array),
    ),
    Rule(
        'first point at the start',
        'before a first point later than the stamp the controller fills in a spline of its own',
        lambda c, m, now: _times(m)[:1] == [0],
    ),
    Rule(
        'nothing left at the end',
        'the last point is held: an effort or acceleration in it would act for ever',
        lambda c, m, now: (
            not np.any(m.points[-1].accelerations)
            and (c.has_weight or not np.any(m.points[-1].effort))
        ),
    ),
    Rule(
        'no effort for a joint without motor',
        'only command_joints are driven; what is asked of others would be lost',
        lambda c, m, now: (
            not any(
                effort
                for point in m.points
                for name, effort in zip(m.joint_names, point.effort, strict=False)
                if name not in (c.command_joints or c.joints)
            )
        ),
    ),
    Rule(
        'dense enough for linear effort',
        'effort is joined by straight lines: beyond 10 ms they are not the planned course',
        lambda c, m, now: max(np.diff(_times(m)), default=0) <= 10_000_000,
    ),
)
"""Nothing of this is checked by the controller, all of it is needed."""


def broken(controller: Controller, msg: JointTrajectory, now: float) -> list[str]:
    """Return the names of all rules that a message breaks."""
    has_both = bool(msg.points and msg.joint_names)
    rules = (*REFUSALS, *PRECAUTIONS) if has_both else REFUSALS[:3]
    return [rule.name for rule in rules if not rule.holds(controller, msg, now)]
