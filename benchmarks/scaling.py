"""Cost of a plan's samples over their number."""

from argparse import Namespace
from importlib.util import find_spec
from pathlib import Path

from flat_planner_ros.core import plan
from measurement import duration_text, Section, timing
import numpy as np
from numpy.typing import NDArray
import problem

COUNTS = (100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000)
"""Numbers of samples."""

CURVE = Path(__file__).parent / 'scaling.png'
"""Where the curve is drawn."""

FloatArray = NDArray[np.float64]


def sections(options: Namespace) -> list[Section]:
    """Return the table of this benchmark, and draw its curve."""
    del options
    made = plan(problem.request(), problem.arm(), problem.OPTIONS)
    counts, times = np.array(COUNTS, dtype=float), []
    for number in COUNTS:
        grid = np.linspace(0.0, problem.DURATION, number)
        samples = made.at(grid)
        assert samples.positions.shape == (number, 2)
        assert abs(samples.positions[-1, 0] - problem.DISTANCE) < 1e-12
        times.append(timing(made.at, lambda grid=grid: grid, budget=1.5))
    medians = np.array([each.median for each in times])
    fixed, slope = _line(counts, medians)
    if find_spec('matplotlib') is not None:
        _draw(counts, medians, fixed, slope)
    return [
        Section(
            'Samples of a plan',
            ('samples', 'median', 'worst', 'per sample', 'over the line'),
            [
                (
                    f'{number}',
                    duration_text(each.median),
                    duration_text(each.worst),
                    f'{1e9 * each.median / number:.3g} ns',
                    f'{each.median / (fixed + slope * number):.2f}',
                )
                for number, each in zip(COUNTS, times, strict=True)
            ],
            [
                f'line: {duration_text(fixed)} + {1e9 * slope:.3g} ns per sample of two joints '
                '(positions, velocities, accelerations, torques, y to y^(5))',
            ],
        )
    ]


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
    axes.loglog(dense, 1e3 * (fixed + slope * dense), color='0.6', label='line')
    axes.loglog(counts, 1e3 * times, 'o', color='tab:blue', label='median')
    axes.set_xlabel('samples')
    axes.set_ylabel('time [ms]')
    axes.set_title(f'{1e6 * fixed:.0f} µs + {1e9 * slope:.0f} ns per sample', fontsize='medium')
    axes.grid(which='both', alpha=0.2)
    axes.legend(frameon=False)
    figure.savefig(CURVE, dpi=120)
    pyplot.close(figure)
