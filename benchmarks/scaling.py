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

"""Cost of a plan's samples over their number, and over the number of joints."""

from argparse import Namespace
from importlib.util import find_spec
import json
import os
from pathlib import Path
import subprocess
import sys

from flat_planner_ros.core import MotionRequest, plan, PlanarArm
from flat_planner_ros.core.planning.motion_problem import MAX_KEPT_INTERVALS
from measurement import duration_text, Section, Timing, timing
import numpy as np
from numpy.typing import NDArray
import problem

COUNTS = (100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000)
"""Numbers of samples."""

LONGEST_KEPT = MAX_KEPT_INTERVALS
"""Samples from which a motion is no longer kept."""

KEPT_MEMORY = {
    'MALLOC_MMAP_THRESHOLD_': '2000000000',
    'MALLOC_TRIM_THRESHOLD_': '2000000000',
    'MALLOC_TOP_PAD_': '67108864',
}
"""Environment in which glibc keeps freed memory; other C libraries ignore it."""

JOINTS = (2, 3, 4, 5, 6, 7)
"""Numbers of joints."""

CURVE = Path(__file__).parent / 'scaling.png'
"""Where the curve is drawn."""

FloatArray = NDArray[np.float64]


def sections(options: Namespace) -> list[Section]:
    """Return the tables of this benchmark, and draw its curve."""
    del options
    return [_samples_section(), _joints_section()]


def sample_times() -> list[Timing]:
    """Return the times of samples on even grids, each of all that a caller wants."""
    times = []
    made = plan(problem.request(), problem.arm(), problem.OPTIONS)
    for number in COUNTS:
        period = problem.DURATION / (number - 1)

        def sample(period: float = period) -> tuple[FloatArray, ...]:
            samples = made.sample(period)
            return samples.positions, samples.efforts, samples.flat

        assert sample()[0].shape == (number, 2)
        assert abs(sample()[0][-1, 0] - problem.DISTANCE) < 1e-12
        times.append(timing(lambda _, sample=sample: sample(), budget=1.0))
    return times


def _samples_section() -> Section:
    """Measure samples in this process and in one that keeps its memory."""
    times, counts = sample_times(), np.array(COUNTS, dtype=float)
    medians = np.array([each.median for each in times])
    kept = _with_kept_memory()
    own = np.array([each.median for each in kept])
    # To this length the motion over 1 rad is kept, beyond it is computed each time: two lines.
    is_short = counts <= LONGEST_KEPT
    lines = [_line(counts[part], own[part]) for part in (is_short, ~is_short)]
    fixed, slope = lines[0]
    if find_spec('matplotlib') is not None:
        _draw(counts, medians, fixed, slope)
    return Section(
        'Samples of a plan, two joints',
        ('samples', 'median', 'per sample', 'memory kept: best', 'median', 'over the line'),
        [
            (
                f'{number}',
                duration_text(each.median),
                f'{1e9 * each.median / number:.3g} ns',
                duration_text(other.best),
                duration_text(other.median),
                f'{other.median / (line[0] + line[1] * number):.2f}',
            )
            for number, each, other, line in zip(
                COUNTS, times, kept, [lines[not short] for short in is_short], strict=True
            )
        ],
        [
            'positions, velocities, accelerations, torques, y to y^(5)',
            *(
                f'line {where} {LONGEST_KEPT} samples: {1e6 * each[0]:.3g} µs + '
                f'{1e9 * each[1]:.3g} ns per sample, memory kept'
                for where, each in zip(('to', 'beyond'), lines, strict=True)
            ),
            'memory kept: freed memory is not given back to the system, which else has to '
            'provide every page of a long table anew',
            f'to {LONGEST_KEPT} samples the motion over 1 rad is kept, beyond it is computed '
            'each time',
        ],
    )


def _with_kept_memory() -> list[Timing]:
    """Return the times in a process whose C library keeps what is freed."""
    code = 'import json, scaling; print(json.dumps(scaling.sample_times()))'
    run = subprocess.run(
        [sys.executable, '-c', code],
        cwd=Path(__file__).parent,
        env={**os.environ, **KEPT_MEMORY},
        check=True,
        capture_output=True,
        text=True,
    )
    return [Timing(*numbers) for numbers in json.loads(run.stdout)]


def _joints_section() -> Section:
    """Measure arms of two to seven joints."""
    rows, joints, medians = [], np.array(JOINTS, dtype=float), []
    for number in JOINTS:
        arm = _arm(number)
        final = np.append(np.linspace(1.0, 0.5, number - 1), 0.0)
        request = MotionRequest(start=np.zeros(number), final=final, duration=problem.DURATION)

        def sample(
            arm: PlanarArm = arm, request: MotionRequest = request
        ) -> tuple[FloatArray, FloatArray]:
            samples = plan(request, arm, problem.OPTIONS).sample(1.0 / (problem.SAMPLES - 1))
            return samples.positions, samples.efforts

        assert np.abs(sample()[0][-1] - final).max() < 1e-12
        time = timing(lambda _, sample=sample: sample(), budget=1.0)
        medians.append(time.median)
        rows.append((f'{number}', *map(duration_text, (time.best, time.median, time.worst))))
    # From three joints on: with two, no inverse dynamics is needed.
    fixed, slope = _line(joints[1:], np.array(medians[1:]))
    shares = [f'{m / (fixed + slope * n):.2f}' for n, m in zip(joints, medians, strict=True)]
    return Section(
        'Joints: plan of a known law, 1001 samples of all positions and efforts',
        ('joints', 'best', 'median', 'worst', 'over the line'),
        [(*row, share) for row, share in zip(rows, shares, strict=True)],
        [
            f'line through three to seven: {duration_text(fixed)} + {duration_text(slope)} per '
            "joint; the efforts before the last two joints take the arm's inverse dynamics"
        ],
    )


def _arm(joints: int) -> PlanarArm:
    """Return an arm whose last two links are the paper's."""
    inner = joints - 2
    return PlanarArm.reduced(
        inertia_star=(6.4e-4, 3.3e-5),
        stiffness=3e-3,
        damping=2e-5,
        link_length=np.full(inner, 0.1),
        link_com=np.full(inner, 0.05),
        link_mass=np.full(inner, 0.05),
        link_inertia=np.full(inner, 1e-4),
        tip_mass=0.05,
    )


def _line(counts: FloatArray, times: FloatArray) -> tuple[float, float]:
    """Return offset [s] and slope [s] of the line of least relative errors."""
    table = np.stack([np.ones_like(counts), counts], axis=1) / times[:, None]
    (fixed, slope), *_ = np.linalg.lstsq(table, np.ones_like(times), rcond=None)
    return float(fixed), float(slope)


def _draw(counts: FloatArray, times: FloatArray, fixed: float, slope: float) -> None:
    """Draw measured times and the line."""
    import matplotlib

    matplotlib.use('Agg')
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(6.0, 3.8), layout='constrained')
    dense = np.geomspace(counts[0], counts[-1], 200)
    axes.loglog(dense, 1e3 * (fixed + slope * dense), color='0.6', label='memory kept')
    axes.loglog(counts, 1e3 * times, 'o', color='tab:blue', label='median')
    axes.set_xlabel('samples')
    axes.set_ylabel('time [ms]')
    axes.set_title(f'{1e6 * fixed:.0f} µs + {1e9 * slope:.0f} ns per sample', fontsize='medium')
    axes.grid(which='both', alpha=0.2)
    axes.legend(frameon=False)
    figure.savefig(CURVE, dpi=120)
    pyplot.close(figure)
