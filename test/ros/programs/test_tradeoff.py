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

"""The program that draws effort against residual, as a user runs it."""

import csv
from pathlib import Path

from flat_planner_ros.ros.programs import tradeoff
import pytest

CONFIG = Path(__file__).resolve().parents[3] / 'config' / 'arm_2dof.yaml'
MOTION = ['joint1=3.14159265', '--duration', '1', '--stretch', '1']


def rows(path):
    """Return the rows of a file of numbers."""
    with path.open(encoding='utf-8') as file:
        return list(csv.DictReader(file))


def test_numbers_and_a_picture(tmp_path, capsys):
    pytest.importorskip('matplotlib')
    numbers, picture = tmp_path / 'tradeoff.csv', tmp_path / 'tradeoff.png'
    arguments = ['--params-file', str(CONFIG), *MOTION, '--csv', str(numbers)]
    assert tradeoff.main([*arguments, '--plot', str(picture)]) == 0
    found = rows(numbers)
    polynomial = next(row for row in found if row['series'] == 'polynomial')
    assert float(polynomial['worst']) == pytest.approx(0.119, abs=1e-3)
    assert float(polynomial['rms_effort']) == pytest.approx(0.00828, abs=1e-5)
    assert {row['series'] for row in found} >= {'insensitive_exact', 'insensitive_free'}
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert picture.stat().st_size > 20_000
    assert 'zvd_quintic' in capsys.readouterr().out


def test_the_shortest_within_an_effort(tmp_path, capsys):
    pytest.importorskip('matplotlib')
    numbers, picture = tmp_path / 'fastest.csv', tmp_path / 'fastest.png'
    arguments = [*MOTION, '--max-effort', '0.015', '--csv', str(numbers)]
    assert tradeoff.main([*arguments, '--plot', str(picture)]) == 0
    said = capsys.readouterr().out
    shortest = said.partition('shortest within 0.015 N m:')[2].splitlines()
    durations = {row.split('|')[0].strip(): row.split('|')[1] for row in shortest if '|' in row}
    assert float(durations['min_peak_effort']) == pytest.approx(0.845, abs=1e-3)
    assert float(durations['min_peak_effort, insensitive']) == pytest.approx(1.039, abs=1e-3)
    assert float(durations['min_control_effort']) > 0.94
    within = [row for row in rows(numbers) if row['series'] == 'min_peak_effort, residual bounded']
    by_residual = sorted(within, key=lambda row: float(row['worst']))
    times = [float(row['duration']) for row in by_residual]
    assert len(times) == 6
    assert times == sorted(times, reverse=True)
    assert all(float(row['peak_effort']) <= 0.015 for row in within)
    assert picture.stat().st_size > 20_000


def test_parameters_decide(tmp_path):
    wide, narrow = tmp_path / 'wide.csv', tmp_path / 'narrow.csv'
    tradeoff.main([*MOTION, '--csv', str(narrow)])
    tradeoff.main([*MOTION, '--csv', str(wide), '-p', 'insensitivity.stiffness:=0.2'])
    worst = [float(rows(path)[0]['worst']) for path in (narrow, wide)]
    assert worst[1] > 1.5 * worst[0]


def test_the_drive_decides(tmp_path):
    heavy = ['-p', 'model.inertia_star:=[6.4e-4, 2.5e-4]', '-p', 'model.stiffness:=0.023']
    heavy += ['-p', 'model.damping:=2.0e-5', '-p', 'joints:=[joint1, joint2]']
    worst = {}
    for drive in ('effort', 'position'):
        file = tmp_path / f'{drive}.csv'
        arguments = [*MOTION, '--csv', str(file), '-p', f'drive:={drive}', *heavy]
        assert tradeoff.main(arguments) == 0
        worst[drive] = {row['series']: float(row['worst']) for row in rows(file)}
    assert worst['effort'].keys() == worst['position'].keys()
    assert worst['position']['polynomial'] != pytest.approx(worst['effort']['polynomial'], rel=0.1)


@pytest.mark.parametrize(
    ('arguments', 'complaint'),
    [
        (['--params-file', 'none.yaml', *MOTION], 'cannot read none.yaml'),
        ([*MOTION, '-p', 'insensitivity.stifness:=0.2'], 'did you mean insensitivity.stiff'),
        (['elbow=1', '--duration', '1'], "unknown joint 'elbow'; the arm has joint1, joint2"),
        ([*MOTION, '--csv', '/nowhere/numbers.csv'], 'No such file'),
    ],
)
def test_what_is_wrong_is_said_in_one_line(arguments, complaint, capsys):
    assert tradeoff.main(arguments) == 1
    error = capsys.readouterr().err
    assert complaint in error
    assert error.count('\n') == 1


def test_help_has_examples(capsys):
    with pytest.raises(SystemExit) as ended:
        tradeoff.main(['--help'])
    assert ended.value.code == 0
    assert 'tradeoff joint1=3.14 --duration 1 --plot tradeoff.png' in capsys.readouterr().out
