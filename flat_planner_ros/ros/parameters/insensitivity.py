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

"""Parameters of the strategy `insensitive` and of the predicted residual."""

from collections.abc import Sequence

from flat_planner_ros.core.insensitive import (
    Criterion,
    DEFAULT_WEIGHT,
    Insensitivity,
    MAX_HALF_WIDTH,
    MAX_INSENSITIVITY,
    MAX_PAYLOAD,
    Nominal,
    UncertaintyBox,
)
from flat_planner_ros.ros.parameters.row import InvalidParameter, Row, Values

INSENSITIVITY_ROWS = [
    Row(
        'insensitivity.stiffness',
        UncertaintyBox.stiffness,
        '',
        'uncertainty of the stiffness, half-width as a share of the nominal value',
        'also of the predicted residual',
        lower=0.0,
        upper=MAX_HALF_WIDTH,
    ),
    Row(
        'insensitivity.damping',
        UncertaintyBox.damping,
        '',
        'the same of the damping',
        lower=0.0,
        upper=MAX_HALF_WIDTH,
    ),
    Row(
        'insensitivity.inertia',
        UncertaintyBox.inertia,
        '',
        "the same of the last link's inertia about its joint",
        lower=0.0,
        upper=MAX_HALF_WIDTH,
    ),
    Row(
        'insensitivity.payload',
        list(UncertaintyBox.payload),
        '',
        'least and most that the last link may carry, as shares of its inertia',
        lower=-MAX_HALF_WIDTH,
        upper=MAX_PAYLOAD,
    ),
    Row(
        'insensitivity.nominal',
        Insensitivity.nominal,
        '',
        'what strategy insensitive may leave on the nominal arm: exact = nothing, free = up to '
        'the worst residual, which takes less effort',
    ),
    Row(
        'insensitivity.criterion',
        Insensitivity.criterion,
        '',
        'which residual strategy insensitive weighs: worst or (root) mean (square)',
    ),
    Row(
        'insensitivity.weight',
        Insensitivity.weight,
        '',
        'a residual of distance / weight costs as much as the least effort',
        f'0 = {DEFAULT_WEIGHT:g}, or what follows from the next two',
        lower=0.0,
        upper=MAX_INSENSITIVITY,
    ),
    Row(
        'insensitivity.max_effort_rms',
        Insensitivity.max_effort_rms,
        'N m',
        'RMS effort within which strategy insensitive leaves as little as it can',
        '0 = not set',
        lower=0.0,
    ),
    Row(
        'insensitivity.max_residual',
        Insensitivity.max_residual,
        'rad',
        'worst residual that strategy insensitive keeps with as little effort as it can',
        '0 = not set',
        lower=0.0,
    ),
    Row(
        'insensitivity.modes',
        Insensitivity.modes,
        '',
        'free coefficients of the law of strategy insensitive, 6 to 48: more take less effort, '
        'steeper at the ends, and want a shorter sampling.period',
    ),
]
"""Parameters of the planner node that concern its uncertainty."""


def insensitivity_of(values: Values) -> Insensitivity:
    """
    Return what the parameters ask for.

    Raises
    ------
    InvalidRequest
        The values contradict each other.

    """
    name = 'insensitivity'
    return Insensitivity(
        box=UncertaintyBox(
            stiffness=values[f'{name}.stiffness'],
            damping=values[f'{name}.damping'],
            inertia=values[f'{name}.inertia'],
            payload=_payload(values[f'{name}.payload']),
        ),
        nominal=Nominal(values[f'{name}.nominal']),
        criterion=Criterion(values[f'{name}.criterion']),
        weight=values[f'{name}.weight'],
        max_effort_rms=values[f'{name}.max_effort_rms'],
        max_residual=values[f'{name}.max_residual'],
        modes=values[f'{name}.modes'],
    )


def _payload(shares: Sequence[float]) -> tuple[float, float]:
    """Return the least and the most."""
    if len(shares) != 2:
        raise InvalidParameter(
            f'insensitivity.payload needs two numbers, the least and the most, got {len(shares)}'
        )
    return shares[0], shares[1]
