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

"""The planner node on a real graph: one verdict per goal, commands as executors want them."""

from math import inf, nan, pi
from pathlib import Path
import resource
import signal

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flat_planner_ros.ros.wire import interfaces, stamps
import numpy as np
import pytest
from ros.rig import Planner, Rig, table
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

GOAL = '/flat_planner/goal'
PATIENT = {'start.joint_state_timeout': 60.0, 'start.source': 'measured'}


class Patient(Planner):
    """A planner whose arm is measured once, and everything that it says."""

    def __init__(self, graph, parameters=None, *arguments):
        """Start it."""
        super().__init__(graph, {**PATIENT, **(parameters or {})}, *arguments)
        self.name = self.node.get_fully_qualified_name()
        self.flat = self.hear(JointTrajectory, '/flat_planner/flat_plan', interfaces.LATCHED)
        self.references = self.hear(JointState, '/flat_planner/reference')

    def statuses(self) -> list[DiagnosticStatus]:
        """Return all that was said of goals and motions."""
        return [array.status[0] for array in self.status]


def values(status: DiagnosticStatus) -> dict[str, str]:
    """Return a status as a dictionary."""
    pairs = {pair.key: pair.value for pair in status.values}
    assert len(pairs) == len(status.values)
    return {**pairs, 'message': status.message, 'level': status.level}


def goal(angle=pi, duration=1.0, stamp=0.0, **fields) -> JointTrajectory:
    """Return a goal for joint 1."""
    arguments = {'positions': [float(angle)], **fields}
    point = JointTrajectoryPoint(time_from_start=stamps.duration_msg(duration), **arguments)
    message = JointTrajectory(joint_names=['joint1'], points=[point])
    message.header.stamp = stamps.time_msg(stamp)
    return message


@pytest.fixture
def planner(graph):
    """Return a planner that has seen the arm at rest."""
    result = Patient(graph)
    result.measure()
    return result


def test_an_accepted_goal_becomes_a_command_that_an_executor_can_play(planner):
    sent_at = planner.now()
    verdict = planner.ask(goal())
    assert verdict['state'] == 'ACCEPTED'
    assert verdict['level'] == DiagnosticStatus.OK
    planner.graph.expect(lambda: planner.commands, 'the command')
    command = planner.commands[0]
    assert command.joint_names == ['joint1', 'joint2']
    times = [
        point.time_from_start.sec * 10**9 + point.time_from_start.nanosec
        for point in command.points
    ]
    assert times[0] == 0
    assert times[-1] == 10**9
    assert np.diff(times).min() > 0
    assert np.diff(times).max() <= 5_000_001
    start = stamps.seconds(command.header.stamp)
    assert sent_at + 0.05 <= start <= planner.now() + 0.05
    for field in ('positions', 'velocities', 'accelerations', 'effort'):
        rows = table(command, field)
        assert rows.shape == (201, 2)
        assert np.isfinite(rows).all()
    assert table(command, 'positions')[0].tolist() == [0.0, 0.0]
    assert table(command, 'positions')[-1].tolist() == [pi, 0.0]
    for field in ('velocities', 'accelerations', 'effort'):
        assert not table(command, field)[-1].any()
    assert not table(command, 'effort')[:, 1].any()
    assert np.abs(table(command, 'effort')[:, 0]).max() > 0.005


def test_the_verdict_states_numbers_and_repeats_the_goal(planner):
    planner.ask(goal())
    verdict = planner.ask(goal(stamp=planner.now() - 100.0))
    assert verdict['error_name'] == 'OLD_HEADER_TIMESTAMP'
    accepted = values(planner.statuses()[0])
    assert accepted['plan_id'] == '1'
    assert (accepted['error_code'], accepted['error_name']) == ('0', 'SUCCESSFUL')
    assert accepted['strategy'] == 'min_control_effort'
    assert accepted['flat_model'] == 'exact'
    assert float(accepted['duration']) == 1.0
    assert float(accepted['rms_effort.joint1']) == pytest.approx(0.007427, rel=1e-3)
    assert float(accepted['peak_effort.joint1']) > float(accepted['rms_effort.joint1'])
    assert float(accepted['rms_effort.joint2']) == 0.0
    assert float(accepted['peak_velocity.joint1']) > pi
    assert 0.0 < float(accepted['planning_time']) < 5.0
    assert float(accepted['boundary_residual']) < 1e-9
    assert float(accepted['optimality_residual']) < 1e-9
    assert float(accepted['cost']) > 0.0
    planner.graph.expect(lambda: planner.plans, 'the plan')
    stamp = stamps.seconds(planner.plans[0].header.stamp)
    assert float(accepted['start_time']) == pytest.approx(stamp, abs=1e-6)
    assert accepted['goal.joint_names'] == '[joint1]'
    assert accepted['goal.positions'] == '[3.14159265]'
    assert accepted['goal.time_from_start'] == '1'
    assert 'joint' not in accepted
    assert 'limit' not in accepted


def test_plan_and_flat_plan_are_latched_and_share_their_times(planner, graph):
    planner.ask(goal())
    plan = graph.collect(JointTrajectory, '/flat_planner/plan', interfaces.LATCHED)
    flat = graph.collect(JointTrajectory, '/flat_planner/flat_plan', interfaces.LATCHED)
    status = graph.collect(DiagnosticArray, '/flat_planner/status', interfaces.LATCHED_HISTORY)
    command = graph.collect(JointTrajectory, '/flat_planner/joint_trajectory')
    graph.expect(lambda: plan and flat and status, 'latched messages')
    assert flat[0].joint_names == ['y1', 'y1_d3']
    assert [p.time_from_start for p in flat[0].points] == [
        p.time_from_start for p in plan[0].points
    ]
    assert flat[0].header.stamp == plan[0].header.stamp
    # The angle of the last link is the sum of the joints; its derivatives belong together.
    y = [table(flat[0], field) for field in ('positions', 'velocities', 'accelerations')]
    assert y[0][:, 0] == pytest.approx(table(plan[0], 'positions').sum(axis=1), abs=1e-12)
    assert y[1][:, 0] == pytest.approx(table(plan[0], 'velocities').sum(axis=1), abs=1e-9)
    jerk = np.gradient(y[2][:, 0], 0.005, edge_order=2)
    assert y[0][:, 1] == pytest.approx(jerk, abs=0.01 * np.abs(jerk).max())
    # A command is never played again for those who come late.
    assert not graph.spin_until(lambda: command, timeout=0.3)


def test_a_flat_plan_that_nobody_has_heard_reaches_those_who_come_later(graph):
    planner = Planner(graph, PATIENT)
    planner.measure()
    planner.ask(goal())
    graph.expect(lambda: planner.plans, 'the plan')
    for _ in range(2):  # the first one has it made, the second one hears the latched message
        flat = graph.collect(JointTrajectory, '/flat_planner/flat_plan', interfaces.LATCHED)
        graph.expect(lambda flat=flat: flat, 'the flat plan')
        assert flat[0].header.stamp == planner.plans[0].header.stamp
        assert len(flat[0].points) == len(planner.plans[0].points)


def test_the_reference_follows_the_plan_and_the_end_is_announced(planner, graph):
    planner.ask(goal(duration=0.3))
    graph.expect(lambda: len(planner.status) > 1, 'the end of the motion')
    finished = values(planner.statuses()[1])
    assert (finished['state'], finished['plan_id']) == ('FINISHED', '1')
    end = float(finished['start_time']) + 0.3
    assert planner.now() >= end
    graph.expect(
        lambda: stamps.seconds(planner.references[-1].header.stamp) > end, 'the rest after'
    )
    plan = planner.plans[0]
    start = stamps.seconds(plan.header.stamp)
    times = np.array([stamps.seconds(p.time_from_start) for p in plan.points])
    moving = 0
    for reference in planner.references:
        elapsed = stamps.seconds(reference.header.stamp) - start
        moving += 0.0 < elapsed < 0.3
        expected = np.interp(elapsed, times, table(plan, 'positions')[:, 0])
        assert reference.position[0] == pytest.approx(expected, abs=0.01)
        assert len(reference.velocity) == len(reference.effort) == 2
    assert moving >= 5
    assert list(planner.references[-1].position) == [pi, 0.0]


def refused_goals() -> dict[str, tuple[JointTrajectory, str, str]]:
    """Return malformed goals, with the code and the name of their rejection."""
    other = goal()
    other.joint_names = ['elbow']
    twice = goal(positions=[1.0, 1.0])
    twice.joint_names = ['joint1', 'joint1']
    missing = goal(0.0)
    missing.joint_names = ['joint2']
    loaded = goal(positions=[1.0, 0.2])
    loaded.joint_names = ['joint1', 'joint2']
    via = goal(velocities=[0.5])
    via.points = [*via.points, *goal(duration=2.0).points]
    standing = goal()
    standing.points = [*standing.points, *standing.points]
    many = goal()
    many.points = many.points * 10_000
    pointless = goal()
    pointless.points = []
    return {
        'empty': (JointTrajectory(), '-101', 'EMPTY_GOAL'),
        'no points': (pointless, '-101', 'EMPTY_GOAL'),
        'unknown joint': (other, '-2', 'INVALID_JOINTS'),
        'joint twice': (twice, '-2', 'INVALID_JOINTS'),
        'joint missing': (missing, '-2', 'INVALID_JOINTS'),
        'NaN': (goal(nan), '-102', 'NON_FINITE'),
        'infinite': (goal(-inf), '-102', 'NON_FINITE'),
        'wrong size': (goal(positions=[1.0, 2.0]), '-103', 'SIZE_MISMATCH'),
        'standing time': (standing, '-104', 'TIME_NOT_INCREASING'),
        'negative time': (goal(duration=-1.0), '-104', 'TIME_NOT_INCREASING'),
        'moving end': (goal(velocities=[0.5]), '-105', 'NONZERO_END_STATE'),
        'accelerated end': (goal(accelerations=[0.5]), '-105', 'NONZERO_END_STATE'),
        'loaded spring': (loaded, '-106', 'PASSIVE_JOINT_NOT_ZERO'),
        'effort': (goal(effort=[0.1]), '-107', 'EFFORT_NOT_ALLOWED'),
        'far away': (goal(1e300), '-110', 'POSITION_LIMIT'),
        'no duration': (goal(duration=0.0), '-113', 'DURATION_OUT_OF_RANGE'),
        'too short': (goal(duration=1e-9), '-113', 'DURATION_OUT_OF_RANGE'),
        'too long': (goal(duration=1e9), '-113', 'DURATION_OUT_OF_RANGE'),
        'past': (goal(stamp=1.0), '-3', 'OLD_HEADER_TIMESTAMP'),
        'moving via point': (via, '-1', 'INVALID_GOAL'),
        'enormous': (many, '-1', 'INVALID_GOAL'),
    }


def test_every_malformed_goal_gets_one_rejection_and_leaves_the_motion_alone(planner):
    planner.ask(goal(stamp=planner.now() + 60.0))
    cases = refused_goals()
    for name, (message, code, error_name) in cases.items():
        verdict = planner.ask(message)
        found = (verdict['state'], verdict['error_code'], verdict['error_name'])
        assert found == ('REJECTED', code, error_name), name
        assert verdict['level'] == DiagnosticStatus.ERROR
        assert verdict['message']
    assert len(planner.status) == len(cases) + 1
    assert len(planner.commands) == len(planner.plans) == 1
    assert planner.references[-1].position[0] == 0.0


def test_a_rejection_names_joint_value_and_limit(planner):
    verdict = planner.ask(goal(velocities=[0.5]))
    assert (verdict['joint'], verdict['value'], verdict['limit']) == ('joint1', '0.5', '0')
    for text in ('joint1', 'velocity', '0.5'):
        assert text in verdict['message']
    assert verdict['goal.positions'] == '[3.14159265]'


def test_verdicts_come_in_the_order_of_the_goals(planner, graph):
    durations = [-1.0, 0.5, -2.0, -3.0, -4.0]
    for duration in durations:
        graph.publish(GOAL, goal(duration=duration))
    graph.expect(lambda: len(planner.status) >= 5, 'five verdicts')
    echoed = [float(values(s)['goal.time_from_start']) for s in planner.statuses()[:5]]
    assert echoed == durations
    states = [values(s)['state'] for s in planner.statuses()[:5]]
    assert states == ['REJECTED', 'ACCEPTED', 'REJECTED', 'REJECTED', 'REJECTED']


@pytest.mark.parametrize(
    ('measured', 'code', 'joint'),
    [
        ({'position': (0.0, 0.05)}, '-122', 'joint2'),
        ({'velocity': (0.3, 0.0)}, '-123', 'joint1'),
    ],
)
def test_an_arm_that_is_not_at_rest_is_not_moved(planner, measured, code, joint):
    planner.measure(**{'position': (0.1, 0.0), **measured, 'names': ('joint1', 'joint2')})
    verdict = planner.ask(goal())
    assert (verdict['error_code'], verdict['joint']) == (code, joint)


def test_without_fresh_joint_states_nothing_starts(graph):
    planner = Patient(graph, {'start.joint_state_timeout': 0.2})
    assert planner.ask(goal())['error_name'] == 'START_STATE_UNKNOWN'
    planner.measure()
    measured_at = planner.now()
    graph.expect(lambda: planner.now() > measured_at + 0.3, 'time to pass')
    assert planner.ask(goal())['error_name'] == 'START_STATE_STALE'


def test_joint_states_of_other_robots_and_in_other_orders_are_understood(graph):
    planner = Patient(graph)
    planner.measure((0.0, 0.4, 7.0), (nan, nan, nan), ('joint2', 'joint1', 'gripper'))
    planner.ask(goal())
    graph.expect(lambda: planner.plans, 'the plan')
    assert list(planner.plans[0].points[0].positions) == [0.4, 0.0]
    state = JointState(name=['wheel'], position=[1.0])
    graph.publish('joint_states', state)
    graph.expect(lambda: graph.logged('joint state ignored'), 'a warning')


def test_a_pose_is_a_goal_with_the_default_duration(graph):
    planner = Patient(graph, {'duration.default': 0.8})
    planner.measure()
    pose = JointState(name=['joint1'], position=[1.0])
    verdict = planner.ask(pose, '/flat_planner/goal_state')
    assert (verdict['state'], verdict['duration']) == ('ACCEPTED', '0.8')


def test_a_future_stamp_is_kept_exactly(planner, graph):
    message = goal()
    message.header.stamp.sec = int(planner.now()) + 50
    message.header.stamp.nanosec = 123_456_789
    planner.ask(message)
    graph.expect(lambda: planner.commands, 'the command')
    stamp = planner.commands[0].header.stamp
    assert stamp.sec == message.header.stamp.sec
    assert abs(stamp.nanosec - 123_456_789) < 1000


def test_changed_parameters_apply_to_the_next_plan_and_to_a_replan(planner, graph):
    results = graph.set_parameters('flat_planner', execute=False)
    assert results[0].successful
    first = planner.ask(goal())
    graph.set_parameters(
        'flat_planner', **{'strategy': 'min_potential_energy', 'model.damping': 0.0}
    )
    response = graph.call(Trigger, '/flat_planner/replan')
    assert response.success
    second = values(planner.statuses()[1])
    assert first['strategy'] == 'min_control_effort'
    assert second['strategy'] == 'min_potential_energy'
    assert float(second['rms_effort.joint1']) == pytest.approx(0.008692, rel=5e-3)
    assert not planner.commands
    graph.expect(lambda: len(planner.plans) == 2, 'both plans')


def test_replanning_needs_a_goal_and_stopping_a_motion(planner, graph):
    response = graph.call(Trigger, '/flat_planner/replan')
    assert not response.success
    assert 'no goal' in response.message
    response = graph.call(Trigger, '/flat_planner/stop')
    assert response.success
    assert 'nothing to stop' in response.message


@pytest.mark.parametrize(
    ('name', 'value', 'text'),
    [
        ('strategy', 'fastest', 'min_control_effort'),
        ('flat_model', 'rough', 'approximate'),
        ('start_delay', inf, 'start_delay'),
        ('weights.r', 2000.0, '1000'),
        ('weights.effort', 31.0, '30'),
        ('weights.Q', [1.0], '36'),
        ('model.stiffness', -1.0, 'stiffness'),
        ('model.inertia_star', [3.3e-5, 6.4e-4], 'kg m^2'),
        ('limits.effort', [0.01], 'one number for each of joint1, joint2'),
        ('limits.velocity', [0.0, inf], 'above 0'),
        ('limits.position_max', [nan, inf], 'limits.position_max'),
        ('limits.on_violation', 'ignore', 'scale'),
        ('duration.max', 1e-4, 'duration.min'),
        ('start.source', 'parameter', 'start.position'),
        ('start_delay', nan, 'start_delay'),
        ('joints', ['a', 'b'], 'read-only'),
        ('strategy', 'custom', 'weights.Q'),
    ],
)
def test_an_impossible_parameter_is_refused_with_a_reason(planner, graph, name, value, text):
    before = graph.get_parameters('flat_planner', name)
    result = graph.set_parameters('flat_planner', **{name: value})[0]
    assert not result.successful
    assert text in result.reason
    assert graph.get_parameters('flat_planner', name) == before
    assert planner.ask(goal())['state'] == 'ACCEPTED'


def test_limits_that_limit_nothing_are_allowed(planner, graph):
    assert graph.set_parameters('flat_planner', **{'limits.effort': [inf, inf]})[0].successful


def test_a_custom_cost_is_planned(graph):
    matrix = np.zeros((6, 6))
    matrix[5, 5] = 1.0
    matrix[1, 1] = 17.0**8
    planner = Patient(graph, {'strategy': 'custom', 'weights.Q': matrix.ravel().tolist()})
    planner.measure()
    verdict = planner.ask(goal())
    assert float(verdict['rms_effort.joint1']) == pytest.approx(0.008709, rel=1e-3)


def test_the_command_can_be_cut_to_what_an_executor_takes(graph):
    changes = {
        'command.include_passive_joint': False,
        'command.include_effort': False,
        'command.stamp': 'zero',
        'sampling.period': 0.01,
    }
    planner = Patient(graph, changes)
    planner.measure()
    planner.ask(goal())
    graph.expect(lambda: planner.commands and planner.plans, 'command and plan')
    command = planner.commands[0]
    assert command.joint_names == ['joint1']
    assert table(command, 'positions').shape == (101, 1)
    assert not command.points[50].effort
    assert (command.header.stamp.sec, command.header.stamp.nanosec) == (0, 0)
    assert planner.plans[0].joint_names == ['joint1', 'joint2']
    assert planner.plans[0].header.stamp.sec > 0


def test_namespaces_and_remappings_hold(graph):
    planner = Patient(graph, {}, '-r', '__ns:=/left', '-r', 'joint_states:=/left/measured')
    assert planner.name == '/left/flat_planner'
    state = JointState(name=['joint1', 'joint2'], position=[0.2, 0.0])
    state.header.stamp = stamps.time_msg(planner.now())
    graph.publish('/left/measured', state)
    graph.expect(lambda: planner.node._session.measured is not None, 'the measured state')
    assert planner.ask(goal())['state'] == 'ACCEPTED'


MORE = {'planning fails': 1 << 20, 'its command fails': 16 << 20}
"""Memory that a planner may still take [bytes]: not enough for all of a long motion."""


@pytest.mark.parametrize('more', MORE)
def test_an_internal_error_is_a_verdict_too(more, graph):
    parameters = ['start.source:=parameter', 'start.position:=[0.0, 0.0]']
    words = [word for parameter in parameters for word in ('-p', parameter)]
    process = graph.start('planner_node', '--ros-args', *words)
    planner = Rig(graph)
    planner.hear_planner(raw=True)
    assert planner.ask(goal(duration=0.3))['state'] == 'ACCEPTED'
    graph.expect(lambda: planner.verdicts('FINISHED'), 'the end')
    _, most = resource.prlimit(process.pid, resource.RLIMIT_AS)
    pages = int(Path(f'/proc/{process.pid}/statm').read_text().split()[0])
    limit = pages * resource.getpagesize() + MORE[more]
    resource.prlimit(process.pid, resource.RLIMIT_AS, (limit, most))
    verdict = planner.ask(goal(duration=500.0))
    assert (verdict['error_code'], verdict['error_name']) == ('-199', 'INTERNAL')
    resource.prlimit(process.pid, resource.RLIMIT_AS, (most, most))
    assert planner.ask(goal(duration=500.0))['state'] == 'ACCEPTED'


BAD_ARGUMENTS = {
    'integer': (['-p', 'weights.r:=150'], 'weights.r must be of type double (write 1.0, not 1)'),
    'typing error': (['-p', 'weigths.r:=150.0'], 'did you mean weights.r?'),
    'half a model': (['-p', 'model.stiffness:=1.0'], 'joints'),
    'three joints': (
        [
            *('-p', 'joints:=[a, b, c]', '-p', 'model.inertia_star:=[6.4e-4, 3.3e-5]'),
            *('-p', 'model.stiffness:=3.0e-3', '-p', 'model.damping:=2.0e-5'),
        ],
        '3 joints are named, but the model has 2',
    ),
    'unknown choice': (['-p', 'strategy:=best'], 'one of polynomial'),
    'range': (
        ['-p', 'sampling.period:=1.0'],
        'sampling.period must be in [0.0005, 0.01], got 1.0',
    ),
}


@pytest.mark.parametrize('name', BAD_ARGUMENTS)
def test_a_bad_parameter_ends_the_node_with_one_line(graph, name):
    arguments, text = BAD_ARGUMENTS[name]
    process = graph.start('planner_node', '--ros-args', *arguments)
    assert process.wait() == 1
    lines = process.stderr.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith('cannot start: ')
    assert text in lines[0]


def test_a_broken_parameter_file_ends_the_node_with_exit_code_1(graph, tmp_path):
    file = tmp_path / 'broken.yaml'
    file.write_text('/**:\n  ros__parameters: [1\n')
    process = graph.start('planner_node', '--ros-args', '--params-file', str(file))
    assert process.wait() == 1
    assert 'cannot start' in process.stderr.strip().splitlines()[-1]
    assert 'Traceback' not in process.stderr


def test_arguments_that_are_not_for_ros_are_explained(graph):
    process = graph.start('planner_node', '--params-file', 'arm.yaml')
    assert process.wait() == 2
    assert '--ros-args' in process.stdout + process.stderr
    process = graph.start('planner_node', '--help')
    assert process.wait() == 0
    assert '--ros-args --params-file' in process.stdout


def test_an_integer_in_a_list_is_explained(graph, tmp_path):
    file = tmp_path / 'integer.yaml'
    file.write_text('/**:\n  ros__parameters:\n    model:\n      inertia_star: [1, 0.5]\n')
    process = graph.start('planner_node', '--ros-args', '--params-file', str(file))
    assert process.wait() == 1
    assert 'write every number of a list as 1.0' in process.stderr


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_ends_the_node_with_exit_code_0(graph, number):
    process = graph.start('planner_node')
    graph.expect(lambda: 'flat_planner' in graph.probe.get_node_names(), 'the node')
    assert process.stop(number) == 0
    assert 'Traceback' not in process.stderr


def test_the_start_position_may_be_a_parameter(graph):
    planner = Patient(graph, {'start.source': 'parameter', 'start.position': [0.5, 0.0]})
    verdict = planner.ask(goal())
    assert verdict['state'] == 'ACCEPTED'
    graph.expect(lambda: planner.plans, 'the plan')
    assert planner.plans[0].points[0].positions[0] == 0.5


def test_a_refusal_says_in_the_log_that_it_is_one(planner, graph):
    planner.ask(goal(velocities=[0.5]))
    graph.expect(lambda: graph.logged('goal rejected (NONZERO_END_STATE, -105)'), 'a line')


def test_a_goal_that_is_reached_already_says_so(planner):
    assert planner.ask(goal(0.0))['message'].endswith('the arm is there already')


def test_what_looks_like_a_mistake_is_a_warning(planner):
    verdict = planner.ask(goal(90.0, duration=10.0))
    assert verdict['state'] == 'ACCEPTED'
    assert verdict['level'] == DiagnosticStatus.WARN
    assert '14.3 turns' in verdict['message']
