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

"""What feedback leaves of a wrong model, over rate, delay and noise; simulated, without ROS."""

from argparse import Namespace
from collections.abc import Iterator
from dataclasses import replace
from math import pi

from flat_planner_ros.core.arm import JointSample, PlanarArm, UncertifiedLoop
from flat_planner_ros.core.model_fit import fit_model, Measurements
from flat_planner_ros.core.planning import plan, PlanningOptions, PlanSamples, Strategy
from flat_planner_ros.core.plant import SimulatedArm
from flat_planner_ros.core.tracking import (
    Phase,
    TrackedMotion,
    Tracker,
    TrackerSettings,
    Uncertainty,
)
from measurement import Section
import numpy as np
from problem import arm, request

RATES = (200.0, 500.0, 1000.0)
"""Samples per second [Hz]."""

DELAYS = (1, 2)
"""Samples from a joint state until its effort acts."""

NOISES = (1e-4, 1e-3)
"""Standard deviation of the measured angles [rad]."""

ENCODER = 2 * pi / 2**14
"""Step of an encoder [rad]."""

BAND = 5e-3
"""Errors below are settled [rad]."""

AFTER = 2.0
"""Time that is looked at after a motion of one second [s]."""

STEP = 1e-3
"""Longest integration step [s]."""

JITTERS = (0.005, 0.01, 0.015, 0.02, 0.03)
"""Times by which an effort may be later than the loop knows, each as likely as none [s]."""

LIMITS = (np.inf, 0.3, 0.1, 0.05, 0.02, 0.014, 0.01, 0.007)
"""Largest efforts [N m]; the plan takes 0.014."""

PUSH = 3e-3
"""Torque on the last link that starts a swing of 0.3 rad [N m]."""

PUSHED = 0.03
"""For how long it acts [s]."""

MOST_LATE = 40
"""Samples of a delay that the loop does not know, at most."""


OPTIONS = PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT)
"""Of every plan."""


def sections(_: Namespace) -> Iterator[Section]:
    """Return the table of faults, that of rates and delays, and that of delays not known."""
    samples = plan(request(), arm(), OPTIONS).sample(0.005)
    about = "the paper's arm, 0 to pi in 1 s, least effort, encoders of 14 bits"
    yield Section(
        'Time after the motion until swing and position error stay below 5 mrad [s]',
        ['arm', 'feed-forward alone', 'tracked, 200 Hz', 'tracked, 500 Hz', 'peak effort / plan'],
        [_fault(samples, name, true) for name, true in _faults().items()],
        [about, 'one sample of delay; > 2: not within that time'],
    )
    yield Section(
        'Tracked, stiffness and damping 10 % low: settling time [s], and noise while holding',
        [
            'rate',
            'delay',
            'bandwidth',
            'margin',
            *(f'{1e3 * noise:g} mrad of noise' for noise in NOISES),
        ],
        [_corner(samples, rate, late) for rate in RATES for late in DELAYS],
        [about, 'settled: error averaged over 20 ms; then the RMS of the true error, [mrad]'],
    )
    yield Section(
        'Delay that the loop does not know: certified, settled within 2 s, unstable from',
        ['rate', 'certified to', 'settled to', 'unstable from'],
        [_unknown(samples, rate) for rate in RATES],
        [about, 'nominal arm; beyond the sample of delay that it does know; [ms]'],
    )
    yield Section(
        'Efforts late by anything up to a time, unknown to the loop: settled [s]; RMS [mrad]',
        ['rate', *(f'{1e3 * jitter:g} ms' for jitter in JITTERS)],
        [_jittered(samples, rate) for rate in RATES],
        [about, 'stiffness and damping 10 % low, beyond the sample of delay that is known'],
    )
    yield Section(
        'A second motion by the model fitted to the first: settled [s]; swing at the end [rad]',
        ['arm', 'first', 'second', 'its feedback / peak effort'],
        [_adopted(samples, true, name) for name, true in _faults().items() if name != 'nominal'],
        [about, '500 Hz; the model by `fit_model` from the angles and efforts of the first'],
    )
    yield Section(
        'A push that starts a swing of 0.3 rad while holding, over the limit of the effort',
        ['effort_limit [N m]', 'largest effort [N m]', 'settled [s]'],
        [_pushed(samples, limit) for limit in LIMITS],
        [about, f'500 Hz, {PUSH:g} N m for {PUSHED:g} s on the last link'],
    )


def _faults() -> dict[str, PlanarArm]:
    """Return arms that the model is wrong about."""
    model = arm()
    scaled = {
        f'k, c {percent:+d} %': model.scaled(
            stiffness=1 + percent / 100, damping=1 + percent / 100
        )
        for percent in (10, -10, 25, -25)
    }
    heavy = {f'inertias {p:+d} %': model.scaled(inertia=1 + p / 100) for p in (10, -10)}
    rubbing = replace(model, viscous_friction=[2e-4], coulomb_friction=[5e-4])
    return {'nominal': model, **scaled, **heavy, 'friction': rubbing}


def _settings(rate: float, late: int) -> TrackerSettings:
    """Return the loop for a rate and a delay that it knows: the fastest that is certified."""
    return TrackerSettings(rate=rate, delay=late / rate)


def _fault(samples: PlanSamples, name: str, true: PlanarArm) -> list[str]:
    """Return the row of an arm."""
    free = _Run(samples, true, None, 500.0, 0)
    loops = [
        _Run(samples, true, Tracker(arm(), _settings(rate, 1)), rate, 1) for rate in RATES[:2]
    ]
    peak = loops[1].peak / np.abs(samples.efforts).max()
    return [name, free.settling, *(loop.settling for loop in loops), f'{peak:.2f}']


def _corner(samples: PlanSamples, rate: float, late: int) -> list[str]:
    """Return the row of a rate and a delay."""
    settings, true = _settings(rate, late), _faults()['k, c -10 %']
    cells = []
    for noise in NOISES:
        run = _Run(samples, true, Tracker(arm(), settings), rate, late, noise)
        cells.append(f'{run.settling}; {1e3 * run.left:.2g}')
    found = Tracker(arm(), settings).certificate
    loop = [f'{found.bandwidth:.3g} rad/s', f'{found.margin:.2f}']
    return [f'{rate:g} Hz', f'{1e3 * late / rate:g} ms', *loop, *cells]


def _unknown(samples: PlanSamples, rate: float) -> list[str]:
    """Return the row of delays that are not known."""
    certified = 0
    while certified < MOST_LATE and _is_certified(rate, certified + 1):
        certified += 1
    settled, unstable = 0, 0
    for late in range(1, MOST_LATE):
        tracker = Tracker(arm(), _settings(rate, 1))
        run = _Run(samples, arm(), tracker, rate, 1 + late)
        if run.has_settled and settled == late - 1:
            settled = late
        if tracker.phase is not Phase.TRACKING or run.left > 0.1:
            unstable = late
            break
    return [
        f'{rate:g} Hz',
        *(f'{1e3 * count / rate:g}' for count in (certified, settled, unstable)),
    ]


def _jittered(samples: PlanSamples, rate: float) -> list[str]:
    """Return the row of a rate."""
    cells, true = [], _faults()['k, c -10 %']
    for jitter in JITTERS:
        tracker = Tracker(arm(), _settings(rate, 1))
        run = _Run(samples, true, tracker, rate, 1, jitter=round(jitter * rate))
        held = tracker.phase is Phase.TRACKING
        cells.append(f'{run.settling}; {1e3 * run.left:.2g}' if held else 'given up')
    return [f'{rate:g} Hz', *cells]


def _adopted(samples: PlanSamples, true: PlanarArm, name: str) -> list[str]:
    """Return the row of an arm whose model is fitted to its first motion."""
    settings = _settings(500.0, 1)
    first = _Run(samples, true, Tracker(arm(), settings), 500.0, 1)
    model = fit_model(first.measurements, arm()).arm
    second = plan(request(), model, OPTIONS).sample(0.005)
    again = _Run(second, true, Tracker(model, settings), 500.0, 1)
    planned = np.interp(
        again.measurements.times + 0.001, 0.05 + second.times, second.efforts[:, 0], 0, 0
    )
    during = again.measurements.times < 1.05
    feedback = np.abs(again.measurements.efforts[:, 0] - planned)[during].max()
    return [
        name,
        *(f'{run.settling}; {run.swing:.4f}' for run in (first, again)),
        f'{feedback / np.abs(planned).max():.3f}',
    ]


def _pushed(samples: PlanSamples, limit: float) -> list[str]:
    """Return the row of a limit."""
    settings = replace(_settings(500.0, 1), effort_limit=(limit,))
    tracker = Tracker(arm(), settings)
    run = _Run(samples, arm(), tracker, 500.0, 1, pushed=1.55)
    held = tracker.phase is Phase.TRACKING
    return [
        f'{limit:g}',
        f'{run.peak:.3g}',
        run.settled_after(1.55 + PUSHED - 1.05) if held else 'given up',
    ]


def _is_certified(rate: float, late: int) -> bool:
    """Tell whether the loop is certified for a number of samples that it does not know of."""
    box = Uncertainty(stiffness=0.0, damping=0.0, inertia=0.0, samples=late)
    try:
        settings = _settings(rate, 1)
        bandwidth = Tracker(arm(), settings).certificate.bandwidth
        Tracker(arm(), replace(settings, uncertainty=box, bandwidth=bandwidth))
    except UncertifiedLoop:
        return False
    return True


class _Run:
    """One motion, tracked or by its efforts alone, and what is left after it."""

    def __init__(
        self,
        samples: PlanSamples,
        true: PlanarArm,
        tracker: Tracker | None,
        rate: float,
        late: int,
        noise: float = 0.0,
        pushed: float = np.inf,
        jitter: int = 0,
    ) -> None:
        begin, period = 0.05, 1.0 / rate
        plant = SimulatedArm(true, step=min(STEP, period))
        random = np.random.default_rng(1)
        motion = TrackedMotion(
            start=begin,
            times=samples.times,
            positions=samples.positions,
            velocities=samples.velocities,
            accelerations=samples.accelerations,
        )
        waiting: list[tuple[int, np.ndarray]] = []
        acting, self.peak = np.zeros(1), 0.0
        times, errors, shown, applied = [], [], [], []
        for k in range(round((begin + 1.0 + AFTER) * rate)):
            now = k * period
            if tracker is None:
                middle = now + period / 2 - begin
                acting = np.array([np.interp(middle, samples.times, samples.efforts[:, 0], 0, 0)])
            else:
                angles = plant.position + noise * random.standard_normal(2)
                seen = ENCODER * np.round(angles / ENCODER)
                given = tracker.hear(JointSample(time=now, positions=seen), now)
                if given is not None:
                    due = k + late + (int(random.integers(jitter + 1)) if jitter else 0)
                    # What is sent later does not arrive before.
                    waiting.append((max(due, waiting[-1][0] if waiting else 0), given))
                if k == 2:
                    tracker.follow(motion, now)
                while waiting and waiting[0][0] <= k:
                    acting = waiting.pop(0)[1]
            self.peak = max(self.peak, float(np.abs(acting).max()))
            times.append(now - begin - 1.0)
            errors.append(plant.position - motion.at(now).positions)
            shown.append(ENCODER * np.round(plant.position / ENCODER))
            applied.append(acting)
            if 0.0 <= now - pushed < period:  # a torque on the last link acts at both joints
                plant.push([PUSH, PUSH], now + PUSHED)
            plant.hold(acting)
            plant.advance(now + period)
        self.measurements = Measurements(
            times=np.array(times) + begin + 1.0,
            positions=np.array(shown),
            efforts=np.array(applied),
        )
        after = np.array(times) >= 0.0
        self._times, self._errors = np.array(times)[after], np.array(errors)[after]
        self._width = max(1, round(0.02 * rate)) if noise else 1

    @property
    def _beyond(self) -> np.ndarray:
        """Return the times at which an error is beyond the band [s]."""
        kernel = np.ones(self._width) / self._width
        smooth = np.array([np.convolve(e, kernel, mode='same') for e in self._errors.T])
        found: np.ndarray = self._times[np.abs(smooth).max(axis=0) > BAND]
        return found

    @property
    def has_settled(self) -> bool:
        """Tell whether errors are in the band at the end."""
        return not self._beyond.size or bool(self._beyond[-1] < 0.9 * AFTER)

    @property
    def settling(self) -> str:
        """Return the time until errors stay in the band, as text."""
        if not self.has_settled:
            return f'> {AFTER:g}'
        return f'{self._beyond[-1]:.2f}' if self._beyond.size else '0.00'

    def settled_after(self, since: float) -> str:
        """Return the time from then on until errors stay in the band, as text [s]."""
        return f'{max(0.0, self._beyond[-1] - since):.2f}' if self.has_settled else 'not'

    @property
    def swing(self) -> float:
        """Return the envelope of the passive joint's error at the end of the motion [rad]."""
        error, mode = self._errors[:, 1], arm().natural_mode()
        rate = (error[1] - error[0]) / (self._times[1] - self._times[0])
        return float(np.hypot(error[0], rate / mode.frequency))

    @property
    def left(self) -> float:
        """Return the RMS of the larger error over the last half second [rad]."""
        last = self._errors[self._times > AFTER - 0.5]
        return float(np.sqrt((last**2).mean(axis=0)).max())
