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

"""A node whose start fails leaves nothing in the graph, however long somebody keeps the error."""

from contextlib import suppress
from typing import Any

from rclpy.node import Node


class AllOrNothing(type):
    """
    Metaclass of nodes that are there as a whole or not at all.

    The error that a constructor raises refers to the frames in which it was raised, and they to
    the half-made node: until the garbage collector comes by, its name stays in the graph, and its
    topics and services, which nobody serves.
    """

    def __call__(cls, *args: Any, **options: Any) -> Any:
        """Make a node, or destroy what there is of it."""
        kind: Any = cls
        node = kind.__new__(kind)
        try:
            node.__init__(*args, **options)
        except BaseException:
            # By rclpy alone: what our nodes do at their end needs all of them. Nor has one that
            # rclpy itself has refused anything to destroy.
            with suppress(Exception):
                Node.destroy_node(node)
            raise
        return node
