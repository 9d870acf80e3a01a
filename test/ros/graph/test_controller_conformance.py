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

"""Every command that the planner publishes can be played by joint_trajectory_controller."""

from copy import deepcopy
from functools import cache
from pathlib import Path
from types import SimpleNamespace

from builtin_interfaces.msg import Time
from flat_planner_ros.core import Strategy
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.parameters.arm_model import arm_of
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.parameters.planner import ROWS
from flat_planner_ros.ros.wire import stamps
import numpy as np
import pytest
from random_cases import cases
from ros.rig import goal
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger
from trajectory_controller import broken, Controller, PRECAUTIONS, REFUSALS
from trajectory_msgs.msg import JointTrajectory
import yaml

CONFIG = Path(__file__).resolve().parents[3] / 'config'
CONTROL = CONFIG / 'ros2_control'
GOALS = cases(25)
"""Random goals per strategy and form of the command."""

FORMS = {
    'effort': {},
    'effort_on_arrival': {'command.stamp': 'zero'},
    'position': {'command.include_passive_joint': False, 'command.include_effort': False},
}
"""Parameters of the planner for each form of the command."""


@cache
def read(name):
    """Return a parameter file."""
    return yaml.safe_load((CONTROL / name).read_text('utf-8'))


def controller(form):
    """Return the shipped controller that plays a form of the command."""
    file = f'{form.partition("_")[0]}_controllers.yaml'
    return Controller.of(read(file)['flat_arm_controller']['ros__parameters'])


class Session:
    """A planner on simulated time that answers goals with commands."""

    def __init__(self, graph, **parameters):
        """Start it at some time and rest."""
        self.graph, self.now = graph, 0.0
        fixed = {'start.source': 'parameter', 'start.position': [0.5, 0.0], 'use_sim_time': True}
        self.planner = graph.create(PlannerNode, {**fixed, **parameters})
        self.commands = graph.collect(JointTrajectory, 'flat_planner/joint_trajectory')
        self.advance(100.0)

    def advance(self, step):
        """Let time go on, until the planner knows."""
        self.now += step
        self.graph.publish('/clock', Clock(clock=stamps.time_msg(self.now)))
        self.graph.expect(
            lambda: self.planner.get_clock().now().nanoseconds >= round(self.now * 1e9),
            'the time',
        )

    def command(self, angles, duration):
        """Return the command that answers a goal, and when it was received."""
        message = goal(angles, duration)
        return self.answer(lambda: self.graph.publish('flat_planner/goal', message))

    def answer(self, ask):
        """Return the next command and the time."""
        count = len(self.commands)
        ask()
        self.graph.expect(lambda: len(self.commands) > count, 'a command')
        return self.commands[count], self.now


@pytest.mark.parametrize('form', FORMS)
@pytest.mark.parametrize('strategy', [s.value for s in Strategy if s.value != 'custom'])
def test_random_goals_give_commands_that_the_controller_plays(graph, form, strategy):
    player = controller(form)
    rng = np.random.default_rng([len(form), len(strategy)])
    session = Session(
        graph,
        strategy=strategy,
        **{'sampling.period': float(rng.choice([0.0005, 0.003, 0.005, 0.01]))},
        **FORMS[form],
    )
    for _ in range(GOALS):
        angle, duration = rng.uniform(-6.0, 6.0), rng.uniform(0.2, 4.0)
        msg, now = session.command(angle, duration)
        session.advance(duration + 1.0)
        assert broken(player, msg, now) == []
        assert list(msg.joint_names) == list(player.joints)
        assert msg.points[0].positions[0] == 0.5
        assert msg.points[-1].positions[0] == pytest.approx(angle, abs=1e-9)
        end = msg.points[-1].time_from_start
        assert stamps.seconds(end) == pytest.approx(duration, abs=1e-9)
        times = np.array([stamps.seconds(point.time_from_start) for point in msg.points])
        assert np.ptp(np.diff(times)) < 3e-9  # even, also where the period does not divide
        has_effort = [len(point.effort) > 0 for point in msg.points]
        assert all(has_effort) == any(has_effort) == form.startswith('effort')


@pytest.mark.parametrize('file', sorted(CONFIG.glob('arm_*.yaml')), ids=lambda file: file.stem)
def test_commands_of_every_shipped_arm_are_played(graph, file):
    values = read_settings(file, ROWS, dict, node='flat_planner')
    joints, arm = arm_of(values)
    player = Controller(
        joints=joints,
        command_joints=joints[:-1],
        command_interfaces=['effort'],
        state_interfaces=['position', 'velocity'],
        has_weight=arm.gravity != 0.0,
    )
    start = [0.0] * len(joints)
    session = Session(graph, **{**values, 'start.source': 'parameter', 'start.position': start})
    for duration in (1.37, 2.0):
        msg, now = session.command([0.4] * (len(joints) - 1), duration)
        assert broken(player, msg, now) == []
        assert tuple(msg.joint_names) == joints
        last = msg.points[-1]
        holding = arm.gravity_effort(np.array(last.positions))
        assert np.allclose(last.effort, holding, rtol=0, atol=1e-9 * max(1.0, *abs(holding)))
        session.advance(duration + 1.0)


@pytest.mark.parametrize('form', ['effort', 'position'])  # others need the first to end
def test_goals_in_motion_and_stops_give_commands_that_the_controller_plays(graph, form):
    player, session = controller(form), Session(graph, **FORMS[form])
    rng = np.random.default_rng(len(form))
    for _ in range(cases(5, 2)):
        session.command(rng.uniform(-3.0, 3.0), 2.0)
        session.advance(rng.uniform(0.3, 1.5))
        assert broken(player, *session.command(rng.uniform(-3.0, 3.0), 2.0)) == []
        session.advance(rng.uniform(0.3, 1.5))
        stop, now = session.answer(lambda: graph.call(Trigger, 'flat_planner/stop'))
        assert broken(player, stop, now) == []
        session.advance(10.0)


def spoil(name, msg):
    """Break one rule."""
    last, middle = msg.points[-1], msg.points[len(msg.points) // 2]
    spoilers = {
        'all joints': lambda: _drop_joint(msg),
        'some joints': lambda: msg.joint_names.clear(),
        'some points': lambda: msg.points.clear(),
        'known joints': lambda: msg.joint_names.__setitem__(1, 'elbow'),
        'rest at the end': lambda: last.velocities.__setitem__(0, 1e-6),
        'end in the future': lambda: setattr(msg.header, 'stamp', Time(sec=50)),
        'increasing times': lambda: setattr(
            middle, 'time_from_start', msg.points[len(msg.points) // 2 - 1].time_from_start
        ),
        'positions': lambda: middle.positions.pop(),
        'velocities': lambda: middle.velocities.pop(),
        'accelerations': lambda: middle.accelerations.pop(),
        'unique joints': lambda: msg.joint_names.__setitem__(1, 'joint1'),
        'effort size': lambda: middle.effort.pop(),
        'same fields': lambda: setattr(middle, 'accelerations', []),
        'finite': lambda: middle.effort.__setitem__(0, float('nan')),
        'first point at the start': lambda: msg.points.pop(0),
        'nothing left at the end': lambda: last.effort.__setitem__(0, 1e-3),
        'no effort for a joint without motor': lambda: middle.effort.__setitem__(1, 1e-3),
        'dense enough for linear effort': lambda: [msg.points.pop(10) for _ in range(2)],
    }
    spoilers[name]()


def _drop_joint(msg):
    """Leave out the passive joint."""
    msg.joint_names.pop()
    for point in msg.points:
        for field in ('positions', 'velocities', 'accelerations', 'effort'):
            getattr(point, field).pop()


def test_each_rule_finds_what_it_is_for(graph):
    player = controller('effort')
    good, now = Session(graph).command(1.0, 0.5)
    assert broken(player, good, now) == []
    for rule in (*REFUSALS, *PRECAUTIONS):
        if rule.name == 'effort interface':
            without = SimpleNamespace(**{**vars(player), 'command_interfaces': ['position']})
            assert rule.name in broken(without, good, now)
            continue
        bad = deepcopy(good)
        spoil(rule.name, bad)
        assert rule.name in broken(player, bad, now), rule.reason


@pytest.mark.parametrize('name', ['effort_controllers.yaml', 'position_controllers.yaml'])
def test_a_shipped_controller_can_be_configured(name):
    file = read(name)
    manager = file['controller_manager']['ros__parameters']
    types = {key: value['type'] for key, value in manager.items() if isinstance(value, dict)}
    assert types == {
        'joint_state_broadcaster': 'joint_state_broadcaster/JointStateBroadcaster',
        'flat_arm_controller': 'joint_trajectory_controller/JointTrajectoryController',
    }
    parameters = file['flat_arm_controller']['ros__parameters']
    assert Controller.of(parameters).faults() == []
    arm = yaml.safe_load((CONFIG / 'arm_2dof.yaml').read_text('utf-8'))
    joints = arm['/**']['ros__parameters']['joints']
    is_effort = parameters['command_interfaces'] == ['effort']
    assert parameters['joints'] == (joints if is_effort else joints[:-1])
    assert parameters.get('command_joints', joints[:-1]) == joints[:-1]
    assert set(parameters.get('gains', {})) <= set(joints[:-1])


@pytest.mark.parametrize(
    ('change', 'fault'),
    [
        ({'command_interfaces': ['effort', 'velocity']}, 'effort goes alone'),
        ({'state_interfaces': ['position']}, 'need both states'),
        ({'state_interfaces': ['velocity']}, 'states go'),
        ({'command_joints': ['joint3']}, 'subset'),
        ({'joints': ['joint1', 'joint1']}, 'unique'),
        ({'command_interfaces': ['force']}, 'command_interfaces must be known'),
        ({'command_interfaces': ['acceleration']}, 'acceleration needs'),
        ({'command_interfaces': ['velocity', 'effort']}, 'velocity goes alone'),
    ],
)
def test_a_controller_that_cannot_be_configured_is_found(change, fault):
    parameters = {**read('effort_controllers.yaml')['flat_arm_controller']['ros__parameters']}
    faults = Controller.of({**parameters, **change}).faults()
    assert any(fault in found for found in faults), faults


def test_the_planners_overlay_is_the_form_that_was_tested():
    overlay = read('planner_position.yaml')['/**/flat_planner']['ros__parameters']
    values = {f'command.{name}': value for name, value in overlay['command'].items()}
    assert values == FORMS['position']
