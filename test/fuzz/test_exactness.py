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
Plans of random cases of the whole admitted range, against multiple precision and by themselves.

`FUZZ_CASES` sets the number of cases, `FUZZ_FIRST` the first one, `FUZZ_SEED` what they are made
from and `FUZZ_WORKERS` the processes that share them; a few are done in this one.
"""

from functools import partial
import os

from fuzz.workers import FEW, in_chunks
import pytest

CASES = int(os.environ.get('FUZZ_CASES', '200'))

FIRST = int(os.environ.get('FUZZ_FIRST', '0'))

SEED = int(os.environ.get('FUZZ_SEED', '1'))

REPORT_EVERY = 2000
"""Cases between two reports of a long run."""


@pytest.mark.timeout(0)
def test_plans_are_exact_over_the_whole_range(capsys):
    pytest.importorskip('mpmath')
    from exactness import batch_findings, STATIONARITY, TOLERANCE

    total = None
    for part in in_chunks(partial(batch_findings, SEED), FIRST, FIRST + CASES):
        total = part if total is None else total.joined(part)
        if CASES > FEW and (total.cases % REPORT_EVERY == 0 or total.cases == CASES):
            with capsys.disabled():
                print(f'\n{total}', end='', flush=True)
    assert total.error <= TOLERANCE
    assert total.boundary <= TOLERANCE
    assert total.grid <= TOLERANCE
    assert total.stationarity <= STATIONARITY
    assert total.gain < 1.0
    assert total.refused == ()
