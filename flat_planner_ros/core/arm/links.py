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

"""Link data, counterbalances and friction: checked, and summed up to the constants of an arm."""

from math import inf
from typing import NamedTuple

from flat_planner_ros.core.arm.arrays import FloatArray
from flat_planner_ros.core.arm.errors import InvalidModel
import numpy as np
import numpy.typing as npt

DEFINITE_TOLERANCE = 1e-12
"""Smallest eigenvalue of an admitted inertia matrix scaled to unit diagonal [-]."""

SYMMETRY_TOLERANCE = 1e-12
"""Largest asymmetry of an admitted inertia matrix scaled to unit diagonal [-]."""

COUPLING_TOLERANCE = 1e-9
"""Largest miss of h_ij = l_i s_j, relative to sqrt(h_ii h_jj) [-]."""


class Load(NamedTuple):
    """Inertia (n, n) [kg m^2], static moment (n,) [kg m] and carried mass (n,) [kg]."""

    inertia: FloatArray
    static_moment: FloatArray
    carried_mass: FloatArray


def chain_load(
    length: FloatArray, link: npt.NDArray[np.intp], place: FloatArray, mass: FloatArray
) -> Load:
    """
    Return the load of point masses, each riding at a place on a link of a chain.

    Their levers J (masses, links) are a link's length where it only carries the mass.
    """
    index = np.arange(length.size)
    lever = np.where(index < link[:, None], length, 0.0)
    lever[np.arange(link.size), link] = place
    return Load((lever.T * mass) @ lever, mass @ lever, mass @ (index <= link[:, None]))


def checked_links(
    length: npt.ArrayLike, com: npt.ArrayLike, mass: npt.ArrayLike, inertia: npt.ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the four link arrays, checked."""
    n = np.size(length)
    return (
        checked_vector('link_length', length, n, 'm', 0.0),
        checked_vector('link_com', com, n, 'm'),
        checked_vector('link_mass', mass, n, 'kg', 0.0),
        checked_vector('link_inertia', inertia, n, 'kg m^2', 0.0),
    )


def per_motor(value: npt.ArrayLike | None, motors: int) -> FloatArray:
    """Return one number per actuated joint, zeros for None."""
    return np.zeros(motors) if value is None else np.array(value, dtype=float)


def checked_vector(
    name: str, value: npt.ArrayLike, size: int, unit: str, lower: float = -inf
) -> FloatArray:
    """Return a locked copy, shape (size,), of finite numbers not below a bound."""
    array = np.array(value, dtype=float)
    if array.shape != (size,):
        raise InvalidModel(f'{name} must have {size} entries, got shape {array.shape}')
    if not np.isfinite(array).all():
        raise InvalidModel(f'{name} must be finite, got {array} {unit}')
    if (array < lower).any():
        raise InvalidModel(f'{name} must be at least {lower:g} {unit}, got {array.min():g}')
    array.setflags(write=False)
    return array


def check_definite(inertia: FloatArray) -> None:
    """
    Refuse coefficients h of a mass matrix that is not positive definite in every pose.

    H(theta) is the entrywise product of h and cos(theta_i - theta_j), which is positive
    semidefinite with unit diagonal. By the Schur product theorem H is positive definite in every
    pose if h is; the stretched arm, H = h, shows that nothing less will do.
    """
    if not np.isfinite(inertia).all():
        raise InvalidModel(f'inertia must be finite, got {inertia.tolist()} kg m^2')
    own = np.diag(inertia)
    if own.min() <= 0.0:
        raise InvalidModel(f'inertia of every link must be above 0 kg m^2, got {own.min():g}')
    # Root by root: the product of two entries may leave double precision.
    root = np.sqrt(own)
    with np.errstate(over='ignore'):
        scaled = inertia / root / root[:, None]
    if np.isinf(scaled).any():
        raise InvalidModel(f'inertia must be positive definite, got {inertia.tolist()} kg m^2')
    if (np.abs(scaled - scaled.T) > SYMMETRY_TOLERANCE).any():
        raise InvalidModel(f'inertia must be symmetric, got {inertia.tolist()} kg m^2')
    least = float(np.linalg.eigvalsh(scaled)[0])
    if least < DEFINITE_TOLERANCE:
        raise InvalidModel(
            f'inertia must be positive definite: scaled to unit diagonal its least eigenvalue is '
            f'{least:.3g}, below {DEFINITE_TOLERANCE:g}'
        )


def check_realizable(
    inertia: FloatArray, static_moment: FloatArray, carried_mass: FloatArray
) -> None:
    """
    Refuse inertias and static moments that no masses on a chain have together.

    Links i < j are coupled by h_ij = l_i s_j, and s_i^2 <= (carried mass) h_ii.
    """
    own = np.sqrt(np.diag(inertia))
    least_mass = (static_moment / own) ** 2
    if (least_mass > carried_mass * (1.0 + DEFINITE_TOLERANCE)).any():
        raise InvalidModel(
            f'carried_mass must be at least static_moment^2 / inertia = {least_mass} kg, '
            f'got {carried_mass}'
        )
    for i in range(len(static_moment) - 1):
        coupling, moment = inertia[i, i + 1 :], static_moment[i + 1 :]
        length = coupling @ np.linalg.pinv(moment[:, None])[0]
        miss = float(np.max(np.abs(coupling - length * moment) / (own[i] * own[i + 1 :])))
        if miss > COUPLING_TOLERANCE:
            raise InvalidModel(
                f'inertia and static_moment disagree: link {i + 1} must be coupled to those '
                f'beyond it in proportion to their static moments, relative miss {miss:.3g}, '
                f'bound {COUPLING_TOLERANCE:g}'
            )
