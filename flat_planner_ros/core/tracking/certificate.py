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
Certificate of a loop: stable, with a margin, for every arm of a box of uncertainty.

The loop is linear and the same in any pose, so that this can be computed: poles and frequency
response of the sampled chain with its observer, its delay and its gains. The joints before the
last two have such a loop of their own, as far as computed torque knows the arm.
"""

from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from math import ceil, log
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, InvalidRequest, PlanarArm, UncertifiedLoop
from flat_planner_ros.core.tracking.chain import Chain, last_links, linearised_joint
from flat_planner_ros.core.tracking.gains import feedback_gain, observer_gain
from flat_planner_ros.core.tracking.settings import TrackerSettings
import numpy as np

ROUNDING = 1e-9
"""Share of a period by which a delay may exceed whole periods [-]."""

FREQUENCIES = 200
"""Frequencies of a response, from SLOWEST to half the rate, evenly in logarithm."""

CHOICE = 0.02
"""Step in which a bandwidth is chosen, relative to the one asked for [-]."""

MOST_LATE = 20
"""Samples by which efforts are late at most when it is looked how late they may be."""

KEPT = 64
"""Chains and gains that are remembered: those of one box."""

SLOWEST = 1e-2
"""Lowest frequency of a response, relative to the bandwidth [-]."""


_Case = tuple[tuple[float, float, float], Chain, Chain]


class Certificate(NamedTuple):
    """
    The worst of the arms that were looked at.

    Attributes
    ----------
    bandwidth
        Frequency of the closed loop's poles [rad/s].
    late
        By how much later than known efforts may act without an unstable loop for any arm of the
        box, in whole samples [s].
    decay_rate
        At which the slowest deviation dies away [1/s].
    margin
        Least distance of a loop's frequency response from -1 [-].
    worst
        Factors on stiffness, damping and inertia of the arm with that margin [-].

    """

    bandwidth: float
    late: float
    decay_rate: float
    margin: float
    worst: tuple[float, float, float]

    @property
    def sentence(self) -> str:
        """Return it in words."""
        k, c, inertia = self.worst
        return (
            f'bandwidth {self.bandwidth:.3g} rad/s, slowest decay {self.decay_rate:.3g} 1/s, '
            f'margin {self.margin:.3g} with stiffness, damping and inertia times {k:g}, {c:g} and '
            f'{inertia:g}; stable where efforts act up to {1e3 * self.late:.3g} ms late'
        )


class SampledLoop:
    """
    A loop, sample by sample: a chain as it is, and the controller made for a model of it.

    The state is what the chain does, what the observer expects, and the inputs on their way.

    Parameters
    ----------
    true
        The chain as it is.
    model
        What the controller believes it to be.
    settings
        Rate, delay and the observer's bandwidth.
    bandwidth
        Of the feedback [rad/s].
    late
        Samples by which inputs are later than the controller knows.

    """

    def __init__(
        self,
        true: Chain,
        model: Chain,
        settings: TrackerSettings,
        bandwidth: float,
        late: int = 0,
    ) -> None:
        """Compute the gains."""
        period, m = settings.period, true.order
        transition, effect = _flow(true, period)
        self._true = transition[:m, :m], effect[:m, None]
        self._flow, effect = _flow(model, period)
        self._effect = effect[:, None]
        self._gain, self._correction = _gains(model, settings, bandwidth)
        self._angles, self._order, self._late = model.angles, m, late
        self._delay = ceil(settings.delay / period - ROUNDING)
        self._size = 2 * m + 1 + self._delay + late

    @property
    def radius(self) -> float:
        """Return the largest modulus of a pole of the closed loop, below 1 if it is stable [-]."""
        return float(np.abs(np.linalg.eigvals(self._cycle(np.eye(self._size), None)[0])).max())

    def margin(self, frequencies: FloatArray, period: float) -> float:
        """Return the least distance of the response at the input from -1 [-]."""
        size = self._size
        dynamics, output = self._cycle(np.eye(size), np.zeros((1, size)))
        step, direct = self._cycle(np.zeros((size, 1)), np.ones((1, 1)))
        shifts = np.exp(1j * frequencies * period)[:, None, None] * np.eye(size)
        response = output @ np.linalg.solve(shifts - dynamics, step[None]) + direct
        return float(np.abs(1.0 - response).min())

    def _cycle(
        self, state: FloatArray, acting: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """
        Return states one period later and the input that was to act.

        Columns of states side by side; `acting` takes the place of the input, if there is one.
        """
        m = self._order
        true, expected, waiting = np.split(state, [m, 2 * m + 1])
        surprise = true[: self._angles] - expected[: self._angles]
        estimate = expected + self._correction @ surprise
        predicted, known = estimate, waiting[self._late :]
        for entry in known:
            predicted = self._flow @ predicted + self._effect @ entry[None]
        queue = np.vstack([waiting, -self._gain @ predicted])
        given, believed = queue[:1], queue[self._late : self._late + 1]
        transition, effect = self._true
        following = [
            transition @ true + effect @ (given if acting is None else acting),
            self._flow @ estimate + self._effect @ believed,
            queue[1:],
        ]
        return np.vstack(following), given


@lru_cache(maxsize=KEPT)
def _flow(chain: Chain, period: float) -> tuple[FloatArray, FloatArray]:
    """Return what a chain, known by being this very one, does in a period [s]."""
    return chain.over(period)


@lru_cache(maxsize=KEPT)
def _gains(
    model: Chain, settings: TrackerSettings, bandwidth: float
) -> tuple[FloatArray, FloatArray]:
    """Return the gains of the feedback, with the disturbance, and of the observer."""
    period = settings.period
    gain = feedback_gain(model, period, bandwidth, settings.damping)
    correction = observer_gain(model, period, settings.observer_ratio * bandwidth)
    return np.append(gain, 1.0)[None], correction


def certify(arm: PlanarArm, settings: TrackerSettings) -> Certificate:
    """
    Return the certificate of the loop for an arm.

    With a bandwidth in terms of the free oscillation's frequency it is of the fastest loop up to
    that one that has the margin.

    Raises
    ------
    UncertifiedLoop
        An arm of the box has an unstable loop, or one with less than the margin.
    NotFlat, InvalidRequest
        As the gains raise them.

    """
    asked, cases = settings.bandwidth_of(arm), list(_cases(arm, settings))
    worst = _worst(cases, settings, asked)
    if worst.margin < settings.margin:
        slower = _fastest(cases, settings, asked)
        if settings.bandwidth or slower is None:
            raise UncertifiedLoop(
                worst.margin,
                settings.margin,
                worst.decay_rate,
                worst.worst,
                0.0 if slower is None else slower.bandwidth,
            )
        worst = slower
    return worst._replace(late=_stable_delay(cases, settings, worst.bandwidth))


def _worst(cases: list[_Case], settings: TrackerSettings, bandwidth: float) -> Certificate:
    """Return the least margin and the slowest decay of all cases for a bandwidth [rad/s]."""
    period = settings.period
    frequencies = np.geomspace(SLOWEST * bandwidth, np.pi / period, FREQUENCIES)
    found = []
    for factors, true, model in cases:
        for late in {0, settings.uncertainty.samples}:
            loop = SampledLoop(true, model, settings, bandwidth, late)
            decay = -log(loop.radius) / period
            margin = loop.margin(frequencies, period) if decay > 0.0 else 0.0
            found.append(Certificate(bandwidth, 0.0, decay, margin, factors))
    worst = min(found, key=lambda case: case.margin)
    return worst._replace(decay_rate=min(case.decay_rate for case in found))


def _fastest(cases: list[_Case], settings: TrackerSettings, most: float) -> Certificate | None:
    """Return the certificate of the fastest loop below a bandwidth [rad/s], if there is one."""
    low, high, best = 0.0, most, None
    while high - low > CHOICE * most:
        middle = low + 0.5 * (high - low)
        try:
            found = _worst(cases, settings, middle)
        except InvalidRequest:  # slower than the arm itself
            low = middle
            continue
        if found.margin >= settings.margin:
            low, best = middle, found
        else:
            high = middle
    return best


def _stable_delay(cases: list[_Case], settings: TrackerSettings, bandwidth: float) -> float:
    """Return by how much later than known efforts may act, up to MOST_LATE samples [s]."""
    for late in range(1, MOST_LATE + 1):
        loops = (SampledLoop(true, own, settings, bandwidth, late) for _, true, own in cases)
        if any(loop.radius >= 1.0 for loop in loops):
            return (late - 1) * settings.period
    return MOST_LATE * settings.period


def _cases(arm: PlanarArm, settings: TrackerSettings) -> Iterator[_Case]:
    """Return factors on the model, true chain and model for the corners and the centre."""
    box = settings.uncertainty
    widths = (box.stiffness, box.damping, box.inertia)
    model, joint = last_links(arm), linearised_joint()
    for signs in ((0.0, 0.0, 0.0), *product((-1.0, 1.0), repeat=3)):
        k, c, inertia = (1.0 + s * width for s, width in zip(signs, widths, strict=True))
        true = last_links(arm.scaled(stiffness=k, damping=c, inertia=inertia))
        yield (k, c, inertia), true, model
        if arm.n > 2:
            yield (k, c, inertia), linearised_joint(inertia), joint
