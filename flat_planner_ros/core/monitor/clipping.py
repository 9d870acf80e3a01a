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

"""Clipped efforts: a motor that gives less than was planned, up to a bound and no further."""

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.monitor.motion_record import PlannedMotion
import numpy as np
import numpy.typing as npt

SHORT = 0.95
"""Largest measured effort over the planned one that is less than planned [-]."""

BEYOND = 1.05
"""Planned effort over the bound from which the bound must have acted [-]."""

WITHIN = 0.9
"""Planned effort over the bound up to which it cannot have acted [-]."""

FLAT = 0.05
"""Deviation of measured efforts from the bound, or from the plan, relative to the bound [-]."""

MOST = 0.9
"""Share of the samples that must look like it [-]."""

FEWEST = 5
"""Samples of either kind that tell it [-]."""


def clipped_remark(motion: PlannedMotion, times: FloatArray, efforts: FloatArray) -> str:
    """
    Return which motors were held to a bound that the plan does not know, a clause.

    Parameters
    ----------
    motion
        The motion at the time at which it was carried out; without efforts nothing is known.
    times
        Absolute times within it [s], shape (m,).
    efforts
        Measured then, NaN where they were not, shape (m, n) [N m].

    """
    if motion.efforts is None:
        return ''
    told = []
    for joint, name in enumerate(motion.joint_names[:-1]):
        planned = np.interp(times - motion.start, motion.times, motion.efforts[:, joint])
        bound = _bound(planned, efforts[:, joint])
        if bound is not None:
            told.append(
                f'the effort of {name} was clipped at {bound:.3g} N m, '
                f'{np.abs(planned).max():.3g} N m were planned'
            )
    return '; '.join(told)


def _bound(planned: FloatArray, measured: FloatArray) -> float | None:
    """Return the bound that a motor was held to [N m], None if it was held to none."""
    known = np.isfinite(measured)
    planned, measured = planned[known], measured[known]
    if planned.size < 2 * FEWEST:
        return None
    bound = float(np.abs(measured).max())
    if not 0.0 < bound < SHORT * np.abs(planned).max():
        return None
    # Held to it where more was planned, and as planned where less was.
    held = np.abs(planned) > BEYOND * bound
    free = np.abs(planned) < WITHIN * bound
    at_bound = np.abs(measured - bound * np.sign(planned)) < FLAT * bound
    as_planned = np.abs(measured - planned) < FLAT * bound
    kinds = (held, at_bound), (free, as_planned)
    return bound if all(_mostly(*kind) for kind in kinds) else None


def _mostly(where: npt.NDArray[np.bool_], true: npt.NDArray[np.bool_]) -> bool:
    """Tell whether something holds for nearly all samples of a kind, of which there are some."""
    return bool(where.sum() >= FEWEST and (true & where).sum() >= MOST * where.sum())
