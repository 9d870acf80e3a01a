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

"""Settings read from a parameter file are those of a node that is started with it."""

from pathlib import Path

from flat_planner_ros.core import FlatPlannerError
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.parameters import planner as planner_parameters
from flat_planner_ros.ros.parameters import plant as plant_parameters
from flat_planner_ros.ros.parameters.arm_model import EXAMPLE_ARM
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.parameters.row import InvalidParameter
from flat_planner_ros.ros.wire import interfaces
import pytest

CHECKOUT = Path(__file__).resolve().parents[3]
SHIPPED = CHECKOUT / 'config' / 'arm_2dof.yaml'

MODEL = """
/**:
  ros__parameters:
    joints: [joint1, joint2]
    model: {inertia_star: [6.4e-4, 3.3e-5], stiffness: 3e-3, damping: 2e-5}
"""


def planner_settings(path, *overrides, node=interfaces.PLANNER, warn=lambda text: None):
    """Return the planner's settings from a file."""
    return read_settings(
        path,
        planner_parameters.ROWS,
        planner_parameters.build,
        node=node,
        overrides=overrides,
        warn=warn,
    )


def written(tmp_path, text):
    """Return a parameter file."""
    path = tmp_path / 'arm.yaml'
    path.write_text(text)
    return path


def as_node(graph, path, *arguments):
    """Return the settings of a real node, or its complaint."""
    options = ['--params-file', str(path), *arguments]
    try:
        node = graph.create(PlannerNode, None, *options)
    except FlatPlannerError as error:
        return str(error)
    return node._configuration.settings


def facts(settings):
    """Return the settings as a comparable value."""
    session = settings.session
    arm, options = session.arm, session.options
    return (
        session.joints,
        tuple(arm.inertia_star),
        arm.stiffness,
        arm.damping,
        arm.gravity,
        options.strategy,
        options.effort_weight,
        options.energy_weight,
        options.r,
        options.p,
        options.flat_model,
        session.period,
        session.start_source,
        session.start_position,
        settings.reference_rate,
        settings.auto_tune,
    )


BLOCKS = {
    'shipped': SHIPPED.read_text('utf-8'),
    'numbers without a decimal point': MODEL,
    'node beats wildcard': MODEL + 'flat_planner:\n  ros__parameters: {weights.r: 20.0}\n',
    'slash': MODEL + '/flat_planner:\n  ros__parameters: {weights: {r: 30.0}}\n',
    'any namespace': MODEL + '/**/flat_planner:\n  ros__parameters: {weights.p: 3.0}\n',
    'another node': MODEL + 'flat_plant:\n  ros__parameters: {weights.p: 3.0}\n',
    'one part': MODEL + '/*:\n  ros__parameters: {weights.p: 4.0}\n',
    'two parts': MODEL + '/*/*:\n  ros__parameters: {weights.p: 4.0}\n',
    'earlier block': 'flat_planner:\n  ros__parameters: {model.stiffness: 1.0}\n' + MODEL,
    'words': MODEL + 'flat_planner:\n  ros__parameters: {auto_tune: yes, strategy: mixed}\n',
}


@pytest.mark.parametrize('text', BLOCKS.values(), ids=BLOCKS)
def test_the_same_settings_as_the_node(graph, tmp_path, text):
    path = written(tmp_path, text)
    assert facts(planner_settings(path)) == facts(as_node(graph, path))


WRONG = {
    'integer': 'flat_planner:\n  ros__parameters: {weights.r: 3}\n',
    'integers': 'flat_planner:\n  ros__parameters: {start.position: [0, 1]}\n',
    'text': 'flat_planner:\n  ros__parameters: {strategy: 5.0}\n',
    'choice': 'flat_planner:\n  ros__parameters: {strategy: fastest}\n',
    'range': 'flat_planner:\n  ros__parameters: {weights.r: -1.0}\n',
    'two forms': 'flat_planner:\n  ros__parameters: {weights: {r: 1.0, effort: 1.0}}\n',
    'misspelt': 'flat_planner:\n  ros__parameters: {weights.rr: 1.0}\n',
    'other form': 'flat_planner:\n  ros__parameters: {model.counterbalance_mass: [1.0, 1.0]}\n',
    'contradiction': 'flat_planner:\n  ros__parameters: {duration: {min: 2.0, max: 1.0}}\n',
}


@pytest.mark.parametrize('text', WRONG.values(), ids=WRONG)
def test_the_same_complaint_as_the_node(graph, tmp_path, text):
    path = written(tmp_path, MODEL + text)
    with pytest.raises(FlatPlannerError) as refused:
        planner_settings(path)
    assert str(refused.value) == as_node(graph, path)


def test_overrides_win_as_on_the_command_line(graph):
    texts = ('strategy:=mixed', 'weights.r:=1e1', 'start.position:=[0.5, 0.0]')
    arguments = [argument for text in texts for argument in ('-p', f'flat_planner:{text}')]
    assert facts(planner_settings(SHIPPED, *texts)) == facts(as_node(graph, SHIPPED, *arguments))


def test_namespaces_decide(tmp_path):
    text = MODEL + '/left/flat_planner:\n  ros__parameters: {weights.r: 5.0}\n'
    text += 'right:\n  flat_planner:\n    ros__parameters: {weights.r: 6.0}\n'
    path = written(tmp_path, text)
    assert planner_settings(path).session.options.r is None
    assert planner_settings(path, node='/left/flat_planner').session.options.r == 5.0
    assert planner_settings(path, node='right/flat_planner').session.options.r == 6.0


def test_without_a_file_the_defaults_hold():
    arm = planner_settings(None).session.arm
    assert list(arm.inertia_star) == EXAMPLE_ARM['model.inertia_star']


def test_other_nodes_read_their_own_block():
    arguments = (plant_parameters.ROWS, plant_parameters.build)
    plant = read_settings(SHIPPED, *arguments, node=interfaces.PLANT)
    with pytest.raises(InvalidParameter, match='publish_rate'):
        read_settings(
            SHIPPED, *arguments, node=interfaces.PLANT, overrides=['publish_rate:=5000.0']
        )
    assert plant is not None


def test_unknown_names_are_mentioned(tmp_path):
    heard = []
    path = written(tmp_path, MODEL + 'flat_planner:\n  ros__parameters: {colour: red}\n')
    planner_settings(path, warn=heard.append)
    assert heard == ['parameter colour is unknown here and has no effect']


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        ('', 'no block'),
        ('[1, 2', 'not valid YAML'),
        ('flat_planner: 3', 'every block needs ros__parameters'),
        (
            MODEL + 'flat_planner:\n  ros__parameters: {start.position: [0.5, 0]}\n',
            'start.position has values of several types',
        ),
    ],
)
def test_a_file_that_is_none_is_refused(tmp_path, text, complaint):
    with pytest.raises(InvalidParameter, match=complaint):
        planner_settings(written(tmp_path, text))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InvalidParameter, match='none.yaml: No such file'):
        planner_settings(tmp_path / 'none.yaml')


@pytest.mark.parametrize('override', ['strategy', 'strategy:=', ':=1'])
def test_an_override_has_a_name_and_a_value(override):
    with pytest.raises(InvalidParameter, match='name:=value'):
        planner_settings(SHIPPED, override)
