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

"""What jitter of a stream of efforts costs in residual oscillation, beside a stamped command."""

from argparse import Namespace
from collections.abc import Iterator
from statistics import median

from flat_planner_ros.core import (
    EffortProfile,
    Plan,
    plan,
    PlanningOptions,
    Strategy,
)
from flat_planner_ros.core.plant import SimulatedArm
from measurement import Section
import numpy as np
from problem import arm, request

PERIODS = (0.001, 0.005)
"""Time between two efforts [s]."""

JITTERS = (0.0, 0.0001, 0.0005, 0.001, 0.002, 0.005)
"""Largest delay of an effort on its way; delays are spread evenly from none to that [s]."""

SEEDS = 5
"""Runs with delays of their own."""

STEP = 1e-4
"""Of the simulation; an effort that arrives in between waits for the next one [s]."""


def sections(_: Namespace) -> Iterator[Section]:
    """Return amplitudes over jitter, for some periods."""
    planned = plan(request(), arm(), PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT))
    stamped = _of_command(planned)
    assert stamped < 1e-6, f'the command itself leaves {stamped:.1e} rad'
    rows = []
    for jitter in JITTERS:
        row = [f'{1e3 * jitter:g} ms']
        for period in PERIODS:
            seeds = range(SEEDS if jitter else 1)
            found = [_of_stream(planned, period, jitter, seed) for seed in seeds]
            row += [f'{median(found):.1e}', f'{max(found):.1e}']
        rows.append(row)
    header = ['largest delay']
    for period in PERIODS:
        header += [f'every {1e3 * period:g} ms [rad]', 'worst']
    yield Section(
        'Stream of efforts: residual amplitude over jitter',
        header,
        rows,
        [
            f"{SEEDS} runs each; the paper's arm, 0 to pi in 1 s, least effort, exact flat model",
            f'the same motion as a stamped command of points every 5 ms: {stamped:.1e} rad',
        ],
    )


def _of_command(planned: Plan) -> float:
    """Return what the stamped command leaves [rad]."""
    samples = planned.sample(0.005)
    plant = SimulatedArm(arm(), step=STEP)
    profile = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :1])
    plant.command(profile, 0.0)
    plant.advance(planned.duration)
    return _amplitude(plant)


def _of_stream(planned: Plan, period: float, jitter: float, seed: int) -> float:
    """Return what a stream leaves [rad]."""
    random = np.random.default_rng(seed)
    sent = np.arange(round(planned.duration / period)) * period
    efforts = planned.at(sent + 0.5 * period).efforts[:, :1]
    # Nothing overtakes on the way.
    arrivals = np.maximum.accumulate(sent + random.uniform(0.0, jitter, len(sent)))
    plant = SimulatedArm(arm(), step=STEP)
    for arrival, effort in zip(arrivals, efforts, strict=True):
        plant.advance(arrival)
        plant.hold(effort)
    plant.advance(planned.duration + jitter)
    plant.hold([0.0])
    return _amplitude(plant)


def _amplitude(plant: SimulatedArm) -> float:
    """Return the amplitude of the free oscillation of the elastic joint [rad]."""
    mode = plant.arm.natural_mode()
    angle, rate = plant.position[-1], plant.velocity[-1]
    return float(np.hypot(angle, (rate + mode.decay_rate * angle) / mode.damped_frequency))
