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

"""The plant as a process: how fast it can be, and how evenly it keeps 1 kHz in real time."""

from argparse import Namespace
from pathlib import Path
from time import monotonic, time
from typing import NamedTuple

from flat_planner_ros.core import MotionRequest, plan
from flat_planner_ros.core.planning import PlanSamples
from flat_planner_ros.ros.parameters import planner as planner_parameters
from flat_planner_ros.ros.parameters import plant as plant_parameters
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.wire import interfaces, stamps
from flat_planner_ros.ros.wire.point_writer import trajectory_bytes
from measurement import Section, verdict
import numpy as np
import problem
from processes import (
    executors,
    Listener,
    listener,
    NodeProcess,
    processes,
    SHIPPED,
    stamp_of,
    Usage,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

COMMAND = interfaces.topic_of(interfaces.PLANNER, interfaces.COMMAND)
"""Where the plant listens."""

FREE_SECONDS = 10.0
"""Time for which the plant runs as fast as it can [s]."""

SPEED_TARGETS = {2: 80.0, 4: 5.0}
"""Simulated seconds per second at 200 Hz, by the number of joints [-]."""

ARM_FILES = {2: None, 4: Path(__file__).parents[1] / 'config' / 'arm_4dof.yaml'}
"""Parameters of the arms; None for the nodes' own, the paper's arm."""


class FreeMotion(NamedTuple):
    """
    A motion that outlasts a measurement, in simulated time.

    Attributes
    ----------
    ahead
        Time to its start, in which the plant is to hear of it [s].
    duration, spacing
        How long it lasts, and the time between its points [s].

    """

    ahead: float
    duration: float
    spacing: float


FREE_MOTIONS = {2: FreeMotion(100.0, 3600.0, 0.6), 4: FreeMotion(10.0, 240.0, 0.06)}
"""Motions by the number of joints."""

RATE = 1000.0
"""Rate of joint states in real time [Hz]."""

COMPARED_SECONDS = 20.0
"""Longest run in real time with another executor than the node's own [s]."""

RATE_TOLERANCE = 0.01
"""Deviation of the published rate that is fine [-]."""


class Run(NamedTuple):
    """
    What was seen of a plant in real time.

    Attributes
    ----------
    stamps, arrivals
        Of each joint state [s].
    usage
        Of the plant's process.
    warnings
        What it complained about.

    """

    stamps: np.ndarray
    arrivals: np.ndarray
    usage: Usage
    warnings: list[str]


def sections(options: Namespace) -> list[Section]:
    """Return the tables of this benchmark."""
    return [_free_section(), _real_time_section(options.seconds)]


def trajectory(start: float, duration: float, points: int = 1001) -> JointTrajectory:
    """Return a motion of the paper's arm as a command or plan that starts at a time [s]."""
    made = plan(problem.request(duration=duration), problem.arm(), problem.OPTIONS)
    samples = made.sample(duration / (points - 1))
    return _trajectory_msg(start, samples)


def _trajectory_msg(start: float, samples: PlanSamples) -> JointTrajectory:
    """Return samples as a command."""
    joints = samples.positions.shape[1]
    msg = JointTrajectory(joint_names=[f'joint{i + 1}' for i in range(joints)])
    msg.header.stamp = stamps.time_msg(start)
    msg.points = [
        JointTrajectoryPoint(
            positions=samples.positions[i].tolist(),
            velocities=samples.velocities[i].tolist(),
            accelerations=samples.accelerations[i].tolist(),
            effort=samples.efforts[i].tolist(),
            time_from_start=stamps.duration_msg(samples.times[i]),
        )
        for i in range(len(samples.times))
    ]
    return msg


def _motion(joints: int) -> PlanSamples:
    """Return a long motion of an arm from where its plant starts."""
    file, (_, duration, spacing) = ARM_FILES[joints], FREE_MOTIONS[joints]
    if file is None:
        made = plan(problem.request(duration=duration), problem.arm(), problem.OPTIONS)
        return made.sample(spacing)
    plant = read_settings(file, plant_parameters.ROWS, plant_parameters.build, node='flat_plant')
    planner = read_settings(
        file, planner_parameters.ROWS, planner_parameters.build, node='flat_planner'
    )
    first = np.array(plant.simulation.position)
    final = first + np.append(np.full(joints - 1, 0.5), 0.0)
    request = MotionRequest(start=first, final=final, duration=duration)
    made = plan(request, planner.session.arm, planner.session.options)
    return made.sample(spacing)


def _command(samples: PlanSamples, start: float) -> bytes:
    """Return samples as a serialised command: message objects would take simulated minutes."""
    tables = [samples.positions, samples.velocities, samples.accelerations, samples.efforts]
    names = [f'joint{i + 1}' for i in range(samples.positions.shape[1])]
    return trajectory_bytes(names, stamps.sec_and_nanosec(start), samples.times, tables)


def _free_section() -> Section:
    """Measure the speed of a plant that owns the time."""
    rows, notes = [], []
    for joints, target in SPEED_TARGETS.items():
        for executor in executors() if joints == 2 else executors()[:1]:
            speed, usage = _free_run(executor, joints)
            share = f'{100.0 * usage.share:.0f} %'
            rows.append(
                (f'{joints}', executor, f'{speed:.3g}', share, f'{speed / usage.share:.3g}')
            )
            if executor == SHIPPED:
                notes.append(f'{joints} joints, target {target:g}: {verdict(speed >= target)}')
    return Section(
        'Plant as fast as it can, 200 Hz of joint states and /clock, during a motion',
        ('joints', 'executor', 'simulated s per s', 'CPU', 'per s of CPU'),
        rows,
        notes,
    )


def _free_run(executor: str, joints: int) -> tuple[float, Usage]:
    """Return simulated seconds per second, and the work."""
    parameters = {'publish_clock': 'true', 'real_time_factor': '0.0', 'publish_rate': '200.0'}
    motion = _motion(joints)
    process = NodeProcess('plant', executor, parameters, ARM_FILES[joints])
    with processes(process), listener('free_listener') as ours:
        seen: list[tuple[float, float]] = []
        states: list[bytes] = []
        ours.node.create_subscription(
            Clock, '/clock', lambda m: seen.append((monotonic(), stamp_of(m))), 10, raw=True
        )
        ours.node.create_subscription(JointState, '/joint_states', states.append, 10, raw=True)
        ours.spin_until(lambda: seen, 'a /clock')
        command = ours.node.create_publisher(JointTrajectory, COMMAND, 10)
        ours.spin_until(command.get_subscription_count, 'the plant')
        start = seen[-1][1] + FREE_MOTIONS[joints].ahead
        command.publish(_command(motion, start))
        ours.spin_until(lambda: seen[-1][1] > start, 'the motion')
        process.look()
        first = len(seen)
        ours.spin(FREE_SECONDS)
        usage = process.look()
        assert process.is_running(), process.log
        assert not process.warnings, process.log
        simulated, elapsed = np.subtract(seen[-1][::-1], seen[first][::-1])
        assert seen[-1][1] < start + FREE_MOTIONS[joints].duration, 'the motion must outlast it'
        assert states, 'joint states go with /clock'
    return simulated / elapsed, usage


def _real_time_section(seconds: float) -> Section:
    """Measure a plant that follows the system's clock."""
    rows, notes = [], []
    for executor in executors():
        is_compared = executor != SHIPPED
        run = _real_time_run(executor, min(seconds, COMPARED_SECONDS) if is_compared else seconds)
        gaps = np.rint(np.diff(run.stamps) * RATE).astype(int)
        assert (gaps > 0).all(), 'joint states must not repeat or go back'
        missed = int((gaps - 1).sum())
        span = run.stamps[-1] - run.stamps[0]
        rate = (len(run.stamps) - 1) / span
        heard = (len(run.stamps) - 1) / (run.arrivals[-1] - run.arrivals[0])
        lag = 1e3 * (run.arrivals - run.stamps)
        rows.append(
            (
                executor,
                f'{rate:.2f} Hz',
                f'{heard:.2f} Hz',
                f'{missed}',
                f'{100.0 * run.usage.share:.0f} %',
                ' / '.join(f'{np.percentile(lag, p):.2f}' for p in (50, 99, 100)),
            )
        )
        if executor == SHIPPED:
            is_met = missed == 0 and abs(heard / RATE - 1.0) <= RATE_TOLERANCE
            notes.append(
                f'no missed step, rate within 1 %: {verdict(is_met and not run.warnings)}'
            )
        notes += [f'{executor}: {line}' for line in run.warnings[:3]]
    return Section(
        f'Plant in real time, {RATE:g} Hz of joint states for {seconds:g} s (others: shorter)',
        ('executor', 'stamped', 'heard', 'missed', 'CPU', 'lag p50 / p99 / worst [ms]'),
        rows,
        notes,
    )


def _real_time_run(executor: str, seconds: float) -> Run:
    """Let a plant move and listen to it."""
    process = NodeProcess('plant', executor, {'publish_rate': str(RATE)})
    with processes(process), listener('real_time_listener') as ours:
        seen: list[tuple[float, float]] = []
        ours.node.create_subscription(
            JointState,
            '/joint_states',
            lambda m: seen.append((stamp_of(m), time())),
            1000,
            raw=True,
        )
        ours.spin_until(lambda: seen, 'joint states')
        _move(ours, seconds)
        ours.spin(1.0)
        process.look()
        first = len(seen)
        ours.spin(seconds)
        usage = process.look()
        assert process.is_running(), process.log
        stamps, arrivals = np.array(seen[first:]).T
        return Run(stamps, arrivals, usage, process.warnings)


def _move(ours: Listener, seconds: float) -> None:
    """Command a motion that lasts as long as the measurement."""
    command = ours.node.create_publisher(JointTrajectory, COMMAND, 10)
    ours.spin_until(command.get_subscription_count, 'the plant')
    command.publish(trajectory(time() + 0.5, max(1.0, min(seconds, 60.0))))
