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
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import replace
from functools import partial
import json
from pathlib import Path
import sys
from typing import Any, TYPE_CHECKING

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.core.monitor import MonitorSettings
from flat_planner_ros.ros.parameters import monitor as monitor_parameters
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.programs.command_line import (
    explain_missing,
    explain_os,
    figure_name,
    missing_for_plot,
    parsed,
)
from flat_planner_ros.ros.programs.outputs import (
    NotWritten,
    open_text,
    STANDARD_OUTPUT,
    summary_stream,
    write_through,
)
from flat_planner_ros.ros.wire import diagnostics, interfaces

if TYPE_CHECKING:
    from flat_planner_ros.ros.recording.recording import Recording
    from flat_planner_ros.ros.recording.replay import Judgement, Sources

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
    options = parsed(_parser(), (sys.argv if args is None else args)[1:], ['json', 'plot'])
    if missing := missing_for_plot(options.plot):
        print(missing, file=sys.stderr)
        return 1
    try:
        from flat_planner_ros.ros.recording.recording import Recording
        from flat_planner_ros.ros.recording.replay import find_sources, replay
    except ImportError as error:
        return explain_missing(error, 'record')
    try:
        recording = Recording(options.file)
    except (FlatPlannerError, OSError) as error:
        print(f'analyse: {error}', file=sys.stderr)
        return 1
    try:
        sources = find_sources(
            recording,
            namespace=options.namespace,
            plan=options.plan,
            joint_states=options.joint_states,
        )
        settings = _settings(options, recording, sources)
        remarks: list[str] = []
        judgements = replay(recording, sources, settings, remarks.append)
        reports = [_as_dict(judgement) for judgement in judgements]
        if options.json is not None:
            _write_json(options, recording, sources, reports, remarks)
        with redirect_stdout(summary_stream(options.json, options.plot)):
            _tell(options, recording, sources, reports, remarks)
        if options.plot is not None:
            _draw(judgements, options.plot)
    except FlatPlannerError as error:
        damage = f'; {DAMAGED}: {recording.damage}' if recording.damage else ''
        print(f'analyse: {error}{damage}', file=sys.stderr)
        return 1
    except OSError as error:
        print(f'analyse: {explain_os(error)}', file=sys.stderr)
        return 1
    return 0 if judgements else 1


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
        '--window', type=float, metavar='S', help='time after a motion that is judged [s]'
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
        known = [(0, read_settings(options.params_file, rows, build, node=node))]
    else:
        known = recorded_settings(recording, sources) or [(0, MonitorSettings())]
    if options.window is not None:
        known = [(time, replace(settings, window=options.window)) for time, settings in known]
    return known


def _write_json(
    options: Namespace,
    recording: 'Recording',
    sources: 'Sources',
    reports: Sequence[Mapping[str, Any]],
    remarks: Sequence[str],
) -> None:
    """Write the reports as JSON."""
    document = {
        'file': str(options.file),
        'plan': sources.plan,
        'joint_states': sources.joint_states,
        'damage': recording.damage,
        'remarks': list(remarks),
        'reports': list(reports),
    }
    with open_text(options.json) as file:
        print(json.dumps(document, indent=2, allow_nan=False), file=file)


def _tell(
    options: Namespace,
    recording: 'Recording',
    sources: 'Sources',
    reports: Sequence[Mapping[str, Any]],
    remarks: Sequence[str],
) -> None:
    """Print the reports."""
    differences = _compared(reports, _recorded_reports(recording, sources))
    print(f'{options.file}: plans from {sources.plan}, joint states from {sources.joint_states}')
    if recording.damage:
        print(f'{DAMAGED}: {recording.damage}')
    for remark in remarks:
        print(remark)
    if not reports:
        print('no motion to report on')
    for number, (report, difference) in enumerate(zip(reports, differences, strict=True), 1):
        print(f'\nmotion {number}: {report["level"].upper()}')
        print(f'  {report["message"]}')
        width = max(map(len, report['values']))
        for key, value in report['values'].items():
            shown = f'{value:.9f}' if key in ('start_time', 'end_time') else _shown(value)
            unit = UNITS.get(key.partition('.')[0], '')
            print(f'  {key:<{width}}  {shown} {unit}'.rstrip())
        if difference is not None:
            print(f'  {difference}')


def _as_dict(judgement: 'Judgement') -> dict[str, Any]:
    """Return a report as JSON has it, with the keys of the monitor's report."""
    status = diagnostics.report_status(judgement.report)
    return {
        'level': judgement.report.level.value,
        'message': judgement.report.message,
        'values': {pair.key: _value(pair.value) for pair in status.values},
    }


def _recorded_reports(
    recording: 'Recording', sources: 'Sources'
) -> dict[float, Mapping[str, Any]]:
    """Return the values of the reports that the monitor gave at the time, by start of motion."""
    namespace = sources.plan.removesuffix(interfaces.topic_of(interfaces.PLANNER, interfaces.PLAN))
    topic = namespace + interfaces.topic_of(interfaces.MONITOR, interfaces.REPORT)
    reports: dict[float, Mapping[str, Any]] = {}
    for _, msg in recording.messages({topic}):
        for status in msg.status:
            values: dict[str, Any] = {pair.key: _value(pair.value) for pair in status.values}
            if 'start_time' in values:
                reports[values['start_time']] = values
    return reports


def _compared(
    reports: Sequence[Mapping[str, Any]], recorded: Mapping[float, Mapping[str, Any]]
) -> list[str | None]:
    """Return for each report whether the one in the recording says the same, None without one."""
    verdicts: list[str | None] = []
    for report in reports:
        mine, its = report['values'], recorded.get(report['values']['start_time'])
        if its is None:
            verdicts.append(None)
            continue
        worst = max((_difference(mine.get(k), its.get(k)), k) for k in {*mine, *its} - {'message'})
        if worst[0] <= AGREEMENT:
            verdicts.append('the recorded report says the same')
        else:
            verdicts.append(
                f'the recorded report differs by {worst[0]:.1e} in {worst[1]}; it rests on '
                f'{its.get("samples")} samples, this one on {mine.get("samples")}'
            )
    return verdicts


def _difference(first: Any, second: Any) -> float:
    """Return the relative difference of two values, infinite if they are not comparable."""
    if first == second:
        return 0.0
    if isinstance(first, (int, float)) and isinstance(second, (int, float)):
        return abs(first - second) / max(abs(first), abs(second))
    return float('inf')


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


def _draw(judgements: Sequence['Judgement'], file: str) -> None:
    """Draw each motion into a file of its own."""
    # Imported here: matplotlib is an extra.
    from flat_planner_ros.figures.analysis_figure import draw

    if file == STANDARD_OUTPUT and len(judgements) > 1:
        raise NotWritten(f'{len(judgements)} motions are as many figures: --plot needs a name')
    for number, judgement in enumerate(judgements, 1):
        path = Path(file)
        name = file if len(judgements) == 1 else str(path.with_stem(f'{path.stem}-{number}'))
        drawn = partial(
            draw,
            judgement.report,
            judgement.motion,
            judgement.times,
            judgement.positions,
            judgement.efforts,
        )
        write_through(name, drawn, '.png')
        print(f'figure: {name}', file=sys.stderr)


if __name__ == '__main__':
    sys.exit(main())
