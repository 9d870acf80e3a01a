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

"""What a beginner types, and is told: nothing wrong is silent, nothing is said unkindly."""

from pathlib import Path

from flat_planner_ros.ros.programs import flat_plan, identify, live_view, make_urdf, tradeoff
import pytest

MOTION = ['joint1=1.0', '--duration', '0.5']
FILES = {
    'other.yaml': 'planner:\n  ros__parameters:\n    limits: {effort: [0.001, .inf]}\n',
    'far.yaml': '/left/robot:\n  ros__parameters:\n    strategy: mixed\n',
    'broken.yaml': 'flat_planner: [1,\n',
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Work in a folder with some parameter files."""
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        Path(name).write_text(text, 'utf-8')
    return tmp_path


WRONG_CALLS = {
    'two outputs, one file': (
        flat_plan,
        [*MOTION, '--csv', 'a', '--json', './a'],
        'two outputs would be one file',
    ),
    'an output over the input': (
        flat_plan,
        [*MOTION, '--params-file', 'other.yaml', '--csv', 'other.yaml'],
        'is read, and would be overwritten',
    ),
    'a model over the one it began with': (
        identify,
        ['identify', 'a.mcap', '--params-file', 'other.yaml', '-o', 'other.yaml'],
        'is read, and would be overwritten',
    ),
    'no time': (flat_plan, ['joint1=1', '--duration', '0'], "'0' is no time above 0 in seconds"),
    'a time with its unit': (
        flat_plan,
        ['joint1=1', '--duration', '1s'],
        "'1s' is no time above 0 in seconds, e.g. 1.5",
    ),
    'a time below 0': (tradeoff, ['joint1=1', '--duration', '-1'], "'-1' is no time above 0"),
    'a stretch of 0': (
        tradeoff,
        [*MOTION, '--stretch', '0'],
        "argument --stretch: '0' is no number above 0",
    ),
    'an effort below 0': (
        tradeoff,
        [*MOTION, '--max-effort', '-1'],
        "argument --max-effort: '-1' is no number above 0",
    ),
    'an interface of no hardware': (
        make_urdf,
        ['--command-interface', 'position'],
        '--command-interface needs --ros2-control',
    ),
    'a misspelt plugin': (make_urdf, ['--ros2-control', 'moc'], 'none of mock, gz, mujoco, nor'),
    'Gazebo without controllers': (
        make_urdf,
        ['--ros2-control', 'gz'],
        'gz needs --controllers FILE',
    ),
    'no port': (live_view, ['live_view', '--port', '99999'], "'99999' is no port, 0 to 65535"),
}


@pytest.mark.parametrize(('program', 'arguments', 'told'), WRONG_CALLS.values(), ids=WRONG_CALLS)
def test_a_wrong_call_ends_with_what_is_wrong(program, arguments, told, capsys, folder):
    with pytest.raises(SystemExit) as ended:
        program.main(arguments)
    assert ended.value.code == 2
    assert told in capsys.readouterr().err
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)


REFUSALS = {
    'no duration': (flat_plan, ['joint1=1.0'], '; here: --duration'),
    'some via points have times': (
        flat_plan,
        ['joint1=1', '--via', 'joint1=0.5@0.2', '--via', 'joint1=0.7', '--duration', '1'],
        'give every --via a time',
    ),
    'a time of a via point alone': (
        flat_plan,
        ['joint1=1', '--via', 'joint1=0.5@0.2'],
        'and --duration',
    ),
    'an equals sign': (flat_plan, [*MOTION, '-p', 'strategy=mixed'], 'mean strategy:=mixed?'),
    'broken YAML': (flat_plan, [*MOTION, '--params-file', 'broken.yaml'], 'in line 2, column 1'),
    'no folder': (tradeoff, [*MOTION, '--csv', 'none/a.csv'], 'cannot write none/a.csv: No such'),
    'a goal that is the start': (tradeoff, ['joint1=0', '--duration', '1'], 'nothing to compare'),
}


@pytest.mark.parametrize(('program', 'arguments', 'told'), REFUSALS.values(), ids=REFUSALS)
def test_a_refusal_says_what_to_do(program, arguments, told, capsys):
    assert program.main(arguments) == 1
    captured = capsys.readouterr()
    assert captured.out == ''
    (line,) = captured.err.splitlines()
    assert told in line


REMARKS = {
    'a block of another name': (
        ['--params-file', 'other.yaml'],
        'other.yaml: the block /planner is not for /flat_planner, its values have no effect; did',
    ),
    'no block at all': (
        ['--params-file', 'far.yaml'],
        'far.yaml: no block is for /flat_planner, only /left/robot; it has no effect',
    ),
    'a weight of another strategy': (
        ['-p', 'weights.energy:=2.0'],
        'weights.energy has no effect with strategy min_control_effort, only with '
        'min_potential_energy or mixed',
    ),
    'a bound of another strategy': (
        ['-p', 'insensitivity.max_residual:=0.001'],
        'insensitivity.max_residual has no effect with strategy min_control_effort',
    ),
}


@pytest.mark.parametrize(('arguments', 'told'), REMARKS.values(), ids=REMARKS)
def test_what_has_no_effect_is_said(arguments, told, capsys):
    assert flat_plan.main([*MOTION, *arguments]) == 0
    assert told in capsys.readouterr().err


def test_a_weight_that_matters_is_no_remark(capsys):
    matters = ['-p', 'weights.energy:=2.0', '-p', 'strategy:=mixed']
    assert flat_plan.main([*MOTION, *matters]) == 0
    assert capsys.readouterr().err == ''


def test_other_programs_tell_of_blocks_too(capsys):
    assert make_urdf.main(['--params-file', 'other.yaml', '-o', 'arm.urdf']) == 0
    assert 'make_urdf: other.yaml: the block /planner is not for' in capsys.readouterr().err


def test_a_goal_that_is_reached_is_said(capsys):
    assert flat_plan.main(['joint1=0', '--duration', '1']) == 0
    assert 'the arm is there already' in capsys.readouterr().err


def test_via_points_without_times_are_passed_within_the_duration(capsys):
    arguments = ['joint1=1', '--via', 'joint1=1.5', '--duration', '1', '--csv', '-']
    assert flat_plan.main(arguments) == 0
    captured = capsys.readouterr()
    rows = [row.split(',') for row in captured.out.splitlines()[1:]]
    assert float(rows[-1][0]) == pytest.approx(1.0)
    assert max(float(row[1]) for row in rows) > 1.2
    assert 'first point' not in captured.err
