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

"""Axes of a study: rows by their numbers alone, in turn and at random."""

from flat_planner_ros.core.study import (
    Axes,
    chunks_of,
    Distribution,
    Draws,
    InvalidStudy,
    shares_of,
    Turns,
)
import numpy as np
import pytest
from scipy import stats

LAWS = {
    Distribution.UNIFORM: stats.uniform(2.0, 3.0),
    Distribution.LOGUNIFORM: stats.loguniform(2.0, 5.0),
    Distribution.NORMAL: stats.norm(2.0, 5.0),
}
PARAMETERS = (2.0, 5.0)


def axes(**more):
    """Return two axes in turn and two at random."""
    return Axes(
        turns=(
            Turns(names=('strategy',), values=(('a',), ('b',))),
            Turns(names=('time', 'drive'), values=((1.0, 'x'), (2.0, 'y'), (3.0, None))),
        ),
        draws=tuple(
            Draws(name=name, distribution=Distribution.UNIFORM, spread=(0.0, 1.0))
            for name in ('k', 'c')
        ),
        **{'repeats': 4, 'seed': 7, **more},
    )


def test_the_last_axis_in_turn_changes_fastest_and_rows_repeat():
    found = axes().columns(0, 24)
    assert found['strategy'].tolist() == ['a'] * 12 + ['b'] * 12
    assert (
        found['time'].tolist()
        == [1.0] * 4 + [2.0] * 4 + [3.0] * 4 + [1.0] * 4 + [2.0] * 4 + [3.0] * 4
    )
    assert found['drive'].tolist()[:12] == ['x'] * 4 + ['y'] * 4 + [None] * 4
    assert list(found) == ['strategy', 'time', 'drive', 'k', 'c']


@pytest.mark.parametrize('first', range(9))
def test_a_row_is_had_alone(first):
    whole = axes().columns(0, 24)
    part = axes().columns(first, first + 7)
    for name, values in part.items():
        assert values.tolist() == whole[name].tolist()[first : first + 7]


def test_all_combinations_meet_the_same_random_numbers():
    found = axes().columns(0, 24)
    for name in ('k', 'c'):
        assert found[name].tolist() == found[name].tolist()[:4] * 6
        assert len(set(found[name])) == 4


def test_an_axis_that_is_added_changes_nothing_of_the_others():
    one = axes()
    more = Axes(
        turns=one.turns,
        draws=(Draws(name='new', distribution=Distribution.CHOICE, spread=(1,)), *one.draws),
        repeats=4,
        seed=7,
    )
    for name, values in one.columns(0, 24).items():
        assert more.columns(0, 24)[name].tolist() == values.tolist()
    other = axes(seed=8).columns(0, 24)
    assert not set(other['k']) & set(one.columns(0, 24)['k'])


@pytest.mark.parametrize('distribution', LAWS)
def test_draws_are_distributed_as_they_say(distribution):
    drawn = Draws(name='k', distribution=distribution, spread=PARAMETERS).column(1, 0, 20_000)
    assert stats.kstest(drawn, LAWS[distribution].cdf).pvalue > 1e-3
    assert stats.kstest(drawn, stats.norm(2.3, 5.0).cdf).pvalue < 1e-3


def test_choices_come_equally_often_and_streams_are_unrelated():
    chosen = Draws(name='s', distribution=Distribution.CHOICE, spread=('a', 'b', 'c'))
    counts = np.unique(chosen.column(1, 0, 30_000), return_counts=True)[1]
    assert stats.chisquare(counts).pvalue > 1e-3
    pair = np.array([shares_of(1, name, 0, 20_000) for name in ('k', 'c')])
    assert ((pair > 0.0) & (pair < 1.0)).all()
    assert abs(np.corrcoef(pair)[0, 1]) < 0.03


def test_chunks_end_at_multiples_wherever_they_begin():
    assert list(chunks_of(0, 10, 4)) == [(0, 4), (4, 8), (8, 10)]
    assert list(chunks_of(5, 10, 4)) == [(5, 8), (8, 10)]
    assert not list(chunks_of(10, 10, 4))


@pytest.mark.parametrize(
    ('make', 'complaint'),
    [
        (lambda: Turns(names=('a',), values=()), 'the axis a has no values'),
        (lambda: axes(repeats=0), 'has 1 to'),
        (lambda: axes(seed=-1), 'seed must be'),
        (lambda: axes().columns(20, 25), 'rows 0 to 23'),
        (
            lambda: Axes(turns=(Turns(names=('k',), values=((1.0,),)),), draws=axes().draws),
            'k is set by two axes',
        ),
        (
            lambda: Draws(name='k', distribution=Distribution.LOGUNIFORM, spread=(-1.0, 2.0)),
            'above 0, got -1 and 2',
        ),
        (
            lambda: Draws(name='k', distribution=Distribution.NORMAL, spread=(1.0, -2.0)),
            'not below 0, got -2',
        ),
        (
            lambda: Draws(name='k', distribution=Distribution.UNIFORM, spread=(1.0,)),
            'needs two numbers',
        ),
    ],
)
def test_what_has_no_meaning_is_refused_with_numbers(make, complaint):
    with pytest.raises(InvalidStudy, match=complaint):
        make()
