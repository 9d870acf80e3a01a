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

"""From a goal message to the plan inside the planner node, and what it is made of."""

from argparse import Namespace
from collections.abc import Callable
from functools import cache
from math import pi
from time import perf_counter
from typing import Any

from flat_planner_ros.core import Goal, GoalPoint, plan
from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.session import Motion, Timeline
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.wire import conversions, diagnostics, interfaces, stamps
from measurement import duration_text, Section, Timing, timing, verdict
import problem
from processes import PATIENCE
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

TARGET = 5e-3
"""From the goal to the plan with 201 points [s]."""

POINTS = (101, 201, 1001)
"""Numbers of points of a plan."""

WATCHED = 201
"""The number that the target is about."""

GOALS = 200
"""Goals per number of points."""

EXECUTED = 30
"""Goals that are carried out, a second each, so that the command is published too."""

JOINTS = ('joint1', 'joint2')
"""Of the arm."""


def sections(options: Namespace) -> list[Section]:
    """Return the tables of this benchmark."""
    del options
    return [_path_section(), _parts_section(), _building_section()]


class _Bench:
    """
    A planner node and somebody who sends goals, in one process.

    Parameters
    ----------
    points
        Points of each plan.
    execute
        Whether the planner publishes commands.

    """

    def __init__(self, points: int, execute: bool) -> None:
        """Open both."""
        values = {
            'sampling.period': problem.DURATION / (points - 1),
            'start.source': 'parameter',
            'start.position': [0.0, 0.0],
            'start_delay': 0.001,
            'execute': execute,
        }
        rclpy.init(args=['--ros-args', '--log-level', 'error'])
        overrides = [Parameter(name, value=value) for name, value in values.items()]
        self._planner = PlannerNode(parameter_overrides=overrides)
        self._client = Node('client', enable_rosout=False, start_parameter_services=False)
        self._executor = SingleThreadedExecutor()
        for node in (self._planner, self._client):
            self._executor.add_node(node)
        self._plans: list[tuple[float, bytes]] = []
        self.inside: list[float] = []
        # Serialised: reading the plan is the listener's work.
        self._client.create_subscription(
            JointTrajectory,
            interfaces.topic_of(interfaces.PLANNER, interfaces.PLAN),
            lambda plan: self._plans.append((perf_counter(), plan)),
            interfaces.LATCHED,
            raw=True,
        )
        goal = interfaces.topic_of(interfaces.PLANNER, interfaces.GOAL)
        self._goals = self._client.create_publisher(JointTrajectory, goal, interfaces.RELIABLE)
        for subscription in self._planner.subscriptions:
            if subscription.topic_name == self._client.resolve_topic_name(goal):
                subscription.callback = self._timed(subscription.callback)
        self._wait_for(self._goals.get_subscription_count)

    def _timed(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        def timed(msg: JointTrajectory) -> None:
            start = perf_counter()
            callback(msg)
            self.inside.append(perf_counter() - start)

        return timed

    def close(self) -> None:
        """Close both."""
        self._executor.shutdown()
        self._planner.destroy_node()
        self._client.destroy_node()
        rclpy.try_shutdown()

    def answer(self, distance: float) -> tuple[float, bytes]:
        """Return the time from publishing a goal to its plan [s], and the plan."""
        goal = _goal(distance)
        self._plans.clear()
        handled = len(self.inside)
        start = perf_counter()
        self._goals.publish(goal)
        self._wait_for(lambda: self._plans)
        arrival, found = self._plans[0]
        self._wait_for(lambda: len(self.inside) > handled)
        return arrival - start, found

    def spin(self, seconds: float) -> None:
        """Serve callbacks for a time."""
        end = perf_counter() + seconds
        while perf_counter() < end:
            self._executor.spin_once(timeout_sec=0.01)

    def _wait_for(self, condition: Callable[[], object]) -> None:
        end = perf_counter() + PATIENCE
        while not condition():
            if perf_counter() > end:
                raise TimeoutError('the planner does not answer')
            self._executor.spin_once(timeout_sec=0.1)


def _goal(distance: float) -> JointTrajectory:
    """Return a goal of joint 1."""
    point = JointTrajectoryPoint(
        positions=[distance], time_from_start=stamps.duration_msg(problem.DURATION)
    )
    return JointTrajectory(joint_names=['joint1'], points=[point])


def _path(points: int, execute: bool) -> tuple[Timing, Timing]:
    """Return goal to plan, and the goal's callback alone."""
    bench = _Bench(points, execute)
    try:
        _, serialised = bench.answer(pi)
        msg = deserialize_message(serialised, JointTrajectory)
        assert len(msg.points) == points
        assert msg.points[-1].positions[0] == pi
        assert abs(msg.points[points // 2].positions.tolist()[0] - pi / 2) < 0.1
        times = []
        bench.inside.clear()
        for number in range(EXECUTED if execute else GOALS):
            if execute:
                bench.spin(problem.DURATION + 0.05)
            times.append(bench.answer(0.5 + 0.01 * number)[0])
        return Timing.of(times), Timing.of(bench.inside)
    finally:
        bench.close()


def _path_section() -> Section:
    """Measure the real node."""
    rows, notes = [], []
    for points, execute in [*((points, False) for points in POINTS), (WATCHED, True)]:
        path, inside = _path(points, execute)
        mode = 'goal to plan and command' if execute else 'goal to plan'
        rows.append(
            (
                f'{points} points, {mode}',
                duration_text(path.median),
                duration_text(path.worst),
                duration_text(inside.median),
                duration_text(inside.worst),
            )
        )
        if points == WATCHED:
            notes.append(
                f'{points} points, {mode}, target {duration_text(TARGET)}: '
                f'{verdict(path.median <= TARGET)}'
            )
    return Section(
        'Planner node, goal message to plan',
        ('what', 'to the plan: median', 'worst', 'whole callback: median', 'worst'),
        rows,
        notes,
    )


@cache
def _arm() -> PlanarArm:
    """Return the arm, the same one in each plan, as a node has it."""
    return problem.arm()


def _motion(points: int) -> Motion:
    """Return what the session makes of the paper's goal."""
    made = plan(problem.request(), _arm(), problem.OPTIONS)
    samples = made.sample(problem.DURATION / (points - 1))
    return Motion(plan_id=1, plan=made, samples=samples, start=1e9 + 0.5, planned_at=1e9)


def _parts_section() -> Section:
    """Measure the steps of the callback one by one."""
    arm, request = _arm(), problem.request()
    period = problem.DURATION / (WATCHED - 1)
    motion, data = _motion(WATCHED), serialize_message(_goal(pi))
    timeline = Timeline([motion])
    track = timeline.track(motion.planned_at)
    goal = Goal(
        joint_names=('joint1',), points=(GoalPoint(time=problem.DURATION, positions=(pi,)),)
    )

    # A new plan each time: its peaks are computed once.
    def fresh() -> Motion:
        return _motion(WATCHED)

    steps: list[tuple[str, Callable[[Any], object], Callable[[], Any]]] = [
        ('read the goal', lambda _: conversions.goal_from_trajectory(data), lambda: None),
        ('plan', lambda _: plan(request, arm, problem.OPTIONS), lambda: None),
        ('sample', lambda _: motion.plan.sample(period), lambda: None),
        ('gather the points', lambda _: timeline.track(motion.planned_at), lambda: None),
        ('build the plan', lambda _: conversions.command_bytes(track, JOINTS), lambda: None),
        ('build the flat plan', lambda _: conversions.flat_plan_bytes(track), lambda: None),
        (
            'verdict with peaks and RMS values',
            lambda new: diagnostics.accepted_status(new, goal, JOINTS, 0.0),
            fresh,
        ),
    ]
    timings = [(name, timing(step, arguments)) for name, step, arguments in steps]
    total = sum(each.median for _, each in timings)
    return Section(
        f'Steps of the planner node, {WATCHED} points',
        ('step', 'share', 'median', 'worst'),
        [
            (
                name,
                f'{100.0 * each.median / total:.0f} %',
                duration_text(each.median),
                duration_text(each.worst),
            )
            for name, each in timings
        ],
        [f'sum of the medians: {duration_text(total)}'],
    )


def _building_section() -> Section:
    """Measure building messages in serialised form."""
    rows = []
    for points in POINTS:
        motion = _motion(points)
        track = Timeline([motion]).track(motion.planned_at)
        msg = deserialize_message(conversions.command_bytes(track, JOINTS), JointTrajectory)
        assert [p.positions.tolist() for p in msg.points] == motion.samples.positions.tolist()
        build = timing(lambda _, t=track: conversions.command_bytes(t, JOINTS))
        rows.append(
            (
                f'{points}',
                duration_text(build.median),
                duration_text(build.worst),
                f'{1e6 * build.median / points:.2f} µs',
            )
        )
    return Section(
        'Building the serialised plan, two joints',
        ('points', 'median', 'worst', 'per point'),
        rows,
    )
