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

"""What the nodes load when nothing moves yet, seen in the files that they have mapped."""

from pathlib import Path
import sys

import pytest

pytest.importorskip('rclpy')

PROGRAMS = ('planner_node', 'plant_node', 'monitor_node')


def has_loaded(process, part: str) -> bool:
    """Return whether a process has loaded a library whose path has a part."""
    return part in Path(f'/proc/{process.pid}/maps').read_text()


def test_only_the_planner_loads_what_paths_need_and_before_the_first(graph):
    planner, *others = [
        graph.run([sys.executable, '-m', f'flat_planner_ros.ros.{name}']) for name in PROGRAMS
    ]
    for process in (planner, *others):
        graph.expect(lambda process=process: 'ready' in process.stderr + process.stdout, 'a node')
    for library in ('scipy/linalg', 'scipy/optimize'):
        graph.expect(lambda library=library: has_loaded(planner, library), library)
    assert not any(has_loaded(process, 'scipy/') for process in others)
