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

"""What every test relies on: repeatable examples, an up-to-date package, a known state of ROS."""

from importlib import import_module
import os
from pathlib import Path

from flat_planner_ros.programs import THREADS
from flat_planner_ros.ros.dds_profile import profile_environment
from hypothesis import settings
import pytest

CHECKOUT = Path(__file__).resolve().parent.parent
PACKAGE = 'flat_planner_ros'
ROS_TESTS = CHECKOUT / 'test' / 'ros'
CORE_TESTS = CHECKOUT / 'test' / 'core'

KNOWN_SKIPS = {
    'launch_ros': 'comes with ROS only',
    'ros2launch': 'comes with ROS only',
    'no Chromium': 'a program of the system',
    'no Node.js': 'a program of the system',
    'control_msgs': 'comes with ROS, or is made where there is a compiler',
    'no right to make network namespaces': 'a right that root has',
}
"""What the reason of a skip may name, and why it is not mended by installing more."""

settings.register_profile('ci', derandomize=True, deadline=None, database=None, print_blob=True)
settings.register_profile('local', deadline=None)
settings.load_profile('ci' if os.environ.get('CI') else 'local')

# Before any message class is imported, and inherited by the nodes that the tests start.
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

# Before the first node is made: without it nodes may find each other 3 s late.
os.environ.update(profile_environment(os.environ))

# Before linear algebra is loaded, as programs do: more threads would wait for each other.
for variable in THREADS:
    os.environ.setdefault(variable, '1')

try:
    import_module('rclpy')
    ROS_ERROR = None
except ImportError as error:
    ROS_ERROR = error


def _sources(package: Path) -> dict[str, str]:
    """Return the modules below a directory by their relative path."""
    return {str(p.relative_to(package)): p.read_text('utf-8') for p in package.rglob('*.py')}


def pytest_configure(config: pytest.Config) -> None:
    """Refuse to test other code than that of the checkout, or to skip what must run."""
    # pytest-xdist is to take the files as they come (`pytest_collection_modifyitems`).
    config.option.loadscopereorder = False
    tested = Path(import_module(PACKAGE).__file__).parent
    differing = _sources(tested).items() ^ _sources(CHECKOUT / PACKAGE).items()
    if differing:
        names = ', '.join(sorted({name for name, _ in differing}))
        raise pytest.UsageError(
            f'{tested} is not the code of this checkout: run "make install" (differing: {names})'
        )
    if os.environ.get('REQUIRE_ROS') == '1' and not hasattr(config, 'workerinput'):
        config.pluginmanager.register(_SkipsWatch())
    if ROS_ERROR is not None and os.environ.get('REQUIRE_ROS') == '1':
        raise pytest.UsageError(f'REQUIRE_ROS=1, but rclpy is not usable: {ROS_ERROR}')


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the nodes, which wait most of the time; the core's many small files end it."""
    items.sort(
        key=lambda item: (CORE_TESTS in item.path.parents, ROS_TESTS not in item.path.parents)
    )


class _SkipsWatch:
    """Makes a run fail whose skips are not all of a known kind."""

    def __init__(self) -> None:
        """Begin without skips."""
        self._unknown: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note the skip of a test."""
        self._note(report)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Note the skip of a file."""
        self._note(report)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Fail."""
        if self._unknown and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter) -> None:
        """Say which skips are new."""
        for skip in sorted(self._unknown):
            terminalreporter.write_line(f'a new kind of skip: {skip}', red=True)

    def _note(self, report: pytest.TestReport | pytest.CollectReport) -> None:
        if not report.skipped or hasattr(report, 'wasxfail'):
            return
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        if not any(known in reason for known in KNOWN_SKIPS):
            self._unknown.add(f'{report.nodeid}: {reason}')


class _NeedsRos(pytest.Module):
    """A module of tests that is skipped as a whole."""

    def collect(self):
        """Skip, with the reason."""
        pytest.skip(f'rclpy is not usable: {ROS_ERROR}', allow_module_level=True)


def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector):
    """Skip the tests of the nodes where there is no ROS."""
    if ROS_ERROR is not None and ROS_TESTS in module_path.parents:
        return _NeedsRos.from_parent(parent, path=module_path)
    return None
