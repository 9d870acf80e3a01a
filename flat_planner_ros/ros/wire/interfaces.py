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

"""Names and qualities of service of everything that crosses the graph (docs/interfaces.md)."""

from flat_planner_ros.core.planning import Reason
from rclpy.qos import (
    DurabilityPolicy,
    qos_profile_sensor_data,
    QoSProfile,
    ReliabilityPolicy,
)

PLANNER = 'flat_planner'
PLANT = 'flat_plant'
MONITOR = 'flat_monitor'
TRACKER = 'flat_tracker'
LIVE_VIEW = 'flat_live_view'
RECORDER = 'flat_recorder'

JOINT_STATES = 'joint_states'
CLOCK = '/clock'
DIAGNOSTICS = '/diagnostics'

GOAL = '~/goal'
GOAL_STATE = '~/goal_state'
COMMAND = '~/joint_trajectory'
EFFORT_COMMANDS = '~/effort_commands'
PLAN = '~/plan'
FLAT_PLAN = '~/flat_plan'
REFERENCE = '~/reference'
STATUS = '~/status'
REPLAN = '~/replan'
STOP = '~/stop'
FOLLOW = '~/follow_joint_trajectory'
SETTLE = '~/settle'
ADOPT = '~/adopt_estimate'
SAVE = '~/save_model'

RESET = '~/reset'
PUSH = '~/push'
RELEASE = '~/release'
RESIDUAL = '~/residual'
REPORT = '~/report'
MODEL_DRIFT = '~/model_drift'

STATUS_NAME = 'flat_planner: goal'
MODEL_NAME = 'flat_planner: model'
REPORT_NAME = 'flat_monitor: residual oscillation'
DRIFT_NAME = 'flat_monitor: model drift'
TRACKER_NAME = 'flat_tracker: tracking'

RELIABLE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
"""Goals, commands and joint states: nothing is lost, nothing is kept for latecomers."""

BURST = QoSProfile(depth=256, reliability=ReliabilityPolicy.RELIABLE)
"""Goals as the planner hears them: as many may wait for their verdicts."""

LATCHED = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""The last plan or report, also for those who come later."""

LATCHED_HISTORY = QoSProfile(
    depth=10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""The last verdicts, also for those who come later."""

VERDICTS = QoSProfile(
    depth=2 * BURST.depth,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""
Verdicts as the planner gives them: none is lost of as many goals as may wait at once.

A goal has two where the next one takes its place.
"""

SENSOR_DATA = qos_profile_sensor_data
"""Measurements: the newest counts; also hears best-effort publishers."""

ERROR_CODES = {
    Reason.INVALID_GOAL: -1,
    Reason.INVALID_JOINTS: -2,
    Reason.OLD_HEADER_TIMESTAMP: -3,
    Reason.PATH_TOLERANCE_VIOLATED: -4,
    Reason.GOAL_TOLERANCE_VIOLATED: -5,
    Reason.EMPTY_GOAL: -101,
    Reason.NON_FINITE: -102,
    Reason.SIZE_MISMATCH: -103,
    Reason.TIME_NOT_INCREASING: -104,
    Reason.NONZERO_END_STATE: -105,
    Reason.PASSIVE_JOINT_NOT_ZERO: -106,
    Reason.EFFORT_NOT_ALLOWED: -107,
    Reason.POSITION_LIMIT: -110,
    Reason.VELOCITY_LIMIT: -111,
    Reason.EFFORT_LIMIT: -112,
    Reason.DURATION_OUT_OF_RANGE: -113,
    Reason.START_STATE_UNKNOWN: -120,
    Reason.START_STATE_STALE: -121,
    Reason.START_STATE_MISMATCH: -122,
    Reason.NOT_AT_REST: -123,
    Reason.CLOCK_JUMPED: -124,
    Reason.CONTROLLER_FAILED: -125,
    Reason.SOLVER_FAILED: -130,
    Reason.ILL_CONDITIONED: -131,
    Reason.BUSY: -140,
    Reason.INTERNAL: -199,
}
"""Codes in `~/status`; -1 to -5 as in control_msgs/FollowJointTrajectory."""


def topic_of(node: str, topic: str) -> str:
    """Return the name by which another node of ours finds a private topic."""
    return topic.replace('~', node, 1)
