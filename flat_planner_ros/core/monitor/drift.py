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
How an arm ages: estimates of its parameters over many motions, and whether they wander.

A straight line is fitted to the last estimates of each parameter, weighted by their standard
errors. It wanders if its slope is larger than chance makes it: by Student's distribution where the
estimates scatter more than they say, at a level that is shared among the parameters, so that an
arm that does not age is suspected after one motion in `1 / false_alarms` at most (the tests of
motions that follow each other are alike, which makes it fewer).
"""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import NamedTuple

from flat_planner_ros.core.monitor.drift_settings import DriftSettings, FEWEST
from flat_planner_ros.core.monitor.model_estimate import LastLinks
from flat_planner_ros.core.monitor.report import VibrationReport
import numpy as np

FRESH = 10
"""Motions without an estimate after which a parameter is not judged any more."""

FINEST = 1e-5
"""Smallest standard error that an estimate is credited with, relative to it [-]."""

UNITS = {
    'both': 'kg m^2',
    'last': 'kg m^2',
    'stiffness': 'N m/rad',
    'damping': 'N m s/rad',
    'viscous': 'N m s/rad',
    'coulomb': 'N m',
}
"""Units of `LastLinks`."""

RATIO_UNITS = {'stiffness_ratio': '1/s^2', 'damping_ratio': '1/s'}
"""What an oscillation tells: stiffness and damping over the inertia that oscillates."""


@dataclass(frozen=True, kw_only=True)
class ParameterDrift:
    """
    How a parameter has changed over the last motions.

    Attributes
    ----------
    name, unit
        Of the parameter.
    value
        After the last motion, on the line [unit].
    rate, rate_std
        Change from motion to motion, and its standard error [unit].
    change
        Over all motions of the line [unit].
    motions
        From the first to the last of them.
    is_noticed
        Whether the rate is more than chance.

    """

    name: str
    unit: str
    value: float
    rate: float
    rate_std: float
    change: float
    motions: int
    is_noticed: bool

    @property
    def text(self) -> str:
        """Return the change as half a sentence."""
        before = self.value - self.change
        share = f' ({100 * self.change / before:+.2g} %)' if before > 0.0 else ''
        return (
            f'{self.name} {before:.4g} -> {self.value:.4g} {self.unit}{share} in {self.motions} '
            f'motions, {self.rate:+.2g} ± {self.rate_std:.1g} a motion'
        )


class _Estimate(NamedTuple):
    """An estimate and its standard error, after which motion."""

    motion: int
    value: float
    std: float


class DriftWatch:
    """Keeps the estimates of the last motions in memory, and judges whether they wander."""

    def __init__(self) -> None:
        """Know nothing."""
        self._motion = 0
        self._kept: dict[str, deque[_Estimate]] = {}

    def hear(self, report: VibrationReport, settings: DriftSettings) -> list[ParameterDrift]:
        """
        Take what a motion has told.

        Parameters
        ----------
        report
            On the motion.
        settings
            When an arm is said to age.

        Returns
        -------
        list of ParameterDrift
            Of all parameters that can be judged; empty where the motion has told nothing.

        """
        self._motion += 1
        told = dict(_estimates_of(report))
        for name, (value, std) in told.items():
            kept = self._kept.setdefault(name, deque())
            kept.append(_Estimate(self._motion, value, max(std, FINEST * abs(value))))
        for kept in self._kept.values():
            while kept and kept[0].motion <= self._motion - settings.window:
                kept.popleft()
        if not told:
            return []
        judged = {
            name: kept
            for name, kept in self._kept.items()
            if len(kept) >= FEWEST and kept[-1].motion > self._motion - FRESH
        }
        level = settings.false_alarms / max(len(judged), 1)
        return [_judged(name, list(kept), level) for name, kept in judged.items()]


def _estimates_of(report: VibrationReport) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield what a report tells of parameters, with standard errors."""
    model, swing = report.model, report.estimate
    if model is not None and model.is_trustworthy and model.values and model.stds:
        for name, value, std in zip(LastLinks._fields, model.values, model.stds, strict=True):
            if isfinite(std) and std > 0.0:
                yield name, (value, std)
    elif swing is not None and swing.is_trustworthy and swing.case is not None:
        # The inertia is nominal, and another one after an adoption: the ratio is what is seen.
        pairs = {
            'stiffness_ratio': (swing.stiffness, swing.stiffness_std),
            'damping_ratio': (swing.damping, swing.damping_std),
        }
        for name, (estimate, error) in pairs.items():
            if estimate is not None and error and swing.inertia:
                ratios = estimate / swing.inertia, error / swing.inertia
                yield f'{name}.{swing.case.value}', ratios


def _judged(name: str, kept: list[_Estimate], level: float) -> ParameterDrift:
    """Return the line through estimates, and whether its slope is more than chance."""
    from scipy.special import stdtrit  # here: slow to import, and only needed after many motions

    motions, values, stds = np.array(kept).T
    weights = 1.0 / stds**2
    middle, mean = np.average(motions, weights=weights), np.average(values, weights=weights)
    spread = float(weights @ (motions - middle) ** 2)
    rate = float(weights @ ((motions - middle) * (values - mean))) / spread
    left = values - mean - rate * (motions - middle)
    freedom = len(kept) - 2
    # Errors that are larger than stated count as they are, smaller ones as stated.
    excess = max(1.0, float(weights @ left**2) / freedom)
    rate_std = sqrt(excess / spread)
    bound = float(stdtrit(freedom, 1.0 - level / 2))
    span = int(motions[-1] - motions[0])
    base = name.partition('.')[0]
    return ParameterDrift(
        name=name,
        unit=UNITS.get(base) or RATIO_UNITS[base],
        value=mean + rate * (float(motions[-1]) - middle),
        rate=rate,
        rate_std=rate_std,
        change=rate * span,
        motions=span,
        is_noticed=abs(rate) > bound * rate_std,
    )
