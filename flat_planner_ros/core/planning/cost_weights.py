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

"""Weights of a cost: without dimension, in terms of the arm's own oscillation, or the paper's."""

from typing import NamedTuple

from flat_planner_ros.core.arm import InvalidCost, PlanarArm

MAX_WEIGHT = 1000.0
"""Largest r or p accepted: beyond, weight**8 times the arm's data may leave double precision."""

MAX_RELATIVE_WEIGHT = 30.0
"""Largest weight without dimension: layers of 1/190 of a period, which no command plays."""

DEFAULT_EFFORT_WEIGHT = 2.437
"""The paper's r = 150 on the paper's arm, without dimension [-]."""

DEFAULT_ENERGY_WEIGHT = 1.736
"""The paper's p = 17 on the paper's arm, without dimension [-]."""


class PaperWeights(NamedTuple):
    """
    Weights as a cost takes them, each raised to the power of 8.

    Attributes
    ----------
    r
        Of the squared effort [(N m)^(-1/4) s^(-3/2) rad^(1/4)].
    p
        Of the squared acceleration [1/s].

    """

    r: float
    p: float


def check_weight(name: str, weight: float | None, upper: float) -> None:
    """
    Refuse a weight outside its range; None is none.

    Raises
    ------
    InvalidCost
        It is below 0, above the upper end, or no number.

    """
    if weight is not None and not 0.0 <= weight <= upper:
        raise InvalidCost(f'weight {name} = {weight:g} is outside [0, {upper:g}]')


def check_one_form(name: str, relative: float | None, paper_name: str, own: float | None) -> None:
    """
    Refuse a weight that is given in both forms; 0 in one leaves it to the other.

    Raises
    ------
    InvalidCost
        Both are above 0.

    """
    if relative and own:
        raise InvalidCost(
            f'weights.{name} = {relative:g} and weights.{paper_name} = {own:g} say one weight in '
            f'two ways: set one of them to 0.0'
        )


def paper_weights(
    arm: PlanarArm,
    *,
    effort: float | None,
    energy: float | None,
    r: float | None,
    p: float | None,
) -> PaperWeights:
    """
    Return the weights in the paper's units, whichever form they are given in.

    Parameters
    ----------
    arm
        A flat arm; its oscillation with joint n-1 free sets the scale.
    effort, energy
        Weights without dimension [-]; None where they are not given.
    r, p
        The paper's; None where they are not given. Where neither form is, the weight without
        dimension has its default.

    Raises
    ------
    NotFlat
        The arm is not flat.

    References
    ----------
    (19a) of docs/derivation.md.

    """
    frequency = arm.natural_mode().frequency
    by_effort = frequency / arm.inertia_star.both**0.25
    return PaperWeights(
        r=_either(effort, r, DEFAULT_EFFORT_WEIGHT, by_effort),
        p=_either(energy, p, DEFAULT_ENERGY_WEIGHT, frequency),
    )


def _either(relative: float | None, own: float | None, default: float, scale: float) -> float:
    """Return a weight in the paper's units, of its two forms or of its default."""
    if own or (relative is None and own is not None):
        return own
    return scale * (default if relative is None else relative)
