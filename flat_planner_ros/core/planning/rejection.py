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

"""Rejection: the refusal of a request, with its reason and numbers (docs/interfaces.md)."""

from enum import Enum

from flat_planner_ros.core.arm import FlatPlannerError


class Reason(Enum):
    """Why a request is rejected; the names are those of the ROS interface."""

    INVALID_GOAL = 'INVALID_GOAL'
    INVALID_JOINTS = 'INVALID_JOINTS'
    OLD_HEADER_TIMESTAMP = 'OLD_HEADER_TIMESTAMP'
    EMPTY_GOAL = 'EMPTY_GOAL'
    NON_FINITE = 'NON_FINITE'
    SIZE_MISMATCH = 'SIZE_MISMATCH'
    TIME_NOT_INCREASING = 'TIME_NOT_INCREASING'
    NONZERO_END_STATE = 'NONZERO_END_STATE'
    PASSIVE_JOINT_NOT_ZERO = 'PASSIVE_JOINT_NOT_ZERO'
    EFFORT_NOT_ALLOWED = 'EFFORT_NOT_ALLOWED'
    POSITION_LIMIT = 'POSITION_LIMIT'
    VELOCITY_LIMIT = 'VELOCITY_LIMIT'
    EFFORT_LIMIT = 'EFFORT_LIMIT'
    DURATION_OUT_OF_RANGE = 'DURATION_OUT_OF_RANGE'
    START_STATE_UNKNOWN = 'START_STATE_UNKNOWN'
    START_STATE_STALE = 'START_STATE_STALE'
    START_STATE_MISMATCH = 'START_STATE_MISMATCH'
    NOT_AT_REST = 'NOT_AT_REST'
    SOLVER_FAILED = 'SOLVER_FAILED'
    ILL_CONDITIONED = 'ILL_CONDITIONED'
    BUSY = 'BUSY'
    INTERNAL = 'INTERNAL'


class RequestRejected(FlatPlannerError):
    """
    A request that is answered with a refusal.

    Attributes
    ----------
    reason
        The rule that it breaks.
    joint
        The joint concerned, if one is.
    value, limit
        What was found and what is allowed, in SI units, where the rule has numbers.
    time
        Where in the motion [s], if it matters.
    duration_min
        Shortest duration that would be accepted, where that is the remedy [s].

    """

    def __init__(
        self,
        reason: Reason,
        message: str,
        *,
        joint: str | None = None,
        value: float | None = None,
        limit: float | None = None,
        time: float | None = None,
        duration_min: float | None = None,
    ) -> None:
        """Keep the numbers apart from the sentence."""
        super().__init__(message)
        self.reason = reason
        self.joint = joint
        self.value = value
        self.limit = limit
        self.time = time
        self.duration_min = duration_min
