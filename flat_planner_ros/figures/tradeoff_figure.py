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

"""Picture of effort against residual, drawn with matplotlib (extra `plot`)."""

from collections.abc import Sequence
from pathlib import Path

from flat_planner_ros.core.planning import (
    FASTEST,
    FASTEST_INSENSITIVE,
    FASTEST_WITHIN,
    TradeoffPoint,
)
from flat_planner_ros.figures.file_plot import plt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

MARKS = {
    'polynomial': ('o', 'polynomial'),
    'min_control_effort': ('^', 'min_control_effort'),
    'min_potential_energy': ('v', 'min_potential_energy'),
    'quintic': ('x', 'quintic of the rigid arm'),
    'zv_quintic': ('s', 'quintic, ZV-shaped'),
    'zvd_quintic': ('D', 'quintic, ZVD-shaped'),
}
"""Mark and name of each single motion."""

FASTEST_MARKS = {
    FASTEST: ('*', FASTEST),
    FASTEST_INSENSITIVE: ('P', FASTEST_INSENSITIVE),
}
"""The same of the shortest motions of least peak."""

LINES = {'insensitive_exact': '-', 'insensitive_free': '--'}
"""Line of each sweep; its colour tells the duration."""


def draw(
    points: Sequence[TradeoffPoint],
    box: str,
    path: Path,
    fastest: Sequence[TradeoffPoint] = (),
    limit: float = 0.0,
) -> None:
    """
    Draw the worst residual over the RMS effort, and over the time that a limit asks for.

    Parameters
    ----------
    points
        Single motions, weight 0, at least one, and sweeps.
    box
        The uncertainty in words.
    path
        File to write; its suffix chooses the format.
    fastest
        Shortest motions within a limit on the effort; without them there is one picture.
    limit
        That limit [N m].

    """
    columns = 2 if fastest else 1
    figure, axes = plt.subplots(1, columns, figsize=(7.0 * columns + 2.0, 6.0), squeeze=False)
    _draw_efforts(axes[0, 0], points, box)
    if fastest:
        _draw_times(axes[0, 1], fastest, limit)
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _draw_efforts(axis: Axes, points: Sequence[TradeoffPoint], box: str) -> None:
    """Draw the worst residual over the RMS effort, both logarithmic."""
    durations = sorted({point.duration for point in points if point.weight > 0.0})
    shades = plt.get_cmap('viridis')
    colours = {
        duration: shades(index / max(len(durations), 2))
        for index, duration in enumerate(durations)
    }
    for series, line in LINES.items():
        for duration in durations:
            sweep = [p for p in points if (p.series, p.duration) == (series, duration)]
            if sweep:
                axis.plot(
                    [p.rms_effort for p in sweep],
                    [p.worst for p in sweep],
                    line,
                    color=colours[duration],
                )
    singles = [point for point in points if point.weight == 0.0]
    marks = []
    for point in singles:
        mark, name = MARKS[point.series]
        marks += axis.plot(
            point.rms_effort, point.worst, mark, color='C3', label=name, zorder=3, linestyle='none'
        )
    axis.set_xscale('log')
    axis.set_yscale('log')
    axis.set_xlabel('RMS effort of the joint before the elastic one [N m]')
    axis.set_ylabel('worst residual amplitude [rad]')
    axis.set_title(f'Marks: {singles[0].duration:.4g} s. Uncertainty: {box}', fontsize=10)
    axis.grid(alpha=0.3, which='both')
    handles = [
        Line2D([], [], color=colours[d], label=f'insensitive, {d:.4g} s') for d in durations
    ]
    handles += [
        Line2D([], [], color='0.4', linestyle='-', label='exact on the nominal arm'),
        Line2D([], [], color='0.4', linestyle='--', label='nominal residual free'),
    ]
    axis.add_artist(axis.legend(handles=marks, fontsize=8, loc='lower right'))
    axis.legend(handles=handles, fontsize=8, loc='upper right')


def _draw_times(axis: Axes, fastest: Sequence[TradeoffPoint], limit: float) -> None:
    """Draw the worst residual over the shortest duration within a limit."""
    bounded = sorted(
        (point for point in fastest if point.series in (FASTEST, FASTEST_WITHIN)),
        key=lambda point: point.duration,
    )
    axis.plot(
        [point.duration for point in bounded],
        [point.worst for point in bounded],
        '.-',
        color='C0',
        label=f'{FASTEST}, peak.max_residual',
    )
    for point in fastest:
        if point.series == FASTEST_WITHIN:
            continue
        mark, name = FASTEST_MARKS.get(point.series) or MARKS[point.series]
        axis.plot(
            point.duration, point.worst, mark, color='C3', label=name, zorder=3, linestyle='none'
        )
    axis.set_yscale('log')
    axis.set_xlabel(f'shortest duration within {limit:.4g} N m [s]')
    axis.set_ylabel('worst residual amplitude [rad]')
    axis.set_title('As fast as the motor allows', fontsize=10)
    axis.grid(alpha=0.3, which='both')
    axis.legend(fontsize=8, loc='best')
