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
Counterbalances that make an arm flat.

The centres of mass of the last two links must lie on their joint axes ((6) of
docs/derivation.md). Link n comes first: its counterbalance rides on link n-1.
"""

from typing import NamedTuple

from flat_planner_ros.core.arm.arrays import checked_array, FloatArray
from flat_planner_ros.core.arm.errors import InvalidModel
import numpy as np
import numpy.typing as npt

BALANCED = 2
"""Links that must be balanced, the last ones."""

SUGGESTED_ARM = 0.25
"""Arm of a counterbalance that is suggested where there is none, over the link's length [-]."""


class Counterbalances(NamedTuple):
    """
    Point masses behind the joints of links n-1 and n.

    Attributes
    ----------
    mass
        Shape (2,) [kg].
    arm
        Distances from the joints, away from the links, shape (2,) [m].

    """

    mass: FloatArray
    arm: FloatArray


def counterbalances(
    *,
    link_length: npt.ArrayLike,
    link_com: npt.ArrayLike,
    link_mass: npt.ArrayLike,
    mass: npt.ArrayLike | None = None,
    arm: npt.ArrayLike | None = None,
) -> Counterbalances:
    """
    Return the counterbalances that balance the last two links.

    Parameters
    ----------
    link_length, link_com, link_mass
        Length [m], centre of mass from the link's joint [m] and mass [kg] of the links without
        counterbalances, shape (n,).
    mass, arm
        Either the masses [kg] or the arms [m] of both, shape (2,); the other is computed.

    Raises
    ------
    InvalidModel
        A number has no meaning, or no counterbalance behind the joint can balance a link.

    """
    n = np.size(link_length)
    if n < BALANCED:
        raise InvalidModel(f'an arm must have at least {BALANCED} links, got {n}')
    if (mass is None) == (arm is None):
        raise InvalidModel('give either the masses of the counterbalances or their arms')
    length = checked_array('link_length', link_length, 'm', shape=(n,), lower=0.0)
    com = checked_array('link_com', link_com, 'm', shape=(n,))
    own = checked_array('link_mass', link_mass, 'kg', shape=(n,), lower=0.0)
    masses, arms = np.zeros(BALANCED), np.zeros(BALANCED)
    if mass is not None:
        masses = _checked_pair('counterbalance_mass', mass, 'kg')
    if arm is not None:
        arms = _checked_pair('counterbalance_arm', arm, 'm')
    given, wanted = (masses, arms) if arm is None else (arms, masses)
    rider = 0.0
    for i in (n - 1, n - 2):
        j = i - n + BALANCED
        moment = own[i] * com[i] + rider * length[i]
        if moment < 0.0:
            raise InvalidModel(
                f'link {i + 1} has its centre of mass {-moment / (own[i] + rider):.6g} m behind '
                f'joint {i + 1}: no counterbalance behind the joint can balance it'
            )
        if moment > 0.0:
            if given[j] == 0.0:
                kind = 'mass' if arm is None else 'arm'
                raise InvalidModel(
                    f'the counterbalance of link {i + 1} must have {kind} above 0 to take up '
                    f'{moment:.6g} kg m'
                )
            wanted[j] = moment / given[j]
        rider = own[i] + masses[j]
    return Counterbalances(masses, arms)


def suggest_counterbalances(
    *,
    link_length: npt.ArrayLike,
    link_com: npt.ArrayLike,
    link_mass: npt.ArrayLike,
    counterbalance_mass: npt.ArrayLike,
    counterbalance_arm: npt.ArrayLike,
) -> str:
    """
    Return in words which counterbalances would balance an arm.

    An arm without any is suggested arms of a quarter of the links' lengths.

    Parameters
    ----------
    link_length, link_com, link_mass
        As for `counterbalances`, shape (n,) [m], [m], [kg].
    counterbalance_mass, counterbalance_arm
        Those that the arm has, shape (2,) [kg], [m].

    """
    links = {'link_length': link_length, 'link_com': link_com, 'link_mass': link_mass}
    ways = []
    for given, value in (('mass', counterbalance_mass), ('arm', counterbalance_arm)):
        try:
            found = counterbalances(**links, **{given: value})
        except InvalidModel:
            continue
        other, unit = ('arm', 'm') if given == 'mass' else ('mass', 'kg')
        numbers = ', '.join(f'{number:.10g}' for number in getattr(found, other))
        ways.append(
            f'counterbalance_{other} = [{numbers}] {unit} (with counterbalance_{given} as it is)'
        )
    if not ways:
        arms = SUGGESTED_ARM * np.array(link_length, dtype=float)[-BALANCED:]
        try:
            masses = counterbalances(**links, arm=arms).mass.tolist()
        except InvalidModel:
            return 'no counterbalance behind the joints can balance it'
        ways.append(
            f'for example counterbalance_mass = [{masses[0]:.10g}, {masses[1]:.10g}] kg with '
            f'counterbalance_arm = [{arms[0]:.10g}, {arms[1]:.10g}] m'
        )
    return 'what balances both links: ' + ', or '.join(ways)


def displaced_com(
    link_com: npt.ArrayLike, link_mass: npt.ArrayLike, imbalance: npt.ArrayLike
) -> FloatArray:
    """
    Return the links' centres of mass after balance has been lost.

    Parameters
    ----------
    link_com, link_mass
        As for `counterbalances`, shape (n,) [m], [kg].
    imbalance
        Static moments added to links n-1 and n, positive towards the links' ends, shape (2,)
        [kg m]: their own masses are moved.

    Raises
    ------
    InvalidModel
        A link to be displaced has no mass.

    """
    n = np.size(link_mass)
    com = checked_array('link_com', link_com, 'm', shape=(n,)).copy()
    mass = checked_array('link_mass', link_mass, 'kg', shape=(n,), lower=0.0)
    moments = checked_array('imbalance', imbalance, 'kg m', shape=(BALANCED,))
    for j, moment in enumerate(moments.tolist()):
        i = n - BALANCED + j
        if moment and not mass[i]:
            raise InvalidModel(f'link {i + 1} has no mass whose displacement could unbalance it')
        if moment:
            com[i] += moment / mass[i]
    return com


def _checked_pair(name: str, values: npt.ArrayLike, unit: str) -> FloatArray:
    """Return a copy of one number for each counterbalance, none below 0."""
    return checked_array(name, values, unit, shape=(BALANCED,), lower=0.0).copy()
