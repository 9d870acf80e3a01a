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

"""A motion and what it left behind, drawn with matplotlib (extra `plot`)."""

from pathlib import Path
from textwrap import fill
from typing import Any

from flat_planner_ros.core.arm import FloatArray
from flat_planner_ros.core.monitor import PlannedMotion, VibrationReport
from flat_planner_ros.figures.file_plot import plt, with_gaps
from matplotlib.axes import Axes
import numpy as np

MILLI = 1e3
"""Residuals are drawn in mrad."""

Sent = tuple[FloatArray, FloatArray]
"""Times [s], shape (m,), and efforts [N m], shape (m, k)."""

TITLE_WIDTH = 110
"""Characters in a line of the title."""


def draw(
    report: VibrationReport,
    motion: PlannedMotion,
    times: FloatArray,
    positions: FloatArray,
    efforts: FloatArray,
    tracked: Sent,
    pushes: Sent,
    path: Path,
) -> None:
    """
    Draw planned and measured positions, the residual with its fitted envelope, and efforts.

    Parameters
    ----------
    report, motion
        The verdict and what it is about.
    times
        Times of the samples [s], shape (m,).
    positions, efforts
        Measured [rad], [N m], shape (m, n); NaN where unknown.
    tracked, pushes
        Sent by a tracker, and by who pushed the arm: times [s] and efforts [N m].
    path
        File to write; its suffix chooses the format.

    """
    elapsed = times - motion.start
    end = motion.end - motion.start
    last = max(end + report.window, float(elapsed[-1]) if elapsed.size else end)
    planned = np.array([motion.reference(time)[0] for time in times]).reshape(positions.shape)
    figure, axes = plt.subplots(3, 1, figsize=(9.0, 9.0), sharex=True, layout='constrained')
    _draw_positions(axes[0], motion, elapsed, positions, last)
    _draw_residual(axes[1], report, elapsed, MILLI * (positions - planned), end)
    _draw_efforts(axes[2], motion, elapsed, efforts)
    _draw_tracked(axes[2], motion, tracked)
    for time in pushes[0] - motion.start:
        axes[1].axvline(time, color='C8', linewidth=0.6, zorder=0)
    for axis in axes:
        axis.axvline(0.0, color='black', linewidth=0.6)
        axis.axvline(end, color='black', linewidth=0.6)
        axis.grid(alpha=0.3)
        axis.margins(x=0.01)
    axes[-1].set_xlabel('time from the start of the motion [s]')
    figure.suptitle(_title(report), fontsize=10)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw_positions(
    axis: Axes, motion: PlannedMotion, elapsed: FloatArray, positions: FloatArray, last: float
) -> None:
    """Draw each joint as planned and as measured."""
    times = np.append(motion.times, last)
    planned = np.vstack([motion.positions, motion.final])
    for joint, name in enumerate(motion.joint_names):
        colour = f'C{joint}'
        _plot(axis, elapsed, positions[:, joint], color=colour, label=f'{name} measured')
        axis.plot(times, planned[:, joint], '--', color='black', linewidth=0.9)
    axis.plot([], [], '--', color='black', linewidth=0.9, label='planned')
    axis.set_ylabel('position [rad]')
    axis.legend(loc='best', fontsize=8)


def _draw_residual(
    axis: Axes, report: VibrationReport, elapsed: FloatArray, residual: FloatArray, end: float
) -> None:
    """Draw how far each joint is from the plan, and the envelope fitted after the motion."""
    for joint, name in enumerate(report.joint_names):
        _plot(axis, elapsed, residual[:, joint], color=f'C{joint}', label=name)
    after = elapsed[(elapsed >= end) & (elapsed <= end + report.window)]
    if after.size:
        _draw_envelope(axis, report, end, after)
    axis.set_ylabel('measured − planned [mrad]')
    axis.legend(loc='best', fontsize=8)


def _draw_envelope(axis: Axes, report: VibrationReport, end: float, after: FloatArray) -> None:
    """Draw the envelope of the oscillation after the motion, if one was fitted."""
    fit = report.fit
    if fit.amplitude is None or fit.decay is None or fit.bias is None or fit.drift is None:
        return
    times = np.linspace(end, after[-1], 200)
    envelope = fit.amplitude * np.exp(-fit.decay * (times - end))
    middle = fit.bias + fit.drift * (times - 0.5 * (after[0] + after[-1]))
    label = f'envelope fitted to {report.joint}'
    axis.plot(times, MILLI * (middle + envelope), color='C3', linewidth=1.0, label=label)
    axis.plot(times, MILLI * (middle - envelope), color='C3', linewidth=1.0)
    axis.plot(end, MILLI * (middle[0] + envelope[0]), 'o', color='C3', markersize=4)


def _draw_efforts(
    axis: Axes, motion: PlannedMotion, elapsed: FloatArray, efforts: FloatArray
) -> None:
    """Draw the efforts of the actuated joints."""
    for joint, name in enumerate(motion.joint_names[:-1]):
        if np.isfinite(efforts[:, joint]).any():
            _plot(axis, elapsed, efforts[:, joint], color=f'C{joint}', label=f'{name} measured')
        if motion.efforts is not None:
            axis.plot(motion.times, motion.efforts[:, joint], '--', color='black', linewidth=0.9)
    if motion.efforts is not None:
        axis.plot([], [], '--', color='black', linewidth=0.9, label='planned')
    axis.set_ylabel('effort [N m]')
    if axis.get_legend_handles_labels()[0]:
        axis.legend(loc='best', fontsize=8)


def _draw_tracked(axis: Axes, motion: PlannedMotion, tracked: Sent) -> None:
    """Draw what a tracker has sent; its distance from the plan is what feedback has added."""
    times, efforts = tracked
    for joint, name in enumerate(motion.joint_names[:-1][: efforts.shape[1]]):
        style = {'color': f'C{joint + 3}', 'linewidth': 0.8}
        _plot(axis, times - motion.start, efforts[:, joint], label=f'{name} tracker', **style)
    if times.size:
        axis.legend(loc='best', fontsize=8)


def _plot(axis: Axes, times: FloatArray, values: FloatArray, **style: Any) -> None:
    """Draw a line that breaks where samples were lost."""
    axis.plot(*with_gaps(times, values), **style)


def _title(report: VibrationReport) -> str:
    """Return the verdict in lines that fit."""
    return fill(f'{report.level.value.upper()}: {report.message}', TITLE_WIDTH)
