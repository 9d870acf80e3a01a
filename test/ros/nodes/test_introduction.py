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

"""At its start a node says what it is, and which blocks of its files have reached it."""

from flat_planner_ros.ros.nodes.introduction import unused_blocks
import pytest

BLOCK = '{name}:\n  ros__parameters: {{weights.r: 20.0}}\n'


def written(tmp_path, *names):
    """Return a parameter file with blocks of these names."""
    path = tmp_path / 'arm.yaml'
    path.write_text(''.join(BLOCK.format(name=name) for name in names))
    return path


def test_a_node_says_what_it_is(graph, tmp_path):
    path = written(tmp_path, '/**', 'planner')
    process = graph.start('planner_node', '--ros-args', '--params-file', str(path))
    graph.expect(lambda: 'ready' in process.stderr, 'a node')
    assert 'joints joint1, joint2 (joint2 passive)' in process.stderr
    assert 'no limits; goals on /flat_planner/goal' in process.stderr
    assert f'{path}: /**' in process.stderr
    assert 'the block /planner reaches no node' in process.stderr


@pytest.mark.parametrize(
    ('names', 'unused'),
    [
        (['planner'], 'did you mean /left/flat_planner'),
        (['flat_planner'], 'did you mean /left/flat_planner'),
        (['/right/flat_planner'], 'did you mean /left/flat_planner'),
        (['/left/flat_planer'], 'did you mean /left/flat_planner'),
        (['/left/flat_planner', '/right/flat_planner'], None),
        (['/**', '/**/flat_planner', '/**/flat_plant'], None),
        (['/**', 'controller_manager', 'plant'], None),
    ],
)
def test_blocks_that_reach_no_node(tmp_path, names, unused):
    path = written(tmp_path, *names)
    warnings = list(unused_blocks(['/left/flat_planner'], [path]))
    assert len(warnings) == (unused is not None)
    if unused:
        assert unused in warnings[0]
