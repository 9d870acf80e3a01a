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
Lines of a log, written at once.

A logger's own methods find the place of their caller: they compare it with the files of all
modules first, which takes a node that starts longer than reading its parameters, and a line later
on longer than planning a motion.
"""

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.logging import LoggingSeverity

PLACE = ('write_line', __file__, 0)
"""Function, file and line of all lines, for those who show them."""


def write_line(logger: RcutilsLogger, severity: LoggingSeverity, text: str) -> None:
    """Write a line of a severity, if the logger is enabled for it."""
    if logger.is_enabled_for(severity):
        rclpy_implementation.rclpy_logging_rcutils_log(severity, logger.name, text, *PLACE)
