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

"""Studies: plans and simulated motions per second, two processes over one, and memory."""

from argparse import Namespace
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from math import pi
from multiprocessing import get_context
import os
from pathlib import Path
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import perf_counter

from flat_planner_ros.core import PlanarArm, PlanningOptions, SessionSettings
from flat_planner_ros.core.study import (
    Axes,
    Batch,
    Case,
    chunks_of,
    Column,
    Distribution,
    Draws,
    here,
    last_links_of,
    on_executor,
    Refused,
    Study,
)
from flat_planner_ros.core.tracking import TrackerSettings
from measurement import Section, verdict
import numpy as np
import problem

CHUNK = 1000
"""Rows that are done together."""

PLANS, MOTIONS, SCALING, MEMORY = 20_000.0, 5_000.0, 1.8, 100.0
"""Targets: rows per second, two processes over one [-], memory [MB]."""

LONGER = 100.0
"""Target of simulated motions of longer arms [1/s]."""

FOR_TRACKERS = 100.0
"""Target of motions of two-joint arms that trackers carry out [1/s]."""

MILLION = 1_000_000

LINK = {'link_length': [0.2], 'link_com': [0.1], 'link_mass': [0.3], 'link_inertia': [1e-3]}
"""What carries the last two links of an arm of three joints."""

SPEC = """
study:
  repeats: {rows}
  set: {{goal.joint1: pi, simulate: false}}
  axes:
    duration: {{uniform: [0.8, 1.3]}}
    plant.mismatch.stiffness_scale: {{uniform: [0.75, 1.25]}}
"""

PROGRAM = """
import re, sys
from flat_planner_ros.programs import study
assert study() == 0
status = open('/proc/self/status', encoding='ascii').read()
print(re.search(r'VmHWM:\\s+(\\d+) kB', status)[1], file=sys.stderr)
"""
"""Does a study, and says what memory it took at most [kB]."""


def sections(options: Namespace) -> Iterator[Section]:
    """Return the tables of this benchmark."""
    yield _rates()
    yield _memory(options)


@dataclass(frozen=True, kw_only=True)
class Cases:
    """Makes motions of random durations on random arms; may be told to other processes."""

    joints: int
    plays: bool
    tracker: TrackerSettings | None = None

    def __call__(self, columns: Mapping[str, Column]) -> Sequence[Batch | Refused]:
        """Return one batch."""
        count = len(columns['duration'])
        arm = problem.arm() if self.joints == 2 else _longer()
        final = (*(0.5,) * (self.joints - 2), pi, 0.0)
        names = tuple(f'joint{index + 1}' for index in range(self.joints))
        settings = SessionSettings(joints=names, arm=arm, options=PlanningOptions())
        template = Case(
            settings=settings,
            true=arm,
            start=(0.0,) * self.joints,
            final=final,
            plays=self.plays,
            tracker=self.tracker,
        )
        true = np.tile(last_links_of(arm), (count, 1))
        true[:, 2] *= columns['stiffness']
        return [
            Batch(
                template=template,
                places=np.arange(count),
                starts=np.zeros((count, self.joints)),
                finals=np.tile(final, (count, 1)),
                durations=np.array(columns['duration']),
                true=true,
            )
        ]


def _longer() -> PlanarArm:
    """Return the paper's last two links behind another one."""
    arm = problem.arm()
    return PlanarArm.reduced(
        inertia_star=arm.inertia_star, stiffness=arm.stiffness, damping=arm.damping, **LINK
    )


def _study(
    rows: int, joints: int, *, plays: bool, tracker: TrackerSettings | None = None
) -> Study:
    """Return a study of random durations and true springs."""
    limits = {'duration': (0.8, 1.3), 'stiffness': (0.75, 1.25)}
    draws = tuple(
        Draws(name=name, distribution=Distribution.UNIFORM, spread=spread)
        for name, spread in limits.items()
    )
    return Study(
        axes=Axes(draws=draws, repeats=rows, seed=1),
        cases=Cases(joints=joints, plays=plays, tracker=tracker),
        joints=tuple(f'joint{index + 1}' for index in range(joints)),
        chunk=min(CHUNK, rows // 4),
    )


def _rates() -> Section:
    """Return rows per second of one process and of two."""
    rows, notes = [], []
    for name, target, study in (
        ('plans with predicted residuals', PLANS, _study(40_000, 2, plays=False)),
        ('the same, simulated', MOTIONS, _study(8_000, 2, plays=True)),
        ('three joints, simulated', LONGER, _study(400, 3, plays=True)),
        (
            'two joints, with a tracker',
            FOR_TRACKERS,
            _study(2000, 2, plays=True, tracker=TrackerSettings()),
        ),
    ):
        one, two = _rate(study, 1), _rate(study, 2)
        rows.append((name, f'{one:.0f} /s', f'{two:.0f} /s', f'{two / one:.2f}'))
        notes.append(f'{name}, target {target:.0f} /s with two: {verdict(two >= target)}')
        if target is PLANS:
            notes.append(f'two over one, target {SCALING}: {verdict(two >= SCALING * one)}')
    return Section('Rows per second', ('rows', 'one process', 'two', 'ratio'), rows, notes)


def _rate(study: Study, workers: int) -> float:
    """Return rows per second once the processes are there."""
    chunks = chunks_of(0, study.count, study.chunk)
    if workers == 1:
        found = here(study, chunks)
        study(0, 1)
    else:
        pool = ProcessPoolExecutor(workers, mp_context=get_context('spawn'))
        # Each has loaded what it needs.
        list(pool.map(partial(_warm, study), range(4 * workers)))
        found = on_executor(study, chunks, _only(pool), workers)
    begun = perf_counter()
    counted = sum(len(table['row']) for _, table in found)
    elapsed = perf_counter() - begun
    assert counted == study.count
    return counted / elapsed


def _warm(study: Study, row: int) -> int:
    """Do one row; return the process."""
    study(row, row + 1)
    return os.getpid()


def _only(pool: Executor) -> 'partial[Executor]':
    """Return what makes no other executor than this one."""
    return partial(_itself, pool)


def _itself(pool: Executor) -> Executor:
    return pool


def _memory(options: Namespace) -> Section:
    """Return the memory that the program takes over its table's length."""
    rows = []
    most = MILLION if options.seconds >= 60.0 else MILLION // 20
    with TemporaryDirectory() as folder:
        for count in (1000, most):
            spec = Path(folder, 'study.yaml')
            spec.write_text(SPEC.format(rows=count), encoding='utf-8')
            words = [str(spec), '-o', str(Path(folder, f'{count}.csv'))]
            begun = perf_counter()
            # By its own word: what the system tells of a child includes what its parent took.
            process = subprocess.run(
                [sys.executable, '-c', PROGRAM, *words],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                check=True,
            )
            megabytes = int(process.stderr.split()[-1]) / 1000.0
            rows.append((f'{count:,}', f'{megabytes:.0f} MB', f'{perf_counter() - begun:.1f} s'))
    is_met = megabytes < MEMORY
    return Section(
        'Memory of the program, with its libraries',
        ('rows', 'most', 'time'),
        rows,
        [f'{most:,} rows, target {MEMORY:.0f} MB: {verdict(is_met)}'],
    )
