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

"""Plan a motion on the command line, without a ROS graph."""

from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Mapping, Sequence
import csv
from dataclasses import replace
from itertools import chain
import json
import sys
from time import perf_counter
from typing import TextIO

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.core.planning import Plan, Reason, RequestRejected
from flat_planner_ros.core.session import (
    Goal,
    Motion,
    PlannerSession,
    SessionSettings,
    single_goal,
    Track,
)
from flat_planner_ros.ros.parameters.idle import idle_parameters
from flat_planner_ros.ros.parameters.parameter_file import ASSIGNMENT, read_settings
from flat_planner_ros.ros.parameters.planner import build, ROWS
from flat_planner_ros.ros.programs.angles import FORMS
from flat_planner_ros.ros.programs.command_line import (
    animation_name,
    explain_os,
    figure_name,
    joint_angle,
    JointAngles,
    missing_for_plot,
    parsed,
    pose_of,
    seconds,
    via_point,
)
from flat_planner_ros.ros.programs.outputs import (
    check_writable,
    open_text,
    summary_stream,
    write_through,
)
from flat_planner_ros.ros.wire import diagnostics, interfaces
from flat_planner_ros.ros.wire.verdict_text import told, unit_of

EXAMPLES = """
examples:
  flat_plan joint1=pi --duration 1
      the paper's arm, least effort
  flat_plan joint1=90deg --duration 0.8 --params-file my_arm.yaml --plot plan.png
      your own arm, with a figure
  flat_plan joint1=3.14159 --duration 1 -p strategy:=mixed -p weights.energy:=2.0 --csv plan.csv
      another strategy, as points every sampling.period
  flat_plan joint1=pi --duration 1 --animate turn.gif
      the arm in motion, with and without regard to its elastic joint
  flat_plan joint1=1 joint2=0.5 --start joint1=-1 --params-file arm_3dof.yaml --duration 2
      from another start; joints that are not named stay where they are
  flat_plan joint1=2 --duration 2 --via 'joint1=1.5@0.8' --json -
      through a via point at 0.8 s; the numbers as JSON
"""

NOW = 1.0
"""Any time will do for a plan that nobody carries out [s]."""

QUANTITIES = {
    'positions': 'position {} [rad]',
    'velocities': 'velocity {} [rad/s]',
    'accelerations': 'acceleration {} [rad/s^2]',
    'efforts': 'effort {} [N m]',
}
"""Tables of a plan, in the order of a trajectory message, with the titles of their columns."""


def main(args: Sequence[str] | None = None) -> int:
    """
    Plan and print.

    Returns
    -------
    int
        0 if there is a plan, 1 if the goal or the parameters are refused, 2 for a wrong call.

    """
    options = parsed(_parser(), args, ['csv', 'json', 'plot', 'animate'])
    if missing := missing_for_plot(options.plot, options.animate):
        print(f'flat_plan: {missing}', file=sys.stderr)
        return 1
    try:
        check_writable(options.csv, options.json, options.plot, options.animate)
        settings = read_settings(
            options.params_file,
            ROWS,
            build,
            node=f'{options.namespace}/{interfaces.PLANNER}',
            overrides=options.parameter,
            warn=lambda text: print(f'flat_plan: {text}', file=sys.stderr),
        )
        names = [text.partition(ASSIGNMENT)[0] for text in options.parameter]
        for remark in idle_parameters(names, settings.session.options.strategy):
            print(f'flat_plan: {remark}', file=sys.stderr)
        session, goal = _task(settings.session, options)
        started = perf_counter()
        motion = session.submit(goal, NOW)
        elapsed = perf_counter() - started
        track = session.track(NOW)
        joints = settings.session.joints
        status = diagnostics.accepted_status(motion, goal, joints, elapsed)
        values = {pair.key: pair.value for pair in status.values}
        for remark in told(motion):
            print(f'flat_plan: {remark}', file=sys.stderr)
        _print_summary(motion, values, summary_stream(options.csv, options.json, options.plot))
        _write(options, joints, track, values)
        if options.animate:
            _animate(options, motion.plan)
    except RequestRejected as error:
        code = interfaces.ERROR_CODES[error.reason]
        hint = '; here: --duration' if options.duration == 0.0 and error.value is None else ''
        hint = hint if error.reason is Reason.DURATION_OUT_OF_RANGE else ''
        print(f'flat_plan: {error.reason.value} ({code}): {error}{hint}', file=sys.stderr)
        return 1
    except FlatPlannerError as error:
        print(f'flat_plan: {error}', file=sys.stderr)
        return 1
    except OSError as error:
        print(f'flat_plan: {explain_os(error)}', file=sys.stderr)
        return 1
    return 0


def _parser() -> ArgumentParser:
    """Return the command line."""
    parser = ArgumentParser(
        prog='flat_plan',
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        'goal',
        nargs='+',
        action=JointAngles,
        type=joint_angle,
        metavar='JOINT=RAD',
        help=f'final angle of a joint [rad], as {FORMS}',
    )
    parser.add_argument(
        '--duration',
        type=seconds,
        default=0.0,
        metavar='S',
        help='of the motion [s]; without it, as the parameters say (duration.default, limits)',
    )
    parser.add_argument(
        '--start',
        nargs='+',
        action=JointAngles,
        default={},
        type=joint_angle,
        metavar='JOINT=RAD',
        help='where joints start, at rest (default: 0)',
    )
    parser.add_argument(
        '--via',
        action='append',
        default=[],
        type=via_point,
        metavar='JOINT=RAD[,JOINT=RAD…][@S]',
        help='point to pass, at a time, or all points where the planner chooses; may be repeated',
    )
    parser.add_argument('--params-file', metavar='FILE', help="default: the paper's arm")
    parser.add_argument(
        '-p',
        '--parameter',
        action='append',
        default=[],
        metavar='NAME:=VALUE',
        help='parameter of the planner, before the file; may be repeated',
    )
    parser.add_argument(
        '--namespace', default='', help="of the planner, for files with a namespace's blocks"
    )
    output = parser.add_argument_group('output, besides the summary; - is standard output')
    output.add_argument('--csv', metavar='FILE', help='points every sampling.period')
    output.add_argument('--json', metavar='FILE', help='summary and points')
    output.add_argument(
        '--plot',
        metavar='FILE',
        type=figure_name,
        help='figure of the motion, .png, .pdf or .svg (needs matplotlib)',
    )
    output.add_argument(
        '--animate',
        metavar='FILE',
        type=animation_name,
        help='moving picture, .gif, or .mp4 with ffmpeg: the simulated arm, beside a turn with '
        'the torque for a stiff joint',
    )
    return parser


def _task(settings: SessionSettings, options: Namespace) -> tuple[PlannerSession, Goal]:
    """Return a planner at rest at the start, and the goal."""
    times = [*(time for _, time in options.via), options.duration]
    if options.via and any(times[:-1]) != all(times):
        raise FlatPlannerError(
            'give every --via a time, as joint1=0.5@0.8, and --duration; or no --via a time'
        )
    angles = pose_of(options.start, settings.joints, '--start')
    start = dict(zip(settings.joints, angles.tolist(), strict=True))
    poses = [start]
    for changes in [*(pose for pose, _ in options.via), options.goal]:
        poses.append({**poses[-1], **changes})
    return single_goal(settings, poses, times)


def _print_summary(motion: Motion, values: Mapping[str, str], file: TextIO) -> None:
    """Print what the verdict on a goal says, less what only matters in motion."""
    left_out = {'plan_id', 'state', 'error_code', 'error_name', 'start_time'}
    plan = motion.plan
    print(f'{plan.options.strategy.value}, {plan.duration:g} s', file=file)
    shown = {
        key: value
        for key, value in values.items()
        if key not in left_out and not key.startswith('goal.')
    }
    width = max(map(len, shown))
    for key, value in shown.items():
        unit = unit_of(key)
        print(f'  {key:{width}}  {value}{" " if unit else ""}{unit}', file=file)


def _write(
    options: Namespace, joints: Sequence[str], track: Track, values: Mapping[str, str]
) -> None:
    """Write the files that are asked for."""
    if options.csv:
        with open_text(options.csv) as file:
            writer = csv.writer(file)
            titles = [title.format(name) for title in QUANTITIES.values() for name in joints]
            writer.writerow(['time [s]', *titles])
            tables = [getattr(track, quantity) for quantity in QUANTITIES]
            for index, time in enumerate(track.times.tolist()):
                writer.writerow([time, *chain(*(table[index].tolist() for table in tables))])
    if options.json:
        content = {
            'summary': {key: _number(value) for key, value in values.items()},
            'joints': list(joints),
            'times': track.times.tolist(),
            **{quantity: getattr(track, quantity).tolist() for quantity in QUANTITIES},
        }
        with open_text(options.json) as file:
            print(json.dumps(content), file=file)
    if options.plot:
        # Imported here: matplotlib is an extra.
        from flat_planner_ros.figures.plan_figure import draw_plan

        write_through(options.plot, lambda path: draw_plan(track, joints, path), '.png')


def _animate(options: Namespace, plan: Plan) -> None:
    """Write the plan as the plant of the same file would play it if it were as planned."""
    # Imported here: matplotlib is an extra.
    from flat_planner_ros.figures.animation import animate
    from flat_planner_ros.figures.plan_animation import plan_scenes
    from flat_planner_ros.ros.parameters import plant

    settings = read_settings(
        options.params_file,
        plant.ROWS,
        plant.build,
        node=f'{options.namespace}/{interfaces.PLANT}',
    )
    drives = replace(settings.simulation.drives, drive=plan.options.drive)
    scenes = plan_scenes(plan, drives)
    write_through(options.animate, lambda path: animate(scenes, path), '.gif')


def _number(text: str) -> float | str:
    """Return a value as a number where it is one."""
    try:
        return float(text)
    except ValueError:
        return text


if __name__ == '__main__':
    sys.exit(main())
