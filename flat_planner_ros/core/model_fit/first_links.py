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
Rows of the first n-2 links of a flat arm, in weak form: linear in all but the encoders' offsets.

In absolute angles, (4) of docs/derivation.md, link i of the first m = n-2 obeys

    sum_j h_ij (cos(d_ij) a_j'' + sin(d_ij) a_j'^2) + g s_i cos(a_i) = net effort i less i+1

with d_ij = a_i - a_j and h_ij = l_i s_j beyond link i. Multiplied by a window and integrated by
parts, no noise is differentiated twice.
"""

from dataclasses import replace
from typing import NamedTuple

from flat_planner_ros.core.arm import coulomb_share, COULOMB_VELOCITY, FloatArray, PlanarArm
from flat_planner_ros.core.model_fit.scales import FRICTION_SHARE, OFFSET_SCALE
from flat_planner_ros.core.model_fit.signals import derivative
from flat_planner_ros.core.model_fit.weak_form import Windows
import numpy as np

KINDS = ('inertia', 'static_moment', 'viscous_friction', 'coulomb_friction', 'offset')
"""What each of the first links has, in the order of a vector of parameters (5 m,)."""

OWN, MOMENT, VISCOUS, COULOMB, OFFSET = range(len(KINDS))

RESTING = 3.0
"""Velocity below which friction may be anything, in those of Coulomb friction [-]."""

MOMENT_SHARE = 0.3
"""Scale of a static moment, relative to sqrt(carried mass * inertia) [-]."""

HEAVIER = 1.0 + 1e-6
"""Carried mass relative to the least that a static moment and an inertia admit [-]."""


class ChainSignals(NamedTuple):
    """
    What is measured of the first links in one stretch, evenly sampled.

    Attributes
    ----------
    times
        Shape (w,) [s].
    angles, rates
        Absolute angles of the first links and their smoothed velocities, shape (w, m).
    last_rate
        Velocity of joint n-1, shape (w,) [rad/s].
    efforts
        Of the actuated joints when they act, shape (w, m+1) [N m].
    resting
        Whether each of these joints hardly moves, 0 or 1, shape (w, m+1) [-].

    """

    times: FloatArray
    angles: FloatArray
    rates: FloatArray
    last_rate: FloatArray
    efforts: FloatArray
    resting: FloatArray

    @classmethod
    def of(
        cls, times: FloatArray, angles: FloatArray, efforts: FloatArray, span: float
    ) -> 'ChainSignals':
        """
        Return them, velocities smoothed over a span.

        Parameters
        ----------
        times
            Shape (w,) [s].
        angles
            Absolute angles of the first links and of link n-1, shape (w, m+1) [rad].
        efforts
            Of the actuated joints when they act, shape (w, m+1) [N m].
        span
            Of the polynomials [s].

        """
        rates = derivative(times, angles, span, 1)
        joints = np.diff(rates, axis=1, prepend=0.0)
        return cls(
            times=times,
            angles=angles[:, :-1],
            rates=rates[:, :-1],
            last_rate=joints[:, -1],
            efforts=efforts,
            resting=(np.abs(joints) < RESTING * COULOMB_VELOCITY).astype(float),
        )


class Chain(NamedTuple):
    """What is taken for true: lengths (m-1 and more,) [m], gravity, friction of joint n-1."""

    lengths: FloatArray
    gravity: float
    last_friction: tuple[float, float]

    @classmethod
    def of(cls, arm: PlanarArm, last_friction: tuple[float, float]) -> 'Chain':
        """Return that of an arm; a length that only balanced links would tell counts as zero."""
        count = arm.n - 2
        lengths = np.zeros(count)
        for i in range(count - 1):
            moments = arm.static_moment[i + 1 : count]
            if moments.any():
                lengths[i] = arm.inertia[i, i + 1 : count] @ moments / (moments @ moments)
        return cls(lengths, arm.gravity, last_friction)


def parameters_of(arm: PlanarArm) -> FloatArray:
    """Return the parameters of the first links in the order of KINDS, shape (5 m,)."""
    count = arm.n - 2
    return np.concatenate(
        (
            np.diag(arm.inertia)[:count],
            arm.static_moment[:count],
            arm.viscous_friction[:count],
            arm.coulomb_friction[:count],
            np.zeros(count),
        )
    )


def first_scales(arm: PlanarArm, effort: FloatArray, rate: FloatArray) -> FloatArray:
    """
    Return how far each parameter may reasonably be off, shape (5 m,).

    Parameters
    ----------
    arm
        As believed.
    effort, rate
        Standard deviations of efforts and velocities of the first joints, shape (m,).

    """
    count = arm.n - 2
    scales = np.abs(parameters_of(arm)).reshape(len(KINDS), count)
    least = MOMENT_SHARE * np.sqrt(arm.carried_mass[:count] * scales[OWN])
    scales[MOMENT] = np.maximum(scales[MOMENT], least)
    effort, rate = np.maximum(effort, 1e-12), np.maximum(rate, 1e-9)
    scales[VISCOUS] = np.maximum(scales[VISCOUS], FRICTION_SHARE * effort / rate)
    scales[COULOMB] = np.maximum(scales[COULOMB], FRICTION_SHARE * effort)
    scales[OFFSET] = OFFSET_SCALE
    return scales.ravel()


def inertia_of(own: FloatArray, moment: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return the inertia matrix of stretched first links, h_ij = l_i s_j, (m, m) [kg m^2]."""
    coupling = np.triu(np.outer(lengths, moment), k=1)
    result: FloatArray = np.diag(own) + coupling + coupling.T
    return result


def noise_of_rows(inertia: FloatArray, noise: FloatArray, gain: float) -> FloatArray:
    """
    Return what noise of the angles does to the rows, shape (m,) [N m].

    Parameters
    ----------
    inertia
        Of the first links, shape (m, m) [kg m^2].
    noise
        Standard deviation of each joint angle, shape (m and more,) [rad].
    gain
        Of a window for the second derivative, `Windows.gain` [1/s^2].

    """
    spread = np.sqrt(np.cumsum(noise[: len(inertia)] ** 2))
    result: FloatArray = gain * np.linalg.norm(inertia * spread, axis=1)
    return result


def with_first_links(arm: PlanarArm, values: FloatArray) -> PlanarArm:
    """
    Return a copy with other first links; its lengths stay, masses grow where they must.

    Parameters
    ----------
    arm
        Of three or more joints.
    values
        In the order of KINDS, shape (5 m,); friction below zero counts as none.

    """
    count = arm.n - 2
    own, moment, viscous, coulomb, _ = values.reshape(len(KINDS), count)
    lengths = Chain.of(arm, (0.0, 0.0)).lengths
    inertia, static_moment = arm.inertia.copy(), arm.static_moment.copy()
    inertia[:count, :count] = inertia_of(own, moment, lengths)
    static_moment[:count] = moment
    mass = arm.carried_mass.copy()
    mass[:count] = np.maximum(mass[:count], HEAVIER * moment**2 / own)
    frictions = arm.viscous_friction.copy(), arm.coulomb_friction.copy()
    frictions[0][:count], frictions[1][:count] = np.maximum(viscous, 0), np.maximum(coulomb, 0)
    return replace(
        arm,
        inertia=inertia,
        static_moment=static_moment,
        carried_mass=mass,
        viscous_friction=frictions[0],
        coulomb_friction=frictions[1],
    )


def rows(
    signals: ChainSignals, windows: Windows, chain: Chain, values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """
    Return the rows of all first links around a set of parameters.

    Parameters
    ----------
    signals
        One stretch.
    windows
        To integrate over.
    chain
        What is taken for true.
    values
        Shape (5 m,).

    Returns
    -------
    tuple[FloatArray, FloatArray]
        Derivatives of the efforts by the parameters, shape (windows, m, 5 m), and the efforts
        that the parameters leave unexplained, shape (windows, m) [N m].

    """
    count = signals.angles.shape[1]
    own, moment, viscous, coulomb, offset = values.reshape(len(KINDS), count)
    angles = signals.angles - np.cumsum(offset)
    columns = np.zeros((len(windows(signals.times)), count, len(KINDS), count))
    for i in range(count):
        columns[:, i, OWN, i] = windows(angles[:, i], 2)
        columns[:, i, MOMENT, i] += chain.gravity * windows(np.cos(angles[:, i]))
        weight = chain.gravity * moment[i] * windows(np.sin(angles[:, i]))
        columns[:, i, OFFSET, : i + 1] += weight[:, None]
    for i in range(count):
        for j in range(i + 1, count):
            _add_coupling(columns, i, j, angles, signals.rates, windows, chain.lengths[i], moment)
    _add_friction(columns, signals, windows)
    flat = columns.reshape(len(columns), count, -1)
    without = np.concatenate((own, moment, viscous, coulomb, np.zeros(count)))
    return flat, _net(signals, windows, chain) - flat @ without


def _add_coupling(
    columns: FloatArray,
    i: int,
    j: int,
    angles: FloatArray,
    rates: FloatArray,
    windows: Windows,
    length: float,
    moment: FloatArray,
) -> None:
    """Add what links i < j do to each other."""
    for row, other in ((i, j), (j, i)):
        apart = angles[:, row] - angles[:, other]
        both = rates[:, row] * rates[:, other]
        cosine, sine = np.cos(apart), np.sin(apart)
        # d/dt(cos(d) a') = cos(d) a'' - sin(d) (b' - a') a', so that a'^2 leaves the product.
        pull = windows(cosine * rates[:, other], 1) + windows(sine * both)
        columns[:, row, MOMENT, j] += length * pull
        turned = windows(-sine * rates[:, other], 1) + windows(cosine * both)
        # An offset of the joints between both changes their angle apart.
        sign = 1.0 if row == i else -1.0
        change = sign * length * moment[j] * turned
        columns[:, row, OFFSET, i + 1 : j + 1] += change[:, None]


def _add_friction(columns: FloatArray, signals: ChainSignals, windows: Windows) -> None:
    """Add friction: that of joint i acts on link i, and back on link i-1."""
    joints = np.diff(signals.rates, axis=1, prepend=0.0)
    for i, rate in enumerate(joints.T):
        for kind, share in ((VISCOUS, rate), (COULOMB, coulomb_share(rate))):
            effort = windows(share)
            columns[:, i, kind, i] += effort
            if i:
                columns[:, i - 1, kind, i] -= effort


def _net(signals: ChainSignals, windows: Windows, chain: Chain) -> FloatArray:
    """Return the efforts on the links, shape (windows, m) [N m]."""
    viscous, coulomb = chain.last_friction
    efforts = signals.efforts.copy()
    efforts[:, -1] -= viscous * signals.last_rate + coulomb * coulomb_share(signals.last_rate)
    return np.column_stack([windows(column) for column in (efforts[:, :-1] - efforts[:, 1:]).T])
