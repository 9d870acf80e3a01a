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
What all figures share: pyplot, drawing into files, and lines that break where samples were lost.

A terminal without a display is enough. Programs import the figures when one is asked for:
matplotlib is an extra.
"""

from flat_planner_ros.core.arm import FloatArray
from matplotlib import pyplot as plt
import numpy as np

__all__ = ['plt', 'with_gaps']

plt.switch_backend('Agg')

LONGEST_STEP = 0.03
"""Time between two joint states that a line bridges [s]."""


def with_gaps(times: FloatArray, *tables: FloatArray) -> tuple[FloatArray, ...]:
    """Return times and tables with NaN, which breaks a line, where joint states were lost."""
    holes = np.flatnonzero(np.diff(times) > LONGEST_STEP) + 1
    return tuple(np.insert(values, holes, np.nan, axis=0) for values in (times, *tables))
