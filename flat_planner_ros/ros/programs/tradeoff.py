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
Effort against residual oscillation of the arm in a parameter file, as a picture and as numbers.

Draws what the strategies, input shaping and the sweep of `insensitive` need and leave behind, for
one motion and for longer ones. No node has to run.
"""

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Sequence
from contextlib import redirect_stdout
import csv
from dataclasses import astuple, fields
from pathlib import Path
import sys

from flat_planner_ros.core.arm import FlatModel, FlatPlannerError
from flat_planner_ros.core.planning import (
    fastest_points,
    MotionRequest,
    PlanningOptions,
    tradeoff_points,
    TradeoffPoint,
)
from flat_planner_ros.ros.parameters import planner as planner_parameters
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.programs.command_line import (
    explain_os,
    figure_name,
    joint_angle,
    JointAngles,
    missing_for_plot,
    number_above_zero,
    parsed,
    pose_of,
    seconds,
)
from flat_planner_ros.ros.programs.outputs import (
    check_writable,
    open_text,
    summary_stream,
    write_through,
)
from flat_planner_ros.ros.programs.progress import progress
from flat_planner_ros.ros.wire import interfaces

STRETCHES = (1.0, 1.1, 1.25, 1.5)
"""Durations of the sweeps unless others are asked for, over that of the motion [-]."""

EXAMPLES = """\
examples:
  tradeoff joint1=3.14 --duration 1 --plot tradeoff.png
  tradeoff joint1=3.14 --duration 1 --max-effort 0.015 --plot fastest.png
  tradeoff joint1=1.5 --params-file arm.yaml --duration 0.8 --csv tradeoff.csv
  tradeoff joint1=3.14 --duration 1 --stretch 1 1.05 -p insensitivity.stiffness:=0.2
"""


def main(args: Sequence[str] | None = None) -> int:
    """
    Compute, print and draw.

    Returns
    -------
    int
        0 when all is written, 1 when something is wrong with the input, 2 for a wrong option.

    """
    options = _options(args)
    try:
        check_writable(options.csv, options.plot)
        points, fastest, box = _points(options)
        with redirect_stdout(summary_stream(options.csv, options.plot)):
            _print(points, box)
            if fastest:
                print(f'shortest within {options.max_effort:g} N m:')
                for point in fastest:
                    print(_line(point))
        if options.csv is not None:
            _write_csv([*points, *fastest], options.csv)
        if options.plot is not None:
            # Imported here: matplotlib is an extra.
            from flat_planner_ros.figures.tradeoff_figure import draw

            write_through(
                options.plot,
                lambda path: draw(points, box, path, fastest, options.max_effort or 0.0),
                '.png',
            )
            print(f'figure: {options.plot}', file=sys.stderr)
    except FlatPlannerError as error:
        print(f'tradeoff: {error}', file=sys.stderr)
        return 1
    except OSError as error:
        print(f'tradeoff: {explain_os(error)}', file=sys.stderr)
        return 1
    return 0


def _options(args: Sequence[str] | None) -> Namespace:
    """Return the command line's options."""
    parser = ArgumentParser(
        prog='tradeoff',
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        '--params-file', metavar='FILE', type=Path, help='of the planner node; else its defaults'
    )
    parser.add_argument(
        '-p',
        '--parameter',
        metavar='NAME:=VALUE',
        action='append',
        default=[],
        help='another value of a parameter of the planner node; may be repeated',
    )
    parser.add_argument(
        'goal',
        nargs='+',
        action=JointAngles,
        type=joint_angle,
        metavar='JOINT=RAD',
        help='final angle of a joint [rad]',
    )
    parser.add_argument(
        '--start',
        nargs='+',
        action=JointAngles,
        default={},
        type=joint_angle,
        metavar='JOINT=RAD',
        help='where joints start, at rest (default: 0); others stay there',
    )
    parser.add_argument(
        '--namespace', default='', help="of the planner, for files with a namespace's blocks"
    )
    parser.add_argument(
        '--duration', metavar='S', type=seconds, required=True, help='of the motion'
    )
    parser.add_argument(
        '--max-effort',
        metavar='N_M',
        type=number_above_zero,
        help='also show the shortest motions within this effort, and what they leave',
    )
    parser.add_argument(
        '--stretch',
        metavar='RATIO',
        type=number_above_zero,
        nargs='+',
        default=STRETCHES,
        help='durations of the sweeps over that of the motion (default: 1 1.1 1.25 1.5)',
    )
    parser.add_argument(
        '--plot', metavar='FILE', type=figure_name, help='picture, .png, .pdf or .svg, or -'
    )
    parser.add_argument('--csv', metavar='FILE', help='the numbers, or -')
    options = parsed(parser, args, ['csv', 'plot'])
    if missing := missing_for_plot(options.plot):
        parser.error(missing)
    return options


def _points(
    options: Namespace,
) -> tuple[tuple[TradeoffPoint, ...], tuple[TradeoffPoint, ...], str]:
    """Return all points, the fastest within a limit, and the uncertainty in words."""
    settings = read_settings(
        options.params_file,
        planner_parameters.ROWS,
        planner_parameters.build,
        node=f'{options.namespace}/{interfaces.PLANNER}',
        overrides=options.parameter,
        warn=lambda text: print(f'tradeoff: {text}', file=sys.stderr),
    ).session
    arm, planning = settings.arm, settings.options
    start = pose_of(options.start, settings.joints, '--start')
    final = pose_of({**options.start, **options.goal}, settings.joints, 'goal')
    if (start == final).all():
        raise FlatPlannerError('the goal is where the arm starts: there is nothing to compare')
    request = MotionRequest(start=start, final=final, duration=options.duration)
    wanted = PlanningOptions(
        effort_weight=planning.effort_weight,
        energy_weight=planning.energy_weight,
        r=planning.r,
        p=planning.p,
        flat_model=FlatModel.EXACT,
        insensitivity=planning.insensitivity,
        drive=planning.drive,
        peak=planning.peak,
    )
    fastest: tuple[TradeoffPoint, ...] = ()
    if options.max_effort is not None:
        fastest = fastest_points(request, arm, wanted, options.max_effort)
    text = str(planning.insensitivity.box).replace('+-', '±')
    with progress(1.0, 'tradeoff') as advance:
        points = tradeoff_points(request, arm, wanted, stretches=options.stretch, advance=advance)
    return points, fastest, text


def _print(points: Sequence[TradeoffPoint], box: str) -> None:
    """Print what is no sweep, and the nearest of each sweep to it."""
    print(f'worst residual over {box}')
    head = ' | duration [s] | RMS effort [N m] | nominal [rad] | worst [rad]'
    print(' ' + 'method'.ljust(33) + head)
    print('+'.join('-' * width for width in (35, 14, 18, 15, 12)))
    for point in points:
        if point.weight == 0.0:
            print(_line(point))
    reference = next(point for point in points if point.weight == 0.0)
    print(
        f'insensitive, with at most the effort of {reference.series} ({reference.rms_effort:.4g}):'
    )
    for name, duration in dict.fromkeys((p.series, p.duration) for p in points if p.weight > 0.0):
        within = [
            p
            for p in points
            if (p.series, p.duration) == (name, duration)
            and p.weight > 0.0
            and p.rms_effort <= reference.rms_effort
        ]
        if within:
            print(_line(min(within, key=lambda p: p.worst)))


def _line(point: TradeoffPoint) -> str:
    """Return a row of the table."""
    return (
        f' {point.series:<33} | {point.duration:<12.4g} | {point.rms_effort:<16.4g} | '
        f'{point.nominal:<13.2g} | {point.worst:.4g}'
    )


def _write_csv(points: Sequence[TradeoffPoint], name: str) -> None:
    """Write all numbers."""
    with open_text(name) as file:
        writer = csv.writer(file)
        writer.writerow([field.name for field in fields(TradeoffPoint)])
        writer.writerows(astuple(point) for point in points)
    print(f'numbers: {name}', file=sys.stderr)


if __name__ == '__main__':
    sys.exit(main())
