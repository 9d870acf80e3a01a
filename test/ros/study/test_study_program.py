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

"""The program `study`, as a user runs it: tables, engines, interruptions, pictures."""

import csv
import json
from math import inf
import os
from pathlib import Path
import shlex
import signal
import subprocess
import sys
from time import monotonic, sleep

from flat_planner_ros.ros.programs import flat_plan
from flat_planner_ros.ros.study import program as study
import pytest
from ros.conftest import TIMEOUT

SPEC = """
study:
  seed: 3
  repeats: 12
  chunk: 8
  set: {goal.joint1: pi, limits.effort: [0.016, .inf]}
  axes:
    strategy: [polynomial, min_control_effort]
    duration: [0.9, 1.0]
    plant.mismatch.stiffness_scale: {uniform: [0.75, 1.25]}
"""
ROWS = 48
CODE = 'import sys; from flat_planner_ros.programs import study; sys.exit(study())'


@pytest.fixture
def spec(tmp_path):
    """Return the file of a small study."""
    path = tmp_path / 'study.yaml'
    path.write_text(SPEC, encoding='utf-8')
    return path


def run(spec, output, *more):
    """Run the study without the column that is never the same; return the text of its table."""
    assert study.main([str(spec), '-o', str(output), '--no-times', *more]) == 0
    return output.read_text(encoding='utf-8')


def wait_until(condition):
    """Wait for a condition, not for ever."""
    end = monotonic() + TIMEOUT
    while not condition():
        assert monotonic() < end
        sleep(0.005)


def wait_for_rows(output, process):
    """Wait until a process has written a chunk."""

    def has_rows():
        assert process.poll() is None
        return output.exists() and output.read_bytes().count(b'\n') > 8

    wait_until(has_rows)


def table_of(text):
    """Return rows by titles."""
    return list(csv.DictReader(text.splitlines()))


@pytest.fixture
def whole(spec, tmp_path):
    """Return the text of the whole table, made by one process."""
    return run(spec, tmp_path / 'whole.csv')


def test_a_table_has_a_row_for_each_number(spec, whole, tmp_path, capsys):
    rows = table_of(whole)
    assert [int(row['row']) for row in rows] == list(range(ROWS))
    assert list(rows[0])[:6] == [
        'row',
        'strategy',
        'duration',
        'plant.mismatch.stiffness_scale',
        'verdict',
        'code',
    ]
    refused = [row for row in rows if row['verdict'] != 'ACCEPTED']
    assert {(row['verdict'], row['code'], row['rms_effort']) for row in refused} == {
        ('EFFORT_LIMIT', '-112', '')
    }
    accepted = [row for row in rows if row['code'] == '0']
    assert len(accepted) + len(refused) == ROWS
    for row in accepted:
        simulated, predicted = float(row['simulated_residual']), float(row['residual'])
        assert simulated == pytest.approx(predicted, rel=5e-4, abs=1e-6)
    run(spec, tmp_path / 'whole.csv')
    said = capsys.readouterr().out
    assert f'{len(accepted)} ACCEPTED' in said
    assert f'{len(refused)} EFFORT_LIMIT' in said


def test_two_processes_write_the_same_table(spec, whole, tmp_path):
    assert run(spec, tmp_path / 'two.csv', '--workers', '2') == whole


def test_planning_time_is_the_last_column(spec, tmp_path):
    output = tmp_path / 'times.csv'
    assert study.main([str(spec), '-o', str(output), '-p', 'simulate:=false']) == 0
    rows = table_of(output.read_text(encoding='utf-8'))
    assert list(rows[0])[-1] == 'planning_time'
    assert all(0.0 < float(row['planning_time']) < inf for row in rows if row['code'] == '0')
    assert {row['simulated_residual'] for row in rows} == {''}


def test_what_is_done_is_kept_and_the_rest_is_added(spec, whole, tmp_path, capsys):
    output = tmp_path / 'whole.csv'
    lines = whole.splitlines(keepends=True)
    # Killed in the middle of a row: two chunks are whole.
    output.write_text(''.join(lines[:20]) + lines[20][:10], encoding='utf-8')
    assert run(spec, output) == whole
    # All is there: nothing is done again.
    stamp = output.stat().st_mtime_ns
    assert run(spec, output) == whole
    assert output.stat().st_mtime_ns == stamp
    other = SPEC.replace('seed: 3', 'seed: 4')
    spec.write_text(other, encoding='utf-8')
    assert study.main([str(spec), '-o', str(output), '--no-times']) == 1
    assert 'rows of a study that was another one' in capsys.readouterr().err
    assert output.read_text(encoding='utf-8') == whole
    assert run(spec, output, '--fresh') != whole
    foreign = tmp_path / 'foreign.csv'
    foreign.write_text('a,b\n', encoding='utf-8')
    assert study.main([str(spec), '-o', str(foreign)]) == 1
    assert 'is there, and no foreign.csv.study says' in capsys.readouterr().err


def test_an_interrupted_study_goes_on(spec, tmp_path):
    many = SPEC.replace('repeats: 12', 'repeats: 4000')
    spec.write_text(many, encoding='utf-8')
    output = tmp_path / 'many.csv'
    words = [str(spec), '-o', str(output), '--workers', '1', '--no-times']
    process = subprocess.Popen(
        [sys.executable, '-c', CODE, *words], stderr=subprocess.PIPE, text=True
    )
    # It has written a chunk: now it is in the midst of another one.
    wait_for_rows(output, process)
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=TIMEOUT)[1]
    assert process.returncode == 130
    done = output.read_text(encoding='utf-8')
    rows = done.count('\n') - 1
    assert rows % 8 == 0
    assert 0 < rows < 16_000
    assert f'{rows} of 16000 rows are in {output}; the same command goes on' in said
    assert 'Traceback' not in said
    # What is there belongs to the study: its rows are those that one has alone.
    mark = json.loads((tmp_path / 'many.csv.study').read_text(encoding='utf-8'))
    assert mark['rows'] == 16_000


def test_a_study_that_is_killed_leaves_no_process_behind(spec, tmp_path):
    spec.write_text(SPEC.replace('repeats: 12', 'repeats: 4000'), encoding='utf-8')
    output = tmp_path / 'many.csv'
    words = [str(spec), '-o', str(output), '--workers', '1', '--no-times']
    process = subprocess.Popen([sys.executable, '-c', CODE, *words])
    wait_for_rows(output, process)
    threads = Path(f'/proc/{process.pid}/task').glob('*/children')
    workers = [Path('/proc', child) for thread in threads for child in thread.read_text().split()]
    assert workers
    process.kill()
    process.wait(TIMEOUT)
    wait_until(lambda: not any(map(is_alive, workers)))


def is_alive(place):
    """Return whether a process, by its place in /proc, has not ended; nobody may bury it."""
    try:
        return (place / 'stat').read_text().rpartition(')')[2].split()[0] != 'Z'
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_standard_output_gets_the_table(spec, whole, capsys):
    capsys.readouterr()
    assert study.main([str(spec), '-o', '-', '--no-times']) == 0
    assert capsys.readouterr().out == whole


def test_a_row_alone_and_the_line_that_repeats_it(spec, whole, capsys, tmp_path):
    pytest.importorskip('matplotlib')
    number = next(int(row['row']) for row in table_of(whole) if row['code'] == '0')
    capsys.readouterr()
    picture = tmp_path / 'row.png'
    assert study.main([str(spec), '--row', str(number), '--no-times', '--plot', str(picture)]) == 0
    *cells, line = capsys.readouterr().out.splitlines()
    shown = dict(cell.split(maxsplit=1) for cell in cells if len(cell.split()) == 2)
    assert {k: v for k, v in table_of(whole)[number].items() if v} == shown
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert flat_plan.main(shlex.split(line)[1:]) == 0
    assert study.main([str(spec), '--row', str(ROWS)]) == 1
    assert f'rows 0 to {ROWS - 1}' in capsys.readouterr().err


def test_a_row_that_is_refused_says_why(spec, whole, capsys):
    number = next(row['row'] for row in table_of(whole) if row['code'] != '0')
    capsys.readouterr()
    assert study.main([str(spec), '--row', number]) == 0
    assert 'EFFORT_LIMIT: the effort of joint1 reaches' in capsys.readouterr().out


@pytest.mark.parametrize(
    'words',
    [
        ['x=plant.mismatch.stiffness_scale', 'y=duration', 'value=simulated_residual'],
        ['x=plant.mismatch.stiffness_scale', 'value=simulated_residual', 'by=strategy'],
        ['x=strategy', 'value=peak_effort', 'by=duration'],
        ['value=residual', 'by=strategy'],
        ['x=plant.mismatch.stiffness_scale', 'y=rms_effort', 'value=residual'],
        ['x=duration', 'value=peak_effort', 'by=simulated_residual'],
    ],
)
def test_pictures(spec, whole, tmp_path, words):
    pytest.importorskip('matplotlib')
    run(spec, tmp_path / 'whole.csv', '--plot', *words)
    assert (tmp_path / 'whole.png').read_bytes().startswith(b'\x89PNG')
    assert (tmp_path / 'whole.png').stat().st_size > 10_000


@pytest.mark.parametrize(
    ('words', 'complaint'),
    [
        (['--plot', 'x=duration'], 'value=COLUMN is missing'),
        (['--plot', 'z=duration', 'value=residual'], "'z=duration' is none of x, y, value, by"),
        (['--plot', 'value=residual', 'a.txt'], "'a.txt' is no file name that ends in"),
        (['--workers', '-1'], "'-1' is no whole number"),
        (['--workers', '2', '--dask', 'a'], 'not allowed with'),
    ],
)
def test_wrong_options_are_said(spec, tmp_path, words, complaint, capsys):
    with pytest.raises(SystemExit) as ended:
        study.main([str(spec), '-o', str(tmp_path / 'a.csv'), *words])
    assert ended.value.code == 2
    assert complaint in capsys.readouterr().err


@pytest.mark.parametrize(
    ('words', 'complaint'),
    [
        (['-o', '/nowhere/a.csv'], 'cannot write /nowhere/a.csv'),
        (['-o', 'a.csv', '-p', 'duraton:=1'], 'nothing is called duraton; did you mean duration'),
        (['--row', '9999'], 'there is no row 9999'),
    ],
)
def test_what_is_wrong_is_said_in_one_line(spec, words, complaint, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert study.main([str(spec), *words]) == 1
    error = capsys.readouterr().err
    assert complaint in error
    assert error.count('\n') == 1


def test_a_column_that_is_none_is_named(spec, whole, tmp_path, capsys):
    pytest.importorskip('matplotlib')
    words = [str(spec), '-o', str(tmp_path / 'whole.csv'), '--no-times', '--plot', 'value=nothing']
    assert study.main(words) == 1
    assert 'there is no column nothing; there are row, strategy' in capsys.readouterr().err


def test_refused_rows_have_no_place_on_an_axis_of_results(spec, tmp_path, capsys):
    pytest.importorskip('matplotlib')
    words = ['-o', str(tmp_path / 'a.csv'), '-p', 'limits.effort:=[1.0e-5, .inf]', '--plot']
    assert study.main([str(spec), *words, 'x=duration', 'value=residual']) == 0
    assert study.main([str(spec), *words, 'x=rms_effort', 'value=residual']) == 1
    captured = capsys.readouterr()
    assert 'no row has a value of rms_effort' in captured.err
    assert 'EFFORT_LIMIT, as row 0: the effort of joint1 reaches' in captured.out


def test_parquet_has_the_same_numbers(spec, whole, tmp_path, capsys):
    parquet = pytest.importorskip('pyarrow.parquet')
    output = tmp_path / 'whole.parquet'
    for _ in range(2):
        assert study.main([str(spec), '-o', str(output), '--no-times']) == 0
    columns = parquet.read_table(output).to_pydict()
    for row, cells in enumerate(table_of(whole)):
        for title, cell in cells.items():
            found = columns[title][row]
            assert cell == ('' if found is None else str(found))
    assert not list(tmp_path.glob('*.part*'))
    assert 'ACCEPTED' in capsys.readouterr().out


def test_a_library_that_is_missing_is_named_with_its_extra(spec, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, 'distributed', None)
    assert study.main([str(spec), '-o', str(tmp_path / 'a.csv'), '--dask', 'tcp://a:1']) == 1
    assert "pip install '.[study]'" in capsys.readouterr().err


def test_a_cluster_writes_the_same_table_whichever_worker_dies(spec, whole, tmp_path):
    pytest.importorskip('distributed')
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=4, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        process = subprocess.Popen(
            [
                *(sys.executable, '-c', CODE, str(spec), '-o', str(tmp_path / 'dask.csv')),
                *('--no-times', '--dask', cluster.scheduler_address),
            ]
        )
        output = tmp_path / 'dask.csv'
        wait_for_rows(output, process)
        victim = next(iter(cluster.workers.values()))
        os.kill(victim.pid, signal.SIGKILL)
        assert process.wait(timeout=120) == 0
    assert output.read_text(encoding='utf-8') == whole


def test_help_has_examples(capsys):
    with pytest.raises(SystemExit) as ended:
        study.main(['--help'])
    assert ended.value.code == 0
    assert '-o springs.csv --workers 4' in capsys.readouterr().out


def test_shipped_studies_are_read():
    from flat_planner_ros.ros.study.spec import read_spec

    folder = Path(__file__).resolve().parents[3] / 'config' / 'studies'
    for path in folder.glob('*.yaml'):
        assert read_spec(path).axes.count > 1
