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

"""Figure of one plan: positions, velocities and efforts of all joints over time."""

from collections.abc import Sequence
from pathlib import Path

from flat_planner_ros.core.session import Track
from flat_planner_ros.figures.file_plot import plt

ROWS = (
    ('positions', 'position [rad]'),
    ('velocities', 'velocity [rad/s]'),
    ('efforts', 'effort [N m]'),
)
"""Tables that are drawn, one above the other."""


def draw_plan(track: Track, joints: Sequence[str], path: Path) -> None:
    """
    Write a figure.

    Parameters
    ----------
    track
        Samples of the plan.
    joints
        Names of its columns, the passive joint last.
    path
        File, of a kind that matplotlib knows.

    """
    figure, axes = plt.subplots(len(ROWS), 1, sharex=True, figsize=(7.0, 7.0))
    for axis, (quantity, label) in zip(axes, ROWS, strict=True):
        table = getattr(track, quantity)
        for index, name in enumerate(joints):
            if quantity == 'efforts' and index == len(joints) - 1:
                continue
            axis.plot(track.times, table[:, index], label=name)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    axes[0].legend(frameon=False)
    axes[-1].set_xlabel('time [s]')
    axes[-1].set_xlim(track.times[0], track.times[-1])
    figure.align_ylabels(axes)
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)
