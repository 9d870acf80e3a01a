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

"""The prediction is the truth: a hundred random plans, starts, drives and arms of their boxes."""

import pytest
from truth import truth


@pytest.mark.parametrize('decade', range(10))
def test_what_is_predicted_is_what_is_simulated(decade):
    for seed in range(10 * decade, 10 * decade + 10):
        found = truth(seed)
        assert found.is_told, found
