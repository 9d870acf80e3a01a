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

"""The monitor's share of a processor with joint states at 1 kHz."""

from argparse import Namespace
from time import time

from flat_planner_ros.ros.wire import interfaces
from measurement import Section, verdict
from plant import COMMAND, RATE, trajectory
from processes import executors, listener, NodeProcess, processes, SHIPPED, SINGLE
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

TARGET = 0.25
"""Share of one core [-]."""

LONGEST = 15.0
"""Longest run [s]."""

SETTLING = 2.0
"""Time before the measurement [s]."""

LEAD = 1.0
"""From sending the plan to its start [s]."""


def sections(options: Namespace) -> list[Section]:
    """Return the table of this benchmark."""
    rows, notes = [], []
    for executor in executors():
        for residual in (False, True):
            share, heard = _run(executor, residual, min(options.seconds, LONGEST))
            what = 'with a listener of ~/residual' if residual else 'reports only'
            rows.append((executor, what, f'{100.0 * share:.0f} %', heard))
            if executor == SHIPPED:
                notes.append(f'{what}, target {100.0 * TARGET:.0f} %: {verdict(share <= TARGET)}')
    return [
        Section(
            f'Monitor with {RATE:g} Hz of joint states, during a motion',
            ('executor', 'task', 'CPU', 'residuals heard'),
            rows,
            notes,
        )
    ]


def _run(executor: str, residual: bool, seconds: float) -> tuple[float, str]:
    """Return the monitor's work and the rate of what it publishes."""
    source = NodeProcess('plant', SINGLE, {'publish_rate': str(RATE)})
    monitor = NodeProcess('monitor', executor, {})
    with processes(source, monitor), listener('monitor_listener') as ours:
        plan = interfaces.topic_of(interfaces.PLANNER, interfaces.PLAN)
        plans = ours.node.create_publisher(JointTrajectory, plan, interfaces.LATCHED)
        commands = ours.node.create_publisher(JointTrajectory, COMMAND, interfaces.RELIABLE)
        heard: list[bytes] = []
        if residual:
            topic = interfaces.topic_of(interfaces.MONITOR, interfaces.RESIDUAL)
            ours.node.create_subscription(
                JointState, topic, heard.append, qos_profile_sensor_data, raw=True
            )
        ours.spin_until(plans.get_subscription_count, 'the monitor')
        ours.spin_until(commands.get_subscription_count, 'the plant')
        motion = trajectory(time() + LEAD, seconds + SETTLING + 5.0)
        plans.publish(motion)
        commands.publish(motion)
        ours.spin(LEAD + SETTLING)
        heard.clear()
        monitor.look()
        ours.spin(seconds)
        usage = monitor.look()
        assert monitor.is_running(), monitor.log
        assert not monitor.warnings, monitor.warnings
        if not residual:
            return usage.share, '-'
        rate = len(heard) / usage.seconds
        assert rate > 0.5 * RATE, f'{rate:.0f} Hz of residuals'
        return usage.share, f'{rate:.0f} Hz'
