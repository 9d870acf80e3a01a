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
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from math import pi
from multiprocessing import get_context
from pathlib import Path
from resource import getrusage, RUSAGE_SELF
import sys
from time import process_time
from typing import NamedTuple

from flat_planner_ros.core.arm import FloatArray, PlanarArm
from flat_planner_ros.core.model_fit import fit_model, Measurements, NAMES
from measurement import Section
import numpy as np
from structures import play, STRUCTURES

sys.path.append(str(Path(__file__).resolve().parent.parent / 'test'))
from recorded_arm import commanded, recorded  # noqa: E402, I100  It is a part of the tests.

SENSORS = {
    (200.0, 0.0, 0): 0.002,
    (200.0, 1e-4, 14): 0.005,
    (200.0, 1e-3, 12): 0.01,
    (50.0, 0.0, 0): 0.004,
    (50.0, 1e-4, 14): 0.01,
    (50.0, 1e-3, 12): 0.02,
}
"""Rates [Hz], noise [rad] and bits of the encoders, with the largest error that is wanted [-]."""

LENGTHS = (1, 4, 16)
"""Of recordings [min]."""

UNTIL = 6.2
"""Length of a random arm's recording [s]."""

STRUCTURE_RATE, STRUCTURE_NOISE = 200.0, (0.0, 1e-4, 1e-3)
"""Rate [Hz] and noise [rad] with which other structures are looked at."""

STRUCTURE_SHARE = 0.02
"""Arms of each structure, relative to those of all kinds of sensors together [-]."""

WITHIN = 2.0
"""Standard errors within which the true value is looked for [-]."""

OFF = (0.1, 0.3)
"""How far each parameter of the plant is from the model [-]."""

GOALS = 4
"""Motions of 1 s in a recording of 6 s."""


def sections(options: Namespace) -> Iterator[Section]:
    """Yield the tables for as many random arms as are asked for, each with one recording."""
    cases = max(len(SENSORS), options.arms)
    with ProcessPoolExecutor(options.processes, mp_context=get_context('spawn')) as pool:
        found = [
            list(pool.map(_case, repeat(sensors), range(place, cases, len(SENSORS))))
            for place, sensors in enumerate(SENSORS)
        ]
        rows = [_row(*kind, each) for kind, each in zip(SENSORS.items(), found, strict=True)]
        header = (
            *('rate, noise, encoder', 'median error', '90 %', 'goal', 'within the goal'),
            *('within 2 std', 'misfit said', f'CPU for {UNTIL:g} s'),
        )
        title = f'Model fit: worst of six parameters, {cases} random arms 10 to 30 % off'
        yield Section(title, header, rows)
        yield Section('Model fit: how honest standard errors are', *_honesty(found))
        few = max(1, round(STRUCTURE_SHARE * cases))
        header = 'arm, noise', 'said not to be the model', 'largest error where not said'
        title = f'Model fit: other structures, {few} random arms'
        yield Section(title, header, list(_structures(few, pool)))
    header = 'length of the recording', 'samples', 'CPU', 'most memory besides'
    yield Section('Model fit: long recordings, 200 Hz', header, list(_lengths()))


def _row(
    sensors: tuple[float, float, int], bound: float, found: Sequence['_Found']
) -> tuple[object, ...]:
    """Return what comes of one kind of sensor."""
    rate, noise, bits = sensors
    errors = np.array([each.worst for each in found])
    inside = np.concatenate([np.abs(each.ratios) < WITHIN for each in found])
    return (
        f'{rate:g} Hz, {noise:g} rad, {bits} bit',
        f'{100 * np.median(errors):.2g} %',
        f'{100 * np.quantile(errors, 0.9):.2g} %',
        f'{100 * bound:g} %',
        f'{100 * np.mean(errors <= bound):.0f} %',
        f'{100 * np.mean(inside):.0f} %',
        f'{sum(each.is_misfit for each in found)} of {len(found)}',
        f'{np.mean([each.spent for each in found]):.1f} s',
    )


def _honesty(found: Sequence[Sequence['_Found']]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return header and rows: how often either parameter is within 2 std, and all of them."""
    ratios = np.abs(np.concatenate([[each.ratios for each in kind] for kind in found]))
    told = (*NAMES[: ratios.shape[1]], 'all')
    inside = [*(ratios < WITHIN).mean(axis=0), (ratios < WITHIN).mean()]
    middle = [*np.median(ratios, axis=0), np.median(ratios)]
    rows = [
        (name, f'{100 * share:.1f} %', f'{half:.2f}')
        for name, share, half in zip(told, inside, middle, strict=True)
    ]
    return ('parameter', 'within 2 std', 'median error / std (0.67 if normal)'), rows


class _Found(NamedTuple):
    """Worst relative error, the six errors in standard errors, doubt, and time [s]."""

    worst: float
    ratios: np.ndarray
    is_misfit: bool
    spent: float


def _case(sensors: tuple[float, float, int], case: int) -> _Found:
    """Fit one random arm."""
    rate, noise, bits = sensors
    believed, true, goals = _case_arms(case)
    step = 2 * pi / 2**bits if bits else 0.0
    seen = recorded(true, believed, rate=rate, noise=noise, step=step, seed=case, goals=goals)
    begun = process_time()
    fit = fit_model(seen, believed)
    spent = process_time() - begun
    found = np.array([(e.value, e.std) for e in fit.estimates[:6]])
    errors = found[:, 0] - _six(true)
    worst = float(np.abs(errors / _six(true)).max())
    return _Found(worst, errors / found[:, 1], bool(fit.misfit), spent)


def _lengths() -> Iterator[tuple[object, ...]]:
    """Yield what a fit takes over the length of a recording."""
    for minutes in LENGTHS:
        # A process of its own for each: its peak memory never falls.
        with ProcessPoolExecutor(1, mp_context=get_context('spawn')) as alone:
            samples, spent, most = alone.submit(_long, minutes).result()
        yield f'{minutes} min', f'{samples}', f'{spent:.0f} s', f'{most / 1e6:.0f} MB'


def _long(minutes: int) -> tuple[int, float, float]:
    """Return samples, CPU [s] and memory [B] of a fit to the same minute again and again."""
    believed, true = _arms(np.random.default_rng(0))
    goals = tuple(np.random.default_rng(1).uniform(-pi, pi, 40))
    minute = recorded(true, believed, noise=1e-4, goals=goals, until=60.0)
    seen = Measurements(
        times=np.concatenate([minute.times + 61.0 * k for k in range(minutes)]),
        positions=np.tile(minute.positions, (minutes, 1)),
        efforts=np.tile(minute.efforts, (minutes, 1)),
    )
    before = getrusage(RUSAGE_SELF).ru_maxrss
    begun = process_time()
    fit_model(seen, believed)
    spent = process_time() - begun
    return seen.times.size, spent, 1024.0 * (getrusage(RUSAGE_SELF).ru_maxrss - before)


def _structures(cases: int, pool: ProcessPoolExecutor) -> Iterator[tuple[object, ...]]:
    """Yield in how many arms of each structure the fit says that it is not the model's."""
    pairs = [_case_arms(case) for case in range(cases)]
    commands = [_command(believed, goals) for believed, _, goals in pairs]
    for name, structure in STRUCTURES.items():
        played = play([true for _, true, _ in pairs], commands, structure, UNTIL, STRUCTURE_RATE)
        for noise in STRUCTURE_NOISE:
            jobs = [
                (pairs[case][0], played.times, played.positions[:, case], effort, noise, case)
                for case, effort in enumerate(played.efforts.T)
            ]
            found = list(pool.map(_noticed, jobs))
            said = sum(misfit for misfit, _ in found)
            absorbed = [change for misfit, change in found if not misfit]
            yield (
                f'{name}, {noise:g} rad',
                f'{said} of {cases} ({100 * said / cases:.0f} %)',
                f'{100 * max(absorbed):.2g} %' if absorbed else '-',
            )


def _noticed(
    job: tuple[PlanarArm, FloatArray, FloatArray, FloatArray, float, int],
) -> tuple[bool, float]:
    """Return whether a misfit is said, and the largest error of a stated inertia or stiffness."""
    believed, times, positions, effort, noise, case = job
    shaken = positions + noise * np.random.default_rng(case).standard_normal(positions.shape)
    seen = Measurements(times=times, positions=shaken, efforts=effort[:, None])
    true = _six(_case_arms(case)[1])[:3]
    fit = fit_model(seen, believed)
    values = np.array([estimate.value for estimate in fit.estimates[:3]])
    return bool(fit.misfit), float(np.abs(values / true - 1.0).max())


def _case_arms(case: int) -> tuple[PlanarArm, PlanarArm, tuple[float, ...]]:
    """Return an arm as believed, as it is, and the goals of its recording."""
    rng = np.random.default_rng(case)
    believed, true = _arms(rng)
    return believed, true, tuple(rng.uniform(-pi, pi, GOALS))


def _command(believed: PlanarArm, goals: tuple[float, ...]) -> tuple[FloatArray, FloatArray]:
    """Return times and efforts of joint 1."""
    profile = commanded(believed, goals=goals)
    return profile.times, profile.efforts[:, 0]


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
