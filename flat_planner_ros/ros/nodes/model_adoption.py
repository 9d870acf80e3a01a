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

"""Adoption of estimates: what the monitor finds into a planner's parameters."""

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.core.monitor import AdoptionRefused, ModelTuner
from flat_planner_ros.ros.nodes.node_log import NodeLog
from flat_planner_ros.ros.parameters.arm_model import model_parameters
from flat_planner_ros.ros.parameters.planner import PlannerSettings
from flat_planner_ros.ros.wire import estimates, interfaces
from rclpy.node import Node
from std_srvs.srv import Trigger


class ModelAdoption:
    """
    Hears the monitor's reports and adopts an estimate when asked to, or by itself.

    Parameters
    ----------
    node, log
        Node whose parameters are set, and where it says what is ignored.
    settings
        Returns the settings in force.
    last_start
        Returns the absolute start of what was sent last [s], None before the first motion.
    announce
        Publishes a status.

    """

    def __init__(
        self,
        node: Node,
        log: NodeLog,
        settings: Callable[[], PlannerSettings],
        last_start: Callable[[], float | None],
        announce: Callable[[DiagnosticStatus], None],
    ) -> None:
        self._node = node
        self._log = log
        self._settings = settings
        self._last_start = last_start
        self._announce = announce
        self._tuner = ModelTuner()
        report = interfaces.topic_of(interfaces.MONITOR, interfaces.REPORT)
        node.create_subscription(DiagnosticArray, report, self._on_report, interfaces.LATCHED)
        node.create_service(Trigger, interfaces.ADOPT, self._on_adopt)

    def _on_report(self, msg: DiagnosticArray) -> None:
        """Keep an estimate, and adopt it at once if it follows the own last motion and may be."""
        try:
            estimate = estimates.reported_estimate(msg)
        except FlatPlannerError as error:
            self._log.warning(f'report ignored: {error}')
            return
        if estimate is None:
            return
        self._tuner.hear(estimate)
        start = self._last_start()
        if self._settings().auto_tune and start is not None and estimate.is_of_motion(start):
            try:
                self._adopt()
            except AdoptionRefused as refusal:
                self._log.info(f'auto_tune: {refusal}')

    def _on_adopt(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Adopt the last trustworthy estimate."""
        try:
            response.message = self._adopt().message
            response.success = True
        except AdoptionRefused as refusal:
            response.message = str(refusal)
            response.success = False
        return response

    def _adopt(self) -> DiagnosticStatus:
        """Set the parameters of the model to the last estimate, for the next plan."""
        session = self._settings().session
        adoption = self._tuner.propose(session.arm, session.joints[-1])
        changed = model_parameters(self._node, adoption.arm, adoption.former)
        result = self._node.set_parameters_atomically(changed)
        if not result.successful:
            raise AdoptionRefused(f'the parameters refuse the estimate: {result.reason}')
        self._tuner.mark_adopted(adoption)
        status = estimates.adopted_status(adoption)
        self._announce(status)
        return status
