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

"""The arm identifies itself: the monitor's estimate makes the planner's next motion right."""

from math import pi

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.parameters import planner, plant
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.wire import interfaces
import pytest
from rcl_interfaces.msg import SetParametersResult
from ros.rig import goal, Planner, REPORT, Suite, values
from std_srvs.srv import Trigger

STIFFNESS, DAMPING, INERTIA = 3e-3, 2e-5, (6.4e-4, 3.3e-5)
"""Nominal model: spring [N m/rad], damper [N m s/rad] and inertias [kg m^2] of the paper's arm."""

JOINT_INERTIA = {
    'free': INERTIA[1] * (1.0 - INERTIA[1] / INERTIA[0]),
    'held': INERTIA[1],
}
"""What the passive joint oscillates [kg m^2]: rotors in series, or the last link alone."""

QUEUE = 10
"""Joint states after which every node has read the first of them: twice the nodes' queue [-]."""

ADOPT = '/flat_planner/adopt_estimate'


class Tuned(Suite):
    """The three nodes, the plant differing from the model."""

    def __init__(self, graph, scale, planner=None, **plant):
        """Start them."""
        slow = {'start_delay': 0.4, 'strategy': 'polynomial'}
        mismatch = {f'mismatch.{name}_scale': scale for name in ('stiffness', 'damping')}
        super().__init__(graph, {**slow, **(planner or {})}, {**mismatch, **plant})

    def report(self, angle=pi):
        """Move from the initial pose to the goal; return the values of the report."""
        report = self.report_on_attempt(angle)
        assert self.outcomes()[-2:] == ['ACCEPTED', 'FINISHED']
        return report

    def report_on_attempt(self, angle=pi):
        """Move from the initial pose, to the goal or not; return the values of the report."""
        self.graph.call(Trigger, '/flat_plant/reset')
        self.graph.expect(lambda: not any(self.states[-1].velocity), 'the reset')
        seen = len(self.states)
        self.graph.expect(lambda: len(self.states) >= seen + QUEUE, 'the reset at the planner')
        _, report = self.carry_out(angle)
        return report

    def outcomes(self):
        """Return the states of all goals so far."""
        return [values(m)['state'] for m in self.status if m.status[0].name.endswith(': goal')]

    def adoptions(self):
        """Return the notices of a changed model."""
        return [m.status[0] for m in self.status if m.status[0].name == 'flat_planner: model']

    def model(self):
        """Return stiffness and damping as the planner's parameters say."""
        return self.graph.get_parameters('flat_planner', 'model.stiffness', 'model.damping')


def report_msg(start=5.0, factor=1.1, basis='free', **changes):
    """Return a report as the monitor makes it, with an estimate."""
    entries = {
        'start_time': start,
        'joint': 'joint2',
        'stiffness_estimate': factor * STIFFNESS,
        'stiffness_std': 1e-4 * STIFFNESS,
        'damping_estimate': factor * DAMPING,
        'damping_std': 1e-3 * DAMPING,
        'estimate_basis': basis,
        'estimate_inertia': JOINT_INERTIA[basis],
    } | changes
    pairs = [KeyValue(key=k, value=str(v)) for k, v in entries.items() if v is not None]
    status = DiagnosticStatus(name='flat_monitor: residual oscillation', values=pairs)
    return DiagnosticArray(status=[status])


class Told(Planner):
    """A planner alone, told by hand what a monitor would report."""

    def report(self, message):
        """Publish a report and let the planner read it."""
        self.graph.publish(REPORT, message, interfaces.LATCHED)
        for _ in range(3):
            self.model()

    def adopt(self):
        """Return success and message of the service."""
        response = self.graph.call(Trigger, ADOPT)
        return response.success, response.message

    def model(self):
        """Return stiffness and damping as the planner's parameters say."""
        return self.graph.get_parameters('flat_planner', 'model.stiffness', 'model.damping')


@pytest.mark.parametrize('scale', [1.1, 0.9, 1.25, 0.75])
def test_the_second_move_leaves_a_fiftieth_of_the_first(graph, scale):
    suite = Tuned(graph, scale)
    first = suite.report()
    amplitude = float(first['amplitude'])
    assert amplitude > 0.03
    assert float(first['stiffness_estimate']) == pytest.approx(scale * STIFFNESS, rel=1e-3)
    assert float(first['damping_estimate']) == pytest.approx(scale * DAMPING, rel=0.03)
    assert first['estimate_basis'] == 'free'
    again = suite.report()
    assert float(again['amplitude']) == pytest.approx(amplitude, rel=1e-3)
    response = graph.call(Trigger, ADOPT)
    assert response.success, response.message
    assert suite.model() == [float(again[f'{name}_estimate']) for name in ('stiffness', 'damping')]
    second = suite.report()
    assert float(second['amplitude']) <= 0.02 * amplitude
    (notice,) = suite.adoptions()
    assert notice.level == DiagnosticStatus.OK
    assert notice.message == response.message
    noted = {pair.key: pair.value for pair in notice.values}
    assert noted['state'] == 'ADOPTED'
    assert float(noted['stiffness_former']) == STIFFNESS
    assert noted['stiffness'] == again['stiffness_estimate']
    assert suite.outcomes() == 3 * ['ACCEPTED', 'FINISHED']


@pytest.mark.parametrize('scale', [1.1, 0.75])
def test_with_noise_and_without_being_asked(graph, scale):
    tuned = {'auto_tune': True}
    suite = Tuned(graph, scale, planner=tuned, **{'noise.position_std': 1e-4, 'noise.seed': 1})
    first = suite.report()
    error = float(first['stiffness_estimate']) - scale * STIFFNESS
    assert abs(error) < 4 * float(first['stiffness_std'])
    graph.expect(suite.adoptions, 'the adoption')
    assert suite.model()[0] == float(first['stiffness_estimate'])
    second = suite.report()
    assert float(second['amplitude']) <= 0.05 * float(first['amplitude'])
    # What is left is noise, or at most so little that the estimate confirms the model.
    assert len(suite.adoptions()) == 1
    assert suite.model()[0] == float(first['stiffness_estimate'])


def test_one_motion_tells_all_that_moves_the_last_links(graph):
    scale, friction = 1.25, {'friction.viscous': [2e-4], 'friction.coulomb': [5e-4]}
    tuned = {'auto_tune': True, 'compensate_friction': True, 'sampling.period': 0.005}
    plant = {'mismatch.inertia_scale': scale, 'publish_rate': 200.0, 'real_time_factor': 0.5}
    suite = Tuned(graph, scale, planner=tuned, **plant, **friction)
    graph.set_parameters('flat_monitor', fit_model=True)
    first = suite.report_on_attempt()
    names = 'inertia_star.both', 'inertia_star.last', 'stiffness', 'damping'
    for name, nominal in zip(names, (*INERTIA, STIFFNESS, DAMPING), strict=True):
        assert float(first[f'model.{name}']) == pytest.approx(scale * nominal, rel=0.03), name
        assert float(first[f'model.{name}_std']) > 0.0
    assert float(first['model.coulomb_friction']) == pytest.approx(5e-4, rel=0.01)
    graph.expect(suite.adoptions, 'the adoption')
    own, followed = (
        graph.get_parameters(
            node, 'model.inertia_star', 'model.stiffness', 'friction.viscous', 'friction.coulomb'
        )
        for node in ('flat_planner', 'flat_monitor')
    )
    assert list(own[0]) == pytest.approx([scale * inertia for inertia in INERTIA], rel=0.03)
    second = suite.report()
    assert float(second['amplitude']) <= 0.02 * float(first['amplitude'])
    miss = [abs(float(report['final_error.joint1'])) for report in (first, second)]
    assert miss[1] <= 0.02 * miss[0]
    assert [list(v) if hasattr(v, '__len__') else v for v in followed] == [
        pytest.approx(list(v) if hasattr(v, '__len__') else v) for v in own
    ]


def test_below_the_noise_the_estimate_is_withheld(graph):
    suite = Tuned(graph, 1.0, planner={'auto_tune': True}, **{'noise.position_std': 1e-4})
    report = suite.report()
    assert not [key for key in report if 'estimate' in key or key.endswith('_std')]
    message = suite.reports[-1].status[0].message
    assert 'no oscillation above noise' in message
    assert 'stiffness and damping not estimated' in message
    response = graph.call(Trigger, ADOPT)
    assert not response.success
    assert 'no trustworthy estimate' in response.message
    assert suite.adoptions() == []
    assert suite.model() == [STIFFNESS, DAMPING]


def test_a_motor_that_holds_is_recognised(graph):
    gains = {'feedback.p': [2.0], 'feedback.d': [0.05], 'integration_step': 2.5e-4}
    suite = Tuned(graph, 1.1, **gains)
    report = suite.report(1.0)
    assert report['estimate_basis'] == 'held'
    assert float(report['stiffness_estimate']) == pytest.approx(1.1 * STIFFNESS, rel=5e-3)


def test_what_was_adopted_is_kept_in_a_file_that_the_nodes_read(graph, tmp_path):
    path = tmp_path / 'arm_model.yaml'
    bench = Told(graph, {'save_model.path': str(path)})
    saved = graph.call(Trigger, '/flat_planner/save_model')
    assert (saved.success, saved.message) == (True, f'the model is saved in {path}')
    assert 'nothing has been adopted' in path.read_text('utf-8')
    bench.report(report_msg())
    assert bench.adopt()[0]
    saved = graph.call(Trigger, '/flat_planner/save_model')
    assert saved.message == f'the model is saved in {path}; what was there is now {path}.1'
    assert 'stiffness 0.003 -> 0.0033' in path.read_text('utf-8')
    for module, node in ((planner, 'flat_planner'), (plant, 'flat_plant')):
        settings = read_settings(path, module.ROWS, module.build, node=node)
        arm = settings.session.arm if module is planner else settings.simulation.arm
        assert [arm.stiffness, arm.damping] == pytest.approx(bench.model())
    again = graph.create(MonitorNode, None, '--params-file', str(path))
    assert again.get_parameter('model.stiffness').value == pytest.approx(1.1 * STIFFNESS)


def test_a_file_that_cannot_be_written_is_said(graph, tmp_path):
    Told(graph, {'save_model.path': str(tmp_path / 'none' / 'arm.yaml')})
    saved = graph.call(Trigger, '/flat_planner/save_model')
    assert not saved.success
    assert saved.message == f'cannot write {tmp_path}/none/arm.yaml: No such file or directory'


@pytest.mark.parametrize('basis', ['free', 'held'])
def test_an_estimate_is_adopted_once(graph, basis):
    bench = Told(graph)
    assert bench.adopt() == (False, 'no trustworthy estimate has been reported yet')
    bench.report(report_msg(basis=basis))
    # A later report without an estimate does not take this one away.
    bench.report(report_msg(start=9.0, stiffness_estimate=None))
    success, message = bench.adopt()
    assert success, message
    assert '0.003 -> 0.0033' in message
    assert bench.model() == pytest.approx([1.1 * STIFFNESS, 1.1 * DAMPING])
    graph.set_parameters('flat_planner', **{'model.stiffness': STIFFNESS})
    success, message = bench.adopt()
    assert not success
    assert 'has been adopted already' in message
    bench.report(report_msg(basis=basis))
    assert not bench.adopt()[0]
    assert bench.model()[0] == STIFFNESS
    bench.report(report_msg(start=12.0, basis=basis))
    assert bench.adopt()[0]
    assert len(bench.status) == 2


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'estimate_inertia': 1.01 * JOINT_INERTIA['free']}, 'give both nodes the same model'),
        ({'joint': 'elbow'}, 'the estimate is of elbow, not of joint2'),
        ({'factor': 1.0}, 'nothing to adopt'),
        ({'factor': 1.0002}, 'nothing to adopt'),
        ({'estimate_basis': 'loose'}, 'no trustworthy estimate'),
        ({'stiffness_std': None}, 'no trustworthy estimate'),
        ({'stiffness_estimate': 'nan'}, 'no trustworthy estimate'),
        ({'stiffness_estimate': '-3e-3'}, 'no trustworthy estimate'),
    ],
)
def test_what_does_not_fit_is_refused_with_a_reason(graph, changes, reason):
    bench = Told(graph)
    bench.report(report_msg(**changes))
    success, answer = bench.adopt()
    assert not success
    assert reason in answer
    assert bench.model() == [STIFFNESS, DAMPING]
    assert bench.status == []


def test_parameters_that_refuse_leave_the_estimate_for_later(graph):
    bench = Told(graph)
    bench.report(report_msg())

    def refuse(_):
        return SetParametersResult(successful=False, reason='locked')

    bench.node.add_on_set_parameters_callback(refuse)
    assert bench.adopt() == (False, 'the parameters refuse the estimate: locked')
    assert bench.status == []
    assert bench.model() == [STIFFNESS, DAMPING]
    bench.node.remove_on_set_parameters_callback(refuse)
    assert bench.adopt()[0]


def test_auto_tune_leaves_estimates_from_other_motions_alone(graph):
    parameters = {'auto_tune': True, 'execute': False}
    rest = {'start.source': 'parameter', 'start.position': [0.0, 0.0]}
    bench = Told(graph, parameters | rest)
    bench.report(report_msg())
    start = float(bench.ask(goal(1.0))['start_time'])
    bench.report(report_msg(start=start - 1.0))
    assert bench.model() == [STIFFNESS, DAMPING]
    bench.report(report_msg(start=f'{start:.9f}'))
    graph.expect(lambda: len(bench.status) == 2, 'the adoption')
    assert bench.model() == pytest.approx([1.1 * STIFFNESS, 1.1 * DAMPING])
