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

from collections.abc import Sequence
from dataclasses import dataclass
from math import isqrt

from flat_planner_ros.core.arm import flat_map, FlatModel
from flat_planner_ros.core.insensitive import check_insensitivity
from flat_planner_ros.core.motion_law import MAX_WEIGHT, QuadraticCost, Strategy, strategy_cost
from flat_planner_ros.core.planning import JointLimits, OnViolation, PlanningOptions
from flat_planner_ros.core.session import SessionSettings, StartSource
from flat_planner_ros.ros.parameters.declaration import (
    arm_of,
    InvalidParameter,
    model_rows,
    Row,
    Values,
)
from flat_planner_ros.ros.parameters.insensitivity import insensitivity_of, INSENSITIVITY_ROWS
import numpy as np
from rclpy.parameter import Parameter


@dataclass(frozen=True, kw_only=True)
class PlannerSettings:
    """
    What the planner node does, besides planning.

    Attributes
    ----------
    session
        Settings of its session.
    include_passive_joint, include_effort
        Form of the command.
    reference_rate
        Rate of `~/reference` [Hz].
    auto_tune
        Whether estimates from the own last motion are adopted without being asked.
    report_advice, report_baselines
        What the verdict on a goal says besides.
    stream_effort
        Whether `~/effort_commands` is published.

    """

    session: SessionSettings
    include_passive_joint: bool
    include_effort: bool
    reference_rate: float
    auto_tune: bool
    report_advice: bool
    report_baselines: bool
    stream_effort: bool


LIMITS = ('position_min', 'position_max', 'velocity', 'effort')
"""What may be limited."""

ROWS = [
    *model_rows(read_only=False),
    Row(
        name='strategy',
        default=Strategy.MIN_CONTROL_EFFORT.value,
        description='what the motion law minimises besides its sixth derivative',
        choices=tuple(strategy.value for strategy in Strategy),
    ),
    Row(
        name='weights.r',
        default=150.0,
        description='weight of the control effort, raised to the power of 8',
        lower=0.0,
        upper=MAX_WEIGHT,
    ),
    Row(
        name='weights.p',
        default=17.0,
        description='weight of the potential energy [1/s], raised to the power of 8',
        lower=0.0,
        upper=MAX_WEIGHT,
    ),
    Row(
        name='weights.Q',
        default=Parameter.Type.DOUBLE_ARRAY,
        description='36 numbers, row by row: the cost of the strategy custom',
    ),
    *INSENSITIVITY_ROWS,
    Row(
        name='flat_model',
        default=FlatModel.EXACT.value,
        description="treatment of the passive joint's damping; approximate is the paper's",
        choices=tuple(model.value for model in FlatModel),
    ),
    Row(
        name='compensate_friction',
        default=False,
        description='add to the efforts what friction.viscous and friction.coulomb take',
    ),
    Row(
        name='duration.default',
        default=0.0,
        description='duration of goals without times [s]; 0 = the shortest within limits',
        lower=0.0,
    ),
    Row(name='duration.min', default=0.05, description='shortest duration [s]', lower=0.0),
    Row(name='duration.max', default=600.0, description='longest duration [s]', lower=0.0),
    Row(
        name='limits.position_min',
        default=Parameter.Type.DOUBLE_ARRAY,
        infinite=True,
        description='lower position limits per joint [rad]; .inf = none',
    ),
    Row(
        name='limits.position_max',
        default=Parameter.Type.DOUBLE_ARRAY,
        infinite=True,
        description='upper position limits per joint [rad]; .inf = none',
    ),
    Row(
        name='limits.velocity',
        default=Parameter.Type.DOUBLE_ARRAY,
        infinite=True,
        description='velocity limits per joint [rad/s]; .inf = none',
    ),
    Row(
        name='limits.effort',
        default=Parameter.Type.DOUBLE_ARRAY,
        infinite=True,
        description='effort limits per joint [N m]; .inf = none',
    ),
    Row(
        name='limits.on_violation',
        default=OnViolation.REJECT.value,
        description='what becomes of a motion that is too fast for the limits',
        choices=tuple(choice.value for choice in OnViolation),
    ),
    Row(
        name='sampling.period',
        default=0.005,
        description='spacing of the points of the command [s]',
        lower=0.0005,
        upper=0.01,
    ),
    Row(
        name='start.source',
        default=StartSource.AUTO.value,
        description='where a motion starts',
        choices=tuple(source.value for source in StartSource),
    ),
    Row(
        name='start.position',
        default=Parameter.Type.DOUBLE_ARRAY,
        description='start for the source parameter [rad]',
    ),
    Row(
        name='start.position_tolerance',
        default=0.01,
        description='largest deviation of the measured from the planned start [rad]',
        lower=0.0,
    ),
    Row(
        name='start.velocity_tolerance',
        default=0.1,
        description='largest measured velocity that counts as rest [rad/s]',
        lower=0.0,
    ),
    Row(
        name='start.joint_state_timeout',
        default=0.5,
        description='age from which a joint state is stale [s]',
        lower=0.0,
    ),
    Row(
        name='start_delay',
        default=0.05,
        description='from accepting a goal without a stamp to the start of its motion [s]',
        lower=0.0,
    ),
    Row(
        name='replan.lookahead',
        default=0.1,
        description='from accepting a goal while the arm moves to the start of its motion [s]',
        lower=0.01,
        upper=10.0,
    ),
    Row(
        name='replan.tolerance',
        default=0.5,
        description='distance of a measured actuated joint from the running motion beyond which '
        'no other takes over [rad]; 0 = any',
        lower=0.0,
    ),
    Row(
        name='execute',
        default=True,
        description='publish commands; false = plan and report only',
    ),
    Row(
        name='command.include_passive_joint',
        default=True,
        description='name the passive joint in the command',
    ),
    Row(
        name='command.include_effort',
        default=True,
        description='put the feed-forward effort into the command',
    ),
    Row(
        name='command.stamp',
        default='absolute',
        description='stamp of the command: its absolute start, or zero = on arrival',
        choices=('absolute', 'zero'),
    ),
    Row(
        name='reference_rate',
        default=100.0,
        description='rate of ~/reference [Hz]',
        lower=1.0,
        upper=1000.0,
        read_only=True,
    ),
    Row(
        name='auto_tune',
        default=False,
        description='adopt each trustworthy estimate that the monitor makes after a motion',
    ),
    Row(
        name='report_advice',
        default=True,
        description='say in the verdict on a goal when a little more time would pay',
    ),
    Row(
        name='report_baselines',
        default=False,
        description='state in the verdict on a goal what simpler methods would leave behind',
    ),
    Row(
        name='stream_effort',
        default=False,
        description='publish ~/effort_commands every sampling.period while the arm moves',
    ),
]
"""All parameters of the planner node."""


def build(values: Values) -> PlannerSettings:
    """
    Return the planner's settings.

    Raises
    ------
    FlatPlannerError
        They contradict each other, or ask for what this version does not have.

    """
    joints, arm = arm_of(values)
    options = PlanningOptions(
        strategy=Strategy(values['strategy']),
        r=values['weights.r'],
        p=values['weights.p'],
        custom=_custom_cost(values),
        flat_model=FlatModel(values['flat_model']),
        compensate_friction=values['compensate_friction'],
        insensitivity=insensitivity_of(values),
    )
    if options.strategy is Strategy.INSENSITIVE:
        if options.flat_model is not FlatModel.EXACT:
            raise InvalidParameter('strategy insensitive needs flat_model: exact')
        check_insensitivity(arm, options.insensitivity)
    # Builds the cost once, so that an inadmissible one is refused here and not at the next goal.
    strategy_cost(
        options.strategy,
        flat_map(arm, options.flat_model),
        r=options.r,
        p=options.p,
        custom=options.custom,
    )
    session = SessionSettings(
        joints=joints,
        arm=arm,
        options=options,
        period=values['sampling.period'],
        default_duration=values['duration.default'],
        min_duration=values['duration.min'],
        max_duration=values['duration.max'],
        limits=_limits(values, joints),
        on_violation=OnViolation(values['limits.on_violation']),
        start_source=StartSource(values['start.source']),
        start_position=tuple(values.get('start.position', ())),
        position_tolerance=values['start.position_tolerance'],
        velocity_tolerance=values['start.velocity_tolerance'],
        measurement_timeout=values['start.joint_state_timeout'],
        start_delay=values['start_delay'],
        lookahead=values['replan.lookahead'],
        replan_tolerance=values['replan.tolerance'],
        is_stamped=values['command.stamp'] == 'absolute',
        execute=values['execute'],
    )
    return PlannerSettings(
        session=session,
        include_passive_joint=values['command.include_passive_joint'],
        include_effort=values['command.include_effort'],
        reference_rate=values['reference_rate'],
        auto_tune=values['auto_tune'],
        report_advice=values['report_advice'],
        report_baselines=values['report_baselines'],
        stream_effort=values['stream_effort'],
    )


def _limits(values: Values, joints: Sequence[str]) -> JointLimits:
    """Return the limits of all joints."""
    given = {name: values[f'limits.{name}'] for name in LIMITS if f'limits.{name}' in values}
    for name, numbers in given.items():
        if len(numbers) != len(joints):
            raise InvalidParameter(
                f'limits.{name} needs one number for each of {", ".join(joints)}, .inf where '
                f'there is no limit; got {len(numbers)}'
            )
    return JointLimits.of(len(joints), **given)


def _custom_cost(values: Values) -> np.ndarray | None:
    """Return Q as a matrix."""
    numbers = values.get('weights.Q')
    if numbers is None:
        return None
    side = isqrt(len(numbers))
    matrix = np.reshape(numbers, (side, side) if side**2 == len(numbers) else -1)
    # Refused now if it is inadmissible, even while another strategy is in use.
    return QuadraticCost(matrix=matrix).matrix
