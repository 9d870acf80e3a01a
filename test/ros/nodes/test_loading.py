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


def has_loaded(process, part: str) -> bool:
    """Return whether a process has loaded a library whose path has a part."""
    return part in Path(f'/proc/{process.pid}/maps').read_text()


def test_planner_and_monitor_load_before_the_first_motion_what_it_will_need(graph):
    planner, monitor, plant = (
        graph.start(name) for name in ('planner_node', 'monitor_node', 'plant_node')
    )
    for process in (planner, monitor, plant):
        graph.expect(lambda process=process: 'ready' in process.stderr + process.stdout, 'a node')
    for process in (planner, monitor):
        for library in ('scipy/linalg', 'scipy/optimize'):
            graph.expect(
                lambda process=process, library=library: has_loaded(process, library), library
            )
    assert not has_loaded(plant, 'scipy/optimize')
