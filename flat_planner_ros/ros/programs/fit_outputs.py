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

"""What programs that fit a model take and write: parameter files, and a picture of the fit."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.model_fit import Measurements, ModelFit
from flat_planner_ros.ros.parameters.fitted_file import write_fitted
from flat_planner_ros.ros.programs.command_line import figure_name
from flat_planner_ros.ros.programs.outputs import write_through


def add_files(parser: ArgumentParser, believed: str) -> None:
    """
    Add the options that name files.

    Parameters
    ----------
    parser
        Gets `--params-file`, `--output` and `--plot`.
    believed
        What the parameter file is, for the help.

    """
    add = parser.add_argument
    add('--params-file', metavar='FILE', type=Path, required=True, help=believed)
    add('-o', '--output', metavar='FILE', help='parameter file to write, or -')
    add(
        '--plot',
        metavar='FILE',
        type=figure_name,
        help='measured and simulated motion, .png, .pdf or .svg, or -',
    )


def write_files(
    options: Namespace, arm: PlanarArm, measurements: Measurements, fit: ModelFit
) -> None:
    """
    Write the files that are asked for.

    Parameters
    ----------
    options
        Of a parser with `add_files`.
    arm
        As believed.
    measurements, fit
        What was measured, and the model found from it.

    Raises
    ------
    NotWritten
        A file cannot be written.

    """
    if options.plot is not None:
        # Imported here: matplotlib is an extra.
        from flat_planner_ros.figures.fit_figure import draw_fit

        write_through(options.plot, lambda path: draw_fit(measurements, fit, path), '.png')
    if options.output is not None:
        write_through(
            options.output,
            lambda path: write_fitted(options.params_file, fit, arm, path),
            '.yaml',
        )
