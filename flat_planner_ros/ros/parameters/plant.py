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

from flat_planner_ros.core.plant import Sensing, SimulationSettings
from flat_planner_ros.ros.parameters.declaration import (
    arm_of,
    InvalidParameter,
    model_rows,
    per_joint,
    Row,
    Values,
)
from rclpy.parameter import Parameter


class CommandInput(Enum):
    """What moves the plant."""

    TRAJECTORY = 'trajectory'
    EFFORT = 'effort'


@dataclass(frozen=True, kw_only=True)
class PlantSettings:
    """
    What the plant node does.

    Attributes
    ----------
    joints
        Names of the arm's joints, the passive one last.
    simulation
        What is simulated.
    command_input
        What moves it.
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


DOUBLES = Parameter.Type.DOUBLE_ARRAY

ROWS = [
    *model_rows(read_only=True),
    Row(
        name='publish_rate',
        default=200.0,
        description='rate of joint_states and /clock, in simulated time [Hz]',
        lower=1.0,
        upper=1000.0,
        read_only=True,
    ),
    Row(
        name='publish_clock',
        default=False,
        description='publish /clock, for nodes with use_sim_time',
        read_only=True,
    ),
    Row(
        name='real_time_factor',
        default=1.0,
        description='speed of /clock [-]; 0 = as fast as it can; only with publish_clock',
        lower=0.0,
        upper=1000.0,
        read_only=True,
    ),
    Row(
        name='initial_position',
        default=DOUBLES,
        description='joint angles at the start and after ~/reset [rad]; zeros by default',
        lower=-1e3,
        upper=1e3,
        read_only=True,
    ),
    Row(
        name='integration_step',
        default=1e-3,
        description='longest step of the integration [s]; a whole number of them makes a period',
        lower=1e-5,
        upper=1e-2,
        read_only=True,
    ),
    Row(
        name='input',
        default=CommandInput.TRAJECTORY.value,
        description='what moves the plant: flat_planner/joint_trajectory or .../effort_commands',
        choices=tuple(choice.value for choice in CommandInput),
        read_only=True,
    ),
    Row(
        name='input_timeout',
        default=SimulationSettings.input_timeout,
        description='silence after which a stream of efforts has broken: no effort from then [s]',
        lower=1e-3,
        upper=10.0,
    ),
    Row(
        name='start_tolerance',
        default=SimulationSettings.start_tolerance,
        description='largest distance of a command from where the arm is [rad]',
        lower=0.0,
        infinite=True,
    ),
    *(
        Row(
            name=f'mismatch.{quantity}_scale',
            default=1.0,
            description=f'{quantity} of the plant relative to the nominal model [-]',
            lower=lower,
            upper=1e3,
        )
        for quantity, lower in (('stiffness', 1e-3), ('damping', 0.0), ('inertia', 1e-3))
    ),
    Row(
        name='mismatch.imbalance',
        default=DOUBLES,
        description='static moments that links n-1 and n have too much [kg m]; full form only',
        lower=-1e3,
        upper=1e3,
    ),
    Row(
        name='torque.saturation',
        default=DOUBLES,
        description='largest effort per actuated joint [N m]; none by default',
        lower=0.0,
        infinite=True,
        read_only=True,
    ),
    Row(
        name='noise.position_std',
        default=0.0,
        description='standard deviation of the noise on the joint angles shown [rad]',
        lower=0.0,
        upper=10.0,
    ),
    Row(name='noise.seed', default=0, description='seed of the noise, at least 0'),
    Row(
        name='encoder.resolution',
        default=0.0,
        description='step of the joint angles shown [rad]; 0 = ideal',
        lower=0.0,
        upper=10.0,
    ),
    Row(
        name='feedback.p',
        default=DOUBLES,
        description='gain on position errors per actuated joint [N m/rad]; 0 = feed-forward only',
        lower=0.0,
        upper=1e6,
        read_only=True,
    ),
    Row(
        name='feedback.d',
        default=DOUBLES,
        description='gain on velocity errors per actuated joint [N m s/rad]',
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
        They contradict each other or the model.

    """
    imbalance = values.get('mismatch.imbalance', (0.0, 0.0))
    if len(imbalance) != 2:
        raise InvalidParameter(
            f'mismatch.imbalance needs two numbers, for links n-1 and n, got {len(imbalance)}'
        )
    joints, arm = arm_of(values, imbalance)
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
        saturation=per_joint(values, 'torque.saturation', n - 1),
        feedback_p=per_joint(values, 'feedback.p', n - 1),
        feedback_d=per_joint(values, 'feedback.d', n - 1),
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
