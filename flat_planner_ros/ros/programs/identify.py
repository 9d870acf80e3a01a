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

"""The model of an arm from recordings of its motions: fitted, told, drawn and written."""

from argparse import ArgumentParser
from collections.abc import Sequence
from pathlib import Path
import sys

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.core.model_fit import fit_model, Trust
from flat_planner_ros.ros.parameters import planner as planner_parameters
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.programs.command_line import (
    explain_missing,
    explain_os,
    missing_for_plot,
    parsed,
)
from flat_planner_ros.ros.programs.fit_outputs import add_files, write_files
from flat_planner_ros.ros.programs.outputs import check_writable, summary_stream
from flat_planner_ros.ros.programs.progress import progress
from flat_planner_ros.ros.wire import interfaces


def main(args: Sequence[str] | None = None) -> int:
    """
    Identify an arm.

    Returns
    -------
    int
        0 with a model that explains the motions, 1 without.

    """
    options = parsed(_parser(), (sys.argv if args is None else args)[1:], ['output', 'plot'])
    missing = missing_for_plot(options.plot)
    if missing:
        print(missing, file=sys.stderr)
        return 1
    try:
        from flat_planner_ros.ros.recording.measured import measured
    except ImportError as error:
        return explain_missing(error, 'record')
    node = f'{options.namespace.strip("/")}/{interfaces.PLANNER}'
    try:
        check_writable(options.output, options.plot)
        settings = read_settings(
            options.params_file,
            planner_parameters.ROWS,
            planner_parameters.build,
            node=node,
            warn=lambda text: print(f'identify: {text}', file=sys.stderr),
        ).session
        with progress(len(options.files), 'identify') as advance:
            found = measured(
                options.files,
                settings.joints,
                namespace=options.namespace,
                topic=options.joint_states,
                advance=advance,
            )
        fit = fit_model(found, settings.arm, trust=Trust(options.trust), with_imbalance=True)
        print(fit.text, file=summary_stream(options.output, options.plot))
        write_files(options, settings.arm, found, fit)
    except FlatPlannerError as error:
        print(f'identify: {error}', file=sys.stderr)
        return 1
    except OSError as error:
        print(f'identify: {explain_os(error)}', file=sys.stderr)
        return 1
    return 1 if fit.misfit else 0


def _parser() -> ArgumentParser:
    """Return the parser of the command line."""
    parser = ArgumentParser(
        prog='identify',
        description='Fit the model of an arm to recorded joint states with efforts.',
    )
    add = parser.add_argument
    add('files', metavar='FILE', nargs='+', type=Path, help='recordings, as for analyse, or .csv')
    add_files(parser, 'parameter file with the model as believed so far')
    add(
        '--trust',
        choices=[trust.value for trust in Trust],
        default=Trust.EFFORT.value,
        help='what sets the scale: the measured efforts, or the inertia in the file',
    )
    add('--namespace', default='', metavar='NS', help='of the nodes, e.g. /arm1')
    add('--joint-states', default='', metavar='TOPIC', help='measured JointState')
    return parser


if __name__ == '__main__':
    sys.exit(main())
