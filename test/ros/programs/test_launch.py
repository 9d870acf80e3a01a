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

"""What the launch files start, by the command lines that reach the programs."""

from contextlib import suppress
import os
from pathlib import Path
import signal
import subprocess
import sys
from time import monotonic

from flat_planner_ros.figures.paper_example import SCENARIOS
from flat_planner_ros.ros.dds_profile import FILES, variable
import pytest
import yaml

CHECKOUT = Path(__file__).resolve().parents[3]
LAUNCH = CHECKOUT / 'launch'
OWN = {
    'flat_planner_ros': ('planner_node', 'plant_node', 'monitor_node', 'tracker_node', 'record')
}
VIEWERS = {
    'robot_state_publisher': ('robot_state_publisher',),
    'tf2_ros': ('static_transform_publisher',),
    'rviz2': ('rviz2',),
}
DEADLINE = 60.0
"""Time in which all programs must have been started, on a busy machine [s]."""

STAND_IN = f"""#!{sys.executable}
import os, pathlib, signal, sys, yaml
files = [sys.argv[i + 1] for i, a in enumerate(sys.argv) if a == '--params-file']
contents = [yaml.safe_load(pathlib.Path(file).read_text()) for file in files]
name = next((a[8:] for a in sys.argv if a.startswith('__node:=')), pathlib.Path(sys.argv[0]).name)
path = pathlib.Path(RECORDS) / name
profiles = os.environ.get('{variable()}', '')
path.with_suffix('.tmp').write_text(yaml.dump([sys.argv[1:], contents, profiles]))
path.with_suffix('.tmp').rename(path)
signal.sigwait([signal.SIGINT, signal.SIGTERM])
"""
"""A program that writes down how it was started, and waits for its end."""


ROS2 = 'import sys; from ros2cli.cli import main; sys.exit(main())'
"""The program ros2, of the Python that runs the tests."""


class Launched:
    """A launch of stand-ins for all programs."""

    def __init__(self, folder, packages):
        """Make an ament prefix with some packages."""
        self.prefix, self.records = folder / 'prefix', folder / 'records'
        self.records.mkdir()
        index = self.prefix / 'share' / 'ament_index' / 'resource_index' / 'packages'
        index.mkdir(parents=True)
        for package, programs in packages.items():
            (index / package).touch()
            share, libexec = (self.prefix / kind / package for kind in ('share', 'lib'))
            libexec.mkdir(parents=True)
            share.mkdir()
            for program in programs:
                file = libexec / program
                file.write_text(STAND_IN.replace('RECORDS', repr(str(self.records))))
                file.chmod(0o755)
        (self.prefix / 'share' / 'flat_planner_ros' / 'config').symlink_to(CHECKOUT / 'config')

    def run(self, file, *arguments, names):
        """Return the arguments and parameter files of programs, by the names of their nodes."""
        command = [sys.executable, '-c', ROS2, 'launch', str(LAUNCH / file), *arguments]
        prefixes = [str(self.prefix), os.environ.get('AMENT_PREFIX_PATH', '')]
        inherited = {name: text for name, text in os.environ.items() if name not in FILES}
        environment = {
            **inherited,
            'AMENT_PREFIX_PATH': os.pathsep.join(prefixes),
            'PYTHONPATH': str(CHECKOUT),
            'ROS_LOG_DIR': str(self.records / 'log'),
        }
        output = (self.records / 'output').open('w')
        process = subprocess.Popen(
            command, env=environment, stdout=output, stderr=output, start_new_session=True
        )
        try:
            end = monotonic() + DEADLINE
            while not all((self.records / name).exists() for name in names):
                assert process.poll() is None, self.output
                assert monotonic() < end, self.output
                with suppress(subprocess.TimeoutExpired):
                    process.wait(0.05)
        finally:
            process.send_signal(signal.SIGINT)
            with suppress(subprocess.TimeoutExpired):
                process.wait(10.0)
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            output.close()
        started = {path.name for path in self.records.iterdir() if path.is_file()} - {'output'}
        assert started == set(names)
        return {name: yaml.safe_load((self.records / name).read_text()) for name in names}

    @property
    def output(self):
        """Return what launch has said."""
        return (self.records / 'output').read_text()


@pytest.fixture
def launched(tmp_path, request):
    """Return a launch of our own programs, and of those that a test names."""
    pytest.importorskip('launch_ros')
    pytest.importorskip('ros2launch')
    return Launched(tmp_path, {**OWN, **getattr(request, 'param', {})})


def parameters(record):
    """Return the parameters of all files, later ones winning."""
    values = {}
    for content in record[1]:
        for block in content.values():
            values.update(block['ros__parameters'])
    return values


def remappings(record):
    """Return what follows -r."""
    arguments = record[0]
    rules = [arguments[i + 1] for i, text in enumerate(arguments) if text == '-r']
    return dict(rule.split(':=') for rule in rules)


NODES = ['flat_planner', 'flat_plant', 'flat_monitor']


def test_nodes_are_given_the_profiles_of_the_middleware(launched):
    records = launched.run('demo.launch.py', 'view:=false', names=NODES)
    wanted = dict(zip(FILES, ('fastdds.xml', 'fastdds3.xml'), strict=True))[variable()]
    assert {Path(record[2]).name for record in records.values()} == {wanted}


@pytest.mark.parametrize(('chosen', 'found'), [('none', ''), ('/my/own.xml', '/my/own.xml')])
def test_the_profiles_are_a_choice(launched, chosen, found):
    profile = f'dds_profile:={chosen}'
    records = launched.run('demo.launch.py', 'view:=false', profile, names=NODES)
    assert {record[2] for record in records.values()} == {found}


def test_the_demo_says_what_it_leaves_out_and_starts_the_rest(launched):
    records = launched.run('demo.launch.py', names=NODES)
    assert 'robot_state_publisher is not installed' in launched.output
    assert 'Traceback' not in launched.output
    assert remappings(records['flat_planner'])['~/joint_trajectory'] == (
        'flat_planner/joint_trajectory'
    )
    assert parameters(records['flat_plant'])['publish_clock'] is False


def test_the_arguments_of_the_demo_reach_the_nodes(launched):
    arguments = (
        *('namespace:=left', 'use_sim_time:=true', 'log_level:=debug', 'scenario:=3'),
        *('strategy:=polynomial', 'record:=true', 'command_interface:=position'),
    )
    records = launched.run('demo.launch.py', *arguments, names=[*NODES, 'record'])
    for name, record in records.items():
        assert remappings(record)['__ns'] == '/left', name
        assert record[0][record[0].index('--log-level') + 1] == 'debug'
    assert parameters(records['flat_planner'])['strategy'] == 'polynomial'
    assert parameters(records['flat_planner'])['use_sim_time'] is True
    plant = parameters(records['flat_plant'])
    assert plant['drive'] == parameters(records['flat_planner'])['drive'] == 'position'
    assert plant['publish_clock'] is True
    assert plant['mismatch'] == {
        'stiffness_scale': 1.1,
        'damping_scale': 1.1,
        'inertia_scale': 1.0,
    }


def test_a_real_arm_gets_the_command_on_its_controllers_topic(launched):
    records = launched.run(
        'planner.launch.py', 'command_interface:=position', names=['flat_planner', 'flat_monitor']
    )
    planner = records['flat_planner']
    assert remappings(planner)['~/joint_trajectory'] == 'flat_arm_controller/joint_trajectory'
    assert parameters(planner)['command'] == {
        'include_passive_joint': False,
        'include_effort': False,
    }
    assert all(parameters(record)['drive'] == 'position' for record in records.values())
    assert 'is not installed' not in launched.output


def test_a_tracker_closes_the_loop_where_it_is_wanted(launched):
    records = launched.run('demo.launch.py', 'tracker:=true', names=[*NODES, 'flat_tracker'])
    plant = parameters(records['flat_plant'])
    assert (plant['input'], plant['publish_rate']) == ('tracker', 500.0)
    rules = remappings(records['flat_tracker'])
    command = remappings(records['flat_planner'])['~/joint_trajectory']
    assert rules['flat_planner/joint_trajectory'] == command
    assert rules['~/effort_commands'] == 'flat_tracker/effort_commands'


def test_a_tracker_beside_an_action_is_refused(launched):
    arguments = 'tracker:=true', 'command_action:=flat_arm_controller/follow_joint_trajectory'
    with pytest.raises(AssertionError, match='command_action and tracker exclude each other'):
        launched.run('planner.launch.py', *arguments, names=['flat_planner'])


@pytest.mark.parametrize('launched', [VIEWERS], indirect=True, ids=['viewers'])
def test_arm_and_ghost_are_described_where_ros_has_the_programs(launched):
    publishers = ['robot_state_publisher', 'ghost_state_publisher']
    records = launched.run(
        'view.launch.py',
        'rviz:=true',
        'namespace:=left',
        names=[*publishers, 'ghost_base', 'rviz'],
    )
    assert 'not installed' not in launched.output
    arm, ghost = (parameters(records[name]) for name in publishers)
    assert arm['robot_description'] == ghost['robot_description']
    assert '<joint name="joint2"' in arm['robot_description']
    assert 'frame_prefix' not in arm
    assert ghost['frame_prefix'] == 'ghost/'
    rules = remappings(records['ghost_state_publisher'])
    assert rules['joint_states'] == 'flat_planner/reference'
    assert rules['robot_description'] == 'ghost_description'
    for name in records:
        assert remappings(records[name])['/tf'] == 'tf'
    frames = records['ghost_base'][0]
    assert frames[frames.index('--frame-id') + 1] == 'base_link'
    assert frames[frames.index('--child-frame-id') + 1] == 'ghost/base_link'
    config = records['rviz'][0][records['rviz'][0].index('--display-config') + 1]
    assert Path(config).name == 'flat_planner.rviz'


@pytest.mark.parametrize('scenario', SCENARIOS, ids=lambda scenario: scenario.number)
def test_the_scenarios_files_are_the_papers(scenario):
    file = CHECKOUT / 'config' / 'scenarios' / f'scenario_{scenario.number}.yaml'
    content = yaml.safe_load(file.read_text('utf-8'))
    if scenario.damping_factor == 0.0:
        assert content == {'/**': {'ros__parameters': {'model': {'damping': 0.0}}}}
        return
    (block,) = content.values()
    assert block['ros__parameters']['mismatch'] == {
        'stiffness_scale': scenario.stiffness_scale,
        'damping_scale': scenario.damping_scale,
        'inertia_scale': 1.0,
    }
