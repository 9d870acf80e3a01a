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

"""Random equations of motion laws."""

from flat_planner_ros.core.motion_law.cost import QuadraticCost
from flat_planner_ros.core.motion_law.series_basis import speeds
import numpy as np


def equation_of_speed(rng, speed):
    """Return a random equation whose solutions are as fast, some of its roots zero or double."""
    rows = rng.normal(size=(int(rng.integers(1, 4)), 6))
    rows[:, : int(rng.integers(0, 5))] = 0.0
    rows[:, 5] /= np.linalg.norm(rows[:, 5])
    matrix = rows.T @ rows
    matrix[5, 5] = 1.0
    equation = QuadraticCost(matrix=matrix).characteristic()
    return equation * (speed / float(speeds(equation))) ** np.arange(12.0, -1.0, -2.0)
