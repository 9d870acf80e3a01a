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
"""The planner between actions: it sends goals to a controller's, and serves its own."""

from contextlib import ExitStack
from importlib.util import find_spec
import sys

from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.wire import stamps
from flat_planner_ros.ros.wire.message_types import UnknownType
import numpy as np
import pytest
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from ros.control_messages import make_control_messages
from ros.rig import goal
from ros.timed_planner import Timed
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

CONTROLLER = '/arm/follow_joint_trajectory'
BY_ACTION = {'command.interface': 'action', 'command.action': CONTROLLER}
PLANNER = '/flat_planner/follow_joint_trajectory'
HELD = {'start.source': 'parameter', 'start.position': [0.0, 0.0]}
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6


@pytest.fixture(scope='module')
def action(tmp_path_factory):
    """Return the type of the action, made here where control_msgs is not installed."""
    made = ''
    if find_spec('control_msgs') is None:
        made = str(make_control_messages(tmp_path_factory.mktemp('control_msgs')))
        sys.path.insert(0, made)
    from control_msgs.action import FollowJointTrajectory

    yield FollowJointTrajectory
    if made:  # nobody else is to find it
        sys.path.remove(made)
        for name in [name for name in sys.modules if name.partition('.')[0] == 'control_msgs']:
            del sys.modules[name]


@pytest.fixture
def world(graph):
    """Return a graph with `ends`: actions, which do not end with their nodes."""
    with ExitStack() as ends:
        graph.ends = ends
        yield graph


class Controller:
    """A controller that does with its goals as a test says, whatever an arm would do."""

    def __init__(self, graph, action, *, accepts=True):
        """Offer the action."""
        self.action, self.handles, self.accepts = action, [], accepts
        self.server = ActionServer(
            graph.probe,
            action,
            CONTROLLER,
            execute_callback=lambda _: action.Result(),
            goal_callback=lambda _: GoalResponse.ACCEPT if self.accepts else GoalResponse.REJECT,
            handle_accepted_callback=self.handles.append,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )
        graph.ends.callback(self.server.destroy)

    def end(self, verb, code=0, words='', index=-1):
        """End a goal by one of the verbs of rclpy."""

        def ended(handle):
            getattr(handle, verb)()
            return self.action.Result(error_code=code, error_string=words)

        self.handles[index].execute(ended)


class Commanded(Timed):
    """A planner that sends its commands to a controller."""

    def __init__(self, graph, action, **given):
        """Start both, at 10 s."""
        self.controller = Controller(graph, action, **given)
        super().__init__(graph, **BY_ACTION)
        self.be(10.0)
        self.measure()
        graph.expect(lambda: not self.node._outlet._controller.doubt, 'the controller')

    def begin(self, position, duration=2.0):
        """Send a goal that is accepted, and wait until the controller has the command."""
        count = len(self.controller.handles)
        assert self.send(position, duration)['state'] == 'ACCEPTED'
        self.graph.expect(lambda: len(self.controller.handles) > count, 'the command')

    def ending(self, *states):
        """Return the values and the sentence of the first end in one of these states."""
        self.graph.expect(lambda: self.verdicts(*states), f'{states}')
        index = [v.get('state') in states for v in map(_values, self.status)].index(True)
        return {**_values(self.status[index]), 'message': self.status[index].status[0].message}


def _values(msg):
    return {pair.key: pair.value for pair in msg.status[0].values}


def test_a_command_is_the_plan_and_success_belongs_to_its_end(world, action):
    rig = Commanded(world, action)
    rig.begin(1.0)
    sent = rig.controller.handles[0].request.trajectory
    world.expect(lambda: rig.plans, 'the plan')
    assert sent == rig.plans[-1]
    assert not rig.commands
    rig.be(12.5)
    rig.measure((1.0, 0.0))
    rig.be(12.6)
    assert not rig.verdicts('FINISHED'), 'the controller has a say in it'
    rig.controller.end('succeed', words='Goal successfully reached!')
    world.expect(lambda: rig.node._session._watch.answer, 'the answer')
    rig.be(12.7)
    message = rig.ending('FINISHED', 'FAILED')['message']
    assert message.endswith('the controller has succeeded: Goal successfully reached!')


def test_a_controller_that_does_not_answer_is_not_waited_for(world, action):
    rig = Commanded(world, action)
    rig.begin(1.0)
    rig.be(13.0)
    rig.measure((1.0, 0.0))
    rig.be(13.2)
    message = rig.ending('FINISHED', 'FAILED')['message']
    assert message.endswith('the controller has not answered')


@pytest.mark.parametrize(
    ('verb', 'code', 'name'),
    [
        ('abort', -4, 'PATH_TOLERANCE_VIOLATED'),
        ('abort', -1, 'CONTROLLER_FAILED'),
    ],
)
def test_a_motion_that_the_controller_aborts_fails_in_its_words(world, action, verb, code, name):
    rig = Commanded(world, action)
    rig.begin(1.0)
    rig.be(11.0)
    rig.controller.end(verb, code, 'Aborted due to path tolerance violation')
    world.expect(lambda: not rig.node._session.moves(0.0, 99.0), 'the answer')
    rig.be(11.1)
    failed = rig.ending('FAILED')
    assert failed['error_name'] == name
    assert f'aborted it (error code {code}): Aborted due to path' in failed['message']
    rig.measure((0.3, 0.0))
    rig.begin(1.0)


def test_a_command_that_the_controller_rejects_fails(world, action):
    rig = Commanded(world, action, accepts=False)
    assert rig.send(1.0, 2.0)['state'] == 'ACCEPTED'
    world.expect(lambda: not rig.node._session.moves(0.0, 99.0), 'the answer')
    rig.be(10.1)
    failed = rig.ending('FAILED')
    assert failed['error_code'] == '-125'
    assert f'{CONTROLLER} has rejected it' in failed['message']


def test_without_a_controller_a_motion_fails_at_once_and_its_verdict_warns(world, action):
    rig = Timed(world, **BY_ACTION)
    rig.be(10.0)
    rig.measure()
    verdict = rig.send(1.0, 2.0)
    assert verdict['state'] == 'ACCEPTED'
    assert f'no controller offers the action {CONTROLLER}' in verdict['message']
    world.expect(lambda: rig.verdicts('FAILED'), 'the end')


def test_what_a_controller_says_of_a_command_that_was_replaced_fails_nothing(world, action):
    rig = Commanded(world, action)
    rig.begin(1.0)
    rig.be(11.0)
    rig.measure((0.5, 0.0))
    rig.begin(0.5)
    rig.controller.end('abort', -1, 'Current goal cancelled due to new incoming action.', index=0)
    rig.controller.end('succeed')
    world.expect(lambda: rig.node._session._watch.answer, 'the answer')
    rig.be(14.0)
    rig.measure((0.5, 0.0))
    rig.be(14.1)
    assert rig.ending('FINISHED', 'FAILED')['state'] == 'FINISHED'
    assert len(rig.verdicts('PREEMPTED')) == 1


class Served(Timed):
    """A planner and a client of its action."""

    def __init__(self, graph, action, **parameters):
        """Start both, at 10 s."""
        self.action, self.heard = action, []
        super().__init__(graph, **HELD, **parameters)
        self.client = ActionClient(graph.probe, action, PLANNER)
        graph.ends.callback(self.client.destroy)
        self.be(10.0)
        graph.expect(self.client.server_is_ready, 'the action')

    def follow(self, trajectory):
        """Return the handle of a goal, which is accepted at first."""
        asked = self.action.Goal(trajectory=trajectory)
        future = self.client.send_goal_async(asked, lambda msg: self.heard.append(msg.feedback))
        self.graph.expect(future.done, 'a response')
        assert future.result().accepted
        self.answer = future.result().get_result_async()
        return future.result()

    def result(self):
        """Return how the goal has ended, and what is said of it."""
        self.be(self.now() + 0.1)  # results are sent with ticks of the planner's time
        self.graph.expect(self.answer.done, 'a result')
        answer = self.answer.result()
        return answer.status, answer.result.error_code, answer.result.error_string

    def accepted(self):
        """Wait for the verdict on a goal."""
        self.graph.expect(lambda: self.verdicts('ACCEPTED'), 'a verdict')


def test_a_goal_is_planned_followed_and_succeeds(world, action):
    rig = Served(world, action)
    rig.follow(goal(1.0, 60.0))
    rig.accepted()

    def has_heard():
        rig.be(rig.now() + 0.06)
        return any(0.0 < feedback.desired.positions[0] < 1.0 for feedback in rig.heard)

    world.expect(has_heard, 'feedback')
    assert rig.heard[-1].joint_names == ['joint1', 'joint2']
    rig.be(71.0)
    status, code, words = rig.result()
    assert (status, code) == (SUCCEEDED, 0)
    assert 'has come to its end' in words


def test_a_goal_that_breaks_a_rule_is_aborted_with_code_and_reason(world, action):
    rig = Served(world, action)
    asked = goal(1.0, 2.0)
    asked.joint_names = ['elbow']
    rig.follow(asked)
    status, code, words = rig.result()
    assert (status, code) == (ABORTED, -2)
    assert "unknown joint 'elbow'" in words


def test_a_motion_planners_trajectory_ends_where_it_ends(world, action):
    """It has velocities on the way, and more points than a goal may have; its path is straight."""
    rig = Served(world, action)
    shares = np.linspace(0.0, 1.0, 120)
    points = [
        JointTrajectoryPoint(
            positions=[float(s * s * (3.0 - 2.0 * s))],
            velocities=[float(3.0 * s * (1.0 - s))],
            time_from_start=stamps.duration_msg(2.0 * float(s)),
        )
        for s in shares
    ]
    rig.follow(JointTrajectory(joint_names=['joint1'], points=points))
    rig.accepted()
    message = rig.status[-1].status[0].message
    assert '0 of its 118 points on the way are passed' in message
    world.expect(lambda: rig.plans, 'the plan')
    end = rig.plans[-1].points[-1]
    assert end.positions == pytest.approx([1.0, 0.0])


def test_cancelled_it_stops(world, action):
    rig = Served(world, action)
    handle = rig.follow(goal(3.0, 4.0))
    rig.accepted()
    rig.be(10.5)
    answer = handle.cancel_goal_async()
    world.expect(answer.done, 'an answer')
    assert len(answer.result().goals_canceling) == 1
    rig.be(14.5)
    status, code, words = rig.result()
    assert (status, code) == (CANCELED, 0)
    assert 'has been brought to rest on the way' in words


def test_replaced_by_another_goal_it_is_aborted(world, action):
    rig = Served(world, action)
    rig.follow(goal(1.0, 2.0))
    rig.accepted()
    rig.be(11.0)
    assert rig.send(0.5, 2.0)['state'] == 'ACCEPTED'
    status, code, words = rig.result()
    assert (status, code) == (ABORTED, -1)
    assert 'is replaced by a later goal' in words


def test_planned_only_it_does_not_succeed(world, action):
    rig = Served(world, action, execute=False)
    rig.follow(goal(1.0, 2.0))
    status, code, words = rig.result()
    assert (status, code) == (ABORTED, -1)
    assert 'execute is false' in words


def test_a_controller_that_forgets_stamps_is_warned_of(graph):
    for name, is_true in (('good_controller', False), ('bad_controller', True)):
        options = {'context': graph.context, 'use_global_arguments': False}
        controller = graph.add(Node(name, **options))
        controller.declare_parameter('allow_trajectory_replacement', is_true)
        controller.create_subscription(
            JointTrajectory, '/flat_planner/joint_trajectory', lambda _: None, 10
        )
    graph.create(PlannerNode)
    graph.expect(lambda: graph.logged('allow_trajectory_replacement'), 'a warning')
    (warning,) = graph.logged('allow_trajectory_replacement')
    assert warning.startswith('/bad_controller: ')


def test_without_control_msgs_there_are_no_actions_and_one_line_says_so(graph, monkeypatch):
    for name in ('control_msgs', 'control_msgs.action'):
        monkeypatch.setitem(sys.modules, name, None)
    Timed(graph)
    graph.expect(lambda: graph.logged('control_msgs is not installed'), 'the line')
    assert len(graph.logged('control_msgs')) == 1
    with pytest.raises(UnknownType, match='command.interface: action needs control_msgs'):
        graph.create(PlannerNode, BY_ACTION)
