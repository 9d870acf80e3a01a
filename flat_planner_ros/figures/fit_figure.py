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

"""Measured against simulated motion of a fitted model."""

from pathlib import Path

from flat_planner_ros.core.model_fit import Measurements, ModelFit
from flat_planner_ros.figures.file_plot import plt
import numpy as np

MILLI = 1e3
"""Residuals are drawn in mrad."""


def draw_fit(measurements: Measurements, fit: ModelFit, path: Path) -> None:
    """
    Write a figure: both angles as measured and as simulated, what is left, what is not told.

    Parameters
    ----------
    measurements, fit
        What was measured, and the model that was fitted to it.
    path
        File, of a kind that matplotlib knows.

    """
    angles = np.cumsum(measurements.positions, axis=1)
    seen = np.column_stack((angles[:, -2], measurements.positions[:, -1]))
    times = fit.times - fit.times[0]
    figure, axes = plt.subplots(3, 1, sharex=True, figsize=(8.0, 8.0), layout='constrained')
    for axis, column, name in zip(axes, range(2), ('link n-1', 'passive joint'), strict=False):
        axis.plot(times, seen[:, column], color=f'C{column}', label='measured')
        axis.plot(
            times, seen[:, column] + fit.residuals[:, column], '--', color='black', label='model'
        )
        axis.set_ylabel(f'{name} [rad]')
        axis.legend(frameon=False)
    for column, name in enumerate(('link n-1', 'passive joint')):
        axes[2].plot(
            times, MILLI * fit.residuals[:, column], color=f'C{column}', linewidth=0.8, label=name
        )
    axes[2].set_ylabel('model − measured [mrad]')
    axes[2].set_xlabel('time [s]')
    axes[2].legend(frameon=False)
    for axis in axes:
        axis.grid(alpha=0.3)
    untold = ', '.join(each.name for each in fit.estimates if not each.is_told)
    verdict = fit.misfit or 'noise explains what the model leaves'
    figure.suptitle(f'{verdict}\nnot told: {untold or "nothing"}', fontsize=9, wrap=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
