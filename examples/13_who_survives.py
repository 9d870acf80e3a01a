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

"""
Who survives ±25 %? Every strategy, on motors and on servos, with and without a tracker.

A study plans each motion once for the model and carries it out on arms whose spring is up to 25 %
softer or stiffer. Its table is made by the program `study`, from a specification as short as the
question; here it becomes one picture. Needs rclpy, as the programs read parameters with it.
"""

import csv
from pathlib import Path
import sys
from tempfile import TemporaryDirectory

from flat_planner_ros.ros.study import program
from matplotlib import pyplot as plt
import numpy as np

SPEC = """
study:
  set:
    goal.joint1: pi
    duration: 1.0
    insensitivity.stiffness: 0.25
  axes:
    strategy: [polynomial, min_control_effort, min_potential_energy, min_peak_effort, insensitive]
    loop:
      - {drive: effort, tracker: false}
      - {drive: effort, tracker: true}
      - {drive: position, tracker: false}
    plant.mismatch.stiffness_scale: {from: 0.75, to: 1.25, count: 9}
"""

SURVIVES = 0.05
"""Oscillation with which a motion has survived [rad]."""

LOOPS = {
    ('effort', 'false'): 'motors, efforts alone',
    ('effort', 'true'): 'motors and a tracker',
    ('position', 'false'): 'position servos',
}
STYLES = ('o-', 's--', '^-.', 'D:', 'v-')
COLOURS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#000000')

with TemporaryDirectory() as folder:
    spec, output = Path(folder, 'survivors.yaml'), Path(folder, 'survivors.csv')
    spec.write_text(SPEC, encoding='utf-8')
    assert program.main([str(spec), '-o', str(output)]) == 0
    with output.open(encoding='utf-8') as file:
        rows = list(csv.DictReader(file))

survivors = {}
figure, axes = plt.subplots(1, len(LOOPS), figsize=(11.0, 4.2), sharey=True)
for axis, (loop, title) in zip(axes, LOOPS.items(), strict=True):
    here = [row for row in rows if (row['drive'], row['tracker']) == loop]
    names = list(dict.fromkeys(row['strategy'] for row in here))
    for name, style, colour in zip(names, STYLES, COLOURS, strict=True):
        table = np.array(
            [
                (float(row['plant.mismatch.stiffness_scale']), float(row['simulated_residual']))
                for row in here
                if row['strategy'] == name
            ]
        )
        survivors[title, name] = float(np.mean(table[:, 1] < SURVIVES))
        axis.semilogy(*table.T, style, color=colour, markersize=4, label=name)
        print(f'{title:22} {name:22} {100.0 * survivors[title, name]:4.0f} % survive')
    axis.axhline(SURVIVES, color='gray', linewidth=1.0)
    axis.set_title(title, fontsize=10)
    axis.set_xlabel('true stiffness over that of the model [-]')
    axis.grid(alpha=0.3)
axes[0].set_ylabel('oscillation left [rad]')
axes[0].set_ylim(1e-4, 1.0)
figure.legend(*axes[0].get_legend_handles_labels(), frameon=False, ncols=5, loc='lower center')
figure.tight_layout(rect=(0.0, 0.06, 1.0, 1.0))
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_suffix('.png'), dpi=100)
