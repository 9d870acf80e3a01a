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
from pathlib import Path

from flat_planner_ros.figures.file_plot import plt, with_gaps
from flat_planner_ros.figures.paper_example import DURATION, Result
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
}
"""Colour and line of each method, those of the paper as there."""

ROWS = ('$q_1$ [rad]', '$q_2$ [rad]', r'$\tau_1$ [N m]')


def draw(results: Sequence[Result], path: Path) -> None:
    """
    Draw q1, q2 and the effort over time, one column per scenario.

    Parameters
    ----------
    results
        Any of the runs, at least one.
    path
        File to write; its suffix chooses the format.

    """
    scenarios = list(dict.fromkeys(result.scenario for result in results))
    figure, axes = plt.subplots(
        len(ROWS),
        len(scenarios),
        figsize=(4.0 * len(scenarios) + 1.0, 7.5),
        sharex=True,
        sharey='row',
        squeeze=False,
    )
    for column, scenario in enumerate(scenarios):
        axes[0, column].set_title(f'Scenario {scenario.number}: {scenario.title}', fontsize=10)
        for result in results:
            if result.scenario != scenario:
                continue
            colour, line = STYLES[result.strategy]
            times, positions, efforts = with_gaps(*result.recording)
            for row, values in enumerate((positions[:, 0], positions[:, 1], efforts)):
                axes[row, column].plot(times, values, line, color=colour, label=result.strategy)
        for row, label in enumerate(ROWS):
            axis = axes[row, column]
            axis.axvline(DURATION, color='black', linewidth=0.8)
            axis.grid(alpha=0.3)
            if column == 0:
                axis.set_ylabel(label)
        axes[-1, column].set_xlabel('time [s]')
        axes[-1, column].set_xlim(0.0, DURATION + SHOWN_AFTER)
        axes[-1, column].xaxis.set_major_locator(MultipleLocator(TICKS))
    lines = [
        line for axis in axes[0] for line in zip(*axis.get_legend_handles_labels(), strict=True)
    ]
    handles = {label: handle for handle, label in lines}
    figure.legend(
        handles.values(), handles.keys(), loc='lower center', ncols=len(STYLES), frameon=False
    )
    figure.tight_layout(rect=(0.0, 0.04, 1.0, 1.0))
    figure.savefig(path, dpi=120)
    plt.close(figure)
