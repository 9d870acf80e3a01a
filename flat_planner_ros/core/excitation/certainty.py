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

"""How certain parameters are, by what motions have told of them."""

from flat_planner_ros.core.arm import FloatArray
import numpy as np

ROUGH = 0.3
"""Standard error of what is believed at the start, relative to the scales [-]."""


def relative_errors(known: FloatArray, scales: FloatArray) -> FloatArray:
    """
    Return standard errors relative to the scales, by what is known and believed, shape (P,) [-].

    Parameters
    ----------
    known
        Fisher information of all motions, shape (P, P).
    scales
        How far each parameter may reasonably be off, shape (P,).

    """
    inside = known * np.outer(scales, scales) + np.eye(scales.size) / ROUGH**2
    errors: FloatArray = np.sqrt(np.diag(np.linalg.inv(inside)))
    return errors
