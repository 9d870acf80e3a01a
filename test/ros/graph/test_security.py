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

"""The security policy allows what the nodes use and nothing else; nothing received is executed."""

import ast
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

from flat_planner_ros.ros.nodes.monitor_node import MonitorNode
from flat_planner_ros.ros.nodes.planner_node import PlannerNode
from flat_planner_ros.ros.nodes.plant_node import PlantNode
from flat_planner_ros.ros.nodes.tracker_node import TrackerNode
import pytest
from rclpy.node import Node

CHECKOUT = Path(__file__).resolve().parents[3]
POLICY_FILE = CHECKOUT / 'config' / 'sros2' / 'policy.xml'
POLICY = ElementTree.parse(POLICY_FILE).getroot()
NODES = {
    'flat_planner': PlannerNode,
    'flat_plant': PlantNode,
    'flat_monitor': MonitorNode,
    'flat_tracker': TrackerNode,
}
LISTENS_TO_ITSELF = {'flat_tracker': {'/diagnostics', '/flat_tracker/effort_commands'}}
"""Topics that a node hears only once somebody else publishes there."""


def allowed(enclave, kind, right):
    """Return the names that an enclave has a right to."""
    profile = POLICY.find(f"enclaves/enclave[@path='/{enclave}']/profiles/profile")
    return {e.text for block in profile.findall(kind) if block.get(right) for e in block}


def test_the_policy_follows_the_schema():
    assert POLICY.tag == 'policy'
    assert POLICY.attrib == {'version': '0.2.0'}
    rights = {'topics': {'publish', 'subscribe'}, 'services': {'reply', 'request'}}
    rights['actions'] = {'execute', 'call'}
    for enclave in POLICY.find('enclaves'):
        assert enclave.get('path').startswith('/')
        (profiles,) = enclave
        for profile in profiles:
            assert set(profile.attrib) == {'ns', 'node'}
            for block in profile:
                assert set(block.attrib) <= rights[block.tag]
                assert set(block.attrib.values()) == {'ALLOW'}
                assert {e.tag for e in block} == {block.tag[:-1]}


def test_sros2_can_read_the_policy():
    # It takes whatever stands in <enclaves> for an enclave and fails on a comment.
    builder = ElementTree.TreeBuilder(insert_comments=True)
    parser = ElementTree.XMLParser(target=builder)
    enclaves = ElementTree.parse(POLICY_FILE, parser).getroot().find('enclaves')
    assert {e.tag for e in enclaves} == {'enclave'}


@pytest.mark.parametrize('name', NODES)
def test_a_node_may_do_what_it_does_and_no_more(graph, name):
    used = {'publish': set(), 'subscribe': set(), 'reply': set()}
    streams = [{'input': 'effort'}, {'input': 'tracker'}]
    variants = {'flat_plant': [{'publish_clock': True}, *streams]}
    for parameters in ({}, {'use_sim_time': True}, *variants.get(name, [])):
        node = graph.create(NODES[name], parameters)
        for right, names in {
            'publish': node.get_publisher_names_and_types_by_node(name, '/'),
            'subscribe': node.get_subscriber_names_and_types_by_node(name, '/'),
            'reply': node.get_service_names_and_types_by_node(name, '/'),
        }.items():
            # Those of actions have rights by themselves.
            used[right] |= {topic for topic, _ in names if '/_action/' not in topic}
        graph.remove(node)
    assert used['publish'] == allowed(name, 'topics', 'publish')
    used['subscribe'] |= LISTENS_TO_ITSELF.get(name, set())
    assert used['subscribe'] == allowed(name, 'topics', 'subscribe')
    assert used['reply'] == allowed(name, 'services', 'reply')


@pytest.mark.parametrize('enclave', ['operator', 'administrator'])
def test_those_who_use_the_nodes_may_have_a_node(graph, enclave):
    def is_allowed(topic, kind, right):
        return any(fnmatchcase(topic, name) for name in allowed(enclave, kind, right))

    for name in (enclave, '_ros2cli_1234'):  # the ros2 tool's
        node = graph.create(partial(Node, name))
        published = {topic for topic, _ in node.get_publisher_names_and_types_by_node(name, '/')}
        offered = {service for service, _ in node.get_service_names_and_types_by_node(name, '/')}
        graph.remove(node)
        assert {'/parameter_events', '/rosout'} <= published
        assert f'/{name}/get_parameters' in offered
        assert all(is_allowed(topic, 'topics', 'publish') for topic in published)
        assert all(is_allowed(service, 'services', 'reply') for service in offered)
    # In nobody else's name.
    assert not any(is_allowed(f'/{other}/get_parameters', 'services', 'reply') for other in NODES)


def test_only_the_planner_commands_and_only_the_operator_sends_goals():
    enclaves = [e.get('path')[1:] for e in POLICY.find('enclaves')]
    senders = {
        topic: {e for e in enclaves if topic in allowed(e, 'topics', 'publish')}
        for topic in ('/flat_planner/joint_trajectory', '/flat_planner/goal')
    }
    assert senders == {
        '/flat_planner/joint_trajectory': {'flat_planner'},
        '/flat_planner/goal': {'operator'},
    }
    assert not any('set_parameters' in s for s in allowed('operator', 'services', 'request'))


FORBIDDEN = {'eval', 'exec', 'compile', '__import__', 'os.system', 'os.popen'}
FORBIDDEN |= {'yaml.unsafe_load', 'yaml.full_load', 'yaml.unsafe_load_all', 'yaml.full_load_all'}
SAFE_LOADERS = {'yaml.SafeLoader', 'yaml.CSafeLoader'}


@pytest.mark.parametrize(
    'path', sorted((CHECKOUT / 'flat_planner_ros').rglob('*.py')), ids=lambda path: path.stem
)
def test_nothing_received_is_executed(path):
    tree = ast.parse(path.read_text('utf-8'))
    safe = SAFE_LOADERS | {
        found.name
        for found in ast.walk(tree)
        if isinstance(found, ast.ClassDef)
        and {ast.unparse(base) for base in found.bases} & SAFE_LOADERS
    }
    for found in ast.walk(tree):
        if isinstance(found, ast.Import | ast.ImportFrom):
            modules = {alias.name for alias in found.names} | {getattr(found, 'module', None)}
            assert not modules & {'pickle', 'marshal', 'shelve', 'dill', 'joblib', 'cloudpickle'}
        if isinstance(found, ast.Call):
            name = ast.unparse(found.func)
            assert name not in FORBIDDEN
            if name in ('yaml.load', 'yaml.load_all'):
                assert ast.unparse(found.args[1]) in safe
            for keyword in found.keywords:
                is_true = getattr(keyword.value, 'value', None) is True
                assert not (keyword.arg in ('shell', 'allow_pickle') and is_true)
