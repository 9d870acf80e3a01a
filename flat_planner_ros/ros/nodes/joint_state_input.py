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

"""Joint states as nodes hear them: samples for the core, and the rest for the log."""

from collections.abc import Callable

from flat_planner_ros.core.arm import FlatPlannerError, JointSample
from flat_planner_ros.ros.nodes.graph_watch import GraphWatch
from flat_planner_ros.ros.nodes.node_log import NodeLog
from flat_planner_ros.ros.wire.joint_states import JointStateReader
from sensor_msgs.msg import JointState

WARNING_PERIOD = 5.0
"""Shortest time between two warnings about the same input [s]."""


class JointStateInput:
    """
    Reads joint states for a node, and says what is remarkable about them.

    Parameters
    ----------
    log
        Of the node.
    watch
        Is told of joint states that are about other joints, too.
    now
        Returns the node's time [s].

    """

    def __init__(self, log: NodeLog, watch: GraphWatch, now: Callable[[], float]) -> None:
        self._log = log
        self._watch = watch
        self._now = now

    def samples(self, reader: JointStateReader, msg: JointState) -> list[JointSample]:
        """Return the samples that a message completes; none where it cannot be read."""
        try:
            samples = reader.read(msg, self._now)
        except FlatPlannerError as error:
            self._watch.heard_other_part()
            self._log.warning(f'joint state ignored: {error}', WARNING_PERIOD)
            return []
        if reader.is_in_parts:
            self._watch.heard_other_part()
        if reader.has_remarks:
            for remark in reader.take_remarks():
                self._log.warning(remark)
        return samples
