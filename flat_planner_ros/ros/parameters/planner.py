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

"""Parameters of the planner node."""

from dataclasses import dataclass
from math import isqrt

from flat_planner_ros.core.arm import Drive, FlatModel, JointStateRules
from flat_planner_ros.core.motion_law import QuadraticCost, Strategy
from flat_planner_ros.core.planning import (
    check_options,
    DEFAULT_EFFORT_WEIGHT,
    DEFAULT_ENERGY_WEIGHT,
    MAX_RELATIVE_WEIGHT,
    MAX_WEIGHT,
    OnViolation,
    PlanningOptions,
)
from flat_planner_ros.core.session import (
    ReplanFrom,
    SessionSettings,
    SettlePose,
    StartSource,
    WhenMoving,
)
from flat_planner_ros.ros.parameters.arm_model import arm_of, imbalanced_arm, MODEL_ROWS
from flat_planner_ros.ros.parameters.command import (
    command_form,
    COMMAND_ROWS,
    controller_of,
    is_stamped,
)
from flat_planner_ros.ros.parameters.insensitivity import insensitivity_of, INSENSITIVITY_ROWS
from flat_planner_ros.ros.parameters.joint_states import JOINT_STATE_ROWS, joint_state_rules
from flat_planner_ros.ros.parameters.limits import LIMIT_ROWS, limits_of
from flat_planner_ros.ros.parameters.peak import peak_of, PEAK_ROWS
from flat_planner_ros.ros.parameters.row import (
    DOUBLE,
    DOUBLES,
    Row,
    Values,
)
from flat_planner_ros.ros.wire.command_form import CommandForm
import numpy as np


@dataclass(frozen=True, kw_only=True)
class PlannerSettings:
    """
    What the planner node does, besides planning.

    Attributes
    ----------
    session
        Settings of its session.
    joint_states
        How they are read.
    command
        Form of the command.
    controller
        Name of the action whose goals commands are; empty where they go by their topic.
    reference_rate
        Rate of `~/reference` [Hz].
    auto_tune
        Whether estimates from the own last motion are adopted without being asked.
    report_advice, report_baselines
        Additions to the verdict on a goal.
    stream_effort
        Whether `~/effort_commands` is published.
    save_path
        File that `~/save_model` writes.

    """

    session: SessionSettings
    joint_states: JointStateRules
    command: CommandForm
    controller: str
    reference_rate: float
    auto_tune: bool
    report_advice: bool
    report_baselines: bool
    stream_effort: bool
    save_path: str


ROWS = [
    *MODEL_ROWS,
    Row(
        'strategy',
        PlanningOptions.strategy,
        '',
        'what the motion law minimises besides its sixth derivative',
    ),
    Row(
        'weights.effort',
        DOUBLE,
        '',
        "weight of the control effort, relative to the arm's own oscillation",
        f'{DEFAULT_EFFORT_WEIGHT:g} where neither it nor weights.r is set',
        lower=0.0,
        upper=MAX_RELATIVE_WEIGHT,
    ),
    Row(
        'weights.energy',
        DOUBLE,
        '',
        "weight of the potential energy, relative to the arm's own oscillation",
        f'{DEFAULT_ENERGY_WEIGHT:g} where neither it nor weights.p is set',
        lower=0.0,
        upper=MAX_RELATIVE_WEIGHT,
    ),
    Row(
        'weights.r',
        DOUBLE,
        '',
        "the paper's weight of the control effort, raised to the power of 8",
        'in place of weights.effort',
        lower=0.0,
        upper=MAX_WEIGHT,
    ),
    Row(
        'weights.p',
        DOUBLE,
        '1/s',
        "the paper's weight of the potential energy",
        'raised to the power of 8; in place of weights.energy',
        lower=0.0,
        upper=MAX_WEIGHT,
    ),
    Row('weights.Q', DOUBLES, '', '36 numbers, row by row: the cost of the strategy custom'),
    *INSENSITIVITY_ROWS,
    *PEAK_ROWS,
    Row(
        'flat_model',
        PlanningOptions.flat_model,
        '',
        "treatment of the passive joint's damping",
        "approximate is the paper's",
    ),
    Row(
        'compensate_friction',
        PlanningOptions.compensate_friction,
        '',
        'add to the efforts what friction.viscous and friction.coulomb take',
    ),
    *LIMIT_ROWS,
    Row(
        'sampling.period',
        SessionSettings.period,
        's',
        'spacing of the points of the command',
        lower=0.0005,
        upper=0.01,
    ),
    Row('start.source', SessionSettings.start_source, '', 'where a motion starts'),
    Row('start.position', DOUBLES, 'rad', 'start for the source parameter'),
    Row(
        'start.position_tolerance',
        SessionSettings.position_tolerance,
        'rad',
        'largest deviation of the measured from the planned start',
        lower=0.0,
    ),
    Row(
        'start.velocity_tolerance',
        SessionSettings.velocity_tolerance,
        'rad/s',
        'largest measured velocity that counts as rest',
        lower=0.0,
    ),
    Row(
        'start.joint_state_timeout',
        SessionSettings.joint_state_timeout,
        's',
        'age from which a joint state is stale',
        lower=0.0,
    ),
    Row(
        'start.wait',
        SessionSettings.start_wait,
        's',
        'time that a goal waits for the first joint state before it is refused',
        '0 = not at all',
        lower=0.0,
        upper=60.0,
    ),
    Row(
        'start.moving',
        SessionSettings.when_moving,
        '',
        'what becomes of a goal while the arm moves though nothing is planned',
    ),
    *JOINT_STATE_ROWS,
    Row(
        'start.far_ahead',
        SessionSettings.far_ahead,
        's',
        'time to its start from which a goal is warned of',
        lower=0.0,
    ),
    Row(
        'start_delay',
        SessionSettings.start_delay,
        's',
        'from accepting a goal without a stamp to the start of its motion',
        '0 = automatic, by the age of joint states on arrival',
        lower=0.0,
    ),
    Row(
        'replan.lookahead',
        SessionSettings.lookahead,
        's',
        'from accepting a goal while the arm moves to the start of its motion',
        lower=0.01,
        upper=10.0,
    ),
    Row(
        'replan.tolerance',
        SessionSettings.replan_tolerance,
        'rad',
        'distance of a measured actuated joint from the running motion beyond which no other '
        'takes over',
        '0 = any',
        lower=0.0,
    ),
    Row(
        'finish.position_tolerance',
        SessionSettings.finish_tolerance,
        'rad',
        'distance of every actuated joint from the end of a motion within which it is there',
        '0 = any, the plan alone tells',
        lower=0.0,
    ),
    Row(
        'finish.patience',
        SessionSettings.finish_patience,
        's',
        'time after the end of a motion in which the arm must be there at rest',
        lower=0.0,
        upper=60.0,
    ),
    Row(
        'replan.from',
        SessionSettings.replan_from,
        '',
        'where a motion starts that takes over from another',
        'as planned, or as measured',
    ),
    Row(
        'settle.pose',
        SessionSettings.settle_pose,
        '',
        'where ~/settle brings the arm to rest',
    ),
    Row(
        'execute', SessionSettings.execute, '', 'publish commands', 'false = plan and report only'
    ),
    *COMMAND_ROWS,
    Row(
        'reference_rate',
        100.0,
        'Hz',
        'rate of ~/reference',
        lower=1.0,
        upper=1000.0,
        read_only=True,
    ),
    Row(
        'auto_tune',
        False,
        '',
        'adopt each trustworthy estimate that the monitor makes after a motion',
    ),
    Row(
        'report_advice', True, '', 'say in the verdict on a goal when a little more time would pay'
    ),
    Row(
        'report_baselines',
        False,
        '',
        'state in the verdict on a goal what simpler methods would leave behind',
    ),
    Row(
        'stream_effort',
        False,
        '',
        'publish ~/effort_commands every sampling.period while the arm moves',
    ),
    Row(
        'save_model.path',
        'arm_model.yaml',
        '',
        'file that ~/save_model writes',
        'one that is there is kept under another name',
        read_only=True,
    ),
]
"""All parameters of the planner node."""


def build(values: Values) -> PlannerSettings:
    """
    Return the planner's settings.

    Raises
    ------
    FlatPlannerError
        The values contradict each other, or ask for what this version does not have.

    """
    joints, arm = arm_of(values)
    limits = limits_of(values, joints)
    insensitivity = insensitivity_of(values)
    options = PlanningOptions(
        strategy=Strategy(values['strategy']),
        effort_weight=values.get('weights.effort'),
        energy_weight=values.get('weights.energy'),
        r=values.get('weights.r'),
        p=values.get('weights.p'),
        custom=_custom_cost(values),
        flat_model=FlatModel(values['flat_model']),
        compensate_friction=values['compensate_friction'],
        insensitivity=insensitivity,
        peak=peak_of(values, limits, insensitivity.box),
        drive=Drive(values['drive']),
    )
    # What admits no motion is refused here and not at the next goal.
    check_options(arm, options)
    controller = controller_of(values)
    session = SessionSettings(
        joints=joints,
        arm=arm,
        built=imbalanced_arm(values),
        options=options,
        period=values['sampling.period'],
        default_duration=values['duration.default'],
        duration_factor=values['duration.factor'],
        min_duration=values['duration.min'],
        max_duration=values['duration.max'],
        limits=limits,
        on_violation=OnViolation(values['limits.on_violation']),
        start_source=StartSource(values['start.source']),
        start_position=tuple(values.get('start.position', ())),
        position_tolerance=values['start.position_tolerance'],
        velocity_tolerance=values['start.velocity_tolerance'],
        joint_state_timeout=values['start.joint_state_timeout'],
        start_wait=values['start.wait'],
        when_moving=WhenMoving(values['start.moving']),
        far_ahead=values['start.far_ahead'],
        start_delay=values['start_delay'],
        lookahead=values['replan.lookahead'],
        replan_from=ReplanFrom(values['replan.from']),
        settle_pose=SettlePose(values['settle.pose']),
        replan_tolerance=values['replan.tolerance'],
        finish_tolerance=values['finish.position_tolerance'],
        finish_patience=values['finish.patience'],
        is_stamped=is_stamped(values),
        execute=values['execute'],
        awaits_answer=bool(controller),
    )
    return PlannerSettings(
        session=session,
        joint_states=joint_state_rules(values),
        command=command_form(values),
        controller=controller,
        reference_rate=values['reference_rate'],
        auto_tune=values['auto_tune'],
        report_advice=values['report_advice'],
        report_baselines=values['report_baselines'],
        stream_effort=values['stream_effort'],
        save_path=values['save_model.path'],
    )


def _custom_cost(values: Values) -> np.ndarray | None:
    """Return Q as a matrix."""
    numbers = values.get('weights.Q')
    if numbers is None:
        return None
    side = isqrt(len(numbers))
    matrix = np.reshape(numbers, (side, side) if side**2 == len(numbers) else -1)
    # Refused now if it is inadmissible, even while another strategy is in use.
    return QuadraticCost(matrix=matrix).matrix
