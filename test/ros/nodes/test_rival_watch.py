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

"""Who of several publishers of efforts counts as another tracker."""

from flat_planner_ros.ros.nodes.rival_watch import are_twins, UNNAMED
import pytest


@pytest.mark.parametrize(
    ('publishers', 'may_be'),
    [
        (['flat_tracker', 'flat_tracker'], True),
        (['flat_tracker', UNNAMED], True),
        (['flat_tracker', 'teleop'], False),
        (['flat_tracker', UNNAMED, 'teleop'], False),
    ],
)
def test_a_publisher_may_be_a_tracker_until_its_node_is_known(publishers, may_be):
    assert are_twins('flat_tracker', publishers) is may_be
