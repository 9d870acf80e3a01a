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

"""Modules of the page that need no browser, run by Node.js."""

import csv
import json
from math import pi
import re
import shutil
import subprocess

import numpy as np
import pytest
from ros.live_view.viewer import PAGE
import yaml

NODE = shutil.which('node')


pytestmark = pytest.mark.skipif(NODE is None, reason='no Node.js')


@pytest.fixture
def run(tmp_path):
    """Return what an expression gives that may use modules of the page."""

    def evaluate(imports: str, expression: str) -> object:
        folder = shutil.copytree(PAGE, tmp_path / 'page', dirs_exist_ok=True)
        (folder / 'package.json').write_text('{"type": "module"}')
        script = folder / 'script.js'
        script.write_text(f'{imports}\nconsole.log(JSON.stringify({expression}));\n')
        command = [NODE, str(script)]
        answer = subprocess.run(command, capture_output=True, text=True, check=True)
        return json.loads(answer.stdout)

    return evaluate


def test_the_words_of_the_page(run):
    """Angles as people write them, and times as they say them."""
    angles, wrong, numbers, degrees, start, end = run(
        "import {angle, inDegrees, number, readable} from './words.js';",
        """[
            ['1.57', '90deg', '-45 °', 'pi/2', '−3*π/4', '2pi', '1,5 rad'].map(angle),
            ['abc', '', 'deg', 'pi/0'].map(angle),
            ['0.4', '−1,5', ' ', '1e-3', '1x'].map(number),
            [inDegrees(Math.PI / 3), inDegrees(-1), inDegrees(null)],
            readable('plan 3, starts at 1795780633.296 s, in 0.050 s; not x'),
            readable('wait for its end at 1795780633.296 s'),
        ]""",
    )
    expected = [1.57, pi / 2, -pi / 4, pi / 2, -3 * pi / 4, 2 * pi, 1.5]
    assert angles == pytest.approx(expected)
    assert wrong == [None] * 4
    assert numbers == [0.4, -1.5, None, 1e-3, None]
    assert degrees == ['60°', '−57.3°', '']
    assert start == 'plan 3, starts in 0.050 s; not x'
    assert re.fullmatch(r'wait for its end at \d+:\d+:\d+', end)


def test_lists_times_and_commands_in_words(run):
    lists, times, command = run(
        "import {goalCommand, numbers, viaTimes} from './words.js';",
        """[
            ['1e-3, 2', '1; 2', '-1 2 3', '1, x', ''].map(numbers),
            [[[null, null], 3], [[null, 2], 3], [[null], 0], [[2, 1], 3], [[1], 0], [[], 1]]
                .map(([given, duration]) => viaTimes(given, duration)),
            goalCommand('/arm1', ['a', 'b'], {positions: [1, -0.5], duration: 1.5,
                via: [{positions: [0, 2.5], time: 0.75}]}),
        ]""",
    )
    assert lists == [[1e-3, 2.0], [1.0, 2.0], [-1.0, 2.0, 3.0], None, None]
    assert times == [[1.0, 2.0], [1.0, 2.0], [0.0], None, None, []]
    topic, content = re.fullmatch(
        r"ros2 topic pub --once -w 1 (\S+) trajectory_msgs/msg/JointTrajectory '(.*)'", command
    ).groups()
    assert topic == '/arm1/flat_planner/goal'
    via, final = yaml.safe_load(content)['points']
    assert via['positions'] == [0.0, 2.5]
    assert all(isinstance(angle, float) for angle in via['positions'] + final['positions'])
    assert final['time_from_start'] == {'sec': 1, 'nanosec': 500_000_000}


def test_a_spectrum_has_the_amplitude_and_the_frequency_of_a_swing_that_drifts(run):
    rows = run(
        "import {spectrum} from './spectrum.js';",
        """spectrum(Array.from({length: 900}, (_, k) => {
            const time = 3 + 0.0101 * k;
            const swing = 0.02 * Math.sin(2 * Math.PI * 1.7 * time);
            return [time, k === 50 ? null : swing + 0.3 + 0.1 * time, 0.01];
        }), [1, 2], 3, 12, 6)""",
    )
    frequency, amplitude, _ = max(rows, key=lambda row: row[1])
    # A window of 9 s tells 0.1 Hz apart, and four times finer lines are drawn.
    assert frequency == pytest.approx(1.7, abs=0.03)
    assert amplitude == pytest.approx(0.02, rel=0.02)
    assert max(row[2] for row in rows) < 1e-6
    assert rows[0][0] == 0.0
    assert 6.0 <= rows[-1][0] < 6.1


def test_the_transform_is_that_of_numpy(run):
    values = np.random.default_rng(1).normal(size=16)
    real, imaginary = run(
        "import {transform} from './spectrum.js';",
        f"""(() => {{
            const [real, imaginary] = [{values.tolist()}, new Array(16).fill(0)];
            transform(real, imaginary);
            return [real, imaginary];
        }})()""",
    )
    expected = np.fft.fft(values)
    assert real == pytest.approx(expected.real, abs=1e-12)
    assert imaginary == pytest.approx(expected.imag, abs=1e-12)


def test_a_table_has_what_is_shown_and_nothing_where_nothing_is_known(run):
    text = run(
        "import {Store} from './store.js'; import {table} from './export.js';",
        """(() => {
            const store = new Store();
            store.take({values: {joints: ['a, b', 'c'], epoch: 100}, streams: {
                measured: [[0, 1, 2, 3, 4, 5, 6], [1, 2, 2, 3, 4, null, 6],
                    [1.1, 0, 0, 0, 0, 0, 0], [2, 9, 9, 9, 9, 9, 9]],
                reference: [[0.9, 10, 0, 0, 0, 0, 0], [1.1, 20, 0, 0, 0, 0, 0]],
            }});
            return table(store, 0, 1.5);
        })()""",
    )
    titles, *rows = csv.reader(text.splitlines())
    assert titles[:2] == ['time [s]', 'measured.position.a, b [rad]']
    assert [row[0] for row in rows] == ['100.0000', '101.0000', '101.1000']
    planned = titles.index('reference.position.a, b [rad]')
    assert [row[planned] for row in rows] == ['', '15', '20']
    assert rows[1][titles.index('measured.effort.a, b [N m]')] == ''
    assert {row[titles.index('residual.position.c [rad]')] for row in rows} == {''}


def test_the_verdict_on_a_plan_is_that_on_its_last_motion(run):
    found = run(
        "import {Store} from './store.js';",
        """[[5, 6], [5, 8], [20, 21]].map(([start, end]) => {
            const store = new Store();
            const verdict = (state, time) => ({state, values: {start_time: String(1e9 + time)}});
            store.take({values: {epoch: 1e9, plan: {start, end}, verdicts: [
                verdict('REJECTED', 7), verdict('ACCEPTED', 7), verdict('ACCEPTED', 5)]}});
            return store.verdictOfPlan?.values.start_time ?? null;
        })""",
    )
    assert found == ['1000000005', '1000000007', None]


def test_dense_rows_keep_their_extremes_and_gaps(run):
    dense, sparse = run(
        "import {points} from './plots.js';",
        """[
            points({rows: Array.from({length: 1000}, (_, k) => [k / 100, k === 333 ? 7 : k % 2]),
                column: 1}, 0, 10, 20),
            points({rows: [[0, 1], [0.1, null], [0.2, 3], [1, 4]], column: 1, factor: 2},
                0, 1, 20),
        ]""",
    )
    values = [point[1] for point in dense if point]
    assert len(dense) <= 45
    assert (max(values), min(values)) == (7, 0)
    times = [point[0] for point in dense if point]
    assert times == sorted(times)
    assert sparse == [None, [0, 2], None, None, [0.2, 6], None, [1, 8]]


def test_a_pull_at_the_tip_is_a_force_there(run):
    """Efforts are the work of the force per angle, by finite differences."""
    strongest, links, angles = 1.5e-3, [0.3, 0.2, 0.15], [0.4, -0.7, 0.2]
    reach, scale, base = sum(links), 200.0, np.array([150.0, 160.0])

    def pixels(angles):
        theta = np.cumsum(angles)
        steps = scale * np.array(links)[:, None] * np.stack([np.cos(theta), -np.sin(theta)], 1)
        return np.vstack([base, base + np.cumsum(steps, axis=0)])

    tip, pointer = pixels(angles)[-1], np.array([190.0, 90.0])
    arm = {'pixels': pixels(angles).tolist(), 'links': links, 'scale': scale, 'reach': reach}
    efforts = run(
        "import {pullOf} from './pull.js';",
        f'pullOf({json.dumps(arm)}, {pointer.tolist()}, {strongest})',
    )
    force = (pointer - tip) / scale / reach * strongest / links[-1]
    for k, effort in enumerate(efforts):
        moved = pixels(np.array(angles) + 1e-6 * (np.arange(3) == k))[-1]
        assert effort == pytest.approx(force @ (moved - tip) / scale / 1e-6, rel=1e-4)


def test_a_window_moves_with_time_or_stands(run):
    states = run(
        "import {TimeWindow} from './timewindow.js';",
        """(() => {
            const view = new TimeWindow(6);
            const states = [];
            const note = () => states.push([view.from, view.to, view.isLive]);
            view.follow(0, 20); note();
            view.zoom(0.5, 0.5); note();      // live: the present stays at the edge
            view.move(-4); note();
            view.zoom(0.5, 0.5); note();      // standing: the middle stays
            view.follow(0, 30); note();
            view.move(-1000); note();         // half of it has something to show
            view.move(1000); note();
            return states;
        })()""",
    )
    assert states == [
        [14, 20, True],
        [17, 20, True],
        [13, 16, False],
        [13.75, 15.25, False],
        [13.75, 15.25, False],
        [-0.75, 0.75, False],
        [28.5, 30, True],
    ]
