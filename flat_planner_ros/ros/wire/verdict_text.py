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

"""What verdicts say to people besides their numbers."""

from collections.abc import Mapping, Sequence
from typing import Any

from flat_planner_ros.core.arm import is_noticed
from flat_planner_ros.core.session import Motion
import numpy as np

REACHED = 1e-9
"""Distance from a goal at which it is reached [rad]: rounding of positions as text."""


ECHO_LENGTH = 16
"""Most entries of a goal's list that a verdict repeats."""

ECHO_CHARACTERS = 64
"""Most characters of an entry that a verdict repeats."""

UNITS = {
    'duration': 's',
    'duration_min': 's',
    'planning_time': 's',
    'peak_effort': 'N m',
    'rms_effort': 'N m',
    'peak_velocity': 'rad/s',
    'predicted_residual': 'rad',
    'predicted_residual_worst': 'rad',
    'predicted_miss_worst': 'rad',
    'imbalance_residual': 'rad',
    'residual': 'rad',
    'residual_worst': 'rad',
    'time': 's',
}
"""Units of a verdict's values, by a part of the key between dots."""


def unit_of(key: str) -> str:
    """Return the unit of a verdict's value, empty where it has none or one that varies."""
    return next((UNITS[part] for part in key.split('.') if part in UNITS), '')


def told(motion: Motion) -> list[str]:
    """Return what there is to say of an accepted motion, as clauses."""
    found = list(motion.remarks)
    if _stands_still(motion):
        found.insert(0, 'the arm is there already')
    if motion.duration_factor > 1.0:
        found.insert(0, f'up to {motion.duration_factor:g} times the shortest (duration.factor)')
    return found


def clauses(motion: Motion) -> str:
    """Return the same, each clause after a semicolon."""
    return ''.join(f'; {clause}' for clause in told(motion))


def clock_clause(offset: float | None) -> str:
    """Return how far ahead the stamps of joint states are [s], a clause; empty if hardly."""
    if offset is None or not is_noticed(offset):
        return ''
    if offset > 0.0:
        return f"joint states are stamped {offset:.3g} s ahead of the planner's clock"
    late = f'joint states arrive {-offset:.3g} s after their stamps'
    return f'{late} (a slow network, or another clock)'


def values_of(status: Any) -> dict[str, str]:
    """Return the values of a status by their keys."""
    return {pair.key: pair.value for pair in status.values}


def log_line(message: str, values: Mapping[str, str]) -> str:
    """Return a verdict as a line of the log: a refusal says that it is one, and its code."""
    if values.get('state') != 'REJECTED':
        return message
    return f'goal rejected ({values["error_name"]}, {values["error_code"]}): {message}'


def _stands_still(motion: Motion) -> bool:
    """Return whether a motion starts at rest where it ends, and passes no other point."""
    request = motion.plan.request
    is_plain = request.start_jets is None and not request.via
    return is_plain and bool((np.abs(request.final - request.start) <= REACHED).all())


def list_text(entries: Sequence[float | str]) -> str:
    """Return the first entries of a list as text."""
    shown = [text_of(entry)[:ECHO_CHARACTERS] for entry in entries[:ECHO_LENGTH]]
    more = ', ...' if len(entries) > ECHO_LENGTH else ''
    return f'[{", ".join(shown)}{more}]'


def precise(value: float | None) -> str | None:
    """Return a number that may be a time since 1970."""
    return None if value is None else f'{value:.13g}'


def text_of(value: float | int | str) -> str:
    """Return a number so that it reads well and is exact enough to compute with."""
    if isinstance(value, bool):
        return str(value).lower()
    return f'{value:.9g}' if isinstance(value, float) else str(value)
