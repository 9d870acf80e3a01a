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
Motions of least peak on random arms: what is left when the samples are played, joined linearly.

`FUZZ_CASES` sets a hundred times the number of cases, `FUZZ_SEED` what they are made from.
"""

from dataclasses import replace
import os

from flat_planner_ros.core.arm import Drive, PlanarArm
from flat_planner_ros.core.peak import PeakSettings
from flat_planner_ros.core.planning import MotionRequest, plan, PlanningOptions, Strategy
import numpy as np
import pytest
from scipy.linalg import expm

CASES = max(25, int(os.environ.get('FUZZ_CASES', '0')) // 100)

SEED = int(os.environ.get('FUZZ_SEED', '1'))

SWING = 1e-5
"""Largest oscillation that may be left [rad]."""

MISS = 1e-4
"""Largest distance from the goal [rad]."""


def random_arm(rng, n):
    """Return an arm of the admitted range with n joints."""
    both = 10.0 ** rng.uniform(-5.0, 0.0)
    last = both * 10.0 ** rng.uniform(-2.0, np.log10(0.9))
    frequency = 2.0 * np.pi * 10.0 ** rng.uniform(-1.0, np.log10(50.0))
    series = last * (both - last) / both
    lengths = rng.uniform(0.1, 0.5, n - 2)
    return PlanarArm.reduced(
        inertia_star=(both, last),
        stiffness=frequency**2 * series,
        damping=2.0 * rng.uniform(0.0, 0.3) * frequency * series,
        link_length=lengths,
        link_com=0.5 * lengths,
        link_mass=rng.uniform(0.1, 2.0, n - 2),
        link_inertia=rng.uniform(1e-3, 1e-2, n - 2),
    )


def played(arm, samples, drive):
    """
    Return the angles and rates of the last two links at the end, absolute, shape (2, 2).

    The two rows do not depend on the joints before them; a servo gives link n-1 its acceleration.
    """
    both, last = arm.inertia_star
    k, c = arm.stiffness, arm.damping
    a = np.zeros((6, 6))
    a[:2, 2:4] = np.eye(2)
    a[3, :4] = np.array([k, -k, c, -c]) / last
    # The drive and its slope on a piece.
    a[4, 5] = 1.0
    if drive is Drive.EFFORT:
        a[2, :4] = np.array([-k, k, -c, c]) / (both - last)
        a[2, 4] = 1.0 / (both - last)
        inputs = samples.driving_effort
    else:
        a[2, 4] = 1.0
        inputs = samples.accelerations[:, :-1].sum(axis=1)
    step = samples.times[1]
    growth = expm(a * step)
    first = samples.positions[0].cumsum()[-2:]
    state = np.append(first, [0.0, 0.0])
    for before, after in zip(inputs[:-1], inputs[1:], strict=True):
        state = (growth @ np.append(state, [before, (after - before) / step]))[:4]
    return state.reshape(2, 2)


@pytest.mark.timeout(0)
def test_nothing_is_left_on_any_arm(capsys):
    worst_swing = worst_miss = 0.0
    for case in range(CASES):
        rng = np.random.default_rng([SEED, case])
        n, drive = int(rng.integers(2, 8)), list(Drive)[case % 2]
        arm = random_arm(rng, n)
        duration = float(np.exp(rng.uniform(np.log(0.1), np.log(5.0))))
        mode = arm.natural_mode(held=drive is Drive.POSITION)
        settings = PeakSettings(intervals=int(rng.choice([16, 48, 96])))
        # In a small part of a turn arms hardly differ, nor do the conditions on them.
        if mode.frequency * duration > 0.5:
            settings = replace(
                settings,
                insensitive=bool(rng.integers(2)),
                max_residual=0.2 if case % 5 == 4 else 0.0,
            )
        start, final = np.zeros((2, n))
        start[:-1], final[:-1] = rng.uniform(-1.5, 1.5, (2, n - 1))
        options = PlanningOptions(strategy=Strategy.MIN_PEAK_EFFORT, peak=settings, drive=drive)
        made = plan(MotionRequest(start=start, final=final, duration=duration), arm, options)
        samples = made.sample(float(rng.uniform(5e-4, 1e-2)))
        angles, rates = played(arm, samples, drive)
        deflection, rate = np.diff(angles)[0], np.diff(rates)[0]
        swing = np.hypot(deflection, (rate + mode.decay_rate * deflection) / mode.damped_frequency)
        miss = np.abs(angles - final.sum()).max()
        worst_swing, worst_miss = max(worst_swing, swing), max(worst_miss, miss)
        assert swing < SWING, (case, n, drive, swing)
        assert miss < MISS, (case, n, drive, miss)
    if CASES > 25:
        with capsys.disabled():
            print(f'\n{CASES} arms: swing {worst_swing:.1e}, miss {worst_miss:.1e} rad', end='')
