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
Plan, predict and simulate a whole study: many motions over axes of choice and chance.

A specification is a parameter file with one more block, which says what is set and what varies;
config/studies has some. The table grows in chunks: interrupt it, and the same command goes on from
there. No node has to run.
"""

from argparse import ArgumentParser, ArgumentTypeError, Namespace, RawDescriptionHelpFormatter
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import closing, contextmanager, nullcontext
import csv
import os
from pathlib import Path
import signal
import sys
from threading import Event
from time import perf_counter
from typing import Any

from flat_planner_ros.core.arm import FlatPlannerError
from flat_planner_ros.core.study import (
    ACCEPTED,
    Answer,
    answer,
    Case,
    chunks_of,
    here,
    on_executor,
    Study,
)
from flat_planner_ros.ros.parameters.parameter_file import ASSIGNMENT
from flat_planner_ros.ros.parameters.yaml_reader import parsed as yaml_of
from flat_planner_ros.ros.programs.command_line import (
    explain_missing,
    explain_os,
    figure_name,
    missing_for_plot,
    parsed,
)
from flat_planner_ros.ros.programs.outputs import (
    check_writable,
    STANDARD_OUTPUT,
    summary_stream,
    write_through,
)
from flat_planner_ros.ros.programs.progress import progress
from flat_planner_ros.ros.study.cases import Cases
from flat_planner_ros.ros.study.executors import dask_cluster, processes
from flat_planner_ros.ros.study.line import flat_plan_line
from flat_planner_ros.ros.study.results import (
    cells_of,
    is_parquet_of,
    Lines,
    PARQUET,
    remove,
    ResultFile,
    text_of,
    titles_of,
    values_of,
    VERDICT,
    write_parquet,
)
from flat_planner_ros.ros.study.spec import label_of, read_spec, Spec

EXAMPLES = """\
examples:
  study config/studies/duration.yaml -o durations.csv --plot x=duration value=worst_residual
  study config/studies/spring.yaml -o springs.csv --workers 4
  study config/studies/spring.yaml -o springs.parquet --dask tcp://10.0.0.1:8786
  study config/studies/scenario_3.yaml --row 47
      one row by itself, and the line of flat_plan that repeats it
  study my_study.yaml -o - -p duration:=0.8 | head
"""

INTERRUPTED = 130
"""Exit code of a study that was interrupted."""

PLOT_KEYS = ('x', 'y', 'value', 'by')
"""What a picture is asked for: axes, the value, and what tells its curves apart."""


def main(args: Sequence[str] | None = None) -> int:
    """
    Do the rows that are not done yet; print, draw.

    Returns
    -------
    int
        0 when all is there, 1 when something is wrong with the input, 2 for a wrong option, 130
        when interrupted.

    """
    options = _options(args)
    try:
        spec = read_spec(options.spec, dict(map(_assigned, options.parameter)))
        cases = Cases(spec=spec)
        study = Study(
            axes=spec.axes,
            cases=cases,
            joints=cases.joints,
            chunk=spec.chunk,
            clock=None if options.no_times else perf_counter,
        )
        if options.row is not None:
            return _show_row(options, study, cases)
        return _run(options, study, spec)
    except FlatPlannerError as error:
        print(f'study: {error}', file=sys.stderr)
        return 1
    except OSError as error:
        print(f'study: {explain_os(error)}', file=sys.stderr)
        return 1
    except ModuleNotFoundError as error:
        return explain_missing(error, 'study')


def _options(args: Sequence[str] | None) -> Namespace:
    """Return the command line's options."""
    parser = ArgumentParser(
        prog='study',
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument('spec', type=Path, metavar='SPEC', help='what is set and what varies')
    parser.add_argument(
        '-p',
        '--parameter',
        metavar='NAME:=VALUE',
        action='append',
        default=[],
        help='set in place of what SPEC sets, or besides; may be repeated',
    )
    parser.add_argument('--row', type=_number, metavar='N', help='only this row, from 0; no table')
    work = parser.add_mutually_exclusive_group()
    work.add_argument(
        '--workers', type=_number, default=0, metavar='N', help='processes; 0 = this one (default)'
    )
    work.add_argument('--dask', metavar='ADDRESS', help='scheduler of a Dask cluster')
    parser.add_argument(
        '-o', '--output', metavar='FILE', help='table, .csv or .parquet, or - (CSV)'
    )
    parser.add_argument('--fresh', action='store_true', help='write anew what is there')
    parser.add_argument(
        '--no-times', action='store_true', help='leave out planning_time, which is never the same'
    )
    parser.add_argument(
        '--plot',
        nargs='*',
        metavar='KEY=COLUMN',
        help='picture of x=, y=, value= and by=, and the name of its file (default: as the table)',
    )
    options = parsed(parser, args, ['output'])
    if options.row is None and options.output is None:
        parser.error('say with -o where the table goes, or with --row which row is wanted')
    options.figure, options.asked = None, {}
    if options.plot is not None:
        try:
            options.figure, options.asked = _plot_words(options)
        except ArgumentTypeError as error:
            parser.error(f'--plot: {error}')
        if missing := missing_for_plot(options.figure):
            parser.error(missing)
    return options


def _number(text: str) -> int:
    """Return a whole number that is not negative."""
    if not text.isdecimal():
        raise ArgumentTypeError(f'{text!r} is no whole number')
    return int(text)


def _assigned(text: str) -> tuple[str, Any]:
    """Return name and value of `NAME:=VALUE`."""
    name, separator, value = text.partition(ASSIGNMENT)
    if not (name and separator and value):
        raise FlatPlannerError(f'an override is written name:=value, got {text!r}')
    return name, yaml_of(value, f'the value of {name}')


def _plot_words(options: Namespace) -> tuple[str, dict[str, str]]:
    """Return the file of a picture, and what it shows."""
    asked, file = {}, ''
    for word in options.plot:
        key, separator, value = word.partition('=')
        if not separator:
            file = figure_name(word)
        elif key in PLOT_KEYS and value:
            asked[key] = value
        else:
            raise ArgumentTypeError(f'{word!r} is none of {", ".join(PLOT_KEYS)}=COLUMN')
    if options.row is None and 'value' not in asked:
        raise ArgumentTypeError('value=COLUMN is missing')
    if not file and options.output == STANDARD_OUTPUT:
        raise ArgumentTypeError('the table is on standard output: give the file of the picture')
    stem = options.spec if options.row is not None else Path(options.output)
    ending = f'_row_{options.row}.png' if options.row is not None else '.png'
    return file or str(Path(stem.parent, f'{stem.stem}{ending}')), asked


def _run(options: Namespace, study: Study, spec: Spec) -> int:
    """Write the table, and what is asked for besides."""
    check_writable(options.output, options.figure)
    if options.output == STANDARD_OUTPUT:
        sys.stdout.write(','.join(titles_of(study)) + '\n')
        return _fill(options, study, sys.stdout.write, 0)
    target = Path(options.output)
    fingerprint = f'{spec.fingerprint}{"" if study.clock else ", without times"}'
    if target.suffix == PARQUET:
        code = _write_parquet(options, study, target, fingerprint)
    else:
        code = _write_csv(options, study, target, fingerprint)
    if code == 0:
        _summarise(options, study, target)
    return code


def _write_csv(options: Namespace, study: Study, path: Path, fingerprint: str) -> int:
    """Write the rows of a table that are missing; return the exit code."""
    file = ResultFile(path, study, fingerprint, is_fresh=options.fresh)
    try:
        code = _fill(options, study, file.add, file.done)
    finally:
        file.close()
    if code:
        print(
            f'study: {file.done} of {study.count} rows are in {path}; the same command goes on '
            'from there',
            file=sys.stderr,
        )
    return code


def _write_parquet(options: Namespace, study: Study, target: Path, fingerprint: str) -> int:
    """Write a table by way of a CSV file; return the exit code."""
    if not options.fresh and is_parquet_of(target, fingerprint):
        return 0
    part = target.with_name(f'{target.name}.part')
    code = _write_csv(options, study, part, fingerprint)
    if code == 0:
        write_parquet(part, target, study, fingerprint)
        remove(part)
    return code


def _fill(options: Namespace, study: Study, add: Callable[[str], object], done: int) -> int:
    """Do the rows from a number on; return the exit code."""
    with _engine(options) as engine, _interruptible() as interrupted:
        chunks = chunks_of(done, study.count, study.chunk)
        (executor, workers), work = engine, Lines(study=study)
        found = (
            here(work, chunks)
            if executor is None
            else on_executor(work, chunks, executor, workers)
        )
        with closing(found), progress(float(study.count), 'study') as advance:
            advance(done)
            for chunk, lines in found:
                add(lines)
                advance(chunk.stop - chunk.first)
                if interrupted.is_set() and chunk.stop < study.count:
                    return INTERRUPTED
    return 0


@contextmanager
def _engine(options: Namespace) -> Iterator[tuple[Callable[[], Executor] | None, int]]:
    """Return what makes an executor, None for this process, and its number of workers."""
    if options.dask:
        with dask_cluster(options.dask) as cluster:
            yield cluster
    elif options.workers:
        with nullcontext((processes(options.workers), options.workers)) as engine:
            yield engine
    else:
        yield None, 1


@contextmanager
def _interruptible() -> Iterator[Event]:
    """
    Let the first signal stop the work after the chunk under way, and a second one the process.

    An exception instead could come up in the middle of an executor's `submit`, which then holds a
    task that nobody does and waits for it for ever.
    """
    interrupted = Event()

    def stop(_number: int, _frame: object) -> None:
        if interrupted.is_set():
            os._exit(INTERRUPTED)
        interrupted.set()

    signals = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, stop) for number in signals]
    try:
        yield interrupted
    finally:
        for number, handler in zip(signals, before, strict=True):
            signal.signal(number, handler)


def _summarise(options: Namespace, study: Study, target: Path) -> None:
    """Say what the rows have become, and draw them."""
    counts, first, stream = Counter[str](), dict[str, int](), summary_stream(options.figure)
    for row, (verdict,) in enumerate(cells_of(target, [VERDICT])):
        counts[verdict] += 1
        first.setdefault(verdict, row)
    words = ', '.join(f'{count} {verdict}' for verdict, count in counts.most_common())
    print(f'{study.count} rows in {target}: {words}', file=stream)
    for verdict, _ in counts.most_common():
        if verdict != ACCEPTED:
            said = _said(study.case(first[verdict]))
            print(f'  {verdict}, as row {first[verdict]}: {said.message}', file=stream)
    if options.figure is None:
        return
    # Imported here: matplotlib is an extra.
    from flat_planner_ros.figures.study_figure import draw, Shown

    titles = list(options.asked.values())
    columns = list(zip(*cells_of(target, titles), strict=True))
    shown = {
        key: Shown(title, label_of(title), values_of(cells))
        for (key, title), cells in zip(options.asked.items(), columns, strict=True)
    }
    if not shown['value'].is_number:
        raise FlatPlannerError(f'value={options.asked["value"]} is no column of numbers')
    write_through(
        options.figure,
        lambda path: draw(
            shown['value'], path, x=shown.get('x'), y=shown.get('y'), by=shown.get('by')
        ),
        '.png',
    )
    print(f'figure: {options.figure}', file=sys.stderr)


def _said(case: Case | Answer) -> Answer:
    """Return what the planner says to a row."""
    return case if isinstance(case, Answer) else answer(case)


def _show_row(options: Namespace, study: Study, cases: Cases) -> int:
    """Print one row, and the line that repeats it; draw its motion."""
    if not options.row < study.count:
        raise FlatPlannerError(
            f'there is no row {options.row}: the study has rows 0 to {study.count - 1}'
        )
    table = study.row(options.row)
    header, cells = titles_of(study), next(csv.reader([text_of(table)]))
    stream = summary_stream(options.figure)
    width = max(map(len, header))
    for title, cell in zip(header, cells, strict=True):
        print(f'{title:{width}}  {cell}', file=stream)
    case = study.case(options.row)
    said = _said(case)
    if said.verdict != ACCEPTED:
        print(f'{said.verdict}: {said.message}', file=stream)
    if not isinstance(case, Answer):
        print(flat_plan_line(cases, options.row, case), file=stream)
    if options.figure and said.motion is not None and not isinstance(case, Answer):
        # Imported here: matplotlib is an extra.
        from flat_planner_ros.figures.study_figure import draw_row

        motion = said.motion
        write_through(options.figure, lambda path: draw_row(case, motion, path), '.png')
        print(f'figure: {options.figure}', file=sys.stderr)
    return 0


if __name__ == '__main__':
    sys.exit(main())
