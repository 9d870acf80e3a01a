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

"""How far residuals err alike: their autocorrelation, added up over the segments."""

from collections.abc import Iterable

from flat_planner_ros.core.arm import FloatArray
import numpy as np

LONGEST_LAG = 0.25
"""Longest lag of an autocorrelation, relative to the segment [-]."""


def lags_for(lengths: Iterable[int]) -> int:
    """Return how many lags segments of so many samples tell."""
    return max(2, int(LONGEST_LAG * min(lengths)))


def products(values: FloatArray, lags: int) -> FloatArray:
    """
    Return sums of products of values that are 0, 1, ... samples apart.

    Parameters
    ----------
    values
        Shape (samples, channels).
    lags
        How many.

    Returns
    -------
    FloatArray
        Shape (channels, lags).

    """
    # Zeros behind keep the ends apart.
    size = 1 << (len(values) + lags - 1).bit_length()
    power = np.abs(np.fft.rfft(values, size, axis=0)) ** 2
    found: FloatArray = np.fft.irfft(power, size, axis=0)[:lags].T
    return found


def correlation_length(sums: FloatArray) -> float:
    """
    Return how many samples are worth one independent one, at least 1 [-].

    Parameters
    ----------
    sums
        Products of residuals 0, 1, ... samples apart, over all segments, shape (lags,).

    Notes
    -----
    The sum of the autocorrelations over its initial positive pairs (Geyer 1992).

    """
    if sums[0] == 0.0:
        return 1.0
    pairs = (sums[: sums.size // 2 * 2].reshape(-1, 2) / sums[0]).sum(axis=1)
    negative = np.flatnonzero(pairs < 0.0)
    count = int(negative[0]) if negative.size else pairs.size
    return max(1.0, 2.0 * float(pairs[:count].sum()) - 1.0)
