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

"""Run the benchmarks and write their tables to results.md."""

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from datetime import date
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
import os
from pathlib import Path
import platform
import sys

BENCHMARKS = (
    'planning',
    'scaling',
    'node_path',
    'goal_stream',
    'plant',
    'monitor',
    'start_up',
    'stream',
    'via_points',
    'duration',
    'insensitive',
    'plan_many',
    'peak',
    'model_fit',
    'tracking',
    'tracking_nodes',
    'study',
)
"""Modules with a function `sections`, in this order."""

WITH_ROS = ('node_path', 'goal_stream', 'plant', 'monitor', 'start_up', 'tracking_nodes')
"""Those that need ROS."""

RESULTS = Path(__file__).parent / 'results.md'
"""What a whole run writes."""

THREADS = ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS', 'MKL_NUM_THREADS', 'BLIS_NUM_THREADS')
"""Variables that keep linear algebra to one thread; read when NumPy is imported."""

VERSIONS = (
    'numpy',
    'scipy',
    'casadi',
    'drake',
    'control',
    'ruckig',
    'toppra',
    'matplotlib',
    'rclpy',
)
"""Packages that are named in the results."""


def main() -> int:
    """Run what is asked for."""
    options = _options()
    for variable in THREADS:
        os.environ[variable] = '1'
    # A graph of its own: other people's nodes would take part.
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = str(options.domain)
    text = [*_machine()]
    for name in options.only or BENCHMARKS:
        if name in WITH_ROS and find_spec('rclpy') is None:
            text.append(f'## {name}\n\nnot run: rclpy is not installed')
            continue
        for section in import_module(name).sections(options):
            text.append(section.markdown())
            print(f'\n{text[-1]}', flush=True)
    if not options.only:
        options.output.write_text('\n\n'.join(text) + '\n', encoding='utf-8')
        print(f'\nwritten to {options.output}')
    return 0


def _options() -> Namespace:
    """Return the command line's options."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument('only', nargs='*', choices=[*BENCHMARKS, []], help='all by default')
    parser.add_argument('--seconds', type=float, default=60.0, help='of each run in real time')
    parser.add_argument('--arms', type=int, default=60, help='random ones of model_fit, in all')
    parser.add_argument('--processes', type=int, default=2, help='of model_fit')
    parser.add_argument('--speed', type=float, default=1.0, help='of time in tracking_nodes')
    parser.add_argument('--domain', type=int, default=101, help='ROS domain')
    parser.add_argument('--output', type=Path, default=RESULTS, help='file for the tables')
    return parser.parse_args()


def _machine() -> Iterator[str]:
    """Return what the numbers depend on."""
    yield '# Results'
    versions = [f'Python {platform.python_version()}']
    for name in VERSIONS:
        try:
            versions.append(f'{name} {version(name)}')
        except PackageNotFoundError:
            versions.append(f'{name} not installed')
    load = ', '.join(f'{value:.2g}' for value in os.getloadavg())
    yield '\n'.join(
        [
            f'- {date.today().isoformat()}, {platform.system()} {platform.machine()}',
            f'- {_processor()}, {len(os.sched_getaffinity(0))} cores, load {load} at the start',
            f'- {", ".join(versions)}',
        ]
    )


def _processor() -> str:
    """Return the name of the processor."""
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
        return next(line.split(':', 1)[1].strip() for line in lines if 'model name' in line)
    except (OSError, StopIteration):
        return platform.processor() or 'unknown processor'


if __name__ == '__main__':
    sys.exit(main())
