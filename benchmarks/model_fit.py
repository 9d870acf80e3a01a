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

"""How near a fitted model comes to random arms, and how honest its standard errors are."""

from argparse import Namespace
from math import pi
from pathlib import Path
import sys
from time import process_time

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.model_fit import fit_model
from measurement import Section
import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent / 'test'))
from recorded_arm import recorded  # noqa: E402  It is a part of the tests.

SENSORS = (
    (200.0, 0.0, 0),
    (200.0, 1e-4, 14),
    (200.0, 1e-3, 12),
    (50.0, 1e-4, 14),
    (50.0, 1e-3, 12),
)
"""Rates [Hz], noise [rad] and bits of the encoders."""

OFF = (0.1, 0.3)
"""How far each parameter of the plant is from the model [-]."""

GOALS = 4
"""Motions of 1 s in a recording of 6 s."""


def sections(options: Namespace) -> list[Section]:
    """Return the table; `options.seconds` is the number of random arms."""
    rows = [_row(sensors, max(1, int(options.seconds))) for sensors in SENSORS]
    header = ('rate, noise, encoder', 'median error', '90 %', 'within 2 std', 'misfit said', 'CPU')
    return [
        Section('Model fit: worst of six parameters, random arms 10 to 30 % off', header, rows, [])
    ]


def _row(sensors: tuple[float, float, int], cases: int) -> tuple[object, ...]:
    """Return what comes of one kind of sensor."""
    rate, noise, bits = sensors
    step = 2 * pi / 2**bits if bits else 0.0
    errors, inside, misfits, spent = [], [], 0, 0.0
    for case in range(cases):
        rng = np.random.default_rng(case)
        believed, true = _arms(rng)
        goals = tuple(rng.uniform(-pi, pi, GOALS))
        seen = recorded(true, believed, rate=rate, noise=noise, step=step, seed=case, goals=goals)
        begun = process_time()
        fit = fit_model(seen, believed)
        spent += process_time() - begun
        found = np.array([(e.value, e.std) for e in fit.estimates[:6]])
        errors.append(np.abs(found[:, 0] / _six(true) - 1.0).max())
        inside.append(np.abs(found[:, 0] - _six(true)) < 2 * found[:, 1])
        misfits += bool(fit.misfit)
    return (
        f'{rate:g} Hz, {noise:g} rad, {bits} bit',
        f'{100 * np.median(errors):.2g} %',
        f'{100 * np.quantile(errors, 0.9):.2g} %',
        f'{100 * np.mean(inside):.0f} %',
        f'{misfits} of {cases}',
        f'{spent / cases:.1f} s',
    )


def _arms(rng: np.random.Generator) -> tuple[PlanarArm, PlanarArm]:
    """Return an arm as believed and as it is."""
    both = 10 ** rng.uniform(-4.0, -2.0)
    last = both * rng.uniform(0.03, 0.5)
    frequency = rng.uniform(6.0, 14.0)
    stiffness = frequency**2 * last * (both - last) / both
    damping = 2 * rng.uniform(0.005, 0.05) * stiffness / frequency
    off = 1.0 + rng.uniform(*OFF, 4) * rng.choice((-1.0, 1.0), 4)
    true = PlanarArm.reduced(
        inertia_star=(both * off[0], min(last * off[1], 0.7 * both * off[0])),
        stiffness=stiffness * off[2],
        damping=damping * off[3],
        viscous_friction=[both * rng.uniform(0.1, 0.5)],
        coulomb_friction=[both * rng.uniform(0.1, 1.0)],
    )
    believed = PlanarArm.reduced(inertia_star=(both, last), stiffness=stiffness, damping=damping)
    return believed, true


def _six(arm: PlanarArm) -> np.ndarray:
    """Return the parameters of the last two links."""
    friction = arm.viscous_friction[-1], arm.coulomb_friction[-1]
    return np.array([*arm.inertia_star, arm.stiffness, arm.damping, *friction])
