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

"""Roots of equations, found once whatever the unit of time: other units only multiply them."""

from functools import lru_cache

from flat_planner_ros.core.motion_law.roots import Spectrum
import numpy as np

SPECTRA_KEPT = 64
"""Sets of roots that are remembered, one for each combination of arm and cost."""


@lru_cache(maxsize=SPECTRA_KEPT)
def known_spectrum(equation: bytes) -> Spectrum:
    """
    Return the roots of an equation in its own unit of time.

    Parameters
    ----------
    equation
        The bytes of its coefficients a_0 ... a_6, a_0 = 0 and a_6 = 1.

    """
    return Spectrum(np.frombuffer(equation))
