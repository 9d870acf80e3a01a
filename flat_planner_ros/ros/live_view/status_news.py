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

"""Verdicts, reports and the tracker's state as the page shows them."""

from collections import deque
from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flat_planner_ros.ros.live_view.feed import Feed
from flat_planner_ros.ros.wire import stamps
from rclpy.task import Future

VERDICTS = 20
"""Verdicts that are kept, and goals that wait for theirs [-]."""

ANSWERS = ('ACCEPTED', 'REJECTED')
"""States of verdicts on goals."""

SHOWN_VALUES = (
    'plan_id',
    'start_time',
    'predicted_residual',
    'predicted_residual_worst',
    'predicted_residual_box',
    'predicted_miss_worst',
    'advice',
    'goal.joint_names',
    'goal.positions',
    'goal.time_from_start',
)
"""What of a verdict's values the page shows."""

TEXT_LIMIT = 500
"""Longest text of a message that is shown [characters]."""

LEVELS = {
    DiagnosticStatus.OK: 'ok',
    DiagnosticStatus.WARN: 'warn',
    DiagnosticStatus.ERROR: 'error',
    DiagnosticStatus.STALE: 'stale',
}


class Verdicts:
    """
    The last verdicts, and the goals from browsers that wait for theirs.

    Parameters
    ----------
    feed
        Is told of them.

    """

    def __init__(self, feed: Feed) -> None:
        self._feed = feed
        self._known: deque[dict[str, Any]] = deque(maxlen=VERDICTS)
        self._sent: deque[tuple[str, Future]] = deque(maxlen=VERDICTS)

    def expect(self, positions: str) -> Future:
        """Return what will be the verdict on a goal that is sent now, by its final pose."""
        verdict: Future = Future()
        self._sent.append((positions, verdict))
        return verdict

    def hear(self, msg: DiagnosticArray) -> None:
        """Tell verdicts."""
        for status in msg.status:
            values = values_of(status)
            self._known.appendleft(
                {
                    'time': stamps.seconds(msg.header.stamp),
                    'level': LEVELS.get(status.level, 'stale'),
                    'state': values.get('state', ''),
                    'text': status.message[:TEXT_LIMIT],
                    'values': {key: values[key] for key in SHOWN_VALUES if key in values},
                }
            )
            self._answer(values, status.message)
        self._feed.put('verdicts', list(self._known))

    def _answer(self, values: Mapping[str, str], message: str) -> None:
        """Tell the browser whose goal a verdict is on, the first of those who sent the same."""
        state, positions = values.get('state'), values.get('goal.positions')
        if state not in ANSWERS:
            return
        for sent in self._sent:
            if sent[0] == positions:
                self._sent.remove(sent)
                is_accepted = state == ANSWERS[0]
                sent[1].set_result(
                    (is_accepted, message if is_accepted else f'rejected: {message}')
                )
                return


def state_of(status: DiagnosticStatus) -> dict[str, Any]:
    """Return level, sentence and values of a status."""
    return {
        'level': LEVELS.get(status.level, 'stale'),
        'text': status.message[:TEXT_LIMIT],
        'values': values_of(status),
    }


def values_of(status: DiagnosticStatus) -> dict[str, str]:
    """Return the values of a status."""
    return {pair.key: pair.value[:TEXT_LIMIT] for pair in status.values}
