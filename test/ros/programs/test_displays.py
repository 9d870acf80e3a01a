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

"""What RViz, Foxglove and PlotJuggler are told to show exists in our topics and messages."""

import json
from pathlib import Path
import re
from xml.etree import ElementTree

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.nodes.plant_node import PlantNode
from flat_planner_ros.ros.wire import interfaces
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
import yaml

CHECKOUT = Path(__file__).resolve().parents[3]
CONFIG = CHECKOUT / 'config'
FOXGLOVE = json.loads((CONFIG / 'foxglove' / 'flat_planner.json').read_text('utf-8'))
PLOTJUGGLER = ElementTree.parse(CONFIG / 'plotjuggler' / 'flat_planner.xml').getroot()
RVIZ = yaml.safe_load((CONFIG / 'rviz' / 'flat_planner.rviz').read_text('utf-8'))
VIEW = (CHECKOUT / 'launch' / 'view.launch.py').read_text('utf-8')
KEYS = (CHECKOUT / 'docs' / 'interfaces.md').read_text('utf-8')

MESSAGES = {
    f'{kind.__module__.split(".")[0]}/{kind.__name__}': kind
    for kind in (
        DiagnosticArray,
        DiagnosticStatus,
        Header,
        JointState,
        JointTrajectory,
        JointTrajectoryPoint,
        KeyValue,
    )
}
STATUS_NAMES = {
    '/flat_planner/status': interfaces.STATUS_NAME,
    '/flat_monitor/report': interfaces.REPORT_NAME,
}
PANELS = {'3D', 'CallService', 'DiagnosticStatusPanel', 'Plot', 'Publish'}
"""Types of Foxglove's panels that are used."""


@pytest.fixture
def types(graph):
    """Return the types of all topics and services of the three nodes."""
    for node in (PlannerNode, PlantNode, MonitorNode):
        graph.create(node)
    found = dict(graph.probe.get_topic_names_and_types())
    found |= dict(graph.probe.get_service_names_and_types())
    return {
        name: kinds[0].replace('/msg/', '/').replace('/srv/', '/') for name, kinds in found.items()
    }


def field_type(kind, path):
    """Return the type at a path like status[0].message in a message."""
    for step in path.split('.'):
        name, indexed = re.fullmatch(r'(\w+)(\[\d\])?', step).groups()
        kind = MESSAGES[kind].get_fields_and_field_types()[name]
        assert kind.startswith('sequence<') == bool(indexed), path
        kind = kind.removeprefix('sequence<').removesuffix('>')
    return kind


def leaves(layout):
    """Return the panels of a tree of splits."""
    if isinstance(layout, str):
        return [layout]
    assert layout['direction'] in ('row', 'column')
    assert 0 < layout['splitPercentage'] < 100
    return leaves(layout['first']) + leaves(layout['second'])


def panels(kind):
    """Return the settings of all panels of one type."""
    return [p for name, p in FOXGLOVE['configById'].items() if name.startswith(f'{kind}!')]


def test_foxgloves_layout_shows_each_of_its_panels_once():
    assert set(FOXGLOVE) == {
        'configById',
        'globalVariables',
        'userNodes',
        'playbackConfig',
        'layout',
    }
    assert sorted(leaves(FOXGLOVE['layout'])) == sorted(FOXGLOVE['configById'])
    assert {name.partition('!')[0] for name in FOXGLOVE['configById']} == PANELS


def test_foxgloves_plots_are_numbers_of_our_topics(types):
    paths = [path for plot in panels('Plot') for path in plot['paths']]
    assert len(paths) > 8
    for path in paths:
        topic, _, field = path['value'].partition('.')
        assert field_type(types[topic], field) == 'double', path
        assert path['timestampMethod'] == 'headerStamp'


def test_foxgloves_buttons_and_tables_are_of_our_interface(types):
    for panel in panels('DiagnosticStatusPanel'):
        assert types[panel['topicToRender']] == 'diagnostic_msgs/DiagnosticArray'
        assert panel['selectedName'] == STATUS_NAMES[panel['topicToRender']]
    (publish,) = panels('Publish')
    assert types[publish['topicName']] == publish['datatype'].replace('/msg/', '/')
    goal = json.loads(publish['value'])
    assert set(goal) == set(JointTrajectory.get_fields_and_field_types())
    assert set(goal['points'][0]) == set(JointTrajectoryPoint.get_fields_and_field_types())
    (service,) = panels('CallService')
    assert types[service['serviceName']] == 'std_srvs/Trigger'


def test_foxglove_shows_what_the_launch_file_describes():
    (scene,) = panels('3D')
    layers = [x for x in scene['layers'].values() if x['layerId'] == 'foxglove.Urdf']
    assert [(x['topic'], x['framePrefix']) for x in layers] == [
        ('/robot_description', ''),
        ('/ghost_description', 'ghost/'),
    ]
    assert scene['followTf'] == 'base_link'
    assert "GHOST = 'ghost/'" in VIEW


def test_plotjugglers_curves_are_numbers_of_our_topics(types):
    curves = [curve.get('name') for curve in PLOTJUGGLER.iter('curve')]
    plugin = PLOTJUGGLER.find('Plugins/plugin')
    topics = plugin.find('selected_topics').get('value').split(';')
    assert len(curves) > 8
    for curve in curves:
        topic = next(t for t in topics if curve.startswith(f'{t}/'))
        name, _, field = curve.removeprefix(f'{topic}/').rpartition('/')
        if types[topic] == 'sensor_msgs/JointState':
            assert name in ('joint1', 'joint2')
            assert field in ('position', 'velocity', 'effort')
            continue
        assert types[topic] == 'diagnostic_msgs/DiagnosticArray'
        assert name == STATUS_NAMES[topic]
        key = re.sub(r'\.joint\d', '.<joint>', field)
        assert f'`{key}`' in KEYS, key


def test_plotjugglers_layout_has_the_structure_that_it_reads():
    (window,) = PLOTJUGGLER.findall('tabbed_widget')
    assert window.get('parent') == 'main_window'
    for tab in window.findall('Tab'):
        (splitter,) = tab.findall('Container/DockSplitter')
        areas = splitter.findall('DockArea')
        assert len(areas) == int(splitter.get('count')) == int(tab.get('containers')) * 3
        assert sum(map(float, splitter.get('sizes').split(';'))) == pytest.approx(1, abs=1e-5)
        for area in areas:
            (plot,) = area.findall('plot')
            assert plot.get('mode') == 'TimeSeries'
            assert plot.find('range') is not None
    streamer = PLOTJUGGLER.find('previouslyLoaded_Streamer').get('name')
    assert streamer == PLOTJUGGLER.find('Plugins/plugin').get('ID') == 'ROS2 Topic Subscriber'


def test_rviz_shows_the_arm_and_its_ghost():
    manager = RVIZ['Visualization Manager']
    models = [d for d in manager['Displays'] if d['Class'].endswith('/RobotModel')]
    assert [(d['Description Topic']['Value'], d['TF Prefix']) for d in models] == [
        ('robot_description', ''),
        ('ghost_description', 'ghost'),
    ]
    for model in models:
        assert model['Description Topic']['Durability Policy'] == 'Transient Local'
    assert models[1]['Alpha'] < models[0]['Alpha']
    assert manager['Global Options']['Fixed Frame'] == 'base_link'
    assert "('robot_description', 'ghost_description')" in VIEW
