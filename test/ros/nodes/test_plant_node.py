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

"""The plant node on a real graph: true dynamics, commands by time, a time of its own if asked."""

from math import inf, nan
from pathlib import Path
import signal
from time import monotonic

from flat_planner_ros.core import EffortProfile, FlatPlannerError, PlanarArm
from flat_planner_ros.core.plant import DriveSettings, PacedArm, rollout
from flat_planner_ros.ros.nodes.plant_node import CLOCK_START, PlantNode
from flat_planner_ros.ros.parameters.arm_model import EXAMPLE_ARM
from flat_planner_ros.ros.wire import conversions, stamps
import numpy as np
import pytest
from rcl_interfaces.msg import Log
from rclpy.exceptions import ParameterException
from ros.rig import Rig, stamp
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

COMMAND = '/flat_planner/joint_trajectory'
EFFORTS = '/flat_planner/effort_commands'
RESET = '/flat_plant/reset'
PUSH = '/flat_plant/push'

QUICK = {'publish_clock': True, 'real_time_factor': 5.0, 'publish_rate': 50.0}
"""Five simulated seconds per second, so few samples that the test's own node keeps up."""

QUEUE = 20_000
"""Joint states that may wait for a test on a busy machine."""

BUSY = 'this machine is too slow or busy'
"""What a plant says that makes the time when it has less of it than asked for."""

LEAD = 1.5
"""From sending a command to its start, in simulated time [s]."""

PAPER = PlanarArm.reduced(
    inertia_star=EXAMPLE_ARM['model.inertia_star'],
    stiffness=EXAMPLE_ARM['model.stiffness'],
    damping=EXAMPLE_ARM['model.damping'],
)
PEAK = 1e-3
"""Of the efforts commanded here [N m]."""


class Plant(Rig):
    """The node under test and everything that it shows."""

    def __init__(self, graph, parameters=None, *arguments):
        """Listen first, so that nothing is missed, then start it."""
        super().__init__(graph)
        self.hear_plant(qos=QUEUE, matched=False)
        self.node = graph.create(PlantNode, parameters, *arguments)
        if not self.node.get_parameter('use_sim_time').value:
            graph.expect(lambda: self.states, 'a joint state')

    @property
    def times(self) -> np.ndarray:
        """Return the stamps of all joint states [s]."""
        return np.array([stamp(state) for state in self.states])

    def table(self, field: str) -> np.ndarray:
        """Return an array of all joint states, shape (samples, joints)."""
        return np.array([getattr(state, field) for state in self.states])

    def now(self) -> float:
        """Return the stamp of the newest joint state [s]."""
        return stamp(self.states[-1])

    def time(self) -> float:
        """Return the plant's time, which joint states on their way do not show yet [s]."""
        return self.node._arm.time

    def ahead(self) -> float:
        """Return a start that the plant will not have reached when it gets the command [s]."""
        return self.time() + LEAD

    def drive(self, until: float, period: float = 0.01):
        """
        Let a plant that follows /clock go on to a time, in paces that it need not skip.

        From one joint state to the next it takes less than a `period` [s].
        """
        while newest(self.states) < until - period:
            time = min(newest(self.states) + 0.2, until) if self.states else until
            self.graph.publish('/clock', Clock(clock=stamps.time_msg(time)))
            self.graph.expect(lambda t=time: newest(self.states) > t - period, f'{time:.3f} s')

    def play(self, start: float, **fields):
        """Send a command and wait until it is over."""
        self.graph.publish(COMMAND, trajectory(start, **fields))
        self.wait_until(start + fields.get('duration', 1.0))

    def logged(self, text: str) -> list[str]:
        """Wait for a log entry with a text; return all of them."""
        self.graph.expect(lambda: self.graph.logged(text), f'a log entry with "{text}"')
        return self.graph.logged(text)


def wave(duration=1.0, points=101):
    """Return times [s] and one sine wave of effort [N m]."""
    times = np.linspace(0.0, duration, points)
    efforts = PEAK * np.sin(2 * np.pi * times / duration)
    efforts[-1] = 0.0
    return times, efforts


def trajectory(start, duration=1.0, **fields):
    """Return a command of one sine wave as the planner would send it, with other fields."""
    times, efforts = wave(duration)
    points = [
        JointTrajectoryPoint(time_from_start=stamps.duration_msg(t), effort=[e, 0.0])
        for t, e in zip(times.tolist(), efforts.tolist(), strict=True)
    ]
    message = JointTrajectory(joint_names=['joint1', 'joint2'], points=points)
    message.header.stamp = stamps.time_msg(start)
    for name, value in fields.items():
        setattr(message, name, value)
    return message


def expected_motion(arm, start, times, **options):
    """Return positions of the core's rollout, at rest before the start, shape (samples, 2)."""
    wave_times, efforts = wave()
    profile = EffortProfile(start=0.0, times=wave_times, efforts=efforts[:, None])
    motion = rollout(arm, profile, times[-1] - start + 0.01, step=1e-3, **options)
    index = np.maximum(np.rint((times - start) / 1e-3).astype(int), 0)
    return motion.positions[index]


@pytest.fixture
def plant(graph) -> Plant:
    """Return a plant with a quick time of its own."""
    return Plant(graph, QUICK)


def newest(states) -> float:
    """Return the stamp of the last of some joint states, 0 without any [s]."""
    return stamp(states[-1]) if states else 0.0


def complaints(graph) -> list[str]:
    """Return what was complained about, the machine aside."""
    said = [entry.msg for entry in graph.log if entry.level > Log.INFO]
    return [text for text in said if BUSY not in text]


def test_joint_states_come_evenly_at_200_hz(graph):
    plant = Plant(graph)
    latest = graph.collect(JointState, '/joint_states', 1)
    plant.wait_until(plant.now() + 1.0)
    first = plant.states[0]
    assert first.name == ['joint1', 'joint2']
    assert all(len(getattr(first, f)) == 2 for f in ('position', 'velocity', 'effort'))
    steps = np.diff(plant.times) / 5e-3
    assert steps == pytest.approx(np.rint(steps), abs=2e-4)
    if any(np.rint(steps) != 1.0):  # on a busy machine, which the plant tells
        plant.logged('skipped to keep up')
    else:
        assert not complaints(graph)
    clock = plant.node.get_clock()
    graph.expect(lambda: latest and stamps.now(clock) - stamp(latest[-1]) < 2.0, 'the present')
    assert plant.now() <= stamps.now(clock)
    assert np.array_equal(plant.table('position'), np.zeros((len(plant.states), 2)))


@pytest.mark.parametrize('rate', [1000.0, 30.0])
def test_the_rate_may_be_chosen(graph, rate):
    plant = Plant(graph, {'publish_rate': rate, 'use_sim_time': True})
    plant.drive(100.0, 1.0 / rate)
    plant.drive(100.5, 1.0 / rate)
    assert len(plant.times) >= 0.5 * rate
    assert np.diff(plant.times) == pytest.approx(1.0 / rate, abs=1e-6)


def test_a_command_is_played_by_time_and_its_effort_shown(plant, graph):
    start = plant.ahead()
    plant.play(start)
    plant.wait_until(start + 2.0)
    positions, velocities = plant.table('position'), plant.table('velocity')
    expected = expected_motion(PAPER, start, plant.times)
    assert np.abs(positions - expected).max() < 1e-9
    assert np.ptp(positions[:, 1]) > 0.05
    efforts = plant.table('effort')
    planned = np.interp(plant.times - start, *wave())
    assert np.abs(efforts[:, 0] - planned).max() < 1e-12
    spring = PAPER.passive_effort(positions[:, 1], velocities[:, 1])
    assert efforts[:, 1] == pytest.approx(spring, abs=1e-15)
    assert spring == pytest.approx(-3e-3 * positions[:, 1] - 2e-5 * velocities[:, 1])
    assert not complaints(graph)


def test_a_command_may_leave_the_passive_joint_out_and_start_on_arrival(plant):
    message = trajectory(0.0, joint_names=['joint1'])
    for point in message.points:
        point.effort = point.effort[:1]
    plant.graph.publish(COMMAND, message)
    plant.graph.expect(lambda: plant.states[-1].effort[0] != 0.0, 'an effort')
    plant.wait_until(plant.now() + 1.2)
    efforts = plant.table('effort')[:, 0]
    assert efforts.max() == pytest.approx(PEAK, rel=1e-2)
    assert efforts[-1] == 0.0


def test_a_late_command_is_played_from_the_present_with_a_warning(plant):
    start = plant.time() - 0.4
    plant.play(start)
    (warning,) = plant.logged('after its start')
    late_ms = float(warning.split('arrived ')[1].split(' ms')[0])
    assert 400.0 <= late_ms < 1000.0
    efforts, planned = plant.table('effort')[:, 0], np.interp(plant.times - start, *wave())
    played = plant.times > start + 1e-3 * late_ms + 1e-6
    assert efforts[played] == pytest.approx(planned[played], abs=1e-12)
    assert not efforts[~played].any()


def test_mismatch_takes_effect_while_it_runs(plant, graph):
    scale = {'mismatch.stiffness_scale': 1.1, 'mismatch.damping_scale': 1.1}
    assert all(answer.successful for answer in graph.set_parameters('flat_plant', **scale))
    start = plant.ahead()
    plant.play(start)
    other = PAPER.scaled(stiffness=1.1, damping=1.1)
    error = plant.table('position') - expected_motion(other, start, plant.times)
    assert np.abs(error).max() < 1e-9
    error = plant.table('position') - expected_motion(PAPER, start, plant.times)
    assert np.abs(error).max() > 1e-3
    graph.set_parameters('flat_plant', **{'mismatch.inertia_scale': 2.0})
    assert np.allclose(plant.node._arm.settings.arm.inertia_star, 2 * np.array([6.4e-4, 3.3e-5]))


def test_mismatch_during_a_motion_keeps_the_state(graph):
    plant = Plant(graph, {'use_sim_time': True})
    start = 100.3
    plant.drive(start - 0.3)
    graph.publish(COMMAND, trajectory(start))
    graph.expect(lambda: plant.node._arm._profile, 'the command at the plant')
    plant.drive(start + 0.5)  # The time stands still while the parameter is set.
    graph.set_parameters('flat_plant', **{'mismatch.stiffness_scale': 5.0})
    plant.drive(start + 1.0)
    position, velocity = plant.table('position'), plant.table('velocity')
    # Trapezoidal rule at 200 Hz: a jump would leave more than its error.
    travelled = 0.5 * (velocity[1:] + velocity[:-1]) * 0.005
    assert np.diff(position, axis=0) == pytest.approx(travelled, abs=2e-2 * np.ptp(position))
    assert np.abs(position - expected_motion(PAPER, start, plant.times)).max() > 1e-3


def test_reset_brings_it_to_rest_where_it_started(graph):
    plant = Plant(graph, {**QUICK, 'initial_position': [0.5, 0.0]})
    start = plant.ahead()
    graph.publish(COMMAND, trajectory(start, duration=5.0))
    plant.wait_until(start + 1.0)
    assert plant.states[-1].effort[0] != 0.0
    answer = graph.call(Trigger, RESET)
    assert answer.success
    assert '0.5, 0' in answer.message
    reset = plant.time() + 0.1
    plant.wait_until(reset + 0.5)
    after = plant.times > reset
    assert np.array_equal(plant.table('position')[after], [[0.5, 0.0]] * after.sum())
    assert not plant.table('effort')[after].any()
    assert np.diff(plant.times) == pytest.approx(0.02, abs=1e-8)


def point(time=0.5, effort=(0.0, 0.0), **fields):
    """Return one point of a command."""
    duration = stamps.duration_msg(time)
    return JointTrajectoryPoint(time_from_start=duration, effort=list(effort), **fields)


def points(*efforts, times=(0.0, 0.5)):
    """Return a few points of a command."""
    return [point(t, effort) for t, effort in zip(times, efforts, strict=True)]


UNACCEPTABLE = {
    'empty': ({'points': []}, 'is empty'),
    'unknown joint': ({'joint_names': ['joint1', 'elbow']}, 'elbow'),
    'joint twice': ({'joint_names': ['joint1', 'joint1']}, 'expected'),
    'no joint': ({'joint_names': []}, 'expected'),
    'too many joints': ({'joint_names': ['joint1', 'joint2', 'joint3']}, 'joint3'),
    'no effort': ({'points': [point(effort=(), positions=[0.0, 0.0])]}, '0 effort for 2'),
    'short effort': ({'points': points([0.0, 0.0], [0.0])}, 'point 1 has 1 effort'),
    'short positions': ({'points': [point(positions=[0.0])]}, '1 positions for 2'),
    'velocities alone': ({'points': [point(velocities=[0.0, 0.0])]}, 'velocities need'),
    'NaN': ({'points': points([nan, 0.0], [0.0, 0.0])}, 'finite'),
    'infinity': ({'points': points([-inf, 0.0], [0.0, 0.0])}, 'finite'),
    'passive effort': ({'points': points([0.0, 1e-3], [0.0, 0.0])}, 'passive joint'),
    'equal times': ({'points': points([0.0, 0.0], [0.0, 0.0], times=(0.5, 0.5))}, 'increase'),
    'falling times': ({'points': points([0.0, 0.0], [0.0, 0.0], times=(0.5, 0.4))}, 'increase'),
    'negative times': ({'points': points([0.0, 0.0], [0.0, 0.0], times=(-1.0, 5.0))}, 'negative'),
    'effort at the end': ({'points': points([0.0, 0.0], [1e-3, 0.0])}, 'last effort'),
    'short accelerations': ({'points': [point(accelerations=[0.0])]}, '1 accelerations for 2'),
    'NaN aside': ({'points': [point(accelerations=[0.0, nan])]}, 'accelerations must be finite'),
    'passive NaN': ({'points': [point(positions=[0.0, nan])]}, 'positions must be finite'),
    'speed at the end': (
        {'points': [point(positions=[0.0, 0.0], velocities=[1.0, 0.0])]},
        'last velocity',
    ),
    'beyond any motor': ({'points': points([1e300, 0.0], [0.0, 0.0])}, 'effort of 1e+300 N m'),
    'beyond any arm': ({'points': [point(positions=[1e300, 0.0])]}, 'position of 1e+300 rad'),
    'elsewhere': ({'points': [point(positions=[9.0, 0.0])]}, 'should be at 9 rad by now'),
    'over long ago': ({'stamp': 0.5, 'points': points([0.0, 0.0], [0.0, 0.0])}, 'it ended at'),
}
"""Fields of commands that cannot be played, and what is said of each."""


def test_what_cannot_be_played_is_ignored_and_the_running_motion_untouched(graph):
    plant = Plant(graph, {'use_sim_time': True})
    plant.drive(100.0)
    command = trajectory(100.5, duration=2.0)
    graph.publish(COMMAND, command)
    plant.drive(101.0)
    assert plant.states[-1].effort[0] != 0.0
    for number, (fields, text) in enumerate(UNACCEPTABLE.values(), 1):
        fields = dict(fields)
        graph.publish(COMMAND, trajectory(fields.pop('stamp', 101.0), **fields))
        graph.expect(lambda n=number: len(graph.logged('trajectory ignored: ')) == n, 'a warning')
        assert text in graph.logged('trajectory ignored: ')[-1]
    plant.drive(103.0)
    assert len(graph.logged('trajectory')) == len(UNACCEPTABLE)
    names = plant.states[0].name
    undisturbed = PacedArm(plant.node._arm.settings)
    samples = undisturbed.follow(100.0)
    points = conversions.points_of_message(command)
    undisturbed.command(conversions.effort_profile(points, names, 100.0))
    for time in (100.9, 101.8, 102.7, 103.0):
        samples += undisturbed.follow(time)
    count = len(plant.states)
    assert samples[count - 1].time > 102.9
    for sample, seen in zip(samples, plant.states, strict=False):
        assert seen.name == names
        assert seen.header.stamp == stamps.time_msg(sample.time)
        for field in ('position', 'velocity', 'effort'):
            assert list(getattr(seen, field)) == getattr(sample, field).tolist()
    assert np.ptp(plant.table('position')) > 0.1


def test_a_new_command_takes_the_place_of_the_running_one(plant, graph):
    start = plant.ahead()
    graph.publish(COMMAND, trajectory(start, duration=4.0))
    plant.wait_until(start + 0.5)
    second = plant.ahead()
    plant.play(second)
    efforts = plant.table('effort')[:, 0]
    after = plant.times >= second
    planned = np.interp(plant.times[after] - second, *wave())
    assert efforts[after] == pytest.approx(planned, abs=1e-12)
    assert np.abs(np.diff(efforts)).max() < 0.2 * PEAK


def test_it_publishes_the_time_from_its_very_start(graph):
    ticks = graph.collect(Clock, '/clock', matched=False)
    plant = Plant(graph, QUICK)
    graph.expect(lambda: len(ticks) > 20, 'the clock')
    graph.expect(lambda: len(plant.states) > 20, 'joint states')
    assert stamps.seconds(ticks[0].clock) == CLOCK_START
    shown = [state.header.stamp for state in plant.states[:20]]
    assert [tick.clock for tick in ticks[:20]] == shown


@pytest.mark.parametrize('factor', [0.0, 5.0])
def test_time_runs_as_fast_as_asked(graph, factor):
    started = monotonic()
    plant = Plant(graph, {**QUICK, 'real_time_factor': factor})
    assert graph.call(Trigger, RESET).success  # Callbacks are served all the same.
    begin = plant.time(), monotonic()

    def is_fast():
        nonlocal begin
        time, present = plant.time(), monotonic()
        simulated, passed = time - begin[0], present - begin[1]
        if simulated < 2.0:
            return False
        begin = time, present  # of the next try, if others had the machine in this one
        return simulated > 1.5 * passed

    graph.expect(is_fast, 'two simulated seconds in less than 1.3 s')
    if factor:
        assert plant.time() - CLOCK_START <= factor * (monotonic() - started)


def test_it_follows_a_clock_of_others(graph):
    plant = Plant(graph, {'use_sim_time': True})
    graph.publish(COMMAND, trajectory(0.0))
    plant.logged('no time yet')
    assert not plant.states
    for time in 100.0 + 0.01 * np.arange(50):
        plant.drive(time)
    times = plant.times
    assert len(times) >= 97
    assert times[0] == pytest.approx(100.0, abs=5e-3)
    assert np.diff(times) == pytest.approx(5e-3, abs=1e-6)
    assert times[-1] <= 100.49


def test_a_skipped_time_is_told_with_its_length(graph):
    plant = Plant(graph, {'use_sim_time': True})
    plant.drive(100.0)
    graph.publish('/clock', Clock(clock=stamps.time_msg(200.0)))
    (warning,) = plant.logged('skipped to keep up')
    graph.publish('/clock', Clock(clock=stamps.time_msg(200.1)))
    plant.wait_until(200.09)
    assert len(plant.states) < 30
    assert float(warning.split()[0]) == pytest.approx(100.0, abs=0.01)


def test_noise_and_encoder_are_those_asked_for(graph):
    plant = Plant(graph, {**QUICK, 'noise.position_std': 1e-3, 'noise.seed': 7})
    graph.expect(lambda: len(plant.states) > 250, '250 samples')
    noise = plant.table('position')
    assert noise.std() == pytest.approx(1e-3, rel=0.15)
    assert np.array_equal(
        noise[:250], 1e-3 * np.random.default_rng(7).standard_normal((len(noise), 2))[:250]
    )
    assert not plant.table('velocity').any()
    graph.set_parameters('flat_plant', **{'encoder.resolution': 0.01, 'noise.position_std': 0.1})
    changed = plant.time()
    plant.wait_until(changed + 1.0)
    steps = plant.table('position')[plant.times > changed] / 0.01
    assert steps == pytest.approx(np.rint(steps), abs=1e-6)
    assert np.unique(np.rint(steps)).size > 5


def test_saturation_clips_and_is_told_with_counts(graph):
    plant = Plant(graph, {**QUICK, 'torque.saturation': [PEAK / 2]})
    start = plant.ahead()
    plant.play(start)
    expected = expected_motion(
        PAPER, start, plant.times, drives=DriveSettings(saturation=(PEAK / 2,))
    )
    assert np.abs(plant.table('position') - expected).max() < 1e-9
    assert np.abs(plant.table('effort')[:, 0]).max() == PEAK / 2
    counts = [int(text.split()[-2]) for text in plant.logged('effort clipped')]
    graph.expect(
        lambda: sum(int(t.split()[-2]) for t in graph.logged('effort clipped')) > 660,
        'two thirds of all steps',
    )
    assert len(counts) <= 3


def test_feedback_holds_what_friction_would_stop(graph):
    friction = {**QUICK, 'friction.viscous': [2e-3]}
    gains = {'feedback.p': [0.05], 'feedback.d': [0.01]}
    ends = []
    for parameters in (friction, {**friction, **gains}):
        plant = Plant(graph, parameters)
        message = trajectory(plant.ahead())
        for sent in message.points:
            sent.positions = [0.2 * stamps.seconds(sent.time_from_start), 0.0]
            sent.effort = [0.0, 0.0]
        graph.publish(COMMAND, message)
        plant.wait_until(plant.ahead() + 3.0)
        ends.append(plant.states[-1].position[0])
        graph.remove(plant.node)
    assert ends[0] == 0.0
    assert ends[1] == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize('n', [3, 4])
def test_arms_of_more_joints_have_friction_mismatch_and_feedback(graph, n):
    file = Path(__file__).resolve().parents[3] / 'config' / f'arm_{n}dof.yaml'
    friction, gains = [0.02] * (n - 1), {'feedback.p': [80.0] * (n - 1)}
    changes = {
        'friction.viscous': friction,
        'friction.coulomb': [0.01] * (n - 1),
        'mismatch.stiffness_scale': 1.2,
        'mismatch.inertia_scale': 1.05,
        'feedback.d': [4.0] * (n - 1),
    }
    plant = Plant(
        graph, {**QUICK, 'real_time_factor': 2.0, **changes, **gains}, '--params-file', str(file)
    )
    settings = plant.node._arm.settings
    nominal = settings.arm.scaled(stiffness=1 / 1.2, inertia=1 / 1.05)
    assert settings.arm.viscous_friction == pytest.approx(friction)
    begin, start = np.array(settings.position), plant.ahead()
    message = JointTrajectory(joint_names=plant.states[0].name)
    message.header.stamp = stamps.time_msg(start)
    turn = 0.3 * np.eye(n)[0]
    for s in np.linspace(0.0, 1.0, 51):
        position = begin + turn * s**2 * (3 - 2 * s)
        effort = np.append(nominal.gravity_effort(position)[:-1], 0.0)
        velocity = turn * 6 * s * (1 - s)
        message.points.append(
            point(s, effort, positions=position.tolist(), velocities=velocity.tolist())
        )
    if not nominal.has_weight:
        message.points[-1].effort = [0.0] * n
    graph.publish(COMMAND, message)
    plant.wait_until(start + 2.5)
    positions = plant.table('position')
    assert np.isfinite(positions).all()
    assert positions[-1][: n - 1] == pytest.approx((begin + turn)[: n - 1], abs=0.02)
    assert np.array_equal(positions[plant.times < start], [begin] * (plant.times < start).sum())
    assert not graph.logged('ignored')


def test_efforts_move_it_instead_of_trajectories(graph):
    plant = Plant(graph, {**QUICK, 'input': 'effort', 'input_timeout': 10.0})
    assert graph.probe.count_subscribers(COMMAND) == 0
    graph.publish(EFFORTS, Float64MultiArray(data=[2e-4]))
    graph.expect(lambda: plant.states[-1].effort[0] == 2e-4, 'the effort')
    for bad in ([], [1.0, 2.0], [nan], [inf]):
        graph.publish(EFFORTS, Float64MultiArray(data=bad))
    plant.logged('effort ignored: ')
    plant.wait_until(plant.now() + 0.5)
    assert plant.states[-1].effort[0] == 2e-4
    assert plant.states[-1].velocity[0] > 0.0
    graph.publish(EFFORTS, Float64MultiArray(data=[0.0]))
    graph.expect(lambda: plant.states[-1].effort[0] == 0.0, 'no effort')


def test_a_push_moves_it_besides_and_one_that_does_not_suit_is_ignored(graph):
    plant = Plant(graph, QUICK)
    for bad in ([], [1.0], [0.0, nan], [0.0, 1e300]):
        graph.publish(PUSH, Float64MultiArray(data=bad))
    plant.logged('push ignored: ')
    assert not plant.table('velocity').any()
    graph.publish(PUSH, Float64MultiArray(data=[0.0, 1e-4]))
    graph.expect(lambda: plant.states[-1].velocity[1] != 0.0, 'a swing')
    assert not plant.table('effort')[:, 0].any()


def test_a_stream_of_efforts_moves_it_as_samples_that_are_held(graph):
    plant = Plant(graph, {'use_sim_time': True, 'input': 'effort'})
    plant.drive(100.0)
    period, (_, efforts) = 0.01, wave(points=101)
    starts = []
    for number, effort in enumerate(efforts.tolist()):
        starts.append(plant.time())
        graph.publish(EFFORTS, Float64MultiArray(data=[effort]))
        graph.expect(lambda e=effort: plant.node._arm._simulated._held.effort == e, 'the effort')
        plant.drive(100.0 + period * (number + 1))
    plant.drive(101.5)
    times, shown = plant.times, plant.table('effort')[:, 0]
    # At the very moment of a change a sample may belong to either side of it.
    held = [efforts[np.searchsorted(starts, times + shift) - 1] for shift in (-1e-6, 1e-6)]
    streamed = times > starts[0] + 1e-3
    assert ((shown == held[0]) | (shown == held[1]))[streamed].all()
    planned = expected_motion(PAPER, starts[0] + period / 2, times)
    assert np.abs(plant.table('position') - planned).max() < 2e-3
    assert np.ptp(planned[:, 0]) > 0.2
    assert not complaints(graph)


def test_a_stream_that_breaks_stops_safely_with_one_warning(graph):
    plant = Plant(graph, {**QUICK, 'input': 'effort', 'input_timeout': 0.5})
    graph.publish(EFFORTS, Float64MultiArray(data=[2e-4]))
    (warning,) = plant.logged('stream of efforts broke')
    assert 'none came for 0.5 s' in warning
    plant.wait_until(plant.now() + 5.0)
    applied = plant.times[plant.table('effort')[:, 0] != 0.0]
    assert np.ptp(applied) == pytest.approx(0.48, abs=0.03)
    assert len(graph.logged('stream of efforts broke')) == 1
    graph.publish(EFFORTS, Float64MultiArray(data=[1e-4]))  # and goes on with the next stream
    graph.expect(lambda: plant.states[-1].effort[0] == 1e-4, 'the effort')


def test_what_makes_no_sense_in_a_stream_is_ignored(graph):
    plant = Plant(graph, {**QUICK, 'input': 'effort', 'input_timeout': 10.0})
    for bad in ([], [1e-4, 0.0], [nan], [-inf], [1e300]):
        graph.publish(EFFORTS, Float64MultiArray(data=bad))
    plant.logged('effort ignored: ')
    plant.wait_until(plant.now() + 1.0)
    assert not plant.table('effort').any()


def test_an_arm_that_runs_away_is_stopped_until_it_is_reset(graph):
    plant = Plant(graph, QUICK)
    graph.publish(COMMAND, trajectory(0.0, points=points([1e5, 0.0], [0.0, 0.0])))
    plant.logged('stopped until it is reset: joint')
    graph.publish(COMMAND, trajectory(0.0))
    plant.logged('trajectory ignored: the arm has been stopped')
    for field in ('position', 'velocity', 'effort'):
        assert np.isfinite(plant.table(field)).all()
    assert not np.any(plant.states[-1].velocity)
    assert graph.call(Trigger, RESET).success
    plant.play(plant.ahead())
    assert np.abs(plant.table('effort')[-100:, 0]).max() == pytest.approx(PEAK, rel=0.05)


def test_names_follow_the_namespace_and_the_parameters(graph):
    states = graph.collect(JointState, '/left/joint_states', matched=False)
    graph.create(PlantNode, {**QUICK, **EXAMPLE_ARM, 'joints': ['a', 'b']}, '-r', '__ns:=/left')
    graph.expect(lambda: states, 'joint states')
    assert states[0].name == ['a', 'b']
    assert graph.probe.count_subscribers('/left/flat_planner/joint_trajectory') == 1
    assert graph.call(Trigger, '/left/flat_plant/reset').success
    assert graph.probe.count_publishers('/clock') == 1


CONTRADICTIONS = {
    'factor alone': ({'real_time_factor': 5.0}, 'needs publish_clock'),
    'free alone': ({'real_time_factor': 0.0}, 'needs publish_clock'),
    'two clocks': ({'publish_clock': True, 'use_sim_time': True}, 'exclude each other'),
    'position': ({'initial_position': [0.0]}, 'one number per joint, 2, got 1'),
    'saturation': ({'torque.saturation': [1.0, 1.0]}, 'per actuated joint, 1, got 2'),
    'negative saturation': ({'torque.saturation': [-1.0]}, 'torque.saturation must be'),
    'timeout': ({'input_timeout': 0.0}, 'input_timeout'),
    'tolerance': ({'start_tolerance': nan}, 'start_tolerance must be'),
    'gain': ({'feedback.p': [nan]}, 'feedback.p must be'),
    'rate': ({'publish_rate': 2000.0}, 'publish_rate'),
    'seed': ({'noise.seed': -1}, 'seed must be at least 0'),
    'input': ({'input': 'voltage'}, 'one of trajectory, effort'),
    'scale': ({'mismatch.stiffness_scale': 0.0}, 'stiffness_scale'),
    'typing error': ({'publish_rat': 100.0}, 'did you mean publish_rate?'),
}


@pytest.mark.parametrize('name', CONTRADICTIONS)
def test_settings_that_contradict_themselves_are_refused(graph, name):
    parameters, text = CONTRADICTIONS[name]
    with pytest.raises((FlatPlannerError, ParameterException), match=text.replace('?', r'\?')):
        graph.create(PlantNode, parameters)


def test_a_node_that_is_refused_is_not_in_the_graph(graph):
    with pytest.raises(FlatPlannerError) as caught:  # which keeps the half-made node
        graph.create(PlantNode, {'input_timeout': 0.0})
    assert caught.traceback
    graph.expect(lambda: graph.probe.get_node_names() == ['probe'], 'the probe alone')
    assert not graph.probe.count_publishers('joint_states')


def test_changes_that_make_no_sense_are_refused_with_a_reason(plant, graph):
    for name, value, text in (
        ('mismatch.stiffness_scale', -1.0, ''),
        ('mismatch.stiffness_scale', 1, ''),
        ('noise.seed', -1, 'at least 0'),
        ('publish_rate', 100.0, 'read-only'),
        ('model.stiffness', 1.0, 'read-only'),
    ):
        (answer,) = graph.set_parameters('flat_plant', **{name: value})
        assert not answer.successful
        assert answer.reason
        assert text in answer.reason
    assert plant.node._arm.settings.arm.stiffness == PAPER.stiffness


@pytest.mark.parametrize(
    ('arguments', 'text'),
    [
        (['-p', 'publish_rate:=200'], 'publish_rate must be of type double (write 1.0, not 1)'),
        (['-p', 'publish_clock:=true', '-p', 'use_sim_time:=true'], 'exclude each other'),
    ],
)
def test_a_bad_parameter_ends_the_node_with_one_line(graph, arguments, text):
    process = graph.start('plant_node', '--ros-args', *arguments)
    assert process.wait() == 1
    lines = [line for line in process.stderr.splitlines() if '[INFO]' not in line]
    assert len(lines) == 1
    assert lines[0].startswith('cannot start: ')
    assert text in lines[0]


@pytest.mark.parametrize(
    ('number', 'arguments'),
    [
        (signal.SIGINT, []),
        (signal.SIGTERM, ['-p', 'publish_rate:=1000.0']),
        (signal.SIGINT, ['-p', 'publish_clock:=true', '-p', 'real_time_factor:=0.0']),
    ],
)
def test_an_interrupt_ends_the_node_with_exit_code_0(graph, number, arguments):
    states = graph.collect(JointState, 'joint_states', matched=False)
    process = graph.start('plant_node', '--ros-args', *arguments)
    graph.expect(lambda: len(states) > 2, 'joint states of a spinning node')
    assert process.stop(number) == 0
    assert 'Traceback' not in process.stderr
