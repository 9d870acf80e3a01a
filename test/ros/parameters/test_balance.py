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

"""Arms balanced by hand: what is accepted, what follows by itself, what is said of the rest."""

from flat_planner_ros.core.arm import FlatPlannerError, imbalance
from flat_planner_ros.core.session import Goal, GoalPoint, PlannerSession
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.parameters import planner, plant
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.wire.diagnostics import accepted_status
import numpy as np
import pytest

MODEL = """
/**:
  ros__parameters:
    joints: [shoulder, elbow]
    model:
      link_length: [0.20, 0.15]
      link_com: [0.11, 0.075]
      link_mass: [0.20, 0.05]
      link_inertia: [8.0e-4, 1.0e-4]
      counterbalance_mass: MASS
      counterbalance_arm: ARM
      stiffness: 0.12
      damping: 2.0e-4
flat_planner:
  ros__parameters:
    start: {source: parameter, position: [0.0, 0.0]}
"""
MASS = '[0.8, 0.15]'
ROUNDED = '[0.0775, 0.0251]'
"""Arms that somebody has written down: exact are 0.0775 and 0.025 m."""


@pytest.fixture
def written(tmp_path):
    def write(mass=MASS, arm=ROUNDED):
        path = tmp_path / 'arm.yaml'
        path.write_text(MODEL.replace('MASS', mass).replace('ARM', arm), 'utf-8')
        return path

    return write


def session(path, *overrides):
    """Return the settings of a planner's session."""
    found = read_settings(
        path, planner.ROWS, planner.build, node='flat_planner', overrides=overrides
    )
    return found.session


@pytest.mark.parametrize('kinds', [(MASS, 'auto'), ('auto', '[0.05, 0.025]')])
def test_what_balances_follows_by_itself(written, kinds):
    settings = session(written(*kinds))
    settings.arm.check_flat()
    assert settings.built is None


def test_a_rounded_arm_is_planned_for_as_balanced(written):
    path = written()
    settings = session(path)
    settings.arm.check_flat()
    assert 1e-4 < imbalance(settings.built) < 0.02
    simulated = read_settings(path, plant.ROWS, plant.build, node='flat_plant').simulation.arm
    np.testing.assert_array_equal(simulated.static_moment, settings.built.static_moment)


def test_more_is_refused_with_what_would_mend_it(written):
    with pytest.raises(FlatPlannerError, match=r'model\.max_imbalance = 0; what balances both'):
        session(written(), 'model.max_imbalance:=0.0')
    with pytest.raises(FlatPlannerError, match='or counterbalance_arm: auto'):
        session(written(arm='[0.05, 0.02]'))


@pytest.mark.parametrize(
    ('mass', 'arm', 'complaint'),
    [
        ('auto', 'auto', 'both auto: give one'),
        (MASS, 'automatic', 'must be of type double array (write [1.0, 2.0], not [1, 2]) or auto'),
        (MASS, '[1, 2]', 'must be of type double array'),
        (MASS, '[1.0, a]', 'must be of type double array'),
        ('[0.0, 0.0]', 'auto', 'must have mass above 0'),
    ],
)
def test_words_that_say_no_counterbalance(written, mass, arm, complaint):
    with pytest.raises(FlatPlannerError) as refused:
        session(written(mass, arm))
    assert complaint in str(refused.value)


def test_every_verdict_says_what_imbalance_leaves(written):
    settings = session(written())
    goal = Goal(joint_names=('shoulder',), points=(GoalPoint(time=1.0, positions=(1.5,)),))
    motion = PlannerSession(settings).submit(goal, 10.0)
    said = accepted_status(motion, goal, settings.joints, 0.0, built=settings.built)
    left = float({pair.key: pair.value for pair in said.values}['imbalance_residual'])
    assert 1e-5 < left < 5e-3
    assert f'; imbalance leaves about {left:.2g} rad' in said.message
    assert said.level == b'\x00'
    said = accepted_status(motion, goal, settings.joints, 0.0)
    assert 'imbalance' not in said.message


def test_a_node_says_at_its_start_what_imbalance_leaves(graph, written):
    node = graph.create(PlannerNode, None, '--params-file', str(written()))
    assert "% of the last links' inertia, which leaves about" in node.introduction
    change = {'model.counterbalance_arm': 'auto'}
    assert graph.set_parameters('/flat_planner', **change)[0].successful
    assert 'imbalance' not in node.introduction
    refused = graph.set_parameters('/flat_planner', **{'model.counterbalance_arm': 'hand'})[0]
    assert 'or auto' in refused.reason
