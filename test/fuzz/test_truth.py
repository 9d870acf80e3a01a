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

"""The prediction is the truth, as in the suite; `TRUTH_CASES` sets how many random plans."""

import os

from fuzz.workers import in_chunks
import pytest
from truth import untold

CASES = int(os.environ.get('TRUTH_CASES', '50'))

FIRST = 100
"""First case: those before are the suite's own (`test/core/insensitive/test_truth.py`)."""


@pytest.mark.timeout(0)
def test_what_is_predicted_is_what_is_simulated():
    assert not [found for part in in_chunks(untold, FIRST, FIRST + CASES) for found in part]
