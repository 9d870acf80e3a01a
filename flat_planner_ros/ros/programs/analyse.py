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

"""The monitor's report from a recording: read, computed again, printed and drawn."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import replace
from functools import partial
import json
from math import inf
from pathlib import Path
import sys
from typing import Any, TYPE_CHECKING

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.core.monitor import MonitorSettings
from flat_planner_ros.ros.parameters import monitor as monitor_parameters
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.programs.command_line import (
    animation_name,
    explain_missing,
    explain_os,
    figure_name,
    missing_for_plot,
    parsed,
    seconds,
)
from flat_planner_ros.ros.programs.outputs import (
    check_writable,
    NotWritten,
    open_text,
    STANDARD_OUTPUT,
    summary_stream,
    write_through,
)
from flat_planner_ros.ros.programs.progress import progress
from flat_planner_ros.ros.wire import diagnostics, interfaces

if TYPE_CHECKING:
    from flat_planner_ros.ros.recording.recording import Recording
    from flat_planner_ros.ros.recording.replay import Judgement, Sources
    from flat_planner_ros.ros.recording.storage import Entry

AGREEMENT = 1e-9
"""Relative difference up to which a recorded report says the same, in 9 printed digits [-]."""

DAMAGED = 'the recording is cut short or damaged'
"""What is said before the damage."""

UNITS = {
    'start_time': 's',
    'end_time': 's',
    'amplitude': 'rad',
    'peak_to_peak': 'rad',
    'frequency': 'Hz',
    'frequency_expected': 'Hz',
    'settling_time': 's',
    'bias': 'rad',
    'final_error': 'rad',
    'rms_effort': 'N m',
    'window': 's',
    'fit_rms': 'rad',
    'stiffness_estimate': 'N m/rad',
    'stiffness_std': 'N m/rad',
    'damping_estimate': 'N m s/rad',
    'damping_std': 'N m s/rad',
    'estimate_inertia': 'kg m^2',
}
"""Units of a report's values, by the key or its part before the joint."""


def main(args: Sequence[str] | None = None) -> int:
    """
    Analyse a recording.

    Returns
    -------
    int
        0 with at least one report, 1 without.

    """
    options = parsed(
        _parser(), (sys.argv if args is None else args)[1:], ['json', 'plot', 'animate']
    )
    if missing := missing_for_plot(options.plot, options.animate):
        print(missing, file=sys.stderr)
        return 1
    try:
        from flat_planner_ros.ros.recording.recording import Recording
        from flat_planner_ros.ros.recording.replay import find_sources, replay
        from flat_planner_ros.ros.recording.storage import storage_files
    except ImportError as error:
        return explain_missing(error, 'record')
    recording = None
    try:
        check_writable(options.json, options.plot, options.animate)
        with progress(len(storage_files(options.file)), 'analyse') as advance:
            recording = Recording(options.file, advance)
            sources = find_sources(
                recording,
                namespace=options.namespace,
                plan=options.plan,
                joint_states=options.joint_states,
            )
            settings = _settings(options, recording, sources)
            telling = _Telling(options, recording, sources)
            replayed = replay(
                recording, sources, settings, telling.remark, telling.hear, telling.topics
            )
            with redirect_stdout(summary_stream(options.json, options.plot)):
                for judgement in replayed:
                    telling.tell(judgement)
                telling.end()
        if options.json is not None:
            telling.write_json(options.json)
    except FlatPlannerError as error:
        damage = '' if recording is None else recording.damage
        damage = f'; {DAMAGED}: {damage}' if damage else ''
        print(f'analyse: {error}{damage}', file=sys.stderr)
        return 1
    except OSError as error:
        print(f'analyse: {explain_os(error)}', file=sys.stderr)
        return 1
    return 0 if telling.count else 1


def _parser() -> ArgumentParser:
    """Return the parser of the command line."""
    parser = ArgumentParser(
        prog='analyse',
        description="Compute the monitor's report on every motion in a recording: an MCAP file of "
        '"record" or ros2 bag, or a bag of another storage.',
    )
    parser.add_argument(
        'file', metavar='FILE', type=Path, help='MCAP file, or what ros2 bag has written'
    )
    parser.add_argument('--json', metavar='FILE', help='the reports as JSON, or -')
    parser.add_argument(
        '--plot',
        metavar='FILE',
        type=figure_name,
        help='the motions, .png, .pdf or .svg; several as FILE-1, FILE-2 …; - for the only one',
    )
    parser.add_argument(
        '--animate',
        metavar='FILE',
        type=animation_name,
        help='the motions as moving pictures, .gif, or .mp4 with ffmpeg; names as for --plot',
    )
    parser.add_argument(
        '--params-file',
        metavar='FILE',
        type=Path,
        help="parameters of the monitor; by default the recorded ones, else no model's",
    )
    parser.add_argument('--namespace', default='', metavar='NS', help='of the nodes, e.g. /arm1')
    parser.add_argument(
        '--plan', default='', metavar='TOPIC', help='JointTrajectory with plans or commands'
    )
    parser.add_argument('--joint-states', default='', metavar='TOPIC', help='measured JointState')
    parser.add_argument(
        '--window', type=seconds, metavar='S', help='time after a motion that is judged [s]'
    )
    return parser


def _settings(
    options: Namespace, recording: 'Recording', sources: 'Sources'
) -> list[tuple[int, MonitorSettings]]:
    """Return the monitor's settings with the times from which they hold [ns]."""
    from flat_planner_ros.ros.recording.replay import recorded_settings

    if options.params_file is not None:
        node = f'{options.namespace.strip("/")}/{interfaces.MONITOR}'
        rows, build = monitor_parameters.ROWS, monitor_parameters.build
        warn = partial(print, 'analyse:', file=sys.stderr)
        known = [(0, read_settings(options.params_file, rows, build, node=node, warn=warn))]
    else:
        known = recorded_settings(recording, sources) or [(0, MonitorSettings())]
    if options.window is not None:
        known = [(time, replace(settings, window=options.window)) for time, settings in known]
    return known


class _Telling:
    """
    Tells reports as they come.

    Parameters
    ----------
    options
        Of the command line.
    recording, sources
        What the reports are about.

    Attributes
    ----------
    count
        Number of reports so far.
    topics
        Topics with the reports of the time, as far as they are recorded.

    """

    def __init__(self, options: Namespace, recording: 'Recording', sources: 'Sources') -> None:
        usual = interfaces.topic_of(interfaces.PLANNER, interfaces.PLAN)
        report = interfaces.topic_of(interfaces.MONITOR, interfaces.REPORT)
        topic = sources.plan.removesuffix(usual) + report
        self.topics = {topic} & set(recording.topics)
        self.count = 0
        self._options = options
        self._recording = recording
        self._sources = sources
        self._recorded: dict[float, Mapping[str, Any]] = {}
        self._waiting: dict[str, Any] | None = None
        self._remarks: list[str] = []
        self._reports: list[Mapping[str, Any]] = []
        self._figures = [_Figures(options.plot, _draw), _Figures(options.animate, _animate)]
        where = f'plans from {sources.plan}, joint states from {sources.joint_states}'
        self._head = f'{options.file}: {where}'

    def remark(self, text: str) -> None:
        """Keep a remark for the end."""
        self._remarks.append(text)

    def hear(self, entry: 'Entry') -> None:
        """Take a report of the time."""
        msg = self._recording.read(entry)
        for status in [] if msg is None else msg.status:
            values: dict[str, Any] = {pair.key: _value(pair.value) for pair in status.values}
            if 'start_time' in values:
                self._recorded[values['start_time']] = values
        if self._waiting and self._waiting['values']['start_time'] in self._recorded:
            self._print()

    def tell(self, judgement: 'Judgement') -> None:
        """Print a report once the one of the time has come, at the latest with the next."""
        self._print()
        self._begin()
        self.count += 1
        self._waiting = report = _as_dict(judgement)
        if self._options.json is not None:
            self._reports.append(report)
        for figures in self._figures:
            figures.take(judgement)
        start = report['values']['start_time']
        self._recorded = {key: its for key, its in self._recorded.items() if key >= start}
        if start in self._recorded:
            self._print()

    def end(self) -> None:
        """Print what is left."""
        self._print()
        self._begin()
        if not self.count:
            print('no motion to report on')
        for remark in self._remarks:
            print(remark)
        if self._recording.damage:
            print(f'{DAMAGED}: {self._recording.damage}')
        for figures in self._figures:
            figures.end()

    def write_json(self, name: str) -> None:
        """Write the reports as JSON."""
        document = {
            'file': str(self._options.file),
            'plan': self._sources.plan,
            'joint_states': self._sources.joint_states,
            'damage': self._recording.damage,
            'remarks': self._remarks,
            'reports': self._reports,
        }
        with open_text(name) as file:
            print(json.dumps(document, indent=2, allow_nan=False), file=file)

    def _begin(self) -> None:
        """Print where it all comes from, once."""
        if self._head:
            print(self._head)
            self._head = ''

    def _print(self) -> None:
        """Print the report that waits, if one does."""
        report, self._waiting = self._waiting, None
        if report is None:
            return
        print(f'\nmotion {self.count}: {report["level"].upper()}')
        print(f'  {report["message"]}')
        width = max(map(len, report['values']))
        for key, value in report['values'].items():
            shown = f'{value:.9f}' if key in ('start_time', 'end_time') else _shown(value)
            unit = UNITS.get(key.partition('.')[0], '')
            print(f'  {key:<{width}}  {shown} {unit}'.rstrip())
        # Imported here: the extra `record` may be missing.
        from flat_planner_ros.ros.recording.sent_efforts import sentences

        for text in sentences(report['sent']):
            print(f'  {text}')
        recorded = self._recorded.get(report['values']['start_time'])
        if recorded is not None:
            print(f'  {_compared(report["values"], recorded)}')
        sys.stdout.flush()


class _Figures:
    """
    Draws each motion into a file of its own; `NAME` for the only one, else `NAME-1`, `NAME-2` ….

    Parameters
    ----------
    name
        As given, None for no figures.
    draw
        Draws a motion into a file.

    """

    def __init__(self, name: str | None, draw: 'Callable[[Judgement, Path], None]') -> None:
        self._name, self._draw = name, draw
        self._first: Judgement | None = None
        self._count = 0

    def take(self, judgement: 'Judgement') -> None:
        """Draw a motion; the first waits until there is another."""
        if self._name is None:
            return
        self._count += 1
        if self._count == 1:
            self._first = judgement
            return
        if self._name == STANDARD_OUTPUT:
            raise NotWritten('several motions are as many figures: --plot needs a name')
        if self._first is not None:
            self._write(self._first, 1)
            self._first = None
        self._write(judgement, self._count)

    def end(self) -> None:
        """Draw the only motion."""
        if self._first is not None:
            self._write(self._first, None)

    def _write(self, judgement: 'Judgement', number: int | None) -> None:
        """Draw a motion into its file."""
        name = str(self._name)
        if number is not None:
            name = str(Path(name).with_stem(f'{Path(name).stem}-{number}'))
        write_through(name, partial(self._draw, judgement), '.png')
        print(f'figure: {name}', file=sys.stderr)


def _draw(judgement: 'Judgement', path: Path) -> None:
    """Draw a motion and what it left behind."""
    # Imported here, as below: matplotlib is an extra.
    from flat_planner_ros.figures.analysis_figure import draw

    draw(
        judgement.report,
        judgement.motion,
        judgement.times,
        judgement.positions,
        judgement.efforts,
        judgement.tracked,
        judgement.pushes,
        path,
    )


def _animate(judgement: 'Judgement', path: Path) -> None:
    """Write a motion as a moving picture."""
    from flat_planner_ros.figures.plan_animation import animate_recording

    animate_recording(judgement.motion, judgement.times, judgement.positions, path)


def _as_dict(judgement: 'Judgement') -> dict[str, Any]:
    """Return a report as JSON has it, with the keys of the monitor's report."""
    status = diagnostics.report_status(judgement.report)
    # Imported here: the extra `record` may be missing.
    from flat_planner_ros.ros.recording.sent_efforts import told

    return {
        'level': judgement.report.level.value,
        'message': judgement.report.message,
        'values': {pair.key: _value(pair.value) for pair in status.values},
        'sent': told(judgement.motion, judgement.tracked, judgement.pushes),
    }


def _compared(mine: Mapping[str, Any], its: Mapping[str, Any]) -> str:
    """Return whether the report of the time says the same as this one."""
    worst = max((_difference(mine.get(k), its.get(k)), k) for k in {*mine, *its} - {'message'})
    if worst[0] <= AGREEMENT:
        return 'the recorded report says the same'
    difference, key = worst
    by = f'by {difference:.1e} in {key}'
    if difference == inf:
        by = f'in {key}, {its.get(key, "nothing")} and not {mine.get(key, "nothing")}'
    return (
        f'the recorded report differs {by}; it rests on '
        f'{its.get("samples")} samples, this one on {mine.get("samples")}'
    )


def _difference(first: Any, second: Any) -> float:
    """Return the relative difference of two values, infinite if they are not comparable."""
    if first == second:
        return 0.0
    if isinstance(first, (int, float)) and isinstance(second, (int, float)):
        return abs(first - second) / max(abs(first), abs(second))
    return inf


def _value(text: str) -> bool | int | float | str:
    """Return a value of a diagnostic message as what it is."""
    if text in ('true', 'false'):
        return text == 'true'
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _shown(value: bool | int | float | str) -> str:
    """Return a value as a person reads it."""
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    return f'{value:.6g}' if isinstance(value, float) else str(value)


if __name__ == '__main__':
    sys.exit(main())
