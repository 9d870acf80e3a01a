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

"""What a tracker says of itself on `/diagnostics`, and how its namespace hears it."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flat_planner_ros.core.monitor import FeedbackTimes
from flat_planner_ros.core.tracking import Phase, Tracker
from flat_planner_ros.ros.wire import stamps
from flat_planner_ros.ros.wire.diagnostics import status_of, Values
from flat_planner_ros.ros.wire.interfaces import TRACKER_NAME
from flat_planner_ros.ros.wire.status_writer import Status
from flat_planner_ros.ros.wire.verdict_text import values_of


def tracker_status(tracker: Tracker, fault: str, seniority: str) -> Status:
    """
    Return the present state of a tracker.

    Parameters
    ----------
    tracker
        What it does, its certificate, and how late it is.
    fault
        Why tracking was given up last, until the next command; empty if it was not.
    seniority
        Which efforts it sends, and since when it lives.

    """
    phase, certificate, ages = tracker.phase.value, tracker.certificate, tracker.ages
    error = tracker.error if tracker.phase is Phase.TRACKING else None
    values: Values = {
        'phase': phase,
        'error': error,
        'decay_rate': certificate.decay_rate,
        'margin': certificate.margin,
        'bandwidth': certificate.bandwidth,
        'most_late': certificate.late,
        'age': ages.mean,
        'oldest': ages.oldest,
        'unanswered': ages.unanswered,
        'seniority': seniority,
    }
    if fault:
        return status_of(TRACKER_NAME, DiagnosticStatus.ERROR, f'{phase}; {fault}', values)
    message = phase if error is None else f'{phase}, {error:.3g} rad from the plan'
    return status_of(TRACKER_NAME, DiagnosticStatus.OK, message, values)


def tracker_of(msg: DiagnosticArray, namespace: str) -> DiagnosticStatus | None:
    """Return the state of a namespace's tracker, None where a message is of something else."""
    for status in msg.status:
        if status.name != TRACKER_NAME:
            continue
        home, _, node = status.hardware_id.rpartition('/')
        if not node or home == namespace.rstrip('/'):
            return status
    return None


def hear_tracker(msg: DiagnosticArray, namespace: str, feedback: FeedbackTimes) -> None:
    """Note whether a namespace's tracker acts, if it is a tracker that speaks."""
    status = tracker_of(msg, namespace)
    if status is not None:
        values = values_of(status)
        feedback.hear(
            stamps.seconds(msg.header.stamp),
            is_active=values.get('phase', Phase.IDLE.value) != Phase.IDLE.value,
            sender=values.get('seniority', ''),
        )
