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

"""Stiffness and damping of the passive joint from the free oscillation that a motion leaves."""

from dataclasses import dataclass, replace
from enum import Enum
from math import hypot, pi, sqrt
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, InvalidRequest, PlanarArm
from flat_planner_ros.core.monitor.damped_columns import basis_columns, solve_linear
from flat_planner_ros.core.monitor.oscillation import OscillationFit
import numpy as np
from numpy.typing import ArrayLike

ENOUGH_PERIODS = 2.0
"""Fewest periods in the samples from which bias, drift and decay are told apart [-]."""

NOISE_MARGIN = 5.0
"""Smallest amplitude relative to the root mean square of what the fit leaves [-]."""

STIFFNESS_ERROR = 0.02
"""Largest standard error of the stiffness, relative to it [-]."""

DECAY_ERROR = 0.01
"""Largest standard error of the decay relative to the angular frequency [-]."""

STIFFNESS_FACTOR = 4.0
"""Largest factor between estimated and nominal stiffness, either way [-]."""

GROWTH = 1e-4
"""Growth of the envelope that is forgiven as rounding, relative to the angular frequency [-]."""

SIGMAS = 3.0
"""Standard errors within which chance explains a difference [-]."""

MISFIT = 0.02
"""Largest regular remainder of the fit beyond encoder steps, relative to the amplitude [-]."""

REGULAR = 0.5
"""Correlation of neighbours from which a remainder is regular, not noise [-]."""

CORRELATION_LIMIT = 0.99
"""Largest correlation of neighbours for which the standard errors are corrected [-]."""

CASE_TOLERANCE = 0.005
"""Largest error of the stiffness accepted from a joint that is not quite free or held [-]."""

CASE_SHARE = 0.2
"""Largest part of the difference between the two cases that such a joint may show [-]."""

WHOLE = 1e-3
"""Largest distance from a whole number of encoder steps, from rounding [-]."""

STEP_ERROR = 0.5
"""Error that encoder steps leave in the amplitude of a joint, in steps [-]."""

STEP_RMS = 12.0**-0.5
"""Root mean square of the rounding to encoder steps, in steps [-]."""


class ActuatedJoints(Enum):
    """What the actuated joints do while the passive one oscillates."""

    AUTO = 'auto'
    """Unknown: decided from the samples."""

    FREE = 'free'
    """Joint n-1 has no effort and gives way."""

    HELD = 'held'
    """They stand still."""


@dataclass(frozen=True, kw_only=True)
class StiffnessEstimate:
    """
    Stiffness and damping of the passive joint; a value that cannot be computed is ``None``.

    Attributes
    ----------
    stiffness, stiffness_std
        Estimate of k and its standard error [N m/rad].
    damping, damping_std
        Estimate of c, not below 0, and its standard error [N m s/rad].
    case
        Whether joint n-1 was free or held, ``None`` if that is not clear.
    inertia
        What the passive joint oscillates then, by the nominal model [kg m^2].
    is_trustworthy
        Whether the values are good enough to plan with.
    reason
        Why not; empty if they are.

    """

    stiffness: float | None = None
    stiffness_std: float | None = None
    damping: float | None = None
    damping_std: float | None = None
    case: ActuatedJoints | None = None
    inertia: float | None = None
    is_trustworthy: bool = False
    reason: str


def oscillating_inertia(arm: PlanarArm, case: ActuatedJoints) -> float:
    """
    Return the inertia that makes the nominal mode of a flat arm, (47a).

    Raises
    ------
    NotFlat
        If the arm is not flat.

    """
    mode = arm.natural_mode(held=case is ActuatedJoints.HELD)
    return arm.stiffness / mode.frequency**2


def identify(
    times: ArrayLike,
    positions: ArrayLike,
    fit: OscillationFit,
    arm: PlanarArm,
    joints: ActuatedJoints = ActuatedJoints.AUTO,
) -> StiffnessEstimate:
    """
    Estimate stiffness and damping from samples and the oscillation found in them.

    Parameters
    ----------
    times
        Sampling times from the end of the motion [s], shape (m,), ascending.
    positions
        Joint positions from any fixed pose [rad], shape (m, n).
    fit
        Oscillation of the passive joint, fitted to the last column.
    arm
        Nominal model; its inertias are taken as known.
    joints
        Whether joint n-1 is free or held.

    Returns
    -------
    StiffnessEstimate
        The estimate, trustworthy or with the reason why not.

    Raises
    ------
    InvalidRequest
        If the shapes do not fit.
    NotFlat
        If the arm is not flat.

    """
    t, rows = np.asarray(times, dtype=float), np.asarray(positions, dtype=float)
    if t.ndim != 1 or rows.shape != (t.size, arm.n):
        raise InvalidRequest(f'{t.shape} times and {rows.shape} positions of {arm.n} joints')
    if None in (fit.frequency, fit.decay, fit.frequency_std, fit.decay_std):
        return StiffnessEstimate(reason=fit.reason or 'no oscillation')
    pole = _pole(fit)
    # Link n-1 moves by the sum of the joints before the last one, for any n (derivation, 8).
    link, last = _response(t, rows[:, :-1].sum(axis=1), pole), _response(t, rows[:, -1], pole)
    step = max(_step(column) for column in rows.T)
    case, reason = joints, ''
    if joints is ActuatedJoints.AUTO:
        found, reason = _case(link, last, step, arm)
        if found is None:
            return StiffnessEstimate(reason=reason)
        case = found
    inertia = oscillating_inertia(arm, case)
    omega, decay = pole.omega, pole.decay
    # Neighbours that err alike are worth fewer samples; (47c) for noise of first order.
    correlation = last.correlation if last.correlation > SIGMAS / sqrt(t.size) else 0.0
    correlation = min(correlation, CORRELATION_LIMIT)
    inflation = sqrt((1.0 + correlation) / (1.0 - correlation))
    omega_std, decay_std = inflation * pole.omega_std, inflation * pole.decay_std
    estimate = StiffnessEstimate(
        stiffness=inertia * (omega**2 + decay**2),
        stiffness_std=2 * inertia * hypot(omega * omega_std, decay * decay_std),
        damping=2 * inertia * max(decay, 0.0),
        damping_std=2 * inertia * decay_std,
        case=case,
        inertia=inertia,
        reason='',
    )
    spread = sqrt(float(np.mean(last.left**2)))
    doubts = (
        _doubt_of_samples(omega * float(np.ptp(t)) / (2 * pi), last, spread, step),
        _doubt_of_values(estimate, arm, pole, decay_std),
    )
    reason = next(filter(None, doubts), '')
    return replace(estimate, is_trustworthy=not reason, reason=reason)


class _Pole(NamedTuple):
    """Damped angular frequency [rad/s] and decay [1/s] with standard errors for white noise."""

    omega: float
    decay: float
    omega_std: float
    decay_std: float


class _Response(NamedTuple):
    """Complex amplitude [rad] of a signal at a pole, its standard error, and what is left."""

    amplitude: complex
    std: float
    left: FloatArray
    correlation: float


def _pole(fit: OscillationFit) -> _Pole:
    """Return the pole of a fit that has one."""
    turn = 2 * pi
    return _Pole(
        turn * (fit.frequency or 0.0),
        fit.decay or 0.0,
        turn * (fit.frequency_std or 0.0),
        fit.decay_std or 0.0,
    )


def _response(t: FloatArray, y: FloatArray, pole: _Pole) -> _Response:
    """Return how much of a signal oscillates with a pole, beside a straight line."""
    span = float(np.ptp(t))
    basis = basis_columns(t / span, span * np.array((pole.omega, pole.decay)))
    centred = y - y.mean()
    columns, linear = solve_linear(basis, centred)
    left = centred - columns @ (columns.T @ centred)
    power = float(left @ left)
    covariance = np.linalg.pinv(basis.T @ basis, hermitian=True)
    variance = power / max(t.size - basis.shape[1], 1) * float(np.trace(covariance[2:, 2:])) / 2
    correlation = float(left[1:] @ left[:-1]) / power if power > 0.0 else 0.0
    return _Response(complex(linear[2], -linear[3]), sqrt(variance), left, correlation)


def _step(column: FloatArray) -> float:
    """Return the step of the encoder of which all samples are multiples, 0 if there is none."""
    levels = np.unique(column)
    if levels.size in (1, column.size):
        return 0.0
    differences = np.diff(levels)
    step = float(differences.min())
    steps = differences / step
    return step if float(np.abs(steps - np.round(steps)).max()) < WHOLE else 0.0


def _case(
    link: _Response, last: _Response, step: float, arm: PlanarArm
) -> tuple[ActuatedJoints | None, str]:
    """Return whether link n-1 gives way as (47b) says or stands still, or why that is unclear."""
    both, own = arm.inertia_star
    ratios = {ActuatedJoints.FREE: -own / both, ActuatedJoints.HELD: 0.0}
    measured = link.amplitude / last.amplitude
    # All below in terms of the stiffness, which is proportional to 1 + ratio.
    between = own / both
    tolerance = min(CASE_TOLERANCE, CASE_SHARE * between)
    random = (SIGMAS * link.std + STEP_ERROR * step) / abs(last.amplitude)
    distances = {case: abs(measured - ratio) for case, ratio in ratios.items()}
    nearest = min(distances, key=distances.__getitem__)
    fitting = [case for case, distance in distances.items() if distance <= tolerance + random]
    if len(fitting) == 1 or (fitting and between <= CASE_TOLERANCE):
        return nearest, ''
    share = 'link n-1 moves by {:.3g} of the passive joint, a free one by {:.3g}, a held one by 0'
    seen = share.format(measured.real, ratios[ActuatedJoints.FREE])
    if fitting:
        return None, f'{seen}: noise hides whether the actuated joints are free or held'
    return None, f'{seen}: the actuated joints are neither free nor held'


def _doubt_of_samples(periods: float, last: _Response, spread: float, step: float) -> str:
    """Return what speaks against the samples, if anything."""
    amplitude = abs(last.amplitude)
    if periods < ENOUGH_PERIODS:
        return f'{periods:.3g} periods in the samples, fewer than {ENOUGH_PERIODS:g}'
    if amplitude < NOISE_MARGIN * max(spread, STEP_RMS * step):
        return f'amplitude below {NOISE_MARGIN:g} times the noise of {spread:.2g} rad'
    is_regular = last.correlation > REGULAR
    if is_regular and spread > MISFIT * amplitude + STEP_RMS * step:
        return f'the oscillation differs regularly from a damped one, by {spread:.2g} rad'
    return ''


def _doubt_of_values(
    estimate: StiffnessEstimate, arm: PlanarArm, pole: _Pole, decay_std: float
) -> str:
    """Return what speaks against the values, if anything."""
    stiffness, std = estimate.stiffness or 0.0, estimate.stiffness_std or 0.0
    if std > STIFFNESS_ERROR * stiffness:
        return f'standard error of the stiffness {std / stiffness:.2g}, above {STIFFNESS_ERROR:g}'
    if decay_std > DECAY_ERROR * pole.omega:
        share = decay_std / pole.omega
        return f'standard error of the damping ratio {share:.2g}, above {DECAY_ERROR:g}'
    if pole.decay < -SIGMAS * decay_std and pole.decay < -GROWTH * pole.omega:
        return f'the oscillation grows at {-pole.decay:.2g} /s'
    factor = stiffness / arm.stiffness
    if not 1.0 / STIFFNESS_FACTOR <= factor <= STIFFNESS_FACTOR:
        return f'the stiffness would be {factor:.3g} times the nominal one'
    return ''
