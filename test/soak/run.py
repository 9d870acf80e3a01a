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
Soak test: random motions on three arms for a long time, with faults; "make soak".

The 2-DOF arm runs faster than real time and keeps its processes, so that their memory can be
followed; the 4-DOF arm runs in real time and has its nodes killed. The tracked one runs slower and
has its tracker killed, stopped, doubled, and its model wrong. Exit code 1 if anything failed.
"""

from __future__ import annotations

from argparse import ArgumentParser
import json
import os
from pathlib import Path
import subprocess
import sys

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from ros.conftest import free_domain, Graph  # noqa: E402  From the directory of tests.
from soak.rig import Soak  # noqa: E402
from soak.tracked import TrackedSoak  # noqa: E402

RIGS = {
    '2-DOF, 2 x real time': lambda graph, seed: Soak(graph, 'arm_2dof.yaml', 2.0, seed),
    '4-DOF, real time': lambda graph, seed: Soak(graph, 'arm_4dof.yaml', None, seed),
    '2-DOF, tracked': TrackedSoak,
}

WARM_UP = 0.3
"""Share of the time after which memory has to stay as it is."""

MAX_GROWTH = 0.01
"""Largest growth of a node's resident memory after the warm-up [-]."""

MIN_CHECKED = 0.5
"""
Smallest share of the motions reported whose residuals could be checked [-].

Of the others the nodes have said why not: late, lost, or not measured.
"""

MAX_DRIFT = 0.02
"""Largest drift of the plant's clock against the time of day [s]."""


def growth(samples: list[tuple[float, float]], seconds: float) -> float | None:
    """Return the growth of memory after the warm-up [-], None for a process that is too young."""
    times, sizes = np.array(samples).T
    begin = sizes[(times > WARM_UP * seconds) & (times < (WARM_UP + 0.1) * seconds)]
    end = sizes[times > 0.9 * seconds]
    if not begin.size or not end.size:
        return None
    return float(np.median(end) / np.median(begin) - 1.0)


def run_rig(name: str, minutes: float, seed: int) -> None:
    """Run one arm and print what happened as JSON."""
    with free_domain() as domain:
        graph = Graph(domain)
        try:
            rig = RIGS[name](graph, seed)
            rig.run(60.0 * minutes)
            failures = list(rig.failures)
            seconds = rig.counts['seconds']
            checked, reported = rig.counts['residuals checked'], rig.counts['motions reported']
            if checked < MIN_CHECKED * reported:
                failures.append(f'only {checked} residuals checked of {reported} motions reported')
            memory = {}
            for (node, pid), samples in rig.memory.items():
                if samples and (grown := growth(samples, seconds)) is not None:
                    memory[f'{node} {pid}'] = [samples[-1][1] / 2**20, 100.0 * grown]
                    if grown > MAX_GROWTH:
                        failures.append(f'{node} has grown by {100.0 * grown:.2f} %')
            drift = None
            if rig.offsets:  # the least delay of a message, at the beginning and at the end
                times, offsets = np.array(rig.offsets).T
                first, last = (
                    offsets[part].min() for part in (times < 0.2 * seconds, times > 0.8 * seconds)
                )
                drift = float(last - first)
                if abs(drift) > MAX_DRIFT:
                    failures.append(f'the clock of the plant has drifted by {drift:.4f} s')
            for node, process in rig.processes.items():
                if process.stop() != 0 or 'Traceback' in process.stderr:
                    failures.append(f'{node}: {process.stderr[-2000:]}')
        finally:
            graph.close()
    result = {'counts': rig.counts, 'memory': memory, 'drift': drift, 'failures': failures}
    print(json.dumps(result))


def main() -> int:
    """Run the arms beside each other, print the figures and return the exit code."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument('--minutes', type=float, default=30.0)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--rig', choices=RIGS, help='one arm only, the result as JSON')
    given = parser.parse_args()
    if given.rig:
        run_rig(given.rig, given.minutes, given.seed)
        return 0
    paths = [str(Path(__file__).parents[1]), os.environ.get('PYTHONPATH', '')]
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, paths))}
    words = [sys.executable, __file__, '--minutes', str(given.minutes), '--seed', str(given.seed)]
    running = {
        name: subprocess.Popen([*words, '--rig', name], env=environment, stdout=subprocess.PIPE)
        for name in RIGS
    }
    failed = False
    for name, process in running.items():
        output, _ = process.communicate()
        print(name)
        if process.returncode:
            failed = True
            print(f'  ended with exit code {process.returncode}')
            continue
        result = json.loads(output.splitlines()[-1])
        for what, count in result['counts'].items():
            print(f'  {what:45} {count:8}')
        for node, (size, percent) in result['memory'].items():
            print(f'  memory of {node:22} {size:8.1f} MiB, {percent:+.2f} % after the warm-up')
        if result['drift'] is not None:
            print(f"  drift of the plant's clock {1e3 * result['drift']:+.3f} ms")
        for failure in result['failures']:
            print(f'  FAILED {failure}')
        failed |= bool(result['failures'])
    print('failed' if failed else 'passed')
    return int(failed)


if __name__ == '__main__':
    sys.exit(main())
