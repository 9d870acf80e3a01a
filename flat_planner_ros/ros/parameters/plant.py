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

"""Parameters of the plant node."""

from dataclasses import dataclass
from enum import Enum

from flat_planner_ros.core.arm import Drive
from flat_planner_ros.core.plant import DriveSettings, Sensing, SimulationSettings
from flat_planner_ros.ros.parameters.arm_model import built_arm, FIXED_MODEL_ROWS, per_joint
from flat_planner_ros.ros.parameters.row import DOUBLES, InvalidParameter, Row, Values


class CommandInput(Enum):
    """Kinds of command that move the plant."""

    TRAJECTORY = 'trajectory'
    EFFORT = 'effort'
    TRACKER = 'tracker'


@dataclass(frozen=True, kw_only=True)
class PlantSettings:
    """
    What the plant node does.

    Attributes
    ----------
    joints
        Names of the arm's joints, the passive one last.
    simulation
        Settings of the simulation.
    command_input
        Kind of command that moves the plant.
    publish_clock
        Whether the simulated time is the graph's time.
    real_time_factor
        Simulated seconds per second [-], 0 for as fast as it can; 1 without `publish_clock`.

    """

    joints: tuple[str, ...]
    simulation: SimulationSettings
    command_input: CommandInput
    publish_clock: bool
    real_time_factor: float


ROWS = [
    *FIXED_MODEL_ROWS,
    Row(
        'publish_rate',
        SimulationSettings.rate,
        'Hz',
        'rate of joint_states and /clock, in simulated time',
        lower=1.0,
        upper=1000.0,
        read_only=True,
    ),
    Row('publish_clock', False, '', 'publish /clock, for nodes with use_sim_time', read_only=True),
    Row(
        'real_time_factor',
        1.0,
        '-',
        'speed of /clock',
        '0 = as fast as it can; only with publish_clock',
        lower=0.0,
        upper=1000.0,
        read_only=True,
    ),
    Row(
        'initial_position',
        DOUBLES,
        'rad',
        'joint angles at the start and after ~/reset',
        'zeros by default',
        lower=-1e3,
        upper=1e3,
        read_only=True,
    ),
    Row(
        'integration_step',
        SimulationSettings.step,
        's',
        'longest step of the integration',
        'a whole number of them makes a period',
        lower=1e-5,
        upper=1e-2,
        read_only=True,
    ),
    Row(
        'input',
        CommandInput.TRAJECTORY,
        '',
        'what moves the plant: flat_planner/joint_trajectory or .../effort_commands',
        'tracker = flat_tracker/effort_commands',
        read_only=True,
    ),
    Row(
        'input_timeout',
        SimulationSettings.input_timeout,
        's',
        'silence after which a stream of efforts has broken: no effort from then',
        lower=1e-3,
        upper=10.0,
    ),
    Row(
        'start_tolerance',
        SimulationSettings.start_tolerance,
        'rad',
        'largest distance of a command from where the arm is',
        lower=0.0,
        may_be_infinite=True,
    ),
    Row(
        'mismatch.stiffness_scale',
        1.0,
        '-',
        'stiffness of the plant relative to the nominal model',
        lower=1e-3,
        upper=1e3,
    ),
    Row(
        'mismatch.damping_scale',
        1.0,
        '-',
        'damping of the plant relative to the nominal model',
        lower=0.0,
        upper=1e3,
    ),
    Row(
        'mismatch.inertia_scale',
        1.0,
        '-',
        'inertia of the plant relative to the nominal model',
        lower=1e-3,
        upper=1e3,
    ),
    Row(
        'mismatch.imbalance',
        DOUBLES,
        'kg m',
        'static moments that links n-1 and n have too much',
        'full form only',
        lower=-1e3,
        upper=1e3,
    ),
    Row(
        'torque.saturation',
        DOUBLES,
        'N m',
        'largest effort per actuated joint',
        'none by default',
        lower=0.0,
        may_be_infinite=True,
        read_only=True,
    ),
    Row(
        'noise.position_std',
        Sensing.position_std,
        'rad',
        'standard deviation of the noise on the joint angles shown',
        lower=0.0,
        upper=10.0,
    ),
    Row('noise.seed', Sensing.seed, '', 'seed of the noise, at least 0'),
    Row(
        'encoder.resolution',
        Sensing.resolution,
        'rad',
        'step of the joint angles shown',
        '0 = ideal',
        lower=0.0,
        upper=10.0,
    ),
    Row(
        'servo.bandwidth',
        DriveSettings.servo_bandwidth,
        'Hz',
        'with drive position: how fast a joint follows, critically damped',
        '0 = ideal',
        lower=0.0,
        upper=1e4,
        read_only=True,
    ),
    Row(
        'feedback.p',
        DOUBLES,
        'N m/rad',
        'gain on position errors per actuated joint',
        '0 = feed-forward only',
        lower=0.0,
        upper=1e6,
        read_only=True,
    ),
    Row(
        'feedback.d',
        DOUBLES,
        'N m s/rad',
        'gain on velocity errors per actuated joint',
        lower=0.0,
        upper=1e6,
        read_only=True,
    ),
]
"""All parameters of the plant node."""


def build(values: Values) -> PlantSettings:
    """
    Return the plant's settings.

    Raises
    ------
    FlatPlannerError
        The values contradict each other or the model.

    """
    imbalance = values.get('mismatch.imbalance', (0.0, 0.0))
    if len(imbalance) != 2:
        raise InvalidParameter(
            f'mismatch.imbalance needs two numbers, for links n-1 and n, got {len(imbalance)}'
        )
    joints, arm = built_arm(values, imbalance)
    n = len(joints)
    publish_clock, factor = values['publish_clock'], values['real_time_factor']
    if factor != 1.0 and not publish_clock:
        raise InvalidParameter(
            f'real_time_factor {factor:g} needs publish_clock: true; without it the plant follows '
            'a clock that is not its own'
        )
    simulation = SimulationSettings(
        arm=arm.scaled(
            stiffness=values['mismatch.stiffness_scale'],
            damping=values['mismatch.damping_scale'],
            inertia=values['mismatch.inertia_scale'],
        ),
        position=per_joint(values, 'initial_position', n, 'joint') or (0.0,) * n,
        rate=values['publish_rate'],
        step=values['integration_step'],
        drives=DriveSettings(
            drive=Drive(values['drive']),
            servo_bandwidth=values['servo.bandwidth'],
            saturation=per_joint(values, 'torque.saturation', n - 1),
            feedback_p=per_joint(values, 'feedback.p', n - 1),
            feedback_d=per_joint(values, 'feedback.d', n - 1),
        ),
        sensing=Sensing(
            position_std=values['noise.position_std'],
            seed=values['noise.seed'],
            resolution=values['encoder.resolution'],
        ),
        start_tolerance=values['start_tolerance'],
        input_timeout=values['input_timeout'],
    )
    return PlantSettings(
        joints=joints,
        simulation=simulation,
        command_input=CommandInput(values['input']),
        publish_clock=publish_clock,
        real_time_factor=factor,
    )
