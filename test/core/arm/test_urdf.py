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

"""The URDF is the planner's arm: in structure, and by the dynamics of two other libraries."""

from pathlib import Path
import re
from xml.etree import ElementTree

from flat_planner_ros.core import (
    EffortProfile,
    FlatModel,
    FlatPlannerError,
    MotionRequest,
    plan,
    PlanarArm,
    PlanningOptions,
    Strategy,
)
from flat_planner_ros.core.arm import bodies_from_links, bodies_from_reduced
from flat_planner_ros.core.arm.urdf import (
    ArmDescription,
    ControlBlock,
    PLUGINS,
    urdf_of,
    UrdfLimits,
)
import numpy as np
import pytest

MASS_TOLERANCE = 1e-12
"""Largest difference of two mass matrices relative to the larger entry [-]."""

SPRING = {'stiffness': 3e-3, 'damping': 2e-5}
PAPER = {'inertia_star': (6.4e-4, 3.3e-5)}
REDUCED_3 = {
    'inertia_star': (8e-4, 4e-5),
    'link_length': [0.25],
    'link_com': [0.11],
    'link_mass': [0.3],
    'link_inertia': [2e-3],
    'tip_mass': 0.2,
}
FULL_3 = {
    'link_length': [0.3, 0.2, 0.15],
    'link_com': [0.14, 0.09, 0.06],
    'link_mass': [0.4, 0.2, 0.05],
    'link_inertia': [3e-3, 8e-4, 1e-4],
}
FULL_3['counterbalance_mass'] = [(0.2 * 0.09 + 0.10 * 0.2) / 0.08, 0.05]
FULL_3['counterbalance_arm'] = [0.08, 0.06]


def describe(model, *, gravity=0.0, friction=0.0, **options):
    """Return the description of an arm in either form."""
    n = len(model.get('link_length', ())) + (2 if 'inertia_star' in model else 0)
    motors = {
        kind: [friction] * (n - 1) for kind in ('viscous_friction', 'coulomb_friction') if friction
    }
    if 'inertia_star' in model:
        arm = PlanarArm.reduced(**model, **SPRING, **motors, gravity=gravity)
        bodies = bodies_from_reduced(**model)
    else:
        arm = PlanarArm.from_links(**model, **SPRING, **motors, gravity=gravity)
        bodies = bodies_from_links(**model)
    joints = [f'joint{i + 1}' for i in range(n)]
    return ArmDescription(joints=joints, arm=arm, bodies=bodies, **options)


def parse(description, control=None):
    """Return the root element."""
    return ElementTree.fromstring(urdf_of(description, control).encode())


def assert_same(ours, theirs):
    """Compare two matrices to rounding."""
    assert np.abs(ours - theirs).max() <= MASS_TOLERANCE * np.abs(theirs).max()


models = pytest.mark.parametrize('model', [PAPER, REDUCED_3, FULL_3], ids=['paper', '3', 'full'])


@models
@pytest.mark.parametrize('limited', [False, True])
def test_pinocchio_finds_the_same_dynamics(model, limited):
    pin = pytest.importorskip('pinocchio')
    bounds = UrdfLimits(lower=-3.0, upper=3.0, velocity=9.0, effort=2.0)
    n = 2 if model is PAPER else 3
    limits = [bounds] * n if limited else ()
    description = describe(model, gravity=9.81, friction=1e-3, limits=limits)
    arm = description.arm
    other = pin.buildModelFromXML(urdf_of(description))
    other.gravity.linear = np.array([0.0, 0.0, -9.81])
    data = other.createData()
    rng = np.random.default_rng(7)
    for _ in range(20):
        q, dq, ddq = rng.uniform(-3.0, 3.0, (3, n))
        pose = pin.integrate(other, pin.neutral(other), q)
        upper = np.triu(pin.crba(other, data, pose))
        assert_same(upper + np.triu(upper, 1).T, arm.mass_matrix(q))
        expected = arm.mass_matrix(q) @ ddq + arm.coriolis(q, dq) + arm.gravity_effort(q)
        assert np.allclose(pin.rnea(other, data, pose, dq, ddq), expected, rtol=1e-10, atol=1e-12)


@models
def test_mujoco_swings_as_the_arm_does(model):
    mujoco = pytest.importorskip('mujoco')
    description = describe(model, gravity=9.81)
    arm = description.arm
    compiled = mujoco.MjModel.from_xml_string(urdf_of(description))
    compiled.joint(description.joints[-1]).stiffness[0] = arm.stiffness
    data = mujoco.MjData(compiled)
    rng = np.random.default_rng(8)
    for _ in range(20):
        q, dq = rng.uniform(-3.0, 3.0, (2, arm.n))
        effort = rng.uniform(-1e-2, 1e-2, arm.n - 1)
        data.qpos[:], data.qvel[:], data.qfrc_applied[:-1] = q, dq, effort
        mujoco.mj_forward(compiled, data)
        expected = arm.forward_dynamics(q, dq, effort)
        assert np.allclose(data.qacc, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_a_planned_effort_leaves_mujocos_arm_at_rest():
    """The same motion in another physics engine; 1e-5 rad is what the plant leaves as well."""
    mujoco = pytest.importorskip('mujoco')
    description = describe(PAPER)
    request = MotionRequest(start=np.zeros(2), final=np.array([np.pi, 0.0]), duration=1.0)
    options = PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT, flat_model=FlatModel.EXACT)
    samples = plan(request, description.arm, options).sample(0.005)
    profile = EffortProfile(start=0.0, times=samples.times, efforts=samples.efforts[:, :-1])
    compiled = mujoco.MjModel.from_xml_string(urdf_of(description))
    compiled.joint('joint2').stiffness[0] = description.arm.stiffness
    compiled.opt.timestep = 1e-3
    compiled.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(compiled)
    swing, after = 0.0, 0.0
    while data.time < 2.0:
        # A step holds its effort: that of its middle keeps the second order.
        data.qfrc_applied[:-1] = profile.effort(data.time + 5e-4)
        mujoco.mj_step(compiled, data)
        swing = max(swing, abs(data.qpos[1]))
        if data.time > 1.0:
            after = max(after, abs(data.qpos[1]))
    assert swing > 0.3
    assert after < 1e-5
    assert abs(data.qpos[0] - np.pi) < 1e-4


def test_joints_and_links_make_one_chain_from_the_base():
    root = parse(describe(FULL_3))
    chain = [
        (joint.find('parent').get('link'), joint.find('child').get('link'))
        for joint in root.findall('joint')
    ]
    assert chain == [('base_link', 'link1'), ('link1', 'link2'), ('link2', 'link3')]
    assert {link.get('name') for link in root.findall('link')} == set(sum(chain, ()))
    assert {joint.find('axis').get('xyz') for joint in root.findall('joint')} == {'0 0 1'}
    offsets = [float(j.find('origin').get('xyz').split()[0]) for j in root.findall('joint')]
    assert offsets == [0.0, 0.3, 0.2]


@pytest.mark.parametrize(('gravity', 'roll'), [(0.0, 0.0), (9.81, np.pi / 2), (-3.7, -np.pi / 2)])
def test_gravity_in_the_plane_stands_the_plane_up(gravity, roll):
    rolls = [
        float(joint.find('origin').get('rpy').split()[0])
        for joint in parse(describe(PAPER, gravity=gravity)).findall('joint')
    ]
    assert rolls == [roll, 0.0]


def test_what_urdf_cannot_say_is_said_all_the_same():
    text = urdf_of(describe(PAPER))
    assert 'Spring of joint2: 0.003 N m/rad' in text
    root = ElementTree.fromstring(text.encode())
    spring = root.find('gazebo[@reference="joint2"]')
    assert float(spring.find('springStiffness').text) == 3e-3
    dynamics = [joint.find('dynamics').attrib for joint in root.findall('joint')]
    assert [float(entry['damping']) for entry in dynamics] == [0.0, 2e-5]


def test_a_joint_with_two_bounds_is_revolute_and_others_turn_for_ever():
    limits = [UrdfLimits(lower=-1.0, upper=2.0), UrdfLimits(lower=-1.0, effort=0.5)]
    first, second = parse(describe(PAPER, limits=limits)).findall('joint')
    assert (first.get('type'), second.get('type')) == ('revolute', 'continuous')
    numbers = {name: float(value) for name, value in first.find('limit').attrib.items()}
    assert numbers == {'lower': -1.0, 'upper': 2.0, 'effort': 1e9, 'velocity': 1e9}
    assert 'lower' not in second.find('limit').attrib
    assert float(second.find('limit').get('effort')) == 0.5
    assert parse(describe(PAPER)).find('joint/limit') is None


@pytest.mark.parametrize('interfaces', [['effort'], ['position'], ['position', 'effort']])
@pytest.mark.parametrize('plugin', [*PLUGINS, 'my_robot/Driver'])
def test_only_actuated_joints_are_commanded(plugin, interfaces):
    control = ControlBlock(
        plugin=plugin,
        command_interfaces=interfaces,
        initial_position=[0.5, 0.0],
        hardware_parameters={'device': '/dev/ttyUSB0'},
        controllers='controllers.yaml',
    )
    root = parse(describe(PAPER), control)
    block = root.find('ros2_control')
    assert block.find('hardware/plugin').text == PLUGINS.get(plugin, plugin)
    assert block.find('hardware/param[@name="device"]').text == '/dev/ttyUSB0'
    names = {
        joint.get('name'): [c.get('name') for c in joint.findall('command_interface')]
        for joint in block.findall('joint')
    }
    assert names == {'joint1': interfaces, 'joint2': []}
    for joint in block.findall('joint'):
        states = [state.get('name') for state in joint.findall('state_interface')]
        assert states == ['position', 'velocity', 'effort']
    first = block.find('joint/state_interface/param')
    assert (first.get('name'), float(first.text)) == ('initial_value', 0.5)
    is_gazebo = plugin == 'gz'
    assert (root.find('gazebo/plugin') is not None) == is_gazebo
    assert (root.find('link[@name="world"]') is not None) == is_gazebo


def test_what_cannot_be_commanded_is_refused():
    for wrong in (['velocity'], [], ['effort', 'effort'], ['position', 'velocity']):
        with pytest.raises(FlatPlannerError, match='effort, position or both'):
            ControlBlock(plugin='mock', command_interfaces=wrong)


def test_controllers_find_limits_of_every_joint():
    """joint_trajectory_controller 4.39 to 4.41 ends with an exception without them."""
    joints = parse(describe(PAPER), ControlBlock(plugin='mock')).findall('joint')
    limits = [joint.find('limit').attrib for joint in joints if joint.get('type') != 'fixed']
    assert limits == 2 * [{'effort': '1000000000.0', 'velocity': '1000000000.0'}]


def test_parts_that_do_not_fit_are_refused():
    description = describe(PAPER)
    with pytest.raises(FlatPlannerError, match='3 joints'):
        ArmDescription(joints=['a', 'b', 'c'], arm=description.arm, bodies=description.bodies)


def test_link_names_never_clash_with_joint_names():
    description = describe(PAPER)
    other = ArmDescription(
        joints=['shoulder', 'joint_2'], arm=description.arm, bodies=description.bodies
    )
    assert other.links == ['shoulder_link', 'link_2']


def test_the_recipe_for_mujoco_works(tmp_path, monkeypatch):
    mujoco = pytest.importorskip('mujoco')
    text = (Path(__file__).resolve().parents[3] / 'docs' / 'real_robot.md').read_text('utf-8')
    (recipe,) = re.findall(r'^```python\n(.*?)^```', text, re.MULTILINE | re.DOTALL)
    description = describe(PAPER)
    monkeypatch.chdir(tmp_path)
    Path('arm.urdf').write_text(urdf_of(description), 'utf-8')
    exec(compile(recipe, 'recipe', 'exec'), {})
    model = mujoco.MjModel.from_xml_path('arm.xml')
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = [0.3, -0.2], [1.0, 2.0], [5e-3]
    mujoco.mj_forward(model, data)
    expected = description.arm.forward_dynamics(data.qpos, data.qvel, np.array([5e-3]))
    assert np.allclose(data.qacc, expected, rtol=1e-4)  # its format has six digits
    assert model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
