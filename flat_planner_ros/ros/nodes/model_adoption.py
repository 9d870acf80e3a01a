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
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.core.monitor import AdoptionRefused, ModelTuner
from flat_planner_ros.ros.nodes.node_log import NodeLog
from flat_planner_ros.ros.parameters.arm_model import model_parameters
from flat_planner_ros.ros.parameters.planner import PlannerSettings
from flat_planner_ros.ros.parameters.row import Values
from flat_planner_ros.ros.parameters.saved_model import model_file, NotSaved, save
from flat_planner_ros.ros.wire import estimates, interfaces
from flat_planner_ros.ros.wire.status_writer import Status
from rclpy.node import Node
from std_srvs.srv import Trigger


class ModelAdoption:
    """
    Hears the monitor's reports, adopts an estimate when asked to or by itself, saves the model.

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
    values
        Returns the present values of all parameters.

    """

    def __init__(
        self,
        node: Node,
        log: NodeLog,
        settings: Callable[[], PlannerSettings],
        last_start: Callable[[], float | None],
        announce: Callable[[Status], None],
        values: Callable[[], Values],
    ) -> None:
        self._node = node
        self._log = log
        self._settings = settings
        self._last_start = last_start
        self._announce = announce
        self._values = values
        self._tuner = ModelTuner()
        self._adopted: list[str] = []
        report = interfaces.topic_of(interfaces.MONITOR, interfaces.REPORT)
        node.create_subscription(DiagnosticArray, report, self._on_report, interfaces.LATCHED)
        node.create_service(Trigger, interfaces.ADOPT, self._on_adopt)
        node.create_service(Trigger, interfaces.SAVE, self._on_save)

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

    def _adopt(self) -> Status:
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
        self._adopted.append(status.message)
        return status

    def _on_save(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Write the present model to a file that the nodes read."""
        remarks = [
            'The model of an arm, as a planner had it; give it to the nodes after their own file:',
            '--params-file YOURS --params-file THIS',
            *(self._adopted or ['nothing has been adopted since the planner started']),
        ]
        text = model_file(self._values(), self._node.get_namespace(), remarks)
        try:
            response.message = save(Path(self._settings().save_path), text)
            response.success = True
        except NotSaved as error:
            response.message = str(error)
            response.success = False
        say = self._log.info if response.success else self._log.error
        say(response.message)
        return response
