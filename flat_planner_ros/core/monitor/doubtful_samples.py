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

"""Samples that may show something else than the arm's swing: folded, in bursts, or foreign."""

from dataclasses import replace
from math import pi
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.monitor.damped_columns import basis_columns, solve_linear
from flat_planner_ros.core.monitor.oscillation import fit_oscillation, OscillationFit
from flat_planner_ros.core.monitor.settings import MonitorSettings
import numpy as np

ENOUGH_RATE = 2.5
"""Sampling rate from which no folded frequency is near the expected one, relative to it [-]."""

PLAUSIBLE = 1.5
"""Factor within which the arm's frequency is looked for beside the expected one [-]."""

CLEARLY_BETTER = 2.0
"""Factor between what two fits leave from which one is right and the other folded [-]."""

EXACT = 1e-6
"""What a fit leaves relative to the swing below which nothing is compared [-]."""

BURST_GAP = 5.0
"""Gap between two bursts relative to the median time between samples, at least [-]."""

BURST_SIZE = 4.0
"""Mean number of samples in a burst, at least [-]."""

BURST_SHARE = 0.2
"""Part of the time that the bursts take, at most [-]."""

FOREIGN = 2.0
"""Factor of the frequency from which a vibration is not the arm's: stiffness times 4 [-]."""

DECAYING = 0.1
"""Decay over the samples, as exponent, from which a vibration is not kept up by anything [-]."""

SIGMAS = 3.0
"""Standard errors within which a decay may be chance [-]."""

VIBRATIONS = 3
"""Most foreign vibrations that are taken out one after another [-]."""


class Seen(NamedTuple):
    """The swing of the arm, and a clause on vibrations that are not its own, empty without."""

    fit: OscillationFit
    foreign: str


def doubt_of_times(times: FloatArray) -> str:
    """Return why sampling times [s], ascending, shape (m,), are not those of measuring, if so."""
    if times.size < 2 * BURST_SIZE:
        return ''
    gaps = np.diff(times)
    within = gaps <= BURST_GAP * float(np.median(gaps))
    bursts = int(np.count_nonzero(~within)) + 1
    size = times.size / bursts
    if size < BURST_SIZE or bursts < 3 or gaps[within].sum() > BURST_SHARE * np.ptp(times):
        return ''
    return (
        f'joint states come in bursts of {size:.3g} with stamps {1e3 * np.median(gaps):.2g} ms '
        'apart: these are not the times of measuring'
    )


def seen_oscillation(
    times: FloatArray, values: FloatArray, end: float, settings: MonitorSettings
) -> Seen:
    """
    Return the swing that samples show, freed of vibrations that are not the arm's.

    Parameters
    ----------
    times, values
        Sampling times [s], ascending, and angles [rad], shape (m,).
    end
        End of the motion [s].
    settings
        Expected frequency and damping, where they are known.

    """
    remarks: list[str] = []
    fit = fit_oscillation(times, values, end)
    while len(remarks) < VIBRATIONS and _is_foreign(fit, times, settings):
        remarks.append(
            f'a vibration of {fit.amplitude:.2g} rad at {fit.frequency:.4g} Hz is foreign: '
            f'the arm swings at {settings.expected_frequency:.4g} Hz, and decays'
        )
        values = _without(fit, times, values)
        fit = fit_oscillation(times, values, end)
    return Seen(_unfolded(fit, times, values, end, settings), '; '.join(remarks))


def _is_foreign(fit: OscillationFit, times: FloatArray, settings: MonitorSettings) -> bool:
    """Return whether something else keeps up a vibration far from the arm's frequency."""
    expected, ratio = settings.expected_frequency, settings.expected_damping_ratio
    if fit.frequency is None or fit.decay is None or expected is None or not ratio:
        return False
    span = float(np.ptp(times))
    is_near = expected / FOREIGN <= fit.frequency <= expected * FOREIGN
    would_decay = 2 * pi * expected * ratio * span > 2 * DECAYING
    chance = SIGMAS * (fit.decay_std or 0.0)
    return not is_near and would_decay and abs(fit.decay) < max(DECAYING / span, chance)


def _without(fit: OscillationFit, times: FloatArray, values: FloatArray) -> FloatArray:
    """Return samples without the oscillation of a fit."""
    span = float(np.ptp(times))
    rates = span * np.array((2 * pi * (fit.frequency or 0.0), fit.decay or 0.0))
    basis = basis_columns((times - times[0]) / span, rates)
    _, linear = solve_linear(basis, values)
    left: FloatArray = values - basis[:, 2:] @ linear[2:]
    # Rounding is no further vibration.
    return left if np.ptp(left) > EXACT * (fit.amplitude or 0.0) else np.zeros_like(left)


def _unfolded(
    fit: OscillationFit,
    times: FloatArray,
    values: FloatArray,
    end: float,
    settings: MonitorSettings,
) -> OscillationFit:
    """Return the fit whose frequency is the true one, without it where that is not clear."""
    if fit.frequency is None:
        return fit
    rate = 1.0 / float(np.median(np.diff(times)))
    expected = settings.expected_frequency or fit.frequency
    if rate >= ENOUGH_RATE * expected:
        return fit
    band = max(0.5 * rate, expected / PLAUSIBLE), max(PLAUSIBLE * expected, 0.75 * rate)
    other = fit_oscillation(times, values, end, band=band)
    if other.frequency is None:
        return fit
    least = EXACT * (fit.peak_to_peak or 0.0)
    left, left_by_other = (max(each.fit_rms or 0.0, least) for each in (fit, other))
    if left > CLEARLY_BETTER * left_by_other:
        return other
    # Stamps that are off by chance disturb the higher frequency more: that proves nothing.
    if left_by_other > CLEARLY_BETTER * other.frequency / fit.frequency * left:
        return fit
    return replace(
        fit,
        frequency=None,
        natural_frequency=None,
        damping_ratio=None,
        frequency_std=None,
        reason=f'frequency {fit.frequency:.4g} Hz or {other.frequency:.4g} Hz: at {rate:.3g} '
        'samples per second both explain the samples',
    )
