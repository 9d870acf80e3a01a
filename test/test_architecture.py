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

"""The rules of the layout: who may import what, and what the packaging files promise."""

import ast
from functools import cache
from importlib import import_module
from pathlib import Path
import re
import subprocess
import sys
from xml.etree import ElementTree

import pytest

CHECKOUT = Path(__file__).resolve().parent.parent
PACKAGE = CHECKOUT / 'flat_planner_ros'
CORE = PACKAGE / 'core'
ROS = PACKAGE / 'ros'
CORE_FILES = sorted(CORE.rglob('*.py'))
SOURCES = [p for p in sorted(PACKAGE.rglob('*.py')) if p != CORE / '__init__.py']
ROS_FILES = sorted(ROS.rglob('*.py'))
NODES = sorted(ROS.glob('nodes/*_node.py'))

WINGS = {
    'arm': '',
    'motion_law': 'arm',
    'insensitive': 'motion_law arm',
    'peak': 'motion_law insensitive arm',
    'planning': 'motion_law insensitive peak arm',
    'plan_table': 'planning motion_law insensitive arm',
    'session': 'planning tracking model_fit arm',
    'plant': 'arm',
    'monitor': 'model_fit arm',
    'tracking': 'arm',
    'model_fit': 'arm',
    'excitation': 'planning model_fit arm',
    'study': 'plan_table session planning plant tracking insensitive arm',
}
"""The wings of the core, each with the others from whose public lists it may import."""

NEWER = {
    *(('typing', name) for name in ('assert_never', 'LiteralString', 'Never', 'NotRequired')),
    *(('typing', name) for name in ('override', 'Required', 'reveal_type', 'Self', 'Unpack')),
    *(('enum', name) for name in ('EnumType', 'nonmember', 'ReprEnum', 'StrEnum', 'verify')),
    *(('math', name) for name in ('cbrt', 'exp2', 'fma', 'sumprod')),
    ('contextlib', 'chdir'),
    ('datetime', 'UTC'),
    ('itertools', 'batched'),
    ('tomllib', ''),
    *(('np', name) for name in ('astype', 'bool', 'concat', 'cumulative_prod', 'cumulative_sum')),
    *(('np', name) for name in ('isdtype', 'long', 'matrix_transpose', 'matvec', 'permute_dims')),
    *(('np', name) for name in ('pow', 'trapezoid', 'unstack', 'vecdot', 'vecmat')),
    *(('np', name) for name in ('acos', 'asin', 'atan', 'atan2', 'bitwise_count')),
}
"""What libraries have got since Python 3.10 and NumPy 1.26, the oldest that are served."""

MESSAGES_ALLOWED = {
    'conversions.py': 'the one place for messages and core types',
    'joint_states.py': 'the same for joint states, which come in many forms',
    'diagnostics.py': 'the same for verdicts and reports',
    'drift_status.py': 'the same for arms that age',
    'estimates.py': 'the same for estimates, reported and adopted',
    'tracker_word.py': 'what a tracker says of itself, as others hear it',
    '*_node.py': 'the types of its topics and services',
    'page_commands.py': 'goals and services of the live view',
    'status_news.py': 'verdicts and reports as the live view shows them',
    'model_adoption.py': 'hears reports and answers a service for the planner node',
    'row.py': 'descriptors of parameters, from rcl_interfaces',
    'node_parameters.py': 'verdicts on changed parameters, from rcl_interfaces',
    'joint_state_input.py': 'hears joint states for every node',
    'controller_check.py': 'asks a controller for parameters, from rcl_interfaces',
    'rest_services.py': 'answers two services for the planner node',
    'follow_joint_trajectory.py': 'the same as conversions.py for an action',
    'guarded_callbacks.py': 'answers requests that rclpy cannot read, from rcl_interfaces',
    'stamps.py': 'stamps to seconds and back',
    'exciter.py': 'sends goals and reads verdicts as any user does',
    'paper_experiment.py': 'sends goals and reads reports as any user does',
    'tracked_experiment.py': 'calls a service of the tracker besides',
}
"""Patterns of the files that import message packages, each with its reason."""

DISTROS = ('jazzy', 'kilted')
"""Releases of ROS of which an extra brings the client library."""

WITH_RCLPY = {'action_msgs', 'builtin_interfaces', 'rcl_interfaces'}
"""Message packages that the wheel of rclpy brings along."""


def module_name(path: Path) -> str:
    """Return the dotted name of a file of the package, without the suffix of a package."""
    return '.'.join(path.relative_to(CHECKOUT).with_suffix('').parts).removesuffix('.__init__')


NEVER = ('rclpy', 'matplotlib')
"""What importing the core must not need."""

PROBE = f"""
import importlib, os, sys
sys.modules.update(dict.fromkeys({NEVER}))  # any import of them raises ImportError
before = set(sys.modules)
for name in {[module_name(path) for path in CORE_FILES]}:
    importlib.import_module(name)
allowed = sys.stdlib_module_names | {{'numpy', 'scipy', 'flat_planner_ros'}}
libraries = [sys.modules[name].__file__ for name in ('numpy', 'scipy') if name in sys.modules]
homes = tuple(map(os.path.dirname, libraries))  # of compiled modules with names of their own
new = set()
for name in set(sys.modules) - before:
    file = getattr(sys.modules[name], '__file__', None)
    if file and not file.startswith(homes) and not name.startswith('_sysconfigdata'):
        new.add(name.partition('.')[0])
print(*sorted(new))
sys.exit(f'the core imports {{sorted(new - allowed)}}' if new - allowed else 0)
"""


@cache
def imports(path: Path) -> frozenset[str]:
    """Return the absolute names of all modules that a file of the package may import."""
    package = path.relative_to(CHECKOUT).parent.parts
    found = set()
    for node in ast.walk(ast.parse(path.read_text('utf-8'))):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) + 1 - node.level] if node.level else ()
            module = '.'.join((*base, *filter(None, [node.module])))
            found.update([module, *(f'{module}.{alias.name}' for alias in node.names)])
    return frozenset(found)


def roots(path: Path) -> set[str]:
    """Return the top-level packages that a file imports."""
    return {name.partition('.')[0] for name in imports(path)}


def is_message_package(name: str) -> bool:
    """Tell message packages by ROS's convention for their names."""
    return name.endswith(('_msgs', '_srvs', '_interfaces'))


def is_ros(name: str) -> bool:
    """Tell the packages that only a ROS environment has."""
    return is_message_package(name) or name.startswith(('rclpy', 'rcl_', 'ament_', 'launch'))


@cache
def imported_names(path: Path) -> list[tuple[str, set[str]]]:
    """Return what a file imports from other modules of the package, by module."""
    nodes = ast.walk(ast.parse(path.read_text('utf-8')))
    found = [n for n in nodes if isinstance(n, ast.ImportFrom) and n.module]
    return [(n.module, {alias.name for alias in n.names}) for n in found]


@cache
def public_list(wing: str) -> tuple[str, ...]:
    """Return the names in `__all__` of a wing, or of the front door ('')."""
    tree = ast.parse((CORE / wing / '__init__.py').read_text('utf-8'))
    return tuple(ast.literal_eval(tree.body[-1].value))


def wing(module: str) -> str:
    """Return the wing of the core that a module is or belongs to; '' for anything else."""
    parts = module.split('.')
    return parts[2] if parts[:2] == ['flat_planner_ros', 'core'] and len(parts) > 2 else ''


@cache
def setup_arguments() -> dict[str, object]:
    """Return the keywords of the call in setup.py that are literals."""
    tree = ast.parse((CHECKOUT / 'setup.py').read_text('utf-8'))
    call = next(
        n
        for n in ast.walk(tree)
        if isinstance(n, ast.Call) and getattr(n.func, 'id', '') == 'setup'
    )
    arguments = {}
    for keyword in call.keywords:
        try:
            arguments[keyword.arg] = ast.literal_eval(keyword.value)
        except ValueError:
            continue
    return arguments


def distributions(requirements: list[str]) -> set[str]:
    """Return the names in a list of pip requirements."""
    return {re.match(r'[\w.-]+', requirement)[0] for requirement in requirements}


def manifest(tag: str) -> set[str]:
    """Return the texts of all elements of package.xml with a tag."""
    return {e.text for e in ElementTree.parse(CHECKOUT / 'package.xml').iter(tag)}


def scripts() -> list[str]:
    """Return the entry points of setup.py, each as "name = module:function"."""
    return setup_arguments()['entry_points']['console_scripts']


def test_core_needs_only_numpy_and_scipy():
    run = subprocess.run([sys.executable, '-c', PROBE], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert 'flat_planner_ros' in run.stdout.split()


def test_only_the_ros_layer_imports_ros():
    others = [p for p in PACKAGE.rglob('*.py') if p not in ROS_FILES]
    assert len(others) > len(CORE_FILES)
    assert {p.name: found for p in others if (found := set(filter(is_ros, roots(p))))} == {}


def test_the_core_does_not_import_the_rest_of_the_package():
    for path in CORE_FILES:
        ours = {n for n in imports(path) if n.startswith('flat_planner_ros.')}
        assert all(n.startswith('flat_planner_ros.core.') for n in ours), path


def test_every_wing_has_its_row():
    assert {path.name for path in CORE.iterdir() if path.is_dir() and path.name[0] != '_'} == set(
        WINGS
    )


@pytest.mark.parametrize('name', WINGS)
def test_wings_import_in_one_direction(name):
    used = {wing(n) for path in (CORE / name).glob('*.py') for n in imports(path)}
    assert used - {name, ''} <= set(WINGS[name].split())


def test_the_picture_of_the_wings_is_fresh(monkeypatch):
    """Run `python docs/wings.py` if this fails."""
    pytest.importorskip('matplotlib')
    monkeypatch.syspath_prepend(CHECKOUT / 'docs')
    wings = import_module('wings')
    shown = ElementTree.parse(wings.PICTURE).find(
        './/{http://purl.org/dc/elements/1.1/}description'
    )
    assert shown.text == wings.description()


@pytest.mark.parametrize('path', SOURCES, ids=module_name)
def test_wings_are_entered_by_their_public_lists(path):
    """Every name of another wing comes from its list, and the front door is for users alone."""
    own = wing(module_name(path))
    for module, names in imported_names(path):
        if module == 'flat_planner_ros.core':
            raise AssertionError(f'{path} uses the front door')
        if wing(module) not in ('', own):
            assert module.count('.') == 2, f'{path} goes past the list of {module}'
            assert names <= set(public_list(wing(module))), module


def test_the_front_door_loads_what_is_asked_for():
    code = 'import sys, flat_planner_ros.core.arm; print(*sys.modules)'
    run = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert set(map(wing, run.stdout.split())) - {''} == {'arm'}


def test_the_front_door_is_small():
    assert len(public_list('')) <= 32


def test_plant_and_monitor_know_nothing_of_planning_nor_of_each_other():
    assert WINGS['plant'] == WINGS['model_fit'] == 'arm'
    assert WINGS['monitor'] == 'model_fit arm'


@pytest.mark.parametrize('node', NODES, ids=lambda path: path.stem)
def test_nodes_do_not_import_each_other(node):
    others = {path.stem for path in NODES if path != node}
    assert not {name.rpartition('.')[2] for name in imports(node)} & others


@pytest.mark.parametrize('path', ROS_FILES, ids=lambda path: path.stem)
def test_message_packages_have_few_importers(path):
    if not any(path.match(pattern) for pattern in MESSAGES_ALLOWED):
        assert not set(filter(is_message_package, roots(path)))


@pytest.mark.parametrize('folder', ['flat_planner_ros', 'test', 'examples', 'docs', 'benchmarks'])
def test_nothing_is_newer_than_the_oldest_python_and_numpy(folder):
    for path in sorted((CHECKOUT / folder).rglob('*.py')):
        # What only a type checker reads may be newer, hence the imports of the module alone.
        tree = ast.parse(path.read_text('utf-8'))
        found = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
        names = {(node.module, alias.name) for node in found for alias in node.names}
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                names.add((node.value.id, node.attr))
            if isinstance(node, ast.Import):
                names.update((alias.name, '') for alias in node.names)
        assert not names & NEWER, path


def test_versions_agree():
    version = setup_arguments()['version']
    assert manifest('version') == {version}
    # Only so is it found by catkin_prepare_release, which renews these two and no other file.
    assert (CHECKOUT / 'setup.py').read_text('utf-8').count(f"version='{version}',") == 1
    assert not re.search(r'^version:', (CHECKOUT / 'CITATION.cff').read_text('utf-8'), re.M)


def test_descriptions_of_the_package_agree():
    arguments = setup_arguments()
    assert manifest('license') == {arguments['license']}
    assert manifest('maintainer') == {arguments['maintainer']}
    maintainer = ElementTree.parse(CHECKOUT / 'package.xml').find('maintainer')
    assert maintainer.get('email') == arguments['maintainer_email']


def test_dependencies_agree():
    extras = setup_arguments()['extras_require']
    python = {
        name.removeprefix('python3-')
        for name in manifest('exec_depend')
        if name.startswith('python3-')
    }
    ros = {name for name in manifest('exec_depend') if is_message_package(name)} | {'rclpy'}
    assert python == distributions(setup_arguments()['install_requires'])
    for distro in DISTROS:
        assert {name.replace('_', '-') for name in ros - WITH_RCLPY} == {
            name.removeprefix(f'ros-{distro}-') for name in distributions(extras[distro])
        }
    assert {'matplotlib'} == distributions(extras['plot'])


def test_test_dependencies_agree():
    extra = {
        name.replace('pyyaml', 'yaml')
        for name in distributions(setup_arguments()['extras_require']['test'])
    }
    linters = {name for name in manifest('test_depend') if name.startswith('ament_')}
    declared = {name.removeprefix('python3-') for name in manifest('test_depend') - linters}
    only_pip = {'mpmath', 'mypy', 'pytest-xdist', 'ruff'}
    only_pip |= {'aiohttp', 'mcap', 'mcap-ros2-support', 'rosbags', 'zstandard'}
    only_pip |= {
        'argcomplete',
        'control',
        'distributed',
        'mujoco',
        'pin',
        'playwright',
        'pyarrow',
        'tqdm',
    }
    assert declared | only_pip == extra
    for distro in DISTROS:
        wheels = distributions(setup_arguments()['extras_require'][f'{distro}-lint'])
        assert linters - {'ament_copyright'} == {  # of which there is no wheel
            name.removeprefix(f'ros-{distro}-').replace('-', '_') for name in wheels
        }


LOCKS = {
    'requirements.lock': ('jazzy', 'jazzy-lint', 'plot'),
    'requirements-kilted.lock': ('kilted', 'kilted-lint', 'plot'),
    'requirements-test.lock': ('lint', 'test'),
    'requirements-docs.lock': ('docs',),
}
"""What is pinned, with the extras that it holds."""


@pytest.mark.parametrize('name', LOCKS)
def test_the_lock_is_hashed_and_names_no_index(name):
    text = (CHECKOUT / name).read_text('utf-8')
    assert not re.search(r'://|^--|@ ', text, re.MULTILINE)
    pinned = re.split(r'^(?=\w)', text, flags=re.MULTILINE)[1:]
    assert all(re.match(r'[\w.-]+(\[[\w,-]+\])?==\S+', entry) for entry in pinned)
    assert all('--hash=sha256:' in entry for entry in pinned)


@pytest.mark.parametrize('name', LOCKS)
def test_the_lock_holds_what_make_installs(name):
    text = (CHECKOUT / name).read_text('utf-8')
    locked = {name.lower() for name in re.findall(r'^([\w.-]+?)(?:\[[^]]*\])?==', text, re.M)}
    arguments = setup_arguments()
    wanted = set(distributions(arguments['install_requires']))
    for extra in LOCKS[name]:
        wanted |= distributions(arguments['extras_require'][extra])
        for requirement in arguments['extras_require'][extra]:
            exact = re.match(r'([\w.-]+)(?:\[\w+\])?==(\S+)', requirement)
            assert exact is None or f'\n{exact[1]}=={exact[2]}' in text.replace('[fastrtps]', '')
    assert wanted | ({'setuptools'} if 'plot' in LOCKS[name] else set()) <= locked


def test_what_is_imported_is_declared():
    declared = manifest('exec_depend') | {'numpy', 'scipy', 'matplotlib', 'flat_planner_ros'}
    declared |= {'rcl_interfaces', 'yaml'}  # what rclpy itself brings along
    declared |= set().union(
        *(
            distributions(setup_arguments()['extras_require'][extra])
            for extra in ('record', 'live', 'complete', 'progress', 'study')
        )
    )
    used = set().union(*map(roots, [*PACKAGE.rglob('*.py'), *CHECKOUT.glob('launch/*.py')]))
    assert used - sys.stdlib_module_names <= declared


@pytest.mark.parametrize('script', scripts(), ids=lambda script: script.partition(' ')[0])
def test_scripts_have_their_function(script):
    module, _, function = script.partition(' = ')[2].partition(':')
    path = CHECKOUT / f'{module.replace(".", "/")}.py'
    assert path.is_file()
    definitions = ast.parse(path.read_text('utf-8')).body
    assert function in {n.name for n in definitions if isinstance(n, ast.FunctionDef)}


@pytest.mark.parametrize('path', sorted(CHECKOUT.glob('test/**/*.py')), ids=lambda path: path.stem)
def test_tests_use_the_real_thing(path):
    nodes = list(ast.walk(ast.parse(path.read_text('utf-8'))))
    names = {n.id for n in nodes if isinstance(n, ast.Name)}
    names |= {n.attr for n in nodes if isinstance(n, ast.Attribute)}
    names |= {n.arg for n in nodes if isinstance(n, ast.arg)}
    names |= {part for name in imports(path) for part in name.split('.')}
    assert not names & {'mock', 'mocker', 'Mock', 'MagicMock', 'patch'}
