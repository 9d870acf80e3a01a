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

"""The planner on the command line: the same plans, numbers and refusals as the node's."""

import csv
import json
from math import pi
from pathlib import Path
import subprocess
import sys

from flat_planner_ros.ros.programs import flat_plan
from flat_planner_ros.ros.programs.angles import angle_of
import numpy as np
import pytest

CONFIG = Path(__file__).resolve().parents[3] / 'config'


def test_a_plan_is_summed_up(capsys):
    assert flat_plan.main(['joint1=3.14159265', '--duration', '1']) == 0
    shown = capsys.readouterr().out
    lines = dict(line.split(None, 1) for line in shown.splitlines()[1:])
    assert float(lines['rms_effort.joint1'].removesuffix(' N m')) == pytest.approx(
        0.007427, rel=1e-3
    )
    assert lines['duration'] == '1 s'
    assert lines['predicted_residual'].endswith(' rad')
    assert lines['strategy'] == 'min_control_effort'
    assert float(lines['boundary_residual']) < 1e-9


def test_points_are_written_as_csv_and_json(tmp_path, capsys):
    arguments = ['joint1=1.0', '--duration', '0.5', '--csv', str(tmp_path / 'plan.csv')]
    assert flat_plan.main([*arguments, '--json', '-', '--start', 'joint1=-1']) == 0
    content = json.loads(capsys.readouterr().out)
    with open(tmp_path / 'plan.csv', newline='') as file:
        rows = list(csv.reader(file))
    assert rows[0][0] == 'time [s]'
    assert rows[0][-2:] == ['effort joint1 [N m]', 'effort joint2 [N m]']
    table = np.array(rows[1:], dtype=float)
    assert table.shape == (101, 9)
    assert (table[:, 0] == content['times']).all()
    assert (table[:, 1:3] == np.array(content['positions'])).all()
    assert (table[:, 7:] == np.array(content['efforts'])).all()
    assert table[0, 1:3].tolist() == [-1.0, 0.0]
    assert table[-1, 1:3].tolist() == [1.0, 0.0]
    assert content['summary']['duration'] == 0.5


def test_a_figure_is_drawn(tmp_path):
    pytest.importorskip('matplotlib')
    path = tmp_path / 'plan.png'
    assert flat_plan.main(['joint1=1.0', '--duration', '0.5', '--plot', str(path)]) == 0
    assert path.read_bytes().startswith(b'\x89PNG')


def test_the_arm_and_the_strategy_come_from_parameters(capsys):
    arguments = ['joint1=3.14159265', '--duration', '1', '-p', 'strategy:=polynomial']
    assert flat_plan.main([*arguments, '--params-file', str(CONFIG / 'arm_2dof.yaml')]) == 0
    shown = capsys.readouterr().out
    assert shown.startswith('polynomial, 1 s')


@pytest.mark.parametrize(
    ('arguments', 'text'),
    [
        (['joint7=1', '--duration', '1'], "INVALID_JOINTS (-2): unknown joint 'joint7'"),
        (['joint1=nan', '--duration', '1'], 'NON_FINITE (-102)'),
        (['joint2=1', '--duration', '1'], 'PASSIVE_JOINT_NOT_ZERO (-106)'),
        (['joint1=1', '--duration', '1e9'], 'DURATION_OUT_OF_RANGE (-113)'),
        (['joint1=1', '--duration', '1', '--start', 'elbow=1'], "unknown joint 'elbow'"),
        (['joint1=1', '--duration', '1', '--params-file', 'missing.yaml'], 'missing.yaml'),
        (['joint1=1', '--duration', '1', '-p', 'strategy:=fastest'], 'strategy'),
        (['joint1=1', '--duration', '1', '--csv', '/nowhere/plan.csv'], '/nowhere/plan.csv'),
    ],
)
def test_a_refusal_is_one_line(arguments, text, capsys):
    assert flat_plan.main(arguments) == 1
    captured = capsys.readouterr()
    assert captured.err.startswith('flat_plan: ')
    assert text in captured.err
    assert len(captured.err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    'arguments', [[], ['joint1'], ['joint1=x'], ['joint1=1', '--via', 'joint1=0.5@soon']]
)
def test_a_wrong_call_is_explained(arguments, capsys):
    with pytest.raises(SystemExit) as caught:
        flat_plan.main(arguments)
    assert caught.value.code == 2
    assert 'usage: flat_plan' in capsys.readouterr().err


def test_help_has_examples_that_work():
    command = [sys.executable, '-m', 'flat_planner_ros.ros.programs.flat_plan']
    shown = subprocess.run([*command, '--help'], capture_output=True, text=True, check=True)
    assert 'examples:' in shown.stdout
    run = subprocess.run(
        [*command, f'joint1={pi}', '--duration', '1'], capture_output=True, text=True, check=True
    )
    assert 'rms_effort.joint1' in run.stdout


@pytest.mark.parametrize(
    ('text', 'angle'),
    [
        ('1.57', 1.57),
        ('-1e-1', -0.1),
        ('90deg', pi / 2.0),
        ('-45°', -pi / 4.0),
        ('pi', pi),
        ('-pi/2', -pi / 2.0),
        ('3*pi/4', 0.75 * pi),
        ('2pi', 2.0 * pi),
        ('1.5e0π/3', 0.5 * pi),
        ('2rad', 2.0),
    ],
)
def test_angles_as_people_write_them(text, angle):
    assert angle_of(text) == pytest.approx(angle, rel=1e-15)


@pytest.mark.parametrize('text', ['', 'deg', 'pie', 'pi/', '1.2.3pi', '90 deg 5', 'pi*2'])
def test_what_is_no_angle_is_refused(text):
    with pytest.raises(ValueError, match='float'):
        angle_of(text)


def test_degrees_and_parts_of_pi_are_taken(capsys):
    assert flat_plan.main(['joint1=180deg', '--duration', '1', '--via', 'joint1=pi/2@0.5']) == 0
    same = capsys.readouterr().out
    assert (
        flat_plan.main([f'joint1={pi}', '--duration', '1', '--via', f'joint1={pi / 2}@0.5']) == 0
    )
    assert float(_cost(same)) == pytest.approx(float(_cost(capsys.readouterr().out)), rel=1e-9)


def _cost(text):
    """Return the cost in a summary."""
    return next(line.split()[1] for line in text.splitlines() if line.startswith('  cost'))


def test_many_turns_are_remarked(capsys):
    assert flat_plan.main(['joint1=90', '--duration', '5']) == 0
    assert '14.3 turns; angles are in radians' in capsys.readouterr().err


@pytest.mark.parametrize('name', ['plan.xyz', 'plan'])
def test_an_unknown_kind_of_picture_is_refused_before_anything_is_planned(name, tmp_path, capsys):
    with pytest.raises(SystemExit) as caught:
        flat_plan.main(['joint1=1', '--duration', '1', '--plot', str(tmp_path / name)])
    assert caught.value.code == 2
    shown = capsys.readouterr()
    assert 'ends in .png' in shown.err
    assert not shown.out
