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

"""Sample of an arm's joints, as drivers measure them."""

from dataclasses import dataclass

from flat_planner_ros.core.arm.arrays import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False, slots=True)
class JointSample:
    """
    Measured state of the n joints, in the order of the motion's names.

    Attributes
    ----------
    time
        Absolute time of the measurement [s].
    positions
        Joint positions [rad], shape (n,); NaN if unknown.
    velocities, efforts
        Joint velocities [rad/s] and efforts [N m], shape (n,); ``None`` or NaN if unknown.

    """

    time: float
    positions: FloatArray
    velocities: FloatArray | None = None
    efforts: FloatArray | None = None
