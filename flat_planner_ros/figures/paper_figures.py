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

"""The paper's figures, drawn with matplotlib (extra `plot`)."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path

from flat_planner_ros.figures.file_plot import plt, with_gaps
from flat_planner_ros.figures.paper_example import DURATION, Result, Scenario
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.ticker import MultipleLocator

SHOWN_AFTER = 1.0
"""Time that is drawn after the end of the motion [s]."""

TICKS = 0.5
"""Spacing of the marks on the time axis [s]."""

STYLES = {
    'polynomial': ('C0', '-'),
    'min_control_effort': ('C3', '--'),
    'min_potential_energy': ('C2', ':'),
    'exact': ('C1', '-'),
    'insensitive': ('C4', '-'),
    'self-tuned, 2nd move': ('C5', '--'),
    'tracked': ('C6', '-.'),
}
"""Colour and line of each method, those of the paper as there."""

COLUMNS = 5
"""Scenarios beside each other; more go below."""

ROWS = ('$q_1$ [rad]', '$q_2$ [rad]', r'$\tau_1$ [N m]')


def draw(results: Sequence[Result], path: Path) -> None:
    """
    Draw q1, q2 and the effort over time, one column per scenario, `COLUMNS` of them in a band.

    Parameters
    ----------
    results
        Any of the runs, at least one.
    path
        File to write; its suffix chooses the format.

    """
    scenarios = list(dict.fromkeys(result.scenario for result in results))
    columns = min(len(scenarios), COLUMNS)
    bands = ceil(len(scenarios) / columns)
    figure, axes = plt.subplots(
        bands * len(ROWS),
        columns,
        figsize=(4.0 * columns + 1.0, 7.5 * bands),
        sharex=True,
        squeeze=False,
    )
    for index, scenario in enumerate(scenarios):
        band, column = divmod(index, columns)
        column_axes = list(axes[band * len(ROWS) : (band + 1) * len(ROWS), column])
        _draw_scenario(column_axes, scenario, results)
        if column == 0:
            for axis, label in zip(column_axes, ROWS, strict=True):
                axis.set_ylabel(label)
    for axis in axes[-len(ROWS) :, len(scenarios) - (bands - 1) * columns :].flat:
        axis.axis('off')
    for row in range(len(ROWS)):
        _share_range(list(axes[row :: len(ROWS)].flat))
    handles: dict[str, Artist] = {}
    for axis in axes[:: len(ROWS)].flat:
        shown, labels = axis.get_legend_handles_labels()
        handles |= dict(zip(labels, shown, strict=True))
    figure.legend(
        list(handles.values()), list(handles), loc='lower center', ncols=len(STYLES), frameon=False
    )
    figure.tight_layout(rect=(0.0, 0.04 / bands, 1.0, 1.0))
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _draw_scenario(axes: Sequence[Axes], scenario: Scenario, results: Sequence[Result]) -> None:
    """Draw a scenario into its column."""
    axes[0].set_title(f'Scenario {scenario.number}: {scenario.title}', fontsize=10)
    for result in results:
        if result.scenario != scenario:
            continue
        colour, line = STYLES[result.strategy]
        times, positions, efforts = with_gaps(*result.recording)
        curves = (positions[:, 0], positions[:, 1], efforts)
        for axis, values in zip(axes, curves, strict=True):
            axis.plot(times, values, line, color=colour, label=result.strategy)
    for axis in axes:
        axis.axvline(DURATION, color='black', linewidth=0.8)
        axis.grid(alpha=0.3)
    axes[-1].tick_params(labelbottom=True)
    axes[-1].set_xlabel('time [s]')
    axes[-1].set_xlim(0.0, DURATION + SHOWN_AFTER)
    axes[-1].xaxis.set_major_locator(MultipleLocator(TICKS))


def _share_range(axes: Sequence[Axes]) -> None:
    """Give axes of the same quantity the same range."""
    shown = [axis for axis in axes if axis.lines]
    low, high = zip(*(axis.get_ylim() for axis in shown), strict=True)
    for axis in shown:
        axis.set_ylim(min(low), max(high))
