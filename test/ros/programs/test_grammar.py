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

"""One grammar for all programs: versions, joints, outputs, standard output, completion."""

import csv
from importlib import import_module
import io
import json
from pathlib import Path
import subprocess
import sys

from flat_planner_ros.ros.programs import flat_plan, make_urdf, tradeoff
from flat_planner_ros.version import version_line
import pytest

CODE = 'import sys; from flat_planner_ros.programs import {0}; sys.exit({0}())'
PROGRAMS = (
    *('planner_node', 'plant_node', 'monitor_node', 'tracker_node', 'demo', 'record', 'analyse'),
    *('identify', 'excite', 'live_view', 'make_urdf', 'flat_plan', 'paper_table', 'tradeoff'),
    'study',
)
MOTION = ['joint1=1', '--duration', '1']
TRADE = [*MOTION, '--stretch', '1']


def run(name, *arguments, **environment):
    """Run a program to its end."""
    command = [sys.executable, '-c', CODE.format(name), *arguments]
    return subprocess.run(command, capture_output=True, **environment)


@pytest.mark.parametrize('name', PROGRAMS)
def test_every_program_has_a_version(name):
    answer = run(name, '--version')
    assert answer.returncode == 0
    assert answer.stdout.decode().strip() == version_line()


@pytest.mark.parametrize('arguments', [['--version'], ['--version', '--unknown']])
@pytest.mark.parametrize('name', PROGRAMS)
def test_so_has_its_command_line(name, arguments, monkeypatch, capsys):
    wing = 'nodes' if name.endswith('_node') else 'programs'
    module = 'study.program' if name == 'study' else f'{wing}.{name}'
    monkeypatch.setattr(sys, 'argv', [name, *arguments])
    with pytest.raises(SystemExit) as ended:
        import_module(f'flat_planner_ros.ros.{module}').main()
    assert not ended.value.code
    assert capsys.readouterr().out.strip() == version_line()


@pytest.mark.parametrize('program', [flat_plan, tradeoff])
@pytest.mark.parametrize(
    'twice', [['joint1=2', 'joint1=1'], ['joint1=1', '--start', 'joint1=0', 'joint1=2']]
)
def test_a_joint_that_is_given_twice_is_named(program, twice, capsys):
    with pytest.raises(SystemExit) as ended:
        program.main([*twice, '--duration', '1'])
    assert ended.value.code == 2
    assert 'joint1 is given twice: ' in capsys.readouterr().err


def test_standard_output_belongs_to_the_one_output_that_asks_for_it(capsys):
    assert flat_plan.main([*MOTION, '--csv', '-']) == 0
    captured = capsys.readouterr()
    table = list(csv.reader(io.StringIO(captured.out)))
    assert table[0][0] == 'time [s]'
    assert len({len(row) for row in table}) == 1
    assert 'rms_effort.joint1' in captured.err
    assert flat_plan.main([*MOTION, '--json', '-']) == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)['joints'] == ['joint1', 'joint2']
    assert 'rms_effort.joint1' in captured.err
    assert tradeoff.main([*TRADE, '--csv', '-']) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith('series,')
    assert 'worst residual' in captured.err
    assert make_urdf.main(['--output', '-']) == 0
    assert capsys.readouterr().out.startswith('<?xml')
    assert not Path('-').exists()


def test_a_figure_goes_to_standard_output_as_png():
    pytest.importorskip('matplotlib')
    answer = run('flat_plan', *MOTION, '--plot', '-')
    assert answer.stdout.startswith(b'\x89PNG')
    assert b'rms_effort.joint1' in answer.stderr


def test_two_outputs_cannot_share_standard_output(capsys):
    with pytest.raises(SystemExit):
        flat_plan.main([*MOTION, '--csv', '-', '--json', '-'])
    assert 'only one output can be -' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('name', 'arguments'),
    [
        ('flat_plan', MOTION),
        ('tradeoff', MOTION),
        ('analyse', ['file']),
        ('identify', ['file', '--params-file', 'file']),
        ('paper_table', []),
    ],
)
@pytest.mark.parametrize('figure', ['folder.png', 'name', 'name.txt'])
def test_a_name_that_is_no_figure_is_refused(
    name, arguments, figure, tmp_path, monkeypatch, capsys
):
    (tmp_path / 'folder.png').mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, 'argv', [name, *arguments, '--plot', figure])
    with pytest.raises(SystemExit) as ended:
        import_module(f'flat_planner_ros.ros.programs.{name}').main()
    assert ended.value.code == 2
    assert f"'{figure}' is no file name that ends in .png, .pdf, .svg" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ['folder.png']


@pytest.mark.parametrize(
    ('name', 'arguments', 'doing'),
    [
        ('flat_plan', [*MOTION, '--csv', '/nowhere/plan.csv'], 'cannot write /nowhere/plan.csv'),
        ('flat_plan', [*MOTION, '--json', '/'], 'cannot write /'),
        ('flat_plan', [*MOTION, '--params-file', '/nowhere'], 'cannot read /nowhere'),
        ('tradeoff', [*TRADE, '--csv', '/nowhere/a.csv'], 'cannot write /nowhere/a.csv'),
        ('make_urdf', ['-o', '/nowhere/arm.urdf'], 'cannot write /nowhere/arm.urdf'),
        ('analyse', ['/nowhere.mcap'], '/nowhere.mcap'),
    ],
)
def test_what_the_system_complains_about_is_said_with_what_was_being_done(name, arguments, doing):
    answer = run(name, *arguments)
    assert answer.returncode == 1
    (line,) = answer.stderr.decode().splitlines()
    assert doing in line
    assert 'Errno' not in line


def test_a_shell_completes_options(tmp_path):
    pytest.importorskip('argcomplete')
    line = 'flat_plan --para'
    file = tmp_path / 'completions'
    asked = {'_ARGCOMPLETE': '1', 'COMP_LINE': line, 'COMP_POINT': str(len(line))}
    run('flat_plan', env={**asked, '_ARGCOMPLETE_STDOUT_FILENAME': str(file)})
    assert '--params-file' in file.read_text('utf-8')
