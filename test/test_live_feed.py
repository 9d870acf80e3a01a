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

"""What browsers are told: everything once, bounded, and as JSON."""

import json
from math import inf, nan

from flat_planner_ros.ros.live_view.feed import Cursor, Feed, HISTORY, PORTION


def test_each_browser_is_told_everything_once():
    feed = Feed(['a'])
    first, second = Cursor(), Cursor()
    feed.put('x', {'y': 1})
    feed.append('a', [0.0, 1.0])
    news = {'restart': True, 'values': {'x': {'y': 1}}, 'streams': {'a': [[0.0, 1.0]]}}
    assert feed.news(first) == news
    assert feed.news(first) is None
    feed.append('a', [1.0, 2.0])
    assert feed.news(first) == {'streams': {'a': [[1.0, 2.0]]}}
    assert feed.news(second)['streams'] == {'a': [[0.0, 1.0], [1.0, 2.0]]}


def test_a_value_is_told_again_when_it_has_changed():
    feed, cursor = Feed([]), Cursor()
    feed.put('x', None)
    assert feed.news(cursor)['values'] == {'x': None}
    feed.put('x', None)
    assert feed.news(cursor) is None
    feed.put('x', [1])
    assert feed.news(cursor) == {'values': {'x': [1]}}


def test_the_past_is_bounded_and_a_slow_browser_gets_what_is_left_of_it():
    feed, cursor = Feed(['a']), Cursor()
    feed.append('a', [0.0])
    feed.news(cursor)
    for k in range(3 * HISTORY):
        feed.append('a', [k])
    rows = []
    while news := feed.news(cursor):
        portion = news['streams']['a']
        assert len(portion) <= PORTION
        rows += portion
    assert rows == [[k] for k in range(2 * HISTORY, 3 * HISTORY)]


def test_rows_that_come_while_the_past_is_told_follow_it():
    feed, cursor = Feed(['a']), Cursor()
    for k in range(2 * PORTION):
        feed.append('a', [k])
    first = feed.news(cursor)['streams']['a']
    feed.append('a', [2 * PORTION])
    rows = first + feed.news(cursor)['streams']['a'] + feed.news(cursor)['streams']['a']
    assert rows == [[k] for k in range(2 * PORTION + 1)]


def test_times_are_as_exact_after_days():
    feed = Feed(['a'])
    feed.append('a', [300_000.0101, 1 / 3])
    assert feed.news(Cursor())['streams']['a'] == [[300_000.0101, 0.3333333]]


def test_a_restart_voids_what_was_told():
    feed, cursor = Feed(['a']), Cursor()
    feed.append('a', [5.0])
    feed.news(cursor)
    feed.restart()
    feed.append('a', [0.0])
    assert feed.news(cursor) == {'restart': True, 'streams': {'a': [[0.0]]}}


def test_undefined_numbers_are_json():
    feed = Feed(['a'])
    feed.append('a', [nan, inf, 1 / 3])
    text = json.dumps(feed.news(Cursor()), allow_nan=False)
    assert json.loads(text)['streams']['a'] == [[None, None, 0.3333333]]
