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

"""The nodes of the paper's experiment, and others of the same names that must not be there."""

from collections.abc import Sequence
from threading import Event
from time import monotonic

from flat_planner_ros.ros.programs.played_motion import ExperimentFailed, Interrupted
from flat_planner_ros.ros.wire import interfaces
import rclpy
from rclpy.node import Node

OURS = (interfaces.PLANNER, interfaces.PLANT, interfaces.MONITOR)
"""The nodes that take part in each run."""

DISCOVERY = 3.0
"""Time given to nodes that already run to be discovered [s]."""


def refuse_company(interrupted: Event) -> None:
    """
    Make sure that none of our nodes is running: a goal would reach both.

    Raises
    ------
    ExperimentFailed
        One of our nodes is running.
    Interrupted
        If the event is set meanwhile.

    """
    node = Node('paper_table_probe')
    deadline = monotonic() + DISCOVERY
    try:
        while monotonic() < deadline:
            if interrupted.is_set():
                raise Interrupted
            rclpy.spin_once(node, timeout_sec=0.1)
            present = sorted({*OURS, interfaces.TRACKER} & set(node.get_node_names()))
            if present:
                raise has_company(present)
    finally:
        node.destroy_node()


def has_company(names: Sequence[str]) -> ExperimentFailed:
    """Return the error that says what to do about nodes that were there before."""
    return ExperimentFailed(
        f'{", ".join(names)} already runs here: stop it, or choose another ROS_DOMAIN_ID for the '
        f'experiment'
    )
