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

"""The paper's experiment on the three real nodes: table, figures and numbers."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
import csv
from functools import partial
import os
from pathlib import Path
import signal
import subprocess
import sys
from threading import Event

from flat_planner_ros.child_process import end_with_parent
from flat_planner_ros.core.arm import Drive
from flat_planner_ros.figures.paper_example import BEYOND, CASES, Method, Result, Scenario
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
from flat_planner_ros.ros.programs.paper_experiment import (
    Experimenter,
    ExperimentFailed,
    Interrupted,
    refuse_company,
)
from flat_planner_ros.ros.programs.progress import progress
import rclpy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

SPEED = 5.0
"""Simulated seconds per second unless in real time; a busy machine is slower by itself."""

WINDOW = 3.0
"""Time after the motion from which the monitor takes the amplitude [s]."""

SILENCE = 5.0
"""Real time for which a busy machine may be silent [s]."""

TERMINATION = 10.0
"""Time that a node is given to end by itself [s]: twice what it takes to end for certain."""

SHOWN_AS_DECIMAL = 1e-4
"""Amplitude from which the table shows decimals rather than an exponent [rad]."""

COLUMNS = (
    'scenario',
    'strategy',
    'rms_effort',
    'amplitude',
    'paper_rms_effort',
    'paper_amplitude',
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
  monitor has read from the oscillation after the first."""


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
    cases = BEYOND if options.beyond else CASES
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
        'insensitive motions, and a second motion after self-tuning',
    )
    parser.add_argument(
        '--drive',
        choices=[drive.value for drive in Drive],
        default=Drive.EFFORT.value,
        help='what joint 1 is given in all three nodes: the paper gives an effort',
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


def _results(
    speed: float, cases: Sequence[tuple[Scenario, Method]], interrupted: Event, drive: Drive
) -> list[Result]:
    """Return the rows, printed as they come."""
    results = []
    with _node_processes(speed, drive) as processes:
        experimenter = Experimenter(speed, processes, interrupted, drive)
        try:
            print('starting the three nodes ...', flush=True)
            experimenter.wait_for_nodes()
            print(HEADER, flush=True)
            with progress(len(cases), 'paper_table') as advance:
                for scenario, method in cases:
                    results.append(experimenter.run(scenario, method))
                    advance(1)
                    print(_row(results[-1]), flush=True)
        finally:
            experimenter.destroy_node()
    return results


@contextmanager
def _node_processes(speed: float, drive: Drive) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Run planner, plant and monitor, the plant owning the time."""
    parameters = {
        'planner': {
            'use_sim_time': 'true',
            'reference_rate': '10.0',
            # Given, and checked against the measured one, which may be from before a reset.
            'start.source': 'parameter',
            'start.position': '[0.0, 0.0]',
            'start.joint_state_timeout': str(SILENCE * speed),
        },
        'plant': {'publish_clock': 'true', 'real_time_factor': str(speed)},
        'monitor': {
            'use_sim_time': 'true',
            'window': str(WINDOW),
            'timeout': str(SILENCE * speed),
        },
    }
    processes = []
    try:
        for node, values in parameters.items():
            module = f'flat_planner_ros.ros.nodes.{node}_node'
            command = [sys.executable, '-m', module, '--ros-args', '--log-level', 'fatal']
            for name, value in {'drive': drive.value, **values}.items():
                command += ['-p', f'{name}:={value}']
            # Its own session: Ctrl-C reaches this process alone, which ends the nodes in order.
            processes.append(
                subprocess.Popen(
                    command,
                    start_new_session=True,
                    preexec_fn=partial(end_with_parent, signal.SIGTERM),
                )
            )
        yield processes
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            try:
                process.wait(TERMINATION)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


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


def _write_csv(results: Sequence[Result], name: str) -> None:
    """Write the numbers."""
    with open_text(name) as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for result in results:
            printed = result.printed or ()
            numbers = map(repr, (result.rms_effort, result.amplitude, *printed))
            row = [result.scenario.number, result.strategy, *numbers]
            writer.writerow([*row, *[''] * (len(COLUMNS) - len(row))])
    print(f'numbers: {name}', file=sys.stderr)


def _draw(results: Sequence[Result], name: str) -> None:
    """Draw the figures."""
    # Imported here: matplotlib is an extra.
    from flat_planner_ros.figures.paper_figures import draw

    write_through(name, lambda path: draw(results, path), '.png')
    print(f'figures: {name}', file=sys.stderr)


if __name__ == '__main__':
    sys.exit(main())
