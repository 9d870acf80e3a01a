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
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from math import pi
from multiprocessing import get_context
from pathlib import Path
import sys
from time import process_time
from tracemalloc import get_traced_memory, start, stop
from typing import NamedTuple

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.model_fit import fit_model
from measurement import Section
import numpy as np

sys.path.append(str(Path(__file__).resolve().parent.parent / 'test'))
from free_arm import measured, pushes  # noqa: E402, I100  It is a part of the tests.
from recorded_arm import recorded  # noqa: E402

SENSORS = {
    (200.0, 0.0, 0): 0.002,
    (200.0, 1e-4, 14): 0.005,
    (200.0, 1e-3, 12): 0.01,
    (50.0, 0.0, 0): 0.004,
    (50.0, 1e-4, 14): 0.01,
    (50.0, 1e-3, 12): 0.02,
}
"""Rates [Hz], noise [rad] and bits of the encoders, with the largest error that is wanted [-]."""

PROCESSES = 2
"""Processes that fit random arms side by side."""

LENGTHS = (0.5, 1.0, 2.0)
"""Of recordings [min]."""

STRUCTURE_CASES = 5
"""Recordings of each wrong structure."""

OFF = (0.1, 0.3)
"""How far each parameter of the plant is from the model [-]."""

GOALS = 4
"""Motions of 1 s in a recording of 6 s."""


def sections(options: Namespace) -> list[Section]:
    """Return the tables; `options.seconds` is the number of random arms."""
    cases = max(1, int(options.seconds))
    with ProcessPoolExecutor(PROCESSES, mp_context=get_context('spawn')) as pool:
        rows = [_row(sensors, bound, cases, pool) for sensors, bound in SENSORS.items()]
    header = (
        *('rate, noise, encoder', 'median error', '90 %', 'goal', 'within the goal'),
        *('within 2 std', 'misfit said', 'CPU'),
    )
    title = f'Model fit: worst of six parameters, {cases} random arms 10 to 30 % off'
    lengths = ('length of the recording', 'CPU', 'most memory besides')
    return [
        Section(title, header, rows, []),
        Section('Model fit: long recordings, 200 Hz', lengths, list(_lengths()), []),
        Section('Model fit: other structures', ('arm', 'noticed'), list(_structures()), []),
    ]


def _row(
    sensors: tuple[float, float, int], bound: float, cases: int, pool: ProcessPoolExecutor
) -> tuple[object, ...]:
    """Return what comes of one kind of sensor."""
    rate, noise, bits = sensors
    found = list(pool.map(_case, [sensors] * cases, range(cases)))
    errors = np.array([each.worst for each in found])
    inside = np.concatenate([each.inside for each in found])
    return (
        f'{rate:g} Hz, {noise:g} rad, {bits} bit',
        f'{100 * np.median(errors):.2g} %',
        f'{100 * np.quantile(errors, 0.9):.2g} %',
        f'{100 * bound:g} %',
        f'{100 * np.mean(errors <= bound):.0f} %',
        f'{100 * np.mean(inside):.0f} %',
        f'{sum(each.is_misfit for each in found)} of {cases}',
        f'{np.mean([each.spent for each in found]):.1f} s',
    )


class _Found(NamedTuple):
    """Worst relative error, which of the six are within 2 std, doubt, and time [s]."""

    worst: float
    inside: np.ndarray
    is_misfit: bool
    spent: float


def _case(sensors: tuple[float, float, int], case: int) -> _Found:
    """Fit one random arm."""
    rate, noise, bits = sensors
    rng = np.random.default_rng(case)
    believed, true = _arms(rng)
    goals = tuple(rng.uniform(-pi, pi, GOALS))
    step = 2 * pi / 2**bits if bits else 0.0
    seen = recorded(true, believed, rate=rate, noise=noise, step=step, seed=case, goals=goals)
    begun = process_time()
    fit = fit_model(seen, believed)
    spent = process_time() - begun
    found = np.array([(e.value, e.std) for e in fit.estimates[:6]])
    errors = np.abs(found[:, 0] - _six(true))
    worst = float((errors / _six(true)).max())
    return _Found(worst, errors < 2 * found[:, 1], bool(fit.misfit), spent)


def _lengths() -> Iterator[tuple[object, ...]]:
    """Yield what a fit takes over the length of a recording."""
    believed, true = _arms(np.random.default_rng(0))
    for minutes in LENGTHS:
        goals = tuple(np.random.default_rng(1).uniform(-pi, pi, round(40 * minutes)))
        until = 1.5 * len(goals)
        seen = recorded(true, believed, noise=1e-4, goals=goals, until=until)
        begun = process_time()
        fit_model(seen, believed)
        spent = process_time() - begun
        start()
        fit_model(seen, believed)
        _, most = get_traced_memory()
        stop()
        yield f'{until:g} s', f'{spent:.1f} s', f'{most / 1e6:.0f} MB'


def _structures() -> Iterator[tuple[object, ...]]:
    """Yield whether another structure than the model's is said."""
    times = np.arange(0.0, 6.0, 0.005)
    believed = PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)
    for name, spring in SPRINGS.items():
        noticed = []
        for seed in range(STRUCTURE_CASES):
            sensors = {'noise': 1e-4, 'seed': seed}
            seen = measured(pushes, times, both=7e-4, last=3e-5, spring=spring, **sensors)
            noticed.append(bool(fit_model(seen, believed).misfit))
        yield name, f'{sum(noticed)} of {len(noticed)}'


def _linear(q: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return the effort of the spring that the model has [N m]."""
    return 2.7e-3 * q + 2.5e-5 * rate


SPRINGS = {
    'as modelled': _linear,
    'backlash of 5 mrad': lambda q, v: _linear(q - np.clip(q, -0.005, 0.005), v),
    'stiffens by 5 % at 0.3 rad': lambda q, v: _linear(q * (1.0 + 0.05 * (q / 0.3) ** 2), v),
}
"""Efforts of passive joints over angle and rate."""


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
