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
