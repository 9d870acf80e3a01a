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

"""Motions that tell a model: what is proposed, what was heard, and recordings put together."""

from dataclasses import dataclass

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.excitation.candidates import Candidate
from flat_planner_ros.core.model_fit import Measurements, ModelFit
import numpy as np

APART = 100.0
"""Time put between two motions in the measurements [s]: a gap that no segment spans."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Proposal:
    """
    The motion to carry out next.

    Attributes
    ----------
    candidate
        Goal, duration, and what is foreseen.
    sought
        The parameter that is least certain.
    names
        Of all parameters: NAMES, then those of the first links where these are moved, P of them.
    before, after
        Standard errors of all parameters relative to their scales: now, and as predicted for after
        the motion, shape (P,) [-].
    scales
        Shape (P,).

    """

    candidate: Candidate
    sought: str
    names: tuple[str, ...]
    before: FloatArray
    after: FloatArray
    scales: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Heard:
    """
    What a motion has told.

    Attributes
    ----------
    misprediction
        Of the model before it, relative to the motion: of link n-1 and of the passive joint (2,);
        where the first joints moved as well, then of the efforts of their links (n-2,), as a share
        of these.
    holds
        Whether the prediction held, so that the next motion may be larger.
    fit
        Of the last motions; None if there is no model that explains them, or where the first links
        were fitted only.
    reached
        Standard errors of the fit relative to the scales, shape (P,) [-].

    """

    misprediction: FloatArray
    holds: bool
    fit: ModelFit | None
    reached: FloatArray


def joined(parts: list[Measurements]) -> Measurements:
    """Return motions one after the other, with gaps between them."""
    times = []
    begin = 0.0
    for part in parts:
        times.append(part.times - part.times[0] + begin)
        begin = float(times[-1][-1]) + APART
    return Measurements(
        times=np.concatenate(times),
        positions=np.concatenate([part.positions for part in parts]),
        efforts=np.concatenate([part.efforts for part in parts]),
    )
