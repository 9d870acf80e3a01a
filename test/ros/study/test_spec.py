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

"""Specifications of studies: what they say, and what is said of those that mean nothing."""

from pathlib import Path
import shlex

from flat_planner_ros.core.arm import Drive, FlatPlannerError
from flat_planner_ros.core.planning import Strategy
from flat_planner_ros.core.study import ACCEPTED, Answer, answer, InvalidStudy
from flat_planner_ros.ros.programs import flat_plan
from flat_planner_ros.ros.study.cases import Cases
from flat_planner_ros.ros.study.line import flat_plan_line
from flat_planner_ros.ros.study.spec import label_of, read_spec
import numpy as np
import pytest

CONFIG = Path(__file__).resolve().parents[3] / 'config'

WIDE = """
study:
  params_file: {config}/arm_2dof.yaml
  seed: 5
  repeats: 2
  set: {{goal.joint1: 90deg, duration: 1, plant.mismatch.damping_scale: 1.5}}
  axes:
    method:
      - {{strategy: polynomial}}
      - {{strategy: mixed, weights.r: 100, weights.p: 20}}
    drive: [effort, position]
    start.joint1: {{from: -1.0, to: 1.0, count: 3}}
    model.stiffness: {{uniform: [2.0e-3, 4.0e-3]}}
    plant.mismatch.stiffness_scale: {{loguniform: [0.8, 1.25]}}
    payload: {{choice: [0.0, 0.5]}}
    model.inertia_star[2]: {{normal: [3.3e-5, 1.0e-6]}}
    limits.effort[1]: [1.0, .inf]
"""


def spec_of(tmp_path, text):
    """Return a specification."""
    path = tmp_path / 'study.yaml'
    path.write_text(text.format(config=CONFIG), encoding='utf-8')
    return read_spec(path)


def cases_of(spec):
    """Return all cases, as one table of numbers makes them."""
    made = Cases(spec=spec)
    found = {}
    for batch in made(spec.axes.columns(0, spec.axes.count)):
        assert not isinstance(batch, tuple), batch
        for index, place in enumerate(batch.places.tolist()):
            found[place] = batch.case(index)
    return [found[place] for place in range(spec.axes.count)]


def test_every_name_reaches_its_place(tmp_path):
    spec = spec_of(tmp_path, WIDE)
    assert spec.axes.count == 2 * 2 * 3 * 2 * 2
    columns, cases = spec.axes.columns(0, spec.axes.count), cases_of(spec)
    for row, case in enumerate(cases):
        values = {name: column.tolist()[row] for name, column in columns.items()}
        arm, options, true = case.settings.arm, case.settings.options, case.true
        assert options.strategy is Strategy(values['strategy'])
        assert options.r == values['weights.r']
        assert case.drive is options.drive is Drive(values['drive'])
        assert case.final == (pytest.approx(np.pi / 2), 0.0)
        assert case.start == (values['start.joint1'], 0.0)
        assert case.duration == 1.0
        assert arm.stiffness == values['model.stiffness']
        assert arm.inertia_star.last == values['model.inertia_star[2]']
        assert case.settings.limits.effort[0] == values['limits.effort[1]']
        scale = values['plant.mismatch.stiffness_scale']
        assert true.stiffness == pytest.approx(scale * arm.stiffness)
        assert true.damping == pytest.approx(1.5 * arm.damping)
        payload = values['payload'] * arm.inertia_star.last
        assert true.inertia_star == pytest.approx(np.array(arm.inertia_star) + payload)
    assert {case.settings.options.r for case in cases} == {None, 100.0}


def test_numbers_in_arrays_are_what_parameters_would_be(tmp_path):
    """The same values, as numbers of a batch and as parameters of nodes that start with them."""
    spec = spec_of(tmp_path, WIDE)
    made = Cases(spec=spec)
    for row in (0, 11, 47):
        columns = spec.axes.columns(row, row + 1)
        (batch,) = made(columns)
        values = {n: c.tolist()[0] for n, c in columns.items() if c.tolist()[0] is not None}
        slow = made.template({**spec.fixed, **values}).case
        fast = batch.case(0)
        assert fast.settings.arm.inertia == pytest.approx(slow.settings.arm.inertia)
        assert fast.settings.arm.stiffness == slow.settings.arm.stiffness
        assert fast.true.damping == pytest.approx(slow.true.damping)
        assert (fast.start, fast.final, fast.duration) == (slow.start, slow.final, slow.duration)


def test_via_points_in_both_forms(tmp_path):
    text = """
study:
  set: {{goal.joint1: 2.0, duration: 2.0, via: joint1=0.5@0.5}}
  axes:
    via.2.joint1: {{uniform: [1.0, 1.5]}}
    via.2.time: [1.0, 1.25]
"""
    spec = spec_of(tmp_path, text)
    columns = spec.axes.columns(0, 2)
    for row, case in enumerate(cases_of(spec)):
        first, second = case.via
        assert (first.time, first.position) == (0.5, (0.5, 0.0))
        assert second.time == columns['via.2.time'][row]
        assert second.position[0] == columns['via.2.joint1'][row]
        assert answer(case).verdict == ACCEPTED


@pytest.mark.parametrize(
    'text',
    [
        WIDE,
        """
/**:
  ros__parameters:
    joints: [shoulder, elbow, tip]
    model:
      inertia_star: [6.4e-4, 3.3e-5]
      stiffness: 3.0e-3
      damping: 2.0e-5
      link_length: [0.2]
      link_com: [0.1]
      link_mass: [0.3]
      link_inertia: [1.0e-3]
study:
  set: {{goal.elbow: 1.0, start.shoulder: 0.25, via: elbow=0.4}}
  axes:
    goal.shoulder: {{uniform: [-1.0, 1.0]}}
    duration: [1.5, 2.0]
    compensate_friction: [true, false]
""",
        """
study:
  set: {{goal.joint1: pi}}
  axes:
    duration: {{uniform: [0.5, 2.0]}}
    limits.effort: [[0.01], [0.02]]
    model.damping: {{loguniform: [1.0e-6, 1.0e-4]}}
""",
    ],
    ids=['wide', 'three joints and a via point', 'limits'],
)
def test_flat_plan_repeats_a_row(tmp_path, capsys, text):
    if 'limits.effort: [[' in text:
        text = text.replace('[0.01], [0.02]', '[0.01, .inf], [0.02, .inf]')
    spec = spec_of(tmp_path, text)
    made, cases = Cases(spec=spec), cases_of(spec)
    for row in sorted({0, spec.axes.count // 2, spec.axes.count - 1}):
        said = answer(cases[row])
        words = shlex.split(flat_plan_line(made, row, cases[row]))
        assert words[0] == 'flat_plan'
        code = flat_plan.main(words[1:])
        captured = capsys.readouterr()
        assert (code == 0) == (said.verdict == ACCEPTED), captured.err
        if code:
            assert said.message in captured.err
            continue
        peak = next(line for line in captured.out.splitlines() if 'peak_effort.' in line)
        joint = peak.split()[0].partition('.')[2]
        index = cases[row].settings.joints.index(joint)
        assert float(peak.split()[1]) == pytest.approx(
            said.motion.plan.peak_effort[index], rel=1e-4
        )


def test_rows_that_no_node_would_take_are_refused_and_no_others(tmp_path):
    text = """
study:
  set: {{goal.joint1: 1.0, duration: 1.0}}
  axes:
    plant.mismatch.stiffness_scale: [1.0, -1.0, 2000.0]
    weights.energy: [1.0, -1.0]
"""
    spec = spec_of(tmp_path, text)
    found = Cases(spec=spec)(spec.axes.columns(0, 6))
    refused = {
        place: part.answer for part in found if isinstance(part, tuple) for place in part.places
    }
    assert sorted(refused) == [1, 2, 3, 4, 5]
    assert {said.verdict for said in refused.values()} == {'InvalidParameter'}
    assert 'weights.energy must be' in refused[1].message


def test_a_fingerprint_is_that_of_one_table(tmp_path):
    first = spec_of(tmp_path, WIDE).fingerprint
    assert spec_of(tmp_path, WIDE).fingerprint == first
    assert spec_of(tmp_path, WIDE.replace('seed: 5', 'seed: 6')).fingerprint != first
    assert spec_of(tmp_path, WIDE.replace('damping_scale: 1.5', 'damping_scale: 1.4')) != first


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        ('a: 1', 'has no block study'),
        ('study: {{axis: {{}}}}', "unknown 'axis' in study:; did you mean axes"),
        (
            'study: {{axes: {{stratgy: [mixed]}}}}',
            'nothing is called stratgy; did you mean strategy',
        ),
        ('study: {{axes: {{duration: 1.0}}}}', 'duration: an axis is a list'),
        ('study: {{axes: {{duration: {{from: 1, to: 2}}}}}}', 'count is missing'),
        ('study: {{axes: {{duration: {{gauss: [1, 2]}}}}}}', 'a random axis is one of uniform'),
        ('study: {{axes: {{strategy: {{uniform: [1, 2]}}}}}}', 'uniform is for numbers'),
        ('study: {{set: {{duration: long}}}}', "duration must be a number, got 'long'"),
        ('study: {{repeats: 0}}', 'repeats must be a whole number above 0'),
        ('study: {{params_file: none.yaml}}', 'cannot read'),
        ('study: {{axes: {{duration: [1.0]}}}}', 'names no goal: set goal.JOINT'),
        ('study: {{set: {{goal.joint1: 1, via: joint1=x}}}}', "via: 'joint1=x' is not JOINT=RAD"),
        ('study: {{set: {{goal.joint1: 1.0}}, axes: {{via: [joint1=1@x]}}}}', 'via: .*joint1=1@x'),
        ('study: {{axes: {{"strategy[1]": [a]}}}}', r'nothing is called strategy\[1\]'),
    ],
)
def test_what_means_nothing_is_said_with_what_would(tmp_path, text, complaint):
    with pytest.raises(FlatPlannerError, match=complaint):
        spec_of(tmp_path, text)


def test_a_joint_that_is_none_is_named(tmp_path):
    spec = spec_of(tmp_path, 'study: {{axes: {{goal.elbow: [1.0]}}}}')
    (refused,) = Cases(spec=spec)(spec.axes.columns(0, 1))
    assert isinstance(refused.answer, Answer)
    assert 'joint1, joint2' in refused.answer.message
    assert issubclass(InvalidStudy, FlatPlannerError)


def test_columns_are_labelled_with_units():
    assert label_of('model.stiffness') == 'model.stiffness [N m/rad]'
    assert label_of('limits.effort[1]') == 'limits.effort[1] [N m]'
    assert label_of('simulated_residual') == 'simulated residual [rad]'
    assert label_of('peak_effort.elbow') == 'peak effort.elbow [N m]'
    assert label_of('goal.joint1') == 'goal.joint1 [rad]'
    assert label_of('verdict') == 'verdict'
