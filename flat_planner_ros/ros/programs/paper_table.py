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

"""The paper's experiment on the real nodes: table, figures and numbers."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
from contextlib import redirect_stdout
import csv
from itertools import groupby
import os
from pathlib import Path
import sys
from threading import Event

from flat_planner_ros.core.arm import Drive
from flat_planner_ros.figures.paper_example import (
    BEYOND,
    CASES,
    EXACT,
    Method,
    Result,
    Scenario,
    TRACKED,
)
from flat_planner_ros.programs import INTERRUPTED
from flat_planner_ros.ros.dds_profile import profile_environment
from flat_planner_ros.ros.nodes.node_runner import signals_caught
from flat_planner_ros.ros.programs.command_line import (
    explain_os,
    figure_name,
    missing_for_plot,
    parsed,
)
from flat_planner_ros.ros.programs.outputs import (
    NotWritten,
    open_text,
    summary_stream,
    write_through,
)
from flat_planner_ros.ros.programs.paper_company import refuse_company
from flat_planner_ros.ros.programs.paper_experiment import Experimenter
from flat_planner_ros.ros.programs.paper_nodes import (
    node_processes,
    planned_nodes,
    tracked_nodes,
)
from flat_planner_ros.ros.programs.played_motion import (
    ExperimentFailed,
    Interrupted,
    NotFound,
    TooBusy,
)
from flat_planner_ros.ros.programs.progress import progress
from flat_planner_ros.ros.programs.tracked_experiment import TrackedExperimenter
import rclpy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

SPEED = 5.0
"""Simulated seconds per second unless in real time; a busy machine is slower by itself."""

TRACKED_SPEED = 0.5
"""The same with the tracker, whose loop has so much more time for a sample of its own."""

SLOWER, SLOWEST = 0.4, 0.1
"""What a machine that does not keep up is given: speeds of that ratio, down to about the least."""

STARTS = 3
"""How often nodes are started, in all, that do not find each other."""

SHOWN_AS_DECIMAL = 1e-4
"""Amplitude from which the table shows decimals rather than an exponent [rad]."""

COLUMNS = (
    'scenario',
    'strategy',
    'rms_effort',
    'amplitude',
    'paper_rms_effort',
    'paper_amplitude',
    'miss',
    'settling_time',
    'peak_ratio',
)

HEADER = """
          |                       | RMS effort [N m]  | amplitude at T [rad]
 scenario | strategy              |   ours  |  paper  |    ours    |  paper
----------+-----------------------+---------+---------+------------+--------"""

REMARKS = """
Where ours and the paper's differ, and why (docs/paper_errata.md):
- RMS effort: ours is the root mean square over time of the planned torque. The paper's column
  cannot be one: it falls from scenario 1 to 2, while damping can only raise it, and below
  0.00697 N m no torque moves this arm by pi in 1 s.
- Amplitude, scenario 1: the law is exact without damping; what is left, below 2e-5 rad, comes
  from playing it in steps of 5 ms.
- Amplitude, scenarios 2 and 3: within 2 % of the paper's rounded numbers, and within 1 % of a
  plant integrated to high precision under the unsampled torque."""


BEYOND_REMARKS = """
Beyond the paper (docs/derivation.md, sections 3, 8.1 and I); scenario 4 is scenario 3 with -10 %:
- exact: min_control_effort on the exact flat map. Damping leaves nothing, a mismatch what it must.
- insensitive: exact too, and small over all stiffness and damping within 10 %, for more effort.
- self-tuned: the second of two exact motions, planned with the stiffness and damping that the
  monitor has read from the oscillation after the first.
- tracked: exact, with the tracker around it at 500 Hz (encoders of 14 bits); amplitude: largest
  swing after T."""


TRACKED_REMARKS = """
With the tracker (docs/closed_loop.md), also on arms that differ further: k and c +25 % (5) and
-25 % (6), all inertias +10 % (7) and -10 % (8), friction 2e-4 N m s/rad and 5e-4 N m (9). Distance
of joint 1 from its goal at T; time after T until swing and distance stay below 5 mrad, - where
that is not seen; peak of the effort, relative to the planned one:"""

TRACKED_HEADER = """
          |                       |  distance at T | settled | peak
 scenario | strategy              |      [rad]     |   [s]   | [-]
----------+-----------------------+----------------+---------+------"""


SERVO_REMARKS = """
With servos, which the paper does not have (docs/derivation.md, I.7): joint 1 follows the planned
angles whatever it takes, and the passive joint swings against a link that is held.
- RMS effort: of the planned torque, which a servo needs if the arm is as modelled.
- Amplitude: nothing on an arm as modelled without damping, or planned by the exact flat map."""


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the experiment.

    Returns
    -------
    int
        0 when the table is complete, 1 when something failed, 130 after Ctrl-C.

    """
    options = _options(remove_ros_args(args if args is not None else sys.argv)[1:])
    summary = summary_stream(options.csv, options.plot)
    if missing := missing_for_plot(options.plot):
        print(missing, file=sys.stderr)
        return 1
    for path in (options.plot, options.csv):
        if path is not None and not Path(path).parent.is_dir():
            print(f'paper_table: no directory {Path(path).parent} for {path}', file=sys.stderr)
            return 1
    speed = 1.0 if options.real_time else SPEED
    cases = _cases(options)
    if not cases:
        print('paper_table: no row is of these scenarios', file=sys.stderr)
        return 1
    # At once, for whoever waits at the end of a pipe.
    about = f'{len(cases)} motions, {speed:g} times as fast as in real time'
    print(about, file=summary, flush=True)
    try:
        with signals_caught() as interrupted, redirect_stdout(summary):
            arguments = None if args is None else list(args)
            os.environ.update(profile_environment(os.environ))  # for the nodes, too
            rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
            refuse_company(interrupted)
            results = _results(speed, cases, interrupted, Drive(options.drive))
        remarks = SERVO_REMARKS if options.drive == Drive.POSITION.value else REMARKS
        print(remarks, file=summary, flush=True)
        if options.beyond:
            print(BEYOND_REMARKS, file=summary, flush=True)
        if feedback := _feedback_rows(results):
            print(TRACKED_REMARKS, TRACKED_HEADER, *feedback, file=summary, sep='\n', flush=True)
        if options.csv is not None:
            _write_csv(results, options.csv)
        if options.plot is not None:
            _draw(results, options.plot)
    except (ExperimentFailed, NotWritten) as error:
        print(f'paper_table: {error}', file=sys.stderr)
        return 1
    except OSError as error:
        print(f'paper_table: {explain_os(error)}', file=sys.stderr)
        return 1
    except Interrupted:
        print('interrupted', file=sys.stderr)
        return INTERRUPTED
    finally:
        rclpy.try_shutdown()
    return 0


def _options(arguments: Sequence[str]) -> Namespace:
    """Return the command line's options."""
    parser = ArgumentParser(prog='paper_table', description=__doc__)
    parser.add_argument(
        '--beyond',
        action='store_true',
        help='add a plant that is 10 %% softer, and what the paper does not have: exact and '
        'insensitive motions, a second motion after self-tuning, and what the tracker leaves',
    )
    parser.add_argument(
        '--scenario',
        nargs='+',
        type=int,
        metavar='N',
        choices=sorted({scenario.number for scenario, _ in BEYOND}),
        help='only these: the paper has 1 to 3; 4 to 9 with --beyond',
    )
    parser.add_argument(
        '--drive',
        choices=[drive.value for drive in Drive],
        default=Drive.EFFORT.value,
        help='what joint 1 is given in all nodes: the paper gives an effort',
    )
    parser.add_argument(
        '--plot', metavar='FILE', type=figure_name, help='figures, .png, .pdf or .svg, or -'
    )
    parser.add_argument('--csv', metavar='FILE', help='the numbers, or -')
    parser.add_argument(
        '--real-time',
        action='store_true',
        help=f'run the plant in real time instead of {SPEED:g} times faster',
    )
    return parsed(parser, arguments, ['csv', 'plot'])


def _cases(options: Namespace) -> list[tuple[Scenario, Method]]:
    """Return what is to be carried out."""
    return [
        (scenario, method)
        for scenario, method in (BEYOND if options.beyond else CASES)
        if (not options.scenario or scenario.number in options.scenario)
        # The tracker sends efforts, which a servo does not take.
        and not (method.is_tracked and options.drive == Drive.POSITION.value)
    ]


def _results(
    speed: float, cases: Sequence[tuple[Scenario, Method]], interrupted: Event, drive: Drive
) -> list[Result]:
    """Return the rows, printed as they come."""
    results: list[Result] = []
    starts = STARTS
    print('starting the nodes ...', flush=True)
    with progress(len(cases), 'paper_table') as advance:
        for (is_tracked, *_), group in groupby(cases, _setup):
            rows = list(group)
            pace = min(speed, TRACKED_SPEED) if is_tracked and speed > 1.0 else speed
            while rows:
                try:
                    for result in _carried_out(rows, pace, interrupted, drive):
                        if not results:
                            print(HEADER, flush=True)
                        print(_row(result), flush=True)
                        results.append(result)
                        del rows[0]
                        advance(1)
                except NotFound as reason:
                    starts -= 1
                    if not starts:
                        raise
                    print(f'{reason}; the nodes are started again', file=sys.stderr)
                except TooBusy as reason:
                    if speed == 1.0 or pace < SLOWEST:
                        raise
                    pace *= SLOWER
                    print(f'{reason}; {pace:g} times as fast', file=sys.stderr)
    return results


def _carried_out(
    cases: Sequence[tuple[Scenario, Method]], speed: float, interrupted: Event, drive: Drive
) -> Iterator[Result]:
    """Yield the results of cases that share their nodes."""
    scenario, method = cases[0]
    is_tracked = method.is_tracked
    parameters = tracked_nodes(speed, scenario) if is_tracked else planned_nodes(speed, drive)
    kind = TrackedExperimenter if is_tracked else Experimenter
    with node_processes(parameters) as processes:
        experimenter = kind(speed, processes, interrupted, drive)
        try:
            experimenter.wait_for_nodes()
            yield from (experimenter.run(*case) for case in tuple(cases))
        finally:
            experimenter.destroy_node()


def _setup(case: tuple[Scenario, Method]) -> tuple[bool, float, float]:
    """Return what is fixed at the start of the nodes: rows that share it run on the same."""
    scenario, method = case
    return method.is_tracked, scenario.viscous_friction, scenario.coulomb_friction


def _row(result: Result) -> str:
    """Return a line of the table."""
    rms, amplitude = ('-', '-') if result.printed is None else map('{:g}'.format, result.printed)
    ours = (
        f'{result.amplitude:.5f}'
        if result.amplitude > SHOWN_AS_DECIMAL
        else f'{result.amplitude:.1e}'
    )
    return (
        f' {result.scenario.number:^8} | {result.strategy:<21} | {result.rms_effort:.5f} | '
        f'{rms:<7} | {ours:<10} | {amplitude}'
    )


def _feedback_rows(results: Sequence[Result]) -> list[str]:
    """Return what feedback leaves, beside the same motions without it."""
    tracked = {result.scenario.number for result in results if result.strategy == TRACKED.name}
    return [
        f' {result.scenario.number:^8} | {result.strategy:<21} | {result.miss:^14.4f} | '
        f'{"-" if result.settling_time is None else f"{result.settling_time:.2f}":^7} | '
        f'{result.peak_ratio:.2f}'
        for result in results
        if result.strategy in (EXACT.name, TRACKED.name) and result.scenario.number in tracked
    ]


def _write_csv(results: Sequence[Result], name: str) -> None:
    """Write the numbers."""
    with open_text(name) as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for result in results:
            printed = result.printed or ('', '')
            settled = '' if result.settling_time is None else result.settling_time
            writer.writerow(
                [
                    *(result.scenario.number, result.strategy),
                    *(result.rms_effort, result.amplitude, *printed),
                    *(result.miss, settled, result.peak_ratio),
                ]
            )
    print(f'numbers: {name}', file=sys.stderr)


def _draw(results: Sequence[Result], name: str) -> None:
    """Draw the figures."""
    # Imported here: matplotlib is an extra.
    from flat_planner_ros.figures.paper_figures import draw

    write_through(name, lambda path: draw(results, path), '.png')
    print(f'figures: {name}', file=sys.stderr)


if __name__ == '__main__':
    sys.exit(main())
