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
Libraries that are loaded when nothing moves yet: half a second that no motion should wait for.

The core imports the slow parts of SciPy where it needs them, so that a program that does not need
them starts at once. A node will need them, and at a time when it is late: a goal that comes in
motion, the report after it.
"""

from collections.abc import Sequence
from importlib import import_module
from threading import Event, Lock, Thread

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

LOADING = Lock()
"""Held while one node loads: parts of SciPy that two threads load at once may see halves."""

LOADED = Event()
"""Set once a node of this process has loaded all that it will need."""

FIT = 'flat_planner_ros.core.model_fit'
"""The wing that tells how an arm swings, and its whole model."""

SWING = 'flat_planner_ros.core.tracking'
"""The wing that tells how an arm moves from what it has done lately."""

PLANNING = (SWING, 'scipy.linalg.lapack', 'scipy.optimize', FIT)
"""Modules that planning through via points, in motion or from a swing needs."""

REPORTING = ('scipy.fft', 'scipy.integrate', 'scipy.optimize', FIT)
"""Modules that the report on a motion needs."""

DELAY = 0.1
"""Time from the node's start after which it answers and may load libraries [s]."""


def load_early(node: Node, libraries: Sequence[str]) -> None:
    """
    Load libraries once, soon after a node has started.

    Beside the executor: on a busy machine it takes longer than a whole motion, which would not be
    seen, and goals are answered meanwhile.
    """

    def load() -> None:
        with LOADING:
            for library in libraries:
                import_module(library)
        LOADED.set()

    def start() -> None:
        timer.cancel()
        Thread(target=load).start()

    # Steady: with use_sim_time, timers of the node's own clock wait for a /clock.
    timer = node.create_timer(DELAY, start, clock=Clock(clock_type=ClockType.STEADY_TIME))
