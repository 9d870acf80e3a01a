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

"""ROS's own linters, where they are installed, and what they cannot tell."""

from configparser import ConfigParser
from importlib import import_module
from importlib.util import find_spec
import os
from pathlib import Path
import re
import shutil
import subprocess
from xml.etree import ElementTree

from clean_files import CleanFiles
from license_header import FOLDERS, python_files, without_header
import pytest

CHECKOUT = Path(__file__).resolve().parent.parent
CONFIGURATION = Path(__file__).with_name('flake8.ini')
FORMAT_3 = {
    'name',
    'version',
    'description',
    'maintainer',
    'license',
    'url',
    'author',
    'depend',
    'exec_depend',
    'test_depend',
    'doc_depend',
    'export',
}
"""What an ament_python package may say of itself by REP 149."""

IN_ORDER = ('name', 'version', 'description', 'maintainer', 'license')
"""What comes first, in the order of REP 149; the rest in groups."""

ROSDEP_KEYS = {
    'python3-hypothesis',
    'python3-matplotlib',
    'python3-mypy',
    'python3-numpy',
    'python3-pytest',
    'python3-pytest-timeout',
    'python3-pytest-xdist',
    'python3-scipy',
    'python3-yaml',
}
"""Keys of rosdistro's rosdep/python.yaml that have a package on Ubuntu 24.04."""

ROS_PACKAGES = {
    'action_msgs',
    'ament_copyright',
    'ament_flake8',
    'ament_index_python',
    'ament_pep257',
    'ament_xmllint',
    'builtin_interfaces',
    'diagnostic_msgs',
    'launch',
    'launch_ros',
    'rcl_interfaces',
    'rclpy',
    'rosgraph_msgs',
    'sensor_msgs',
    'std_msgs',
    'std_srvs',
    'trajectory_msgs',
    'visualization_msgs',
}
"""Packages that are released into ROS 2 Jazzy."""


@pytest.fixture
def checkout(monkeypatch):
    """Return to the checkout, where linters look for files, and do not look at builds."""
    monkeypatch.chdir(CHECKOUT)


@pytest.fixture
def memory(request, tmp_path):
    """Return where linters keep what they found: the cache of pytest, where there is one."""
    cache = getattr(request.config, 'cache', None)
    return cache.mkdir('linters') if cache else tmp_path


def test_flake8_as_ros_has_it(checkout, memory):
    linter = pytest.importorskip('ament_flake8.main')
    clean = CleanFiles(memory, 'flake8', CONFIGURATION.read_text('utf-8'))
    if files := clean.others(python_files()):
        failed, errors = linter.main_with_errors(['--config', str(CONFIGURATION), *names(files)])
        assert not failed, '\n'.join(errors)
        clean.remember(python_files())


def test_pep257_as_ros_has_it(checkout, memory):
    linter = pytest.importorskip('ament_pep257.main')
    clean = CleanFiles(memory, 'pep257')
    if files := clean.others(python_files()):
        assert linter.main(names(files)) == 0
        clean.remember(python_files())


def names(files):
    """Return the names of files as seen from the checkout."""
    return [str(path.relative_to(CHECKOUT)) for path in files]


def test_linters_look_at_what_is_not_known_to_be_clean(tmp_path):
    files = [tmp_path / 'a.py', tmp_path / 'b.py']
    for path in files:
        path.write_text('x = 1\n')
    assert CleanFiles(tmp_path, 'one').others(files) == files
    CleanFiles(tmp_path, 'one').remember(files)
    assert CleanFiles(tmp_path, 'one').others(files) == []
    assert CleanFiles(tmp_path, 'another').others(files) == files
    assert CleanFiles(tmp_path, 'one', 'in another way').others(files) == files
    files[0].write_text('x = 2\n')
    assert CleanFiles(tmp_path, 'one').others(files) == files[:1]
    CleanFiles(tmp_path, 'one').remember(files)
    files[0].write_text('x = 1\n')
    assert CleanFiles(tmp_path, 'one').others(files) == files[:1]


def test_copyright_as_ros_has_it(checkout):
    """Where ROS's linter is not installed, what it looks for is looked for here."""
    if find_spec('ament_copyright'):
        assert import_module('ament_copyright.main').main([*FOLDERS, 'setup.py']) == 0
    else:
        assert not [path for path in python_files() if not has_notice(path.read_text('utf-8'))]


def has_notice(text):
    """Tell whether a file begins with a copyright and the notice that the licence asks for."""
    licence = (CHECKOUT / 'LICENSE').read_text('utf-8').split()
    notice = licence[len(licence) - licence[::-1].index('Licensed') - 1 :]
    comment = re.match(r'(?:#.*\n)+', text)
    first, *others = comment[0].replace('#', '').strip().splitlines() if comment else ['']
    return (
        re.fullmatch(r'Copyright \d{4}(-\d{4})? \w.*', first) is not None
        and ' '.join(others).split() == notice
    )


@pytest.mark.parametrize(
    ('old', 'new'),
    [
        ('Copyright 2026', 'Copyright'),
        ('2026 flat_planner_ros developers', '2026'),
        ('Apache License', 'MIT License'),
        ('# limitations under the License.\n', ''),
        ('# Copyright', '\n# Copyright'),
    ],
)
def test_a_notice_that_is_not_the_licence_s_is_noticed(old, new):
    text = Path(__file__).read_text('utf-8')
    assert has_notice(text)
    assert not has_notice(text.replace(old, new, 1))


def test_every_file_has_the_licence_header():
    assert not without_header(), 'run python test/license_header.py'


def test_the_configuration_is_that_of_ros_but_for_slices():
    package = pytest.importorskip('ament_flake8')
    theirs, ours = ConfigParser(), ConfigParser()
    theirs.read(Path(package.__file__).parent / 'configuration' / 'ament_flake8.ini')
    ours.read(CONFIGURATION)
    mine, its = dict(ours['flake8']), dict(theirs['flake8'])
    mine['extend-ignore'] = mine['extend-ignore'].removesuffix(',E203')
    assert mine == its


def test_xml_is_well_formed_and_valid():
    path = CHECKOUT / 'package.xml'
    root = ElementTree.parse(path).getroot()
    assert root.tag == 'package'
    assert root.get('format') == '3'
    program = shutil.which('xmllint')
    if program:
        # The schema itself may be out of reach: form only.
        subprocess.run([program, '--noout', str(path)], check=True, env={**os.environ})


def test_the_manifest_follows_rep_149():
    root = ElementTree.parse(CHECKOUT / 'package.xml').getroot()
    tags = [child.tag for child in root]
    assert set(tags) <= FORMAT_3
    assert tuple(tags[: len(IN_ORDER)]) == IN_ORDER
    assert re.fullmatch(r'[a-z]([a-z0-9_]*[a-z0-9])?', root.findtext('name'))
    assert re.fullmatch(r'\d+\.\d+\.\d+', root.findtext('version'))
    assert (CHECKOUT / root.find('license').get('file')).is_file()
    assert root.find('maintainer').get('email')
    assert root.findtext('export/build_type') == 'ament_python'


def test_every_dependency_is_a_key_of_rosdep_or_a_package_of_the_distribution():
    root = ElementTree.parse(CHECKOUT / 'package.xml').getroot()
    keys = [child.text for child in root if child.tag.endswith('depend')]
    assert len(keys) == len(set(keys))
    assert set(keys) <= ROSDEP_KEYS | ROS_PACKAGES
    for tag in ('exec_depend', 'test_depend'):
        listed = [child.text for child in root.iter(tag)]
        assert listed == sorted(listed)


def test_the_changelog_follows_rep_132():
    lines = (CHECKOUT / 'CHANGELOG.rst').read_text('utf-8').splitlines()
    title = 'Changelog for package flat_planner_ros'
    assert lines[:3] == ['^' * len(title), title, '^' * len(title)]
    heads = [i for i, line in enumerate(lines) if set(line) == {'-'}]
    assert heads
    for i in heads:
        assert re.fullmatch(r'Forthcoming|\d+\.\d+\.\d+ \(\d{4}-\d{2}-\d{2}\)', lines[i - 1])
        assert len(lines[i]) == len(lines[i - 1])
    released = re.findall(r'^(\d+\.\d+\.\d+) \(', '\n'.join(lines), re.MULTILINE)
    root = ElementTree.parse(CHECKOUT / 'package.xml').getroot()
    # Until the first release there is Forthcoming alone.
    assert not released or released[0] == root.findtext('version')
    assert sum(lines[i - 1] == 'Forthcoming' for i in heads) <= 1
    titles = {j for i in heads for j in (i - 1, i)}
    body = [line for j, line in enumerate(lines[3:], 3) if line and j not in titles]
    assert all(line.startswith(('* ', '  ')) for line in body)
