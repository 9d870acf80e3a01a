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

"""
Motions of least peak on random arms: what is left when the samples are played, joined linearly.

`FUZZ_CASES` sets a hundred times the number of cases, `FUZZ_SEED` what they are made from.
"""

from functools import partial
import os

from fuzz.workers import in_chunks
from least_peak import left_of
import pytest

CASES = max(25, int(os.environ.get('FUZZ_CASES', '0')) // 100)

SEED = int(os.environ.get('FUZZ_SEED', '1'))

SWING = 1e-5
"""Largest oscillation that may be left [rad]."""

MISS = 1e-4
"""Largest distance from the goal [rad]."""


@pytest.mark.timeout(0)
def test_nothing_is_left_on_any_arm(capsys):
    found = [left for part in in_chunks(partial(left_of, SEED), 0, CASES) for left in part]
    assert len(found) == CASES
    # Nor is NaN below.
    assert not [left for left in found if not (left.swing < SWING and left.miss < MISS)]
    if CASES > 25:
        swing, miss = (max(values) for values in list(zip(*found, strict=True))[:2])
        with capsys.disabled():
            print(f'\n{CASES} arms: swing {swing:.1e}, miss {miss:.1e} rad', end='')
