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
Shortest duration of a motion within the limits of its joints (docs/derivation.md, section L).

Peaks fall with the duration, velocities nearly with its first power, efforts and deflections with
its second; but the shape of a law changes with its duration, gravity does not fall at all, and a
faster motion may even need less effort. So powers only guide the search, which tries durations
until one that obeys is found next to one that does not, and then looks for others below.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import exp, inf, isfinite, log, sqrt

from flat_planner_ros.core.arm import (
    FlatPlannerError,
    FloatArray,
    InvalidRequest,
    OutOfReach,
    UncertifiedPlan,
)
from flat_planner_ros.core.planning.certified_plan import Plan
from flat_planner_ros.core.planning.duration_trial import duration_of, line_root, root_of, Trial
from flat_planner_ros.core.planning.extrema import Quantity
from flat_planner_ros.core.planning.limits import JointLimits, LimitUse
import numpy as np

IsOver = Callable[[], bool]
"""Tells whether a search is to be content with what it has found."""

DURATION_TOLERANCE = 2e-4
"""Distance of the answer to a shorter duration that breaks a limit, relative to it [-]."""

SCAN_STEP = 1.2
"""Ratio of the durations tried below the answer: a feasible range as wide is not missed [-]."""

SCAN_DEPTH = 2.0
"""Share of the answer down to which shorter ones are looked for, inverted [-]."""

AIM = 1.01
"""Ratio of a duration tried to the one that powers suggest: it is to lie beyond the root [-]."""

FIRST_STRIDE = 1.1
"""Least ratio of a duration to the one tried before, if that was too short [-]."""

LONG_STRIDE = 10.0
"""The same from which a line through two trials does not hold it back, which could creep [-]."""

LEAP = 2.0
"""Most that the next duration is of the last, from a start in motion: longer may be worse [-]."""

DIGITS = 9
"""Significant digits of the durations tried: as many as are reported."""

PATIENCE = 3
"""Secants in a row that do not halve a gap, after which a bisection does [-]."""

NARROW = 1.05
"""Ratio of two durations between which trials are looked at in full [-]."""

SHARP = 1.01
"""Ratio of two durations up to which the peaks of one are at the times of the other's [-]."""

ALIKE = 1.02
"""Ratio of two uses of a limit, both beyond it, between which others are taken to be [-]."""

SAMPLES = 65
"""Times at which a duration of a scan is looked at: most are ruled out by that."""

POWERS = {Quantity.POSITION: 2.0, Quantity.VELOCITY: 1.0, Quantity.EFFORT: 2.0}
"""How the use of a limit falls with the duration of a fixed shape, to leading order."""


@dataclass(eq=False, repr=False)
class NoFeasibleDuration(FlatPlannerError):
    """
    No duration keeps a motion within the limits.

    Attributes
    ----------
    use
        The limit that is exceeded even by the least exceeding motion.
    duration
        Duration of that motion [s].
    shortest, longest
        The durations considered [s].
    at_end
        Whether it is an effort beyond its limit at the start or the end already: a static load, or
        that of the motion from which this one starts.

    """

    use: LimitUse
    duration: float
    shortest: float
    longest: float
    at_end: bool = False

    def __post_init__(self) -> None:
        """Say the range in a sentence."""
        super().__init__(
            f'no duration from {self.shortest:g} to {self.longest:g} s obeys the limits'
        )


def shortest_plan(
    plan_of: Callable[[float], Plan],
    limits: JointLimits,
    *,
    shortest: float,
    longest: float,
    bound: float | None = None,
    first: float | None = None,
    most: int | None = None,
    is_over: IsOver | None = None,
) -> Plan:
    """
    Return the plan of the shortest duration that obeys the limits.

    Parameters
    ----------
    plan_of
        Plan of a duration [s].
    limits
        Limits of the joints.
    shortest, longest
        Range of the duration [s].
    bound
        A duration below which none obeys [s], as some strategies know it; it is tried first.
    first
        Where the search starts without a bound [s]; None for the middle of the range.
    most
        Durations after which the search is content with what it has found; None for all that the
        answer needs.
    is_over
        Tells when to be content with it, asked before each duration; None for never. As long as
        nothing obeys, longer ones are tried nevertheless.

    Returns
    -------
    Plan
        Motion that obeys the limits; with a duration shorter by `DURATION_TOLERANCE` it would
        not. No duration on a grid of ratio `SCAN_STEP` down to 1 / `SCAN_DEPTH` of it does either.

    Raises
    ------
    InvalidRequest
        The range is empty or not finite.
    NoFeasibleDuration
        No duration on a grid of ratio `SCAN_STEP` over the whole range obeys the limits; some are
        not tried, whose neighbours rule them out.
    FlatPlannerError
        As `plan_of` raises it, if there is no plan of any duration on that grid.

    """
    if not (0.0 < shortest <= longest and isfinite(longest)):
        raise InvalidRequest(f'no range of durations: {shortest:g} to {longest:g} s')
    enough = inf if most is None else most
    if bound is None or not shortest < bound < longest:
        start = sqrt(shortest * longest) if first is None else min(max(first, shortest), longest)
        return _Search(plan_of, limits, shortest, longest, enough, is_over, start).run()
    least = float(f'{bound:.{DIGITS}g}')
    return _Search(plan_of, limits, least, longest, enough, is_over, least, is_bound=True).run()


@dataclass(eq=False)
class _Search:
    """Durations tried so far, and which to try next."""

    plan_of: Callable[[float], Plan]
    limits: JointLimits
    shortest: float
    longest: float
    most: float
    is_over: IsOver | None
    first: float
    is_bound: bool = False
    trials: dict[float, Trial] = field(default_factory=dict)
    peaks: FloatArray = field(default_factory=lambda: np.zeros(0))
    peaks_of: float = inf
    failure: FlatPlannerError | None = None

    def run(self) -> Plan:
        """Return the shortest plan found."""
        if self.is_bound:
            trial = self._try(self.shortest)
            if trial.obeys and trial.plan is not None:
                return trial.plan
        self._bracket(self.first)
        self._refine()
        while not self._is_confirmed() and max(self.trials) < self.longest:
            # What seemed to obey by samples does not: more often than not, a little more will.
            self._bracket(max(self.trials))
            self._refine()
        if not self._is_confirmed():
            self._scan(self.shortest, self.longest)
            self._refuse_if_none()
        while True:
            self._refine()
            lowest = self._lowest
            self._scan(max(self.shortest, lowest.duration / SCAN_DEPTH), lowest.duration)
            if self._lowest is lowest and lowest.plan is not None:
                return lowest.plan

    @property
    def _is_content(self) -> bool:
        """Tell whether enough durations have been tried."""
        return len(self.trials) >= self.most or (self.is_over is not None and self.is_over())

    @property
    def _lowest(self) -> Trial:
        """Return the shortest trial that obeys."""
        return min((t for t in self.trials.values() if t.obeys), key=lambda t: t.duration)

    def _try(self, duration: float) -> Trial:
        """Return the trial of a duration."""
        return self._looked_at(duration)

    def _try_briefly(self, duration: float) -> Trial:
        """Return the trial of a duration, by samples if they rule it out."""
        trial = self._glance(duration)
        return self._try(duration) if trial.is_sampled and trial.ratio <= 1.0 else trial

    def _glance(self, duration: float) -> Trial:
        """Return the trial of a duration by samples, unless more is known."""
        return self._looked_at(duration, is_sampled=True)

    def _looked_at(self, duration: float, *, is_sampled: bool = False) -> Trial:
        """Return the trial of a duration, rounded so that its usual text is exactly it."""
        rounded = float(f'{duration:.{DIGITS}g}')
        duration = min(max(rounded, self.shortest), self.longest)
        known = self.trials.get(duration)
        if known is not None and (is_sampled or not known.is_sampled):
            return known
        try:
            plan = self.plan_of(duration) if known is None or known.plan is None else known.plan
        except (UncertifiedPlan, OutOfReach) as error:
            self.failure = error
            trial = Trial(duration=duration, plan=None, worst=None, ratio=inf, estimate=duration)
        else:
            self._refuse_ends(plan)
            if is_sampled:
                fractions = np.concatenate([np.linspace(0.0, 1.0, SAMPLES), self.peaks])
                uses = self.limits.uses_at(plan, plan.duration * fractions)
            else:
                uses = self.limits.uses(plan)
                self.peaks = np.array([use.time for use in uses]) / plan.duration
                self.peaks_of = duration
            worst = max(uses, key=lambda use: use.ratio, default=None)
            stretch = [use.ratio ** (1.0 / POWERS[use.quantity]) for use in uses]
            trial = Trial(
                duration=duration,
                plan=plan,
                worst=worst,
                ratio=0.0 if worst is None else worst.ratio,
                estimate=duration * max(stretch, default=0.0),
                is_sampled=is_sampled,
                is_sharp=not is_sampled or self._is_near_peaks(duration),
            )
        self.trials[duration] = trial
        return trial

    def _is_near_peaks(self, duration: float) -> bool:
        """Tell whether the peaks of nearly the same duration are known."""
        return 1.0 / SHARP < duration / self.peaks_of < SHARP

    def _bracket(self, first: float) -> None:
        """Look, by samples, for one duration that seems to obey above one that does not."""
        stride = FIRST_STRIDE
        before = trial = self._glance(first)
        descends = trial.ratio <= 1.0
        while (trial.ratio <= 1.0) == descends:
            here = trial.duration
            root = line_root(before, trial) if stride < LONG_STRIDE else here
            # As far as powers say, or a stride, but not beyond a line through the last two trials.
            if descends:
                line = root / AIM if root < here else 0.0
                beyond = max(self.shortest, min(trial.estimate / AIM, here / stride), line)
            else:
                line = root * AIM if root > here else inf
                leap = here * LEAP if trial.starts_in_motion else inf
                beyond = min(self.longest, max(trial.estimate * AIM, here * stride), leap, line)
            stride *= stride
            if beyond == here or (descends and self._is_content):
                return
            before, trial = trial, self._glance(beyond)

    @property
    def _seeming(self) -> list[Trial]:
        """Return the trials that obey or seem to, the shortest first."""
        return sorted((t for t in self.trials.values() if t.ratio <= 1.0), key=duration_of)

    def _is_confirmed(self) -> bool:
        """Look in full at what seems to obey; tell if anything does."""
        return any(self._try(trial.duration).obeys for trial in self._seeming)

    def _refine(self) -> None:
        """
        Close the gap between the shortest trial that obeys and the next below.

        By samples, until it is narrow: the times of the peaks are among them then, and what
        seems to obey is looked at in full.
        """
        slow = 0
        while self._seeming and not self._is_content:
            good = self._seeming[0]
            below = [t for t in self.trials.values() if t.duration < good.duration]
            bad = max(below, key=duration_of, default=None)
            width = inf if bad is None else good.duration / bad.duration
            is_last = width <= 1.0 + DURATION_TOLERANCE or good.duration == self.shortest
            if good.is_sampled and (is_last or (width <= NARROW and not good.is_sharp)):
                self._try(good.duration)
                continue
            if is_last:
                return
            if bad is None:
                self._glance(max(self.shortest, good.duration / SCAN_STEP))
                continue
            middle = sqrt(bad.duration * good.duration)
            if slow < PATIENCE and isfinite(bad.ratio) and good.ratio > 0.0:
                # It aims a little beyond the root: one trial on either side of it, that near,
                # closes the gap.
                middle = self._secant(bad, good) * (1.0 + 0.25 * DURATION_TOLERANCE)
            margin = 1.0 + 0.5 * DURATION_TOLERANCE
            middle = min(max(middle, bad.duration * margin), good.duration / margin)
            left = good.duration / middle
            if self._glance(middle).ratio <= 1.0:
                left = middle / bad.duration
            slow = slow % (PATIENCE + 1) + 1 if log(left) > 0.5 * log(width) else 0

    def _secant(self, bad: Trial, good: Trial) -> float:
        """Return where the limit is just reached, by a secant in logarithms: powers are lines."""
        low, high = log(bad.duration), log(good.duration)
        known = [t for t in self.trials.values() if 0.0 < t.ratio < inf]
        sharp = [t for t in known if t.is_sharp] or known
        sharp.sort(key=lambda trial: abs(log(trial.ratio)))
        if len(sharp) < 2:
            root = log(sharp[0].estimate)  # so near that powers lead from it to the limit
        elif abs(log(sharp[1].ratio)) > log(NARROW):
            root = root_of(bad, good)
        else:
            # Through the two nearest to the limit, though they may be on one side of it.
            root = root_of(sharp[0], sharp[1])
        return exp(root if low < root < high else root_of(bad, good))

    def _scan(self, low: float, high: float) -> None:
        """Try a grid of durations between two."""
        duration = high / SCAN_STEP
        lowest = max([low, *(trial.least_duration(self.limits) for trial in self.trials.values())])
        while duration > lowest and not self._is_content:
            if not self._is_ruled_out(duration) and self._try_briefly(duration).is_hopeless:
                return
            duration /= SCAN_STEP
        if low == lowest and not self._is_content:
            self._try_briefly(low)

    def _is_ruled_out(self, duration: float) -> bool:
        """Tell whether a limit is exceeded by nearly the same on both sides: a static load."""
        trials = self.trials.values()
        below = max((t for t in trials if t.duration < duration), key=duration_of, default=None)
        above = min((t for t in trials if t.duration > duration), key=duration_of, default=None)
        if below is None or above is None or below.worst is None or above.worst is None:
            return False
        ratios = below.ratio, above.ratio
        place = below.worst.quantity, below.worst.joint
        is_alike = place == (above.worst.quantity, above.worst.joint)
        return is_alike and min(ratios) > 1.0 and max(ratios) < ALIKE * min(ratios)

    def _refuse_ends(self, plan: Plan) -> None:
        """Refuse a motion that starts or ends with too large an effort; looked at once."""
        if self.trials or Quantity.EFFORT not in self.limits.quantities:
            return
        use = self.limits.at_ends(plan)
        if use is not None:
            raise NoFeasibleDuration(use, plan.duration, self.shortest, self.longest, True)

    def _refuse_if_none(self) -> None:
        """Refuse if no trial obeys."""
        least = min(self.trials.values(), key=lambda trial: trial.ratio)
        if least.is_sampled:
            least = self._try(least.duration)
        if any(trial.obeys for trial in self.trials.values()):
            return
        if least.worst is not None:
            raise NoFeasibleDuration(least.worst, least.duration, self.shortest, self.longest)
        if self.failure is not None:
            raise self.failure
