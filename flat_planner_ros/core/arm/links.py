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

"""Links of an arm: summed up to its constants, and as the rigid bodies that simulators want."""

from math import sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm.arrays import check_number, checked_array, FloatArray
from flat_planner_ros.core.arm.errors import InvalidModel
import numpy as np
import numpy.typing as npt

DEFINITE_TOLERANCE = 1e-12
"""Smallest eigenvalue of an admitted inertia matrix scaled to unit diagonal [-]."""

SYMMETRY_TOLERANCE = 1e-12
"""Largest asymmetry of an admitted inertia matrix scaled to unit diagonal [-]."""

COUPLING_TOLERANCE = 1e-9
"""Largest miss of h_ij = l_i s_j, relative to sqrt(h_ii h_jj) [-]."""

DRAWN_LENGTH = 0.1
"""Length of link n-1 where the model does not tell, for two joints or without a tip mass [m]."""


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
    shape = (np.size(length),)
    return (
        checked_array('link_length', length, 'm', shape=shape, lower=0.0),
        checked_array('link_com', com, 'm', shape=shape),
        checked_array('link_mass', mass, 'kg', shape=shape, lower=0.0),
        checked_array('link_inertia', inertia, 'kg m^2', shape=shape, lower=0.0),
    )


def per_motor(value: npt.ArrayLike | None, motors: int) -> FloatArray:
    """Return one number per actuated joint, zeros for None."""
    return np.zeros(motors) if value is None else np.array(value, dtype=float)


def checked_inertia_star(inertia_star: npt.ArrayLike) -> tuple[float, float]:
    """Return I*_{n-1} and I*_n [kg m^2] if they are those of two links."""
    both, last = checked_array('inertia_star', inertia_star, 'kg m^2', shape=(2,)).tolist()
    if not both > last > 0.0:
        raise InvalidModel(
            f'inertia_star must satisfy I*_(n-1) > I*_n > 0 kg m^2, got {both:g}, {last:g}'
        )
    return both, last


def checked_counterbalances(
    mass: npt.ArrayLike, arm: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return masses [kg] and arms [m] of two counterbalances, shape (2,) each."""
    return (
        checked_array('counterbalance_mass', mass, 'kg', shape=(2,), lower=0.0),
        checked_array('counterbalance_arm', arm, 'm', shape=(2,), lower=0.0),
    )


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


def placed_masses(
    length: FloatArray,
    mass: FloatArray,
    tip_mass: float,
    inertia: FloatArray,
    static_moment: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """
    Return centres of mass [m] and barycentric inertias [kg m^2] of links with given constants.

    The inverse of `chain_load`, masses being known; an inertia below zero says that they cannot
    have these constants.

    Parameters
    ----------
    length, mass
        Of each link, shape (m,) [m], [kg].
    tip_mass
        That rides at the end of the last one [kg].
    inertia, static_moment
        Of each link with all it carries about its joint, h_ii and s_i, shape (m,).

    """
    beyond = np.cumsum(np.append(mass, tip_mass)[::-1])[::-1][1:]
    first = static_moment - length * beyond
    com = np.divide(first, mass, out=np.zeros_like(first), where=mass > 0.0)
    return com, inertia - mass * com**2 - length**2 * beyond


class LinkBody(NamedTuple):
    """
    One rigid link with all that is fixed to it; its frame is at its joint, x along the link.

    Attributes
    ----------
    length
        To the next joint, or to the end of the last link [m].
    tail
        How far it reaches behind its joint [m].
    mass
        Counterbalance included [kg].
    com
        Centre of mass, from the joint along the link [m].
    inertia
        About the axis through the centre of mass that is parallel to the joints' [kg m^2].

    """

    length: float
    tail: float
    mass: float
    com: float
    inertia: float


def bodies_from_links(
    *,
    link_length: npt.ArrayLike,
    link_com: npt.ArrayLike,
    link_mass: npt.ArrayLike,
    link_inertia: npt.ArrayLike,
    counterbalance_mass: npt.ArrayLike = (0.0, 0.0),
    counterbalance_arm: npt.ArrayLike = (0.0, 0.0),
) -> tuple[LinkBody, ...]:
    """
    Return the bodies of an arm that is given by its links; parameters as for PlanarArm.from_links.

    Raises
    ------
    InvalidModel
        The arrays have different lengths or numbers without a meaning.

    """
    links = checked_links(link_length, link_com, link_mass, link_inertia)
    n = links[0].size
    weights, arms = checked_counterbalances(counterbalance_mass, counterbalance_arm)
    added = [(0.0, 0.0)] * (n - 2) + list(zip(weights.tolist(), arms.tolist(), strict=True))
    rows = zip(*(array.tolist() for array in links), strict=True)
    return tuple(_balanced(*row, *extra) for row, extra in zip(rows, added, strict=True))


def bodies_from_reduced(
    *,
    inertia_star: npt.ArrayLike,
    link_length: npt.ArrayLike = (),
    link_com: npt.ArrayLike = (),
    link_mass: npt.ArrayLike = (),
    link_inertia: npt.ArrayLike = (),
    tip_mass: float = 0.0,
    drawn_length: float | None = None,
) -> tuple[LinkBody, ...]:
    """
    Return bodies that have the constants of a reduced arm.

    The last two links are one choice of many, (R3): all of them move alike.

    Parameters
    ----------
    inertia_star, link_length, link_com, link_mass, link_inertia, tip_mass
        As for PlanarArm.reduced.
    drawn_length
        Length of link n-1 [m]. By default it makes the last two links equally heavy; where their
        mass is not given either, it is `DRAWN_LENGTH`.

    Raises
    ------
    InvalidModel
        The arrays have different lengths or numbers without a meaning.

    """
    both, last = checked_inertia_star(inertia_star)
    links = checked_links(link_length, link_com, link_mass, link_inertia)
    check_number('tip_mass', tip_mass, 'kg', lower=0.0)
    tip, own = tip_mass, both - last
    is_free = not links[0].size  # of two joints' mass nothing is known: it rests on the base
    if drawn_length is not None:
        check_number('drawn_length', drawn_length, 'm', above=0.0)
        length = drawn_length
    else:
        length = DRAWN_LENGTH if is_free or tip == 0.0 else sqrt(own / (2.0 * tip))
    share = own / (2.0 * length**2)
    if is_free:
        tip = share
    elbow = _elbow(own, length, tip, share)
    bar_mass = tip - elbow.mass
    half = sqrt(3.0 * last / bar_mass) if bar_mass else length
    bar = LinkBody(length=half, tail=half, mass=bar_mass, com=0.0, inertia=last)
    rows = zip(*(array.tolist() for array in links), strict=True)
    return (*(_balanced(*row) for row in rows), elbow, bar)


def _elbow(own: float, length: float, tip: float, share: float) -> LinkBody:
    """Return link n-1, which balances link n about its joint with half of its inertia, (R3)."""
    if tip == 0.0:
        return LinkBody(length=length, tail=length, mass=0.0, com=0.0, inertia=own)
    carried = tip * share / (tip + share)
    mass = tip - carried
    com = -carried * length / mass
    return LinkBody(length=length, tail=-com, mass=mass, com=com, inertia=own / 2.0)


def _balanced(
    length: float,
    com: float,
    mass: float,
    inertia: float,
    weight: float = 0.0,
    arm: float = 0.0,
) -> LinkBody:
    """Return a link and its counterbalance as one body, (R1)."""
    total = mass + weight
    if total == 0.0:
        return LinkBody(length=length, tail=0.0, mass=0.0, com=0.0, inertia=inertia)
    centre = (mass * com - weight * arm) / total
    about = inertia + mass * (com - centre) ** 2 + weight * (arm + centre) ** 2
    return LinkBody(
        length=length, tail=arm if weight else 0.0, mass=total, com=centre, inertia=about
    )
