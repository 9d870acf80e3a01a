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

"""The examples run, show what they claim, and are shown in the documentation."""

from importlib.util import find_spec
from pathlib import Path
import re
import runpy
import sys

from flat_planner_ros.core import FlatModel, Strategy
import numpy as np
import pytest

CHECKOUT = Path(__file__).resolve().parent.parent
EXAMPLES = sorted((CHECKOUT / 'examples').glob('*.py'))
PAGE = (CHECKOUT / 'docs' / 'examples.md').read_text('utf-8')
PAGE_LENGTH = 104
"""Most lines of an example, the licence's header included."""


def first_motion(ran):
    assert ran['left'] < 1e-5
    assert np.abs(ran['played'].positions[:, 1]).max() > 0.1  # the spring has worked


def strategies(ran):
    efforts, left = ran['efforts'], ran['residuals']
    assert max(efforts[Strategy.MIN_CONTROL_EFFORT], efforts[Strategy.MIXED]) < min(
        efforts[Strategy.POLYNOMIAL], efforts[Strategy.MIN_POTENTIAL_ENERGY]
    )
    assert min(left, key=left.get) is Strategy.MIN_POTENTIAL_ENERGY


def exactness(ran):
    left = ran['left']
    assert max(left[FlatModel.EXACT]) < 1e-5
    assert (np.diff(left[FlatModel.APPROXIMATE]) > 0.0).all()
    assert left[FlatModel.APPROXIMATE][0] > 1e-5


def insensitivity(ran):
    worst = ran['worst']
    assert worst['insensitive'] < worst['min_control_effort'] / 2
    assert ran['insensitive'].rms_effort[0] <= 1.3001 * ran['least'].rms_effort[0]


def tuning(ran):
    estimate, truth = ran['estimate'], ran['truth']
    assert estimate.is_trustworthy
    assert estimate.stiffness == pytest.approx(truth.stiffness, rel=1e-3)
    before, after = ran['amplitudes']
    assert after < 1e-3 * before


def four_joints(ran):
    assert ran['use'].ratio == pytest.approx(1.0, abs=1e-3)
    assert ran['left'] < 1e-3


def via_points(ran):
    for motion in ran['motions'].values():
        for point in motion.request.via:
            passed = motion.at(np.array([point.time])).flat[:, 0, 0]
            assert passed == pytest.approx(point.values, abs=1e-9)
    assert ran['relative'] < 0.9


def own_cost(ran):
    assert (np.diff(ran['peaks']) < 0.0).all()


def own_arm(ran):
    assert ran['left'] < 1e-5
    swing = np.abs(ran['unbalanced'].positions[ran['unbalanced'].times >= 1.0, 1]).max()
    assert swing > 100.0 * ran['left']


def on_a_controller(ran):
    assert ran['file'].is_file()
    assert ran['points'][-1]['effort'] == [0.0, 0.0]
    assert ran['points'][-1]['positions'] == [0.2, 0.0]


def servo(ran):
    inside = np.abs(ran['factors'] - 1.0) < 0.101
    right, wrong, own = (left[inside].max() for left in ran['found'].values())
    assert right < 1e-3
    assert wrong > 20.0 * right
    assert own < wrong / 4.0
    assert own < 1.02 * max(ran['worst'].values())


def least_time(ran):
    fastest = ran['motions'][Strategy.MIN_PEAK_EFFORT]
    others = [
        m for strategy, m in ran['motions'].items() if strategy is not fastest.options.strategy
    ]
    assert fastest.duration < 0.9 * min(motion.duration for motion in others)
    assert fastest.duration < 1.02 * fastest.least_duration
    assert max(ran['left'].values()) < 1e-5


def survivors(ran):
    shares = ran['survivors']
    assert len(shares) == 15
    assert all(ran['SURVIVES'] > 0.0 and 0.0 < share <= 1.0 for share in shares.values())
    for title in ('motors, efforts alone', 'position servos'):
        assert shares[title, 'insensitive'] == 1.0
        assert max(shares[title, name] for name in ('polynomial', 'min_control_effort')) < 0.5
    tracked, alone = (
        shares[title, 'polynomial'] for title in ('motors and a tracker', 'motors, efforts alone')
    )
    assert tracked > 2.0 * alone


def unknown_arm(ran):
    excitation, real = ran['excitation'], ran['real']
    assert excitation.is_certain
    assert ran['peaks'][0] <= 0.1 * 0.015
    assert max(ran['peaks']) <= 0.015
    found = excitation.estimate
    assert [*found.inertia_star, found.stiffness, found.damping] == pytest.approx(
        [*real.inertia_star, real.stiffness, real.damping], rel=0.04
    )


CLAIMS = [
    first_motion,
    strategies,
    exactness,
    insensitivity,
    tuning,
    four_joints,
    via_points,
    own_cost,
    own_arm,
    on_a_controller,
    servo,
    least_time,
    survivors,
    unknown_arm,
]


@pytest.mark.parametrize(
    ('path', 'claim'),
    list(zip(EXAMPLES, CLAIMS, strict=True)),
    ids=[path.stem for path in EXAMPLES],
)
def test_an_example_shows_what_it_claims(path, claim, tmp_path, monkeypatch):
    matplotlib = pytest.importorskip('matplotlib')
    if 'rclpy' in path.read_text('utf-8') and find_spec('rclpy') is None:
        pytest.skip('needs rclpy')
    matplotlib.use('Agg')
    picture = tmp_path / f'{path.stem}.png'
    monkeypatch.setattr(sys, 'argv', [str(path), str(picture)])
    ran = runpy.run_path(str(path))
    matplotlib.pyplot.close('all')
    assert picture.read_bytes().startswith(b'\x89PNG')
    claim(ran)


@pytest.mark.parametrize('path', EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_one_page_and_shown(path):
    assert len(path.read_text('utf-8').splitlines()) <= PAGE_LENGTH
    assert f'(../examples/{path.name})' in PAGE
    assert f'(images/examples/{path.stem}.png)' in PAGE
    assert (CHECKOUT / 'docs' / 'images' / 'examples' / f'{path.stem}.png').is_file()


def test_examples_are_numbered_and_use_the_public_list():
    assert [path.name[:2] for path in EXAMPLES] == [f'{i:02}' for i in range(1, 15)]
    for path in EXAMPLES:
        private = re.findall(r'flat_planner_ros\.core\.\w+', path.read_text('utf-8'))
        # Rooms beside the way of a goal are entered by the lists of their wings.
        assert bool(private) == path.stem.startswith('14')
        uses_ros = 'flat_planner_ros.ros' in path.read_text('utf-8')
        assert uses_ros == path.stem.startswith(('10', '13'))
