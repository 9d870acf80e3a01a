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

"""The installed programs and the launch file start what they promise."""

from pathlib import Path
import signal
import subprocess
import sys

import pytest

CHECKOUT = Path(__file__).resolve().parents[3]
NODES = {'flat_planner', 'flat_plant', 'flat_monitor'}


def script(name: str) -> Path:
    """Return an installed console script."""
    path = Path(sys.executable).parent / name
    if not path.exists():
        pytest.skip(f'{name} is not installed beside {sys.executable}')
    return path


@pytest.mark.parametrize(
    ('name', 'nodes'),
    [
        ('planner_node', {'flat_planner'}),
        ('plant_node', {'flat_plant'}),
        ('monitor_node', {'flat_monitor'}),
        ('demo', NODES),
    ],
)
def test_a_program_starts_its_nodes_with_the_shipped_parameters(graph, name, nodes):
    file = CHECKOUT / 'config' / 'arm_2dof.yaml'
    process = graph.run([str(script(name)), '--ros-args', '--params-file', str(file)])
    graph.expect(lambda: nodes <= set(graph.probe.get_node_names()), f'nodes of {name}')
    for node in nodes:
        assert graph.get_parameters(node, 'model.stiffness') == [3.0e-3]
    assert process.stop(signal.SIGINT) == 0
    assert 'Traceback' not in process.stderr
    assert 'unknown' not in process.stderr


def test_the_experiment_explains_itself():
    answer = subprocess.run(
        [str(script('paper_table')), '--help'], capture_output=True, text=True, check=True
    )
    for option in ('--beyond', '--plot', '--csv', '--real-time'):
        assert option in answer.stdout


def test_the_launch_file_starts_the_three_nodes(graph):
    pytest.importorskip('launch_ros')
    process = graph.run(
        ['ros2', 'launch', str(CHECKOUT / 'launch' / 'demo.launch.py'), 'namespace:=left']
    )
    graph.expect(
        lambda: (
            {('flat_planner', '/left'), ('flat_plant', '/left'), ('flat_monitor', '/left')}
            <= set(graph.probe.get_node_names_and_namespaces())
        ),
        'the three nodes',
    )
    process.stop(signal.SIGINT)


def test_options_for_ros_without_ros_args_get_a_hint():
    command = [str(script('planner_node')), '--params-file', 'arm.yaml']
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 2
    assert 'put --ros-args before --params-file' in answer.stderr
