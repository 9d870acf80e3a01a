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

"""Parameters of every node that reads joint states."""

from flat_planner_ros.core.arm import JointStateRules
from flat_planner_ros.ros.parameters.row import Row, Values

JOINT_STATE_ROWS = [
    Row(
        'joint_states.tolerance',
        JointStateRules.tolerance,
        's',
        'time within which all joints were heard, where joint states come in parts',
        lower=0.0,
    ),
    Row(
        'joint_states.unwrap',
        JointStateRules.unwrap,
        '',
        'count the turns of joints that are wrapped, to +-pi or to 0 ... 2 pi',
    ),
]


def joint_state_rules(values: Values) -> JointStateRules:
    """Return how joint states are read."""
    return JointStateRules(
        tolerance=values['joint_states.tolerance'], unwrap=values['joint_states.unwrap']
    )
