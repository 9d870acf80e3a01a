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

"""Joint states at another rate than a loop was made for are remarked, once."""

from flat_planner_ros.ros.nodes.rate_watch import ENOUGH, RateWatch
import pytest


def watched(rate, count=2 * ENOUGH, first=5.0):
    """Return a watch for 500 Hz that has heard samples at a rate [Hz]."""
    watch = RateWatch(500.0)
    for k in range(count):
        watch.heard(first + k / rate)
    return watch


@pytest.mark.parametrize('rate', [200.0, 1000.0])
def test_another_rate_is_remarked_once(rate):
    watch = watched(rate)
    remark = watch.take_remark()
    assert f'joint states come at {rate:.3g} Hz' in remark
    assert 'made and certified for 500 Hz' in remark
    for k in range(2 * ENOUGH):
        watch.heard(10.0 + k / rate)
    assert watch.take_remark() == ''


@pytest.mark.parametrize('rate', [450.0, 500.0, 600.0])
def test_about_the_same_rate_is_none_to_speak_of(rate):
    assert watched(rate).take_remark() == ''


def test_few_samples_and_those_of_one_time_tell_no_rate():
    assert watched(200.0, ENOUGH - 1).take_remark() == ''
    watch = RateWatch(500.0)
    for _ in range(2 * ENOUGH):
        watch.heard(1.0)
    assert watch.take_remark() == ''
