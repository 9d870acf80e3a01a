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

"""The monitor on real topics: one true report per motion, whatever the source sends."""

from dataclasses import replace
from math import cos, exp, hypot, inf, nan, pi, sin, sqrt
import os
import signal
from time import monotonic

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from flat_planner_ros.core.arm import InvalidRequest, JointSample
from flat_planner_ros.core.monitor import (
    Level,
    MonitorSettings,
    PlannedMotion,
    Residual,
    VibrationMonitor,
)
from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.wire import conversions, diagnostics, interfaces, stamps
from flat_planner_ros.ros.wire.joint_states import JointStateReader
import numpy as np
import pytest
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

JOINTS = ('joint1', 'joint2')

RATE = 50
"""Joint states per second of their stamps [Hz]; the tests run faster than that."""

BURST = 4
"""Joint states published at once; the monitor's queue holds five."""

START, DURATION, GOAL = 100.0, 0.5, 1.0
"""Start [s], duration [s] and final position of joint 1 [rad] of the planned motion."""

WINDOW = 2.0
"""Window of the monitor [s]."""

AMPLITUDE, FREQUENCY, DECAY = 0.02, 1.7, 0.4
"""Simulated oscillation of joint 2 [rad], [Hz], [1/s]."""

PARAMETERS = {'window': WINDOW, 'timeout': 60.0}
"""Of the monitor; a busy machine that feeds it late is no silence."""

PLAN, STATES = '/flat_planner/plan', '/joint_states'
RESIDUAL, REPORT, RESET = '/flat_monitor/residual', '/flat_monitor/report', '/flat_monitor/reset'


def plan_msg(start=START, duration=DURATION, goal=GOAL, joints=JOINTS):
    """Return a cubic rest-to-rest motion of joint 1."""
    msg = JointTrajectory(joint_names=list(joints))
    msg.header.stamp = stamps.time_msg(start)
    for s in np.linspace(0.0, 1.0, 51).tolist():
        point = JointTrajectoryPoint(time_from_start=stamps.duration_msg(s * duration))
        point.positions = [goal * s**2 * (3 - 2 * s), 0.0]
        point.velocities = [goal * 6 * s * (1 - s) / duration, 0.0]
        msg.points.append(point)
    return msg


def swing(elapsed, amplitude=AMPLITUDE, frequency=FREQUENCY):
    """Return the oscillation of joint 2 at a time after the motion [rad]."""
    phase = 2 * pi * frequency * elapsed
    return amplitude * exp(-DECAY * elapsed) * cos(phase) if elapsed >= 0.0 else 0.0


def state_msg(time, start=START, goal=GOAL, amplitude=AMPLITUDE, frequency=FREQUENCY):
    """Return the planned state until, a free oscillation of joint 2 after the end."""
    s = min(max((time - start) / DURATION, 0.0), 1.0)
    msg = JointState(name=list(JOINTS))
    msg.header.stamp = stamps.time_msg(time)
    swings = swing(time - start - DURATION, amplitude, frequency)
    msg.position = [goal * s**2 * (3 - 2 * s), swings]
    msg.velocity = [goal * 6 * s * (1 - s) / DURATION, 0.0]
    msg.effort = [sin(2 * pi * s), nan]
    return msg


class Bench:
    """A monitor with ears on what it says."""

    def __init__(self, graph, parameters=PARAMETERS, *, as_process=False):
        """Start the monitor, in this process or in one of its own."""
        self.graph = graph
        if as_process:
            words = [word for k, v in parameters.items() for word in ('-p', f'{k}:={v}')]
            self.process = graph.start('monitor_node', '--ros-args', *words)
        else:
            self.node = graph.create(MonitorNode, parameters)
        self.residuals = graph.collect(JointState, RESIDUAL)
        self.reports = graph.collect(DiagnosticArray, REPORT)

    def plan(self, msg):
        """Publish a plan and let the monitor read it."""
        self.graph.publish(PLAN, msg, interfaces.LATCHED)
        self.synchronise()

    def synchronise(self):
        """Let the monitor work off what it has been sent: one message of a topic per answer."""
        for _ in range(BURST):
            self.graph.get_parameters('flat_monitor', 'window')

    def feed(self, until, start=START, form=lambda msg: msg, *, since=None, **motion):
        """Publish joint states, from the start of a motion on, as fast as they are worked off."""
        first = start if since is None else since
        times = np.arange(round(first * RATE), round(until * RATE) + 1) / RATE
        for burst in np.array_split(times, -(-len(times) // BURST)):
            count = len(self.residuals) + len(burst)
            for time in burst.tolist():
                self.graph.publish(STATES, form(state_msg(time, start, **motion)))
            self.graph.expect(lambda count=count: len(self.residuals) >= count, 'residuals')

    def report(self, count=1):
        """Return level, message and values of the newest report, the count-th one."""
        self.graph.expect(lambda: len(self.reports) >= count, f'report {count}')
        assert len(self.reports) == count
        return read(self.reports[-1])


def read(msg):
    """Return level, message and values of a message's only status."""
    (status,) = msg.status
    assert status.name == 'flat_monitor: residual oscillation'
    values = {pair.key: pair.value for pair in status.values}
    assert len(values) == len(status.values)
    return status.level, status.message, values


@pytest.fixture
def bench(graph):
    return Bench(graph)


def test_a_motion_yields_one_report_with_what_was_simulated(bench):
    bench.plan(plan_msg())
    bench.feed(START + DURATION + WINDOW + 0.5)
    level, message, values = bench.report()
    assert level == DiagnosticStatus.WARN
    assert 'above 0.005 rad' in message
    assert 'effort of joint2 not measured' in message
    assert values.pop('joint') == 'joint2'
    assert values.pop('settled') == 'false'
    assert values.pop('start_time') == '100.000000000'
    assert values.pop('end_time') == '100.500000000'
    assert values.pop('estimate_basis') == 'held'  # joint 1 stands still
    numbers = {key: float(value) for key, value in values.items()}
    assert numbers.pop('fit_rms') < 1e-9
    assert numbers.pop('stiffness_std') < 1e-9
    assert numbers.pop('damping_std') < 1e-9
    assert numbers.pop('bias') == pytest.approx(0.0, abs=1e-9)
    assert numbers.pop('final_error.joint1') == pytest.approx(0.0, abs=1e-9)
    assert numbers.pop('final_error.joint2') == pytest.approx(0.0, abs=0.1 * AMPLITUDE)
    omega = 2 * pi * FREQUENCY
    sampled = [swing(i / RATE) for i in range(round(WINDOW * RATE))]
    assert numbers == {
        'amplitude': pytest.approx(AMPLITUDE, rel=1e-6),
        'peak_to_peak': pytest.approx(max(sampled) - min(sampled)),
        'frequency': pytest.approx(FREQUENCY, rel=1e-6),
        # (41) of docs/derivation.md for the paper's arm, joint 1 free.
        'frequency_expected': pytest.approx(1.557, abs=1e-3),
        'damping_ratio': pytest.approx(DECAY / hypot(DECAY, omega), rel=1e-5),
        'damping_expected': pytest.approx(0.0326, abs=1e-4),
        'rms_effort.joint1': pytest.approx(sqrt(0.5), rel=1e-2),
        'travel_ratio': 1.0,
        'window': pytest.approx(WINDOW),
        'samples': WINDOW * RATE + 1,
        # (42) solved for stiffness and damping.
        'stiffness_estimate': pytest.approx(3.3e-5 * (omega**2 + DECAY**2), rel=1e-6),
        'damping_estimate': pytest.approx(2 * 3.3e-5 * DECAY, rel=1e-5),
        'estimate_inertia': pytest.approx(3.3e-5),
    }


def test_a_plan_latched_before_the_monitor_started_is_judged(graph):
    graph.publish(PLAN, plan_msg(), interfaces.LATCHED, readers=0)
    bench = Bench(graph)
    health = graph.collect(DiagnosticArray, '/diagnostics')
    # The node's own time, which ticks meanwhile, is decades beyond the plan.
    graph.expect(lambda: health, 'diagnostics')

    def is_watching():
        graph.publish(STATES, state_msg(START))
        return bench.residuals

    graph.expect(is_watching, 'a residual')
    bench.synchronise()
    bench.feed(START + DURATION + WINDOW)
    assert float(bench.report()[2]['amplitude']) == pytest.approx(AMPLITUDE, rel=1e-6)


def _shuffled(msg):
    """Name the joints in another order, others among them."""
    entries = dict(zip(msg.name, msg.position, strict=True))
    msg.name = ['gripper', 'joint2', 'wheel', 'joint1']
    msg.position = [entries.get(name, 9.0) for name in msg.name]
    msg.velocity, msg.effort = [nan] * 4, [nan] * 4
    return msg


def _bare(msg):
    """Leave out velocities and efforts."""
    msg.velocity, msg.effort = [], []
    return msg


def _changing(msg):
    """Use one order of joints, then another."""
    return _shuffled(msg) if msg.header.stamp.nanosec % 40_000_000 else msg


@pytest.mark.parametrize('form', [_shuffled, _bare, _changing])
def test_joints_are_found_by_name_and_gaps_tolerated(bench, form):
    bench.plan(plan_msg())
    bench.feed(START + DURATION + WINDOW, form=form)
    _, message, values = bench.report()
    assert float(values['amplitude']) == pytest.approx(AMPLITUDE, rel=1e-6)
    assert float(values['frequency']) == pytest.approx(FREQUENCY, rel=1e-6)
    assert abs(float(values['final_error.joint1'])) < 1e-9
    if form is not _changing:
        assert 'rms_effort.joint1' not in values
        assert 'effort of joint1, joint2' in message


def test_the_residual_is_against_the_plan_and_then_against_the_final_pose(bench):
    shift = np.array((3e-3, -2e-3))

    def shifted(msg):
        msg.header.frame_id = 'base_link'
        msg.position = (np.array(msg.position) + shift).tolist()
        return msg

    bench.plan(plan_msg())
    bench.feed(START + DURATION + 0.2, form=shifted)
    for index, residual in enumerate(bench.residuals):
        time = START + index / RATE
        assert residual.header.stamp == stamps.time_msg(time)
        assert residual.header.frame_id == 'base_link'
        assert residual.name == list(JOINTS)
        wanted = shift + (0.0, swing(time - START - DURATION))
        # The plan's stamps are whole nanoseconds.
        assert residual.position.tolist() == pytest.approx(wanted, abs=1e-8)
        assert residual.velocity.tolist() == pytest.approx([0.0, 0.0], abs=1e-6)
        assert not residual.effort
    assert len(bench.residuals) == round((DURATION + 0.2) * RATE) + 1


def test_each_motion_has_its_report_and_latecomers_hear_the_last(graph, bench):
    bench.plan(plan_msg())
    bench.feed(START + DURATION + WINDOW)
    assert bench.report()[0] == DiagnosticStatus.WARN
    later = START + 10.0
    bench.plan(plan_msg(later, goal=2.0))
    bench.feed(later + DURATION + WINDOW, later, goal=2.0, amplitude=0.15)
    level, _, values = bench.report(2)
    assert level == DiagnosticStatus.ERROR
    assert float(values['amplitude']) == pytest.approx(0.15, rel=1e-6)
    late = graph.collect(DiagnosticArray, REPORT, interfaces.LATCHED)
    graph.expect(lambda: late, 'the latched report')
    assert late == bench.reports[1:]


def test_a_motion_that_follows_soon_cuts_the_window_short(bench):
    bench.plan(plan_msg())
    bench.feed(START + DURATION + 1.0)
    bench.plan(plan_msg(START + DURATION + 1.0, goal=0.0))
    _, message, values = bench.report()
    assert 'cut short' in message
    assert float(values['window']) == pytest.approx(1.0, abs=1.1 / RATE)
    assert float(values['amplitude']) == pytest.approx(AMPLITUDE, rel=1e-6)


def test_the_last_joint_of_the_plan_is_judged_whatever_it_is_called(bench):
    def renamed(msg):
        msg.name = ['base', 'spring']
        return msg

    bench.plan(plan_msg())
    bench.feed(START + 0.1)
    bench.plan(plan_msg(START + 5.0, joints=('base', 'spring')))
    bench.feed(START + 5.0 + DURATION + WINDOW, START + 5.0, renamed)
    _, _, values = bench.report()
    assert values['joint'] == 'spring'
    assert float(values['amplitude']) == pytest.approx(AMPLITUDE, rel=1e-6)
    assert abs(float(values['final_error.base'])) < 1e-9


def test_joint_states_that_stop_make_a_stale_report(graph):
    bench = Bench(graph, PARAMETERS | {'timeout': 0.2})
    bench.plan(plan_msg())
    bench.feed(START + DURATION + 1.5)
    level, message, values = bench.report()
    assert level == DiagnosticStatus.STALE
    assert 'no samples for' in message
    assert float(values['amplitude']) == pytest.approx(AMPLITUDE, rel=1e-6)
    assert float(values['window']) == pytest.approx(1.5)


def test_a_motion_that_nobody_measures_makes_a_stale_report(graph):
    bench = Bench(graph, PARAMETERS | {'timeout': 0.2})
    start = stamps.now(bench.node.get_clock()) + 0.1
    bench.plan(plan_msg(start))
    level, _, values = bench.report()
    assert level == DiagnosticStatus.STALE
    assert values['samples'] == '0'
    assert not {'amplitude', 'settled', 'window', 'final_error.joint1', 'bias'} & set(values)


def test_joint_states_without_a_stamp_count_from_their_receipt(graph):
    # By a clock that stands still while a state is on its way.
    bench = Bench(graph, PARAMETERS | {'use_sim_time': True})
    bench.plan(plan_msg())
    received = START + np.arange(round((DURATION + WINDOW) * RATE) + 1) / RATE
    for count, time in enumerate(received.tolist(), 1):
        now = stamps.time_msg(time)
        graph.publish('/clock', Clock(clock=now))
        graph.expect(lambda n=now: bench.node.get_clock().now().to_msg() == n, f'{time} s')
        msg = state_msg(time)
        msg.header.stamp = stamps.time_msg(0.0)
        graph.publish(STATES, msg)
        graph.expect(lambda n=count: len(bench.residuals) == n, 'a residual')
    _, _, values = bench.report()
    assert float(values['amplitude']) == pytest.approx(AMPLITUDE, rel=1e-6)
    assert float(values['frequency']) == pytest.approx(FREQUENCY, rel=1e-6)
    stamped = [stamps.seconds(residual.header.stamp) for residual in bench.residuals]
    assert stamped == pytest.approx(received, abs=1e-8)


def test_reset_forgets_the_motion_until_the_next_plan(graph, bench):
    bench.plan(plan_msg())
    bench.feed(START + DURATION + 1.0)
    response = graph.call(Trigger, RESET)
    assert response.success
    assert response.message == 'waiting for the next plan'
    heard = len(bench.residuals)
    for i in range(BURST):
        graph.publish(STATES, state_msg(START + DURATION + 1.1 + i / RATE))
    bench.synchronise()
    assert len(bench.residuals) == heard
    # Even an earlier time is welcome: the clock is forgotten, too.
    bench.plan(plan_msg(20.0))
    bench.feed(20.0 + DURATION + WINDOW, 20.0)
    assert bench.report()[2]['start_time'] == '20.000000000'


def test_a_simulation_started_anew_is_followed(graph, bench):
    bench.plan(plan_msg())
    bench.feed(START + DURATION + WINDOW)
    graph.publish(STATES, state_msg(9.0, 10.0))
    bench.synchronise()
    bench.plan(plan_msg(10.0))
    bench.feed(10.0 + DURATION + WINDOW, 10.0)
    assert bench.report(2)[2]['start_time'] == '10.000000000'


def _malformed():
    """Return plans that make no sense, each with a word of the complaint."""
    empty, unstamped, short, backwards, undefined, twice, infinite = (
        plan_msg(START + 1.0) for _ in range(7)
    )
    empty.points = []
    unstamped.header.stamp = stamps.time_msg(0.0)
    short.points[7].positions = [0.0]
    backwards.points[7].time_from_start = stamps.duration_msg(0.01)
    undefined.points[7].positions = [nan, 0.0]
    twice.joint_names = ['joint1', 'joint1']
    infinite.points[7].velocities = [0.0, inf]
    return {
        'times of a motion': empty,
        'header.stamp': unstamped,
        '1 positions for 2': short,
        'ascending': backwards,
        'positions must be finite, got nan rad': undefined,
        'unique': twice,
        'velocities must be finite, got inf rad/s': infinite,
        'joint names': JointTrajectory(),
    }


def test_a_plan_without_sense_is_ignored_in_words_and_disturbs_nothing(graph, bench):
    bench.plan(plan_msg())
    bench.feed(START + DURATION + 1.0)
    for complaint, msg in _malformed().items():
        bench.plan(msg)
        graph.expect(
            lambda words=complaint: any(words in w for w in graph.logged('plan ignored')),
            f'a warning with "{complaint}"',
        )
    bench.feed(START + DURATION + WINDOW, since=START + DURATION + 1.02)
    _, _, values = bench.report()
    assert values['start_time'] == '100.000000000'
    assert float(values['amplitude']) == pytest.approx(AMPLITUDE, rel=1e-6)


def test_joint_states_that_lack_a_joint_are_ignored_with_a_warning_for_each_kind(graph, bench):
    def interrupted(msg):
        for name, position in (('joint1', [0.3]), ('gripper', [0.1]), ('joint2', [])):
            other = JointState(header=msg.header, name=[name], position=position)
            graph.publish(STATES, other)
            bench.synchronise()
        return msg

    bench.plan(plan_msg())
    bench.feed(START)  # before, a part would be one of several that make a whole
    bench.feed(START + 0.1, since=START + 0.02, form=interrupted)
    bench.feed(START + DURATION + WINDOW, since=START + 0.12)
    assert float(bench.report()[2]['amplitude']) == pytest.approx(AMPLITUDE, rel=1e-6)
    graph.expect(lambda: len(graph.logged('joint state ignored')) > 2, 'warnings')
    assert graph.logged('joint state ignored') == [
        'joint state ignored: no joint joint2 among joint1',
        'joint state ignored: no joint joint1, joint2 among gripper',
        'joint state ignored: 0 positions for 1 joint names',
    ]


def test_undefined_positions_are_counted_and_dropped(graph, bench):
    def undefined_at_times(msg):
        if msg.header.stamp.nanosec % 100_000_000 == 40_000_000:
            msg.position[1] = nan
        return msg

    health = graph.collect(DiagnosticArray, '/diagnostics')
    bench.plan(plan_msg())
    bench.feed(START + DURATION + WINDOW + 0.02, form=undefined_at_times)
    assert float(bench.report()[2]['amplitude']) == pytest.approx(AMPLITUDE, rel=1e-6)
    health.clear()
    graph.expect(lambda: health, 'diagnostics')
    assert read(health[0])[2]['dropped_samples'] == '25'


def test_diagnostics_tell_phase_and_last_report_once_a_second(graph, bench):
    health = graph.collect(DiagnosticArray, '/diagnostics')

    def next_status():
        health.clear()
        graph.expect(lambda: health, 'diagnostics')
        return read(health[0])

    level, message, values = next_status()
    assert (level, values['phase']) == (DiagnosticStatus.OK, 'idle')
    assert 'no motion has been judged yet' in message
    first = stamps.seconds(health[0].header.stamp)
    assert next_status()[2] == {'phase': 'idle', 'dropped_samples': '0'}
    assert stamps.seconds(health[0].header.stamp) - first == pytest.approx(1.0, abs=0.5)
    bench.plan(plan_msg())
    bench.feed(START + DURATION + WINDOW)
    level, message, values = next_status()
    assert (level, values['phase']) == (DiagnosticStatus.WARN, 'done')
    assert message == f'done; last motion: {bench.report()[1]}'
    assert bench.report()[2].items() <= values.items()


def test_a_simulated_clock_that_stands_still_does_not_stop_the_monitor(graph):
    bench = Bench(graph, PARAMETERS | {'use_sim_time': True, 'timeout': 0.2})
    health = graph.collect(DiagnosticArray, '/diagnostics')
    bench.plan(plan_msg())
    bench.feed(START + DURATION + 1.0)
    # A pause of the simulation is no silence.
    graph.expect(lambda: len(health) >= 2, 'diagnostics')
    assert read(health[-1])[2]['phase'] == 'settling'
    bench.feed(START + DURATION + WINDOW, since=START + DURATION + 1.02)
    assert bench.report()[0] == DiagnosticStatus.WARN


def test_a_monitor_that_has_been_stopped_does_not_call_it_silence(graph):
    bench = Bench(graph, PARAMETERS | {'timeout': 1.0}, as_process=True)
    bench.plan(plan_msg())

    def is_heard(time):
        # Again and again: what another process is sent while it is found or stopped may be lost.
        graph.publish(STATES, state_msg(time))
        return bench.residuals and stamps.seconds(bench.residuals[-1].header.stamp) > time - 1e-6

    def feed(since, until):
        for time in np.arange(round(since * RATE), round(until * RATE) + 1) / RATE:
            graph.expect(lambda t=float(time): is_heard(t), f'the sample of {time} s')

    def pass_by(seconds):
        begin = monotonic()
        graph.expect(lambda: monotonic() - begin > seconds, f'{seconds} s')

    feed(START, START + 0.2)
    pass_by(0.4)  # shorter than the timeout, and some ticks of the monitor's timer
    os.kill(bench.process.pid, signal.SIGSTOP)
    pass_by(1.5)  # longer than the timeout
    os.kill(bench.process.pid, signal.SIGCONT)  # its timer may come before a sample
    feed(START + 0.22, START + DURATION + WINDOW)
    assert bench.report()[0] == DiagnosticStatus.WARN


def test_a_simulated_clock_that_is_first_heard_in_a_motion_is_no_silence(graph):
    bench = Bench(graph, PARAMETERS | {'use_sim_time': True, 'timeout': 0.2})
    health = graph.collect(DiagnosticArray, '/diagnostics')
    bench.plan(plan_msg())
    now = START + DURATION + 1.0
    bench.feed(now)
    graph.expect(lambda: health, 'diagnostics')

    def is_heard():
        graph.publish('/clock', Clock(clock=stamps.time_msg(now)))
        return bench.node.get_clock().now().nanoseconds

    graph.expect(is_heard, 'the clock')
    health.clear()
    graph.expect(lambda: len(health) >= 2, 'diagnostics')
    assert read(health[-1])[2]['phase'] == 'settling'
    assert not bench.reports


def test_parameters_can_be_changed_even_for_the_motion_being_watched(graph, bench):
    bench.plan(plan_msg())
    bench.feed(START + 0.2)
    results = graph.set_parameters(
        'flat_monitor',
        amplitude_ok=0.021,
        settling_band=0.03,
        window=1.0,
        **{'model.stiffness': 12.0e-3, 'model.damping': 0.0},
    )
    assert all(result.successful for result in results)
    bench.feed(START + DURATION + 1.0, since=START + 0.22)
    level, message, values = bench.report()
    assert level == DiagnosticStatus.OK
    assert 'within 0.021 rad' in message
    assert values['settled'] == 'true'
    assert float(values['settling_time']) == 0.0
    assert float(values['window']) == pytest.approx(1.0)
    inertia = 3.3e-5 * (6.4e-4 - 3.3e-5) / 6.4e-4
    expected = sqrt(12.0e-3 / inertia) / (2 * pi)
    assert float(values['frequency_expected']) == pytest.approx(expected, rel=1e-8)
    assert float(values['damping_expected']) == 0.0
    assert float(values['frequency']) == pytest.approx(FREQUENCY, rel=1e-6)


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        ({'amplitude_error': 1e-3}, 'amplitude_error 0.001 rad is below amplitude_ok'),
        ({'window': 0.3}, 'one period of the expected oscillation, 0.642 s'),
        ({'window': 100.0}, ''),
        ({'timeout': nan}, 'timeout'),
        ({'settling_band': 0.0}, 'settling_band must be finite and above 0 rad'),
        ({'joints': ['a', 'b']}, ''),
        ({'window': 3}, ''),
    ],
    ids=str,
)
def test_senseless_parameters_are_refused_with_a_reason(graph, change, reason):
    graph.create(MonitorNode)
    (result,) = graph.set_parameters('flat_monitor', **change)
    assert not result.successful
    assert result.reason
    assert reason in result.reason
    assert graph.get_parameters('flat_monitor', 'window') == [3.0]


def test_an_arm_that_does_not_swing_raises_no_expectation(graph):
    model = {
        'joints': list(JOINTS),
        'model.inertia_star': [6.4e-4, 3.3e-5],
        'model.stiffness': 3.0e-3,
        'model.damping': 1.0e-3,
    }
    bench = Bench(graph, PARAMETERS | model)
    bench.plan(plan_msg())
    bench.feed(START + DURATION + WINDOW)
    _, _, values = bench.report()
    assert not {'frequency_expected', 'damping_expected'} & set(values)
    assert float(values['amplitude']) == pytest.approx(AMPLITUDE, rel=1e-6)


def test_everything_moves_into_a_namespace(graph):
    graph.create(MonitorNode, PARAMETERS, namespace='left')
    residuals = graph.collect(JointState, '/left/flat_monitor/residual')
    graph.publish('/left/flat_planner/plan', plan_msg(), interfaces.LATCHED)
    graph.get_parameters('/left/flat_monitor', 'window')
    graph.publish('/left/joint_states', state_msg(START))
    graph.expect(lambda: residuals, 'a residual')


def test_an_interrupt_ends_the_process_well(graph):
    signals = (signal.SIGINT, signal.SIGTERM)
    processes = [graph.start('monitor_node') for _ in signals]
    graph.expect(lambda: graph.probe.count_publishers(REPORT) == len(signals), 'the monitors')
    for process, signal_number in zip(processes, signals, strict=True):
        assert process.stop(signal_number) == 0
        assert 'Traceback' not in process.stderr


def test_a_wrong_parameter_ends_the_process_with_one_line(graph):
    wrong = {'window:=3': 'write 1.0, not 1', 'timeout:=-1.0': 'timeout', 'windw:=3.0': 'window?'}
    processes = [graph.start('monitor_node', '--ros-args', '-p', value) for value in wrong]
    for process, words in zip(processes, wrong.values(), strict=True):
        assert process.wait() == 1
        complaints = [line for line in process.stderr.splitlines() if '[INFO]' not in line]
        assert len(complaints) == 1
        assert complaints[0].startswith('cannot start: ')
        assert words in complaints[0]


def never():
    """Return no time of arrival: the message has a stamp."""
    raise AssertionError('the stamp counts')


def test_a_reader_gives_the_sample_of_every_form_of_message():
    reader = JointStateReader(JOINTS)
    forms = [lambda msg: msg, _shuffled, _shuffled, _bare, _bare, lambda msg: msg]
    for i, form in enumerate(forms):
        time = START + DURATION + 0.25 + i
        plain = state_msg(time)
        (sample,) = reader.read(form(state_msg(time)), never)
        assert sample.time == time
        assert sample.positions.tolist() == plain.position.tolist()
        (again,) = JointStateReader(JOINTS).read(form(state_msg(time)), never)
        for name in ('positions', 'velocities', 'efforts'):
            np.testing.assert_equal(getattr(sample, name), getattr(again, name))
        assert (sample.velocities is None) == (sample.efforts is None) == (form is _bare)
    with pytest.raises(InvalidRequest, match='no joint joint1, joint2 among wheel'):
        reader.read(JointState(name=['wheel'], position=[0.0]), never)
    with pytest.raises(InvalidRequest, match='1 positions for 2'):
        reader.read(JointState(name=list(JOINTS), position=[0.0]), never)
    assert reader.read(state_msg(START), never)[0].positions.shape == (2,)
    assert not reader.take_remarks()


def test_a_residual_crosses_the_border_and_back():
    stamp = Time(sec=1_700_000_000, nanosec=250_000_000)
    header = Header(stamp=stamp, frame_id='base_link')
    for velocities in (np.array((3.0, nan)), None):
        residual = Residual(np.array((1e-9, -2.0)), velocities)
        msg = conversions.residual_msg(header, list(JOINTS), residual)
        assert msg.header == header
        assert not msg.effort
        (sample,) = JointStateReader(JOINTS).read(msg, never)
        assert sample.time == 1.7e9 + 0.25
        np.testing.assert_equal(sample.positions, residual.positions)
        np.testing.assert_equal(sample.velocities, velocities)


def test_a_plan_crosses_the_border():
    motion = conversions.planned_motion_from_trajectory(plan_msg())
    assert (motion.start, motion.end) == (START, START + DURATION)
    assert motion.final.tolist() == [GOAL, 0.0]
    position, velocity = motion.reference(START + DURATION / 2)
    assert position.tolist() == pytest.approx([GOAL / 2, 0.0])
    assert velocity.tolist() == pytest.approx([1.5 * GOAL / DURATION, 0.0])
    assert stamps.is_stamped(state_msg(1e-9))
    assert not stamps.is_stamped(state_msg(0.0))


def test_every_level_has_its_diagnostic_and_unknown_values_are_left_out():
    monitor = VibrationMonitor(MonitorSettings(timeout=0.5))
    motion = PlannedMotion(
        joint_names=JOINTS, start=1.0, times=np.array((0.0, 1.0)), positions=np.zeros((2, 2))
    )
    monitor.watch(motion)
    monitor.add(JointSample(time=1.0, positions=np.zeros(2)))
    (report,) = monitor.tick(2.5)
    for level in Level:
        status = diagnostics.report_status(replace(report, level=level))
        assert status.level == getattr(DiagnosticStatus, level.name)
        assert status.message == report.message
        assert {pair.key for pair in status.values} == {
            'start_time',
            'end_time',
            'joint',
            'samples',
        }
        later = diagnostics.monitor_status(replace(report, level=level), 'done', 3)
        assert later.level == status.level
        assert later.message == f'done; last motion: {report.message}'


def test_an_arm_that_ages_is_told_on_its_topic_and_once_in_the_log(graph):
    bench = Bench(graph)
    drifts = graph.collect(DiagnosticArray, '/flat_monitor/model_drift', interfaces.LATCHED)
    count = 22
    for k in range(count):
        start = START + 5.0 * k
        bench.plan(plan_msg(start))
        softer = FREQUENCY * (1.0 - 1e-3 * k)
        bench.feed(start + DURATION + WINDOW + 0.1, start, frequency=softer)
        bench.report(k + 1)
    graph.expect(lambda: len(drifts) == count - 19, 'drifts from the twentieth motion on')
    (status,) = drifts[-1].status
    told = {pair.key: pair.value for pair in status.values}
    assert status.name == interfaces.DRIFT_NAME
    assert status.level == DiagnosticStatus.WARN
    assert status.message.startswith('the arm ages: stiffness_ratio.held ')
    assert told['drifting'] == 'stiffness_ratio.held'
    assert told['motions'] == str(count - 1)
    squared = (2 * pi * FREQUENCY) ** 2 + DECAY**2
    assert float(told['stiffness_ratio.held']) == pytest.approx(
        squared * (1.0 - 1e-3 * (count - 1)) ** 2, rel=1e-3
    )
    assert float(told['stiffness_ratio.held_rate']) == pytest.approx(-2e-3 * squared, rel=0.03)
    assert len(graph.logged('the arm ages')) == 1
