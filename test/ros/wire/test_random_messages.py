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
Random messages on real topics: every goal gets one verdict, and nothing breaks a node.

`make fuzz` sends 10,000 of each kind (RANDOM_MESSAGES); with the other tests it is 150 goals and
60 of the rest.
"""

from collections import Counter
from math import pi
import os
from pathlib import Path
import resource
from time import perf_counter

from builtin_interfaces.msg import Duration, Time
from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.nodes.plant_node import PlantNode
from flat_planner_ros.ros.nodes.tracker_node import TrackerNode
from flat_planner_ros.ros.parameters.planner import ROWS
from flat_planner_ros.ros.parameters.plant import ROWS as PLANT_ROWS
from flat_planner_ros.ros.parameters.tracker import ROWS as TRACKER_ROWS
from flat_planner_ros.ros.wire import interfaces, stamps
from flat_planner_ros.ros.wire.conversions import goal_from_trajectory
from hypothesis import given, HealthCheck, Phase, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from random_cases import cases
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.serialization import serialize_message
from ros.rig import goal, Planner
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

pytestmark = pytest.mark.timeout(1800)

COUNT = int(os.environ.get('RANDOM_MESSAGES', '0'))
"""Messages of each kind; 0 for the usual ones."""

GROWTH = 3.0
"""What a thousand goals may add to the memory of a node whose caches are full [MB]."""

INT32 = (-(2**31), -1, 0, 1, 2**31 - 1)
UINT32 = (0, 1, 999_999_999, 10**9, 2**32 - 1)

numbers = st.one_of(
    st.floats(-4.0, 4.0),
    st.floats(),  # NaN, infinities, denormals and -0 among them
    st.sampled_from([0.0, -0.0, 5e-324, -1e308, 1e6, 1.0000001e6]),
)
texts = st.characters(blacklist_categories=['Cs'], blacklist_characters='\0')
names = st.one_of(
    st.sampled_from(['joint1', 'joint2', 'Joint1', '', 'gelenk_ä', '関節1', 'joint1\x01', '🦾']),
    st.text(texts, max_size=80),
)
usual_names = st.sampled_from([['joint1'], ['joint1', 'joint2'], ['joint2', 'joint1']])
joint_names = st.one_of(usual_names, st.lists(names, max_size=5))
seconds = st.one_of(st.integers(0, 3), st.sampled_from(INT32), st.integers(-(2**31), 2**31 - 1))
nanoseconds = st.one_of(
    st.integers(0, 10**9 - 1), st.sampled_from(UINT32), st.integers(0, 2**32 - 1)
)


def some(count: int):
    """Return a strategy of arrays, mostly of one length."""
    return st.one_of(
        st.lists(numbers, min_size=count, max_size=count),
        st.lists(numbers, max_size=5),
        st.just([]),
    )


@st.composite
def goal_stamps(draw):
    """Return a stamp, mostly the one for as soon as possible."""
    kind = draw(st.integers(0, 3))
    if kind == 0:
        return Time(sec=draw(seconds), nanosec=draw(nanoseconds))
    return Time()


@st.composite
def trajectories(draw, effort: bool):
    """Return a trajectory, from nearly right to nonsense."""
    chosen = draw(joint_names)
    points = []
    for _ in range(draw(st.integers(0, 4))):
        points.append(
            JointTrajectoryPoint(
                positions=draw(some(len(chosen))),
                velocities=draw(st.one_of(st.just([]), some(len(chosen)))),
                accelerations=draw(st.one_of(st.just([]), some(len(chosen)))),
                effort=draw(some(len(chosen)) if effort else st.one_of(st.just([]), some(1))),
                time_from_start=Duration(sec=draw(seconds), nanosec=draw(nanoseconds)),
            )
        )
    message = JointTrajectory(joint_names=chosen, points=points)
    message.header.stamp = draw(goal_stamps())
    return message


@st.composite
def plain_goals(draw):
    """Return a goal that is nearly always right."""
    point = JointTrajectoryPoint(
        positions=[draw(st.floats(-pi, pi))],
        time_from_start=Duration(sec=draw(st.integers(0, 3)), nanosec=draw(nanoseconds)),
    )
    return JointTrajectory(joint_names=['joint1'], points=[point])


@st.composite
def joint_states(draw):
    """Return a joint state, from right to nonsense."""
    chosen = draw(joint_names)
    message = JointState(
        name=chosen,
        position=draw(some(len(chosen))),
        velocity=draw(some(len(chosen))),
        effort=draw(some(len(chosen))),
    )
    message.header.stamp = draw(goal_stamps())
    return message


def enormous() -> list[JointTrajectory]:
    """Return goals beyond any sense of proportion."""
    point = JointTrajectoryPoint(positions=[1.0], time_from_start=Duration(sec=1))
    many_points = JointTrajectory(joint_names=['joint1'], points=100_000 * [point])
    wide = JointTrajectoryPoint(positions=1000 * [1.0], time_from_start=Duration(sec=1))
    many_joints = JointTrajectory(joint_names=[f'joint{k}' for k in range(1000)], points=[wide])
    long_arrays = JointTrajectory(
        joint_names=['joint1'], points=[JointTrajectoryPoint(positions=100_000 * [1.0])]
    )
    long_name = JointTrajectory(joint_names=[100_000 * 'ä'], points=[point])
    return [many_points, many_joints, long_arrays, long_name]


def random_messages(usual: int):
    """Return the settings of hypothesis: as many examples, each at its own pace."""
    return settings(
        max_examples=COUNT or usual,
        deadline=None,
        database=None,
        derandomize=not COUNT,
        phases=[Phase.explicit, Phase.generate],
        suppress_health_check=list(HealthCheck),
    )


def memory() -> float:
    """Return the resident memory of this process [MB]."""
    pages = int(Path('/proc/self/statm').read_text().split()[1])
    return pages * resource.getpagesize() / 2**20


def now_of(node) -> float:
    """Return the time of a node [s]."""
    return stamps.now(node.get_clock())


LENIENT = {'start.joint_state_timeout': 1e6, 'start.position_tolerance': 10.0}
"""Parameters of a planner that takes any measured state."""


class Goals(Planner):
    """A planner that is sent goals."""

    def __init__(self, graph):
        """Start it at rest, where the age of the measured state does not matter."""
        super().__init__(graph, LENIENT)
        self.outcomes = Counter()
        self.measure()
        self.publisher = graph.probe.create_publisher(JointTrajectory, '/flat_planner/goal', 10)
        graph.expect(self.publisher.get_subscription_count, 'the planner on its goals')
        self.slowest = 0.0

    def send(self, message: JointTrajectory) -> dict[str, str]:
        """Send a goal; return its one verdict."""
        self.status.clear()
        data = serialize_message(message)  # takes seconds for an enormous one
        begin = perf_counter()
        self.publisher.publish(data)
        self.graph.expect(self.answers, 'a verdict')
        elapsed = perf_counter() - begin
        (verdict,) = self.answers()
        if verdict['state'] == 'REJECTED':
            self.slowest = max(self.slowest, elapsed)
        self.outcomes[verdict['state']] += 1
        self.graph.log.clear()
        return verdict


def test_every_random_goal_gets_one_verdict(graph):
    goals = Goals(graph)

    @random_messages(150)
    @given(st.one_of(trajectories(effort=False), trajectories(effort=False), plain_goals()))
    def send(message):
        session = goals.node._session
        motion, count = session.motion, len(goals.commands)
        efforts = b'' if motion is None else motion.samples.efforts.tobytes()
        verdict = goals.send(message)
        assert verdict['error_name'] != 'INTERNAL'
        if verdict['state'] == 'REJECTED':
            assert session.motion is motion
            assert len(goals.commands) == count
            if motion is not None:
                assert motion.samples.efforts.tobytes() == efforts
        else:
            graph.expect(lambda: len(goals.commands) > count, 'the command')
            efforts = np.array([point.effort for point in goals.commands[-1].points])
            assert np.isfinite(efforts).all()
            assert not efforts[-1].any()
        goals.commands.clear()

    send()
    for message in enormous():
        assert goals.send(message)['state'] == 'REJECTED'
    accepted, rejected = goals.outcomes['ACCEPTED'], goals.outcomes['REJECTED']
    assert accepted
    print(
        f'\n{accepted + rejected} goals: {accepted} accepted, {rejected} rejected; '
        f'slowest rejection {1e3 * goals.slowest:.0f} ms'
    )


def test_goals_leave_no_memory_behind(graph):
    goals = Planner(graph, LENIENT, is_heard=False)  # what is heard and not read would grow, too
    goals.measure()
    random = np.random.default_rng(1)

    def send(count):
        for _ in range(count):
            # Straight to the node.
            for final in (random.uniform(0.5, 3.0), -1.0):
                data = serialize_message(goal(1.0, final))
                goals.node._answer(lambda data=data: goal_from_trajectory(data))
            goals.node._report_ended()

    send(300)
    before = memory()
    send(cases(1000, 2))
    assert memory() - before < GROWTH


def test_random_joint_states_harm_no_node(graph):
    goals = Goals(graph)
    monitor = graph.create(MonitorNode)
    assert goals.send(goal(1.0, 60.0))['state'] == 'ACCEPTED'
    track = goals.node._session.track(0.0)

    @random_messages(60)
    @given(joint_states())
    def send(message):
        graph.publish('/joint_states', message, readers=2)
        graph.spin_until(lambda: True)

    send()
    assert not graph.logged('internal error')
    assert (goals.node._session.track(0.0).efforts == track.efforts).all()
    _still_serves(graph, goals, monitor)


def test_random_trajectories_and_efforts_never_drive_the_plant_mad(graph):
    graph.create(PlantNode)
    graph.create(PlantNode, {'input': 'effort'}, '-r', '__ns:=/stream')
    states = [
        graph.collect(JointState, topic, interfaces.RELIABLE)
        for topic in ('/joint_states', '/stream/joint_states')
    ]

    @random_messages(60)
    @given(trajectories(effort=True), st.lists(numbers, max_size=3))
    def send(message, efforts):
        graph.publish('/flat_planner/joint_trajectory', message)
        graph.publish('/stream/flat_planner/effort_commands', Float64MultiArray(data=efforts))
        graph.expect(lambda: states[0] and states[1], 'joint states')
        for received in states:
            for state in received:
                assert np.isfinite([*state.position, *state.velocity, *state.effort]).all()
            received.clear()

    send()
    for received in states:
        received.clear()
        graph.expect(lambda received=received: received, 'the plants go on')
    assert not graph.logged('internal error')


def test_random_messages_never_make_a_tracker_send_what_it_must_not(graph):
    limit = 0.01
    tracker = graph.create(TrackerNode, {'limits.effort': [limit], 'timeout': 1.0, 'max_age': 1.0})
    sent = graph.collect(Float64MultiArray, '/flat_tracker/effort_commands')
    still = JointState(name=['joint1', 'joint2'], position=[0.0, 0.0])
    points = [
        JointTrajectoryPoint(
            positions=[0.0, 0.0], velocities=[0.0, 0.0], time_from_start=Duration(sec=k)
        )
        for k in range(2)
    ]
    hold = JointTrajectory(joint_names=['joint1', 'joint2'], points=points)

    def show(state, *commands):
        state.header.stamp = stamps.time_msg(now_of(tracker))
        graph.publish('/joint_states', state)
        for command in commands:
            graph.publish('/flat_planner/joint_trajectory', command)
        graph.spin_until(lambda: False, 0.01)

    @random_messages(60)
    @given(trajectories(effort=True), joint_states())
    def send(trajectory, state):
        show(still, hold)
        show(state, hold, trajectory)
        efforts = np.array([value for message in sent for value in message.data])
        assert np.isfinite(efforts).all()
        assert (np.abs(efforts) <= limit).all()

    graph.expect(lambda: show(still, hold) or sent, 'efforts')
    send()
    assert not graph.logged('internal error')


@pytest.mark.parametrize(
    ('node_class', 'rows'),
    [(PlannerNode, ROWS), (PlantNode, PLANT_ROWS), (TrackerNode, TRACKER_ROWS)],
    ids=['planner', 'plant', 'tracker'],
)
def test_random_parameters_are_refused_or_consistent(graph, node_class, rows):
    node = graph.create(node_class)
    names = [row.name for row in rows] + ['no.such.parameter']
    values = st.one_of(
        numbers,
        st.booleans(),
        st.integers(-(2**63), 2**63 - 1),
        st.text(texts, max_size=20),
        st.lists(numbers, max_size=40),
        st.sampled_from([choice for row in rows for choice in row.choices]),
    )

    @random_messages(60)
    @given(st.sampled_from(names), values)
    def change(name, value):
        before = node._configuration.settings
        result = graph.set_parameters(node.get_name(), **{name: value})[0]
        if not result.successful:
            assert result.reason
            assert node._configuration.settings is before

    change()


@st.composite
def parameter_messages(draw):
    """Return a parameter of any type, with values for some of the types."""
    value = ParameterValue(
        type=draw(st.one_of(st.integers(0, 9), st.integers(0, 255))),
        bool_value=draw(st.booleans()),
        integer_value=draw(st.integers(-(2**63), 2**63 - 1)),
        double_value=draw(numbers),
        string_value=draw(st.text(texts, max_size=20)),
        double_array_value=draw(st.lists(numbers, max_size=5)),
        string_array_value=draw(st.lists(st.text(texts, max_size=5), max_size=3)),
    )
    own = st.sampled_from([row.name for row in ROWS] + ['use_sim_time', ''])
    return Parameter(name=draw(st.one_of(own, st.text(texts, max_size=20))), value=value)


def test_random_requests_are_answered(graph):
    goals = Goals(graph)
    lists = st.lists(parameter_messages(), max_size=4)
    words = st.lists(st.text(texts, max_size=20), max_size=4)

    def ask(kind, service, **fields):
        return graph.call(kind, f'/flat_planner/{service}', kind.Request(**fields))

    @random_messages(40)
    @given(lists, words, st.integers(0, 2**64 - 1))
    def send(parameters, texts, depth):
        results = ask(SetParameters, 'set_parameters', parameters=parameters).results
        assert len(results) == len(parameters)
        ask(SetParametersAtomically, 'set_parameters_atomically', parameters=parameters)
        for kind, service in (
            (GetParameters, 'get_parameters'),
            (GetParameterTypes, 'get_parameter_types'),
            (DescribeParameters, 'describe_parameters'),
        ):
            ask(kind, service, names=texts)
        ask(ListParameters, 'list_parameters', prefixes=texts, depth=depth)

    send()
    assert goals.send(goal(1.0, 1.0))['state'] in ('ACCEPTED', 'REJECTED')


def _still_serves(graph, goals: Goals, monitor) -> None:
    """Check that planner and monitor answer as before."""
    state = JointState(name=['joint1', 'joint2'], position=[0.0, 0.0], velocity=[0.0, 0.0])
    state.header.stamp = stamps.time_msg(now_of(goals.node))
    graph.publish('/joint_states', state, readers=2)
    assert goals.send(goal(1.0, 1.0))['state'] == 'ACCEPTED'
    graph.expect(lambda: monitor.get_name() == 'flat_monitor', 'the monitor')
