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

"""Parameters of the tracker node."""

from dataclasses import dataclass
from math import inf

from flat_planner_ros.core.arm import JointStateRules, PlanarArm
from flat_planner_ros.core.tracking import TrackerSettings, Uncertainty
from flat_planner_ros.ros.parameters.arm_model import arm_of, FIXED_MODEL_ROWS, per_joint
from flat_planner_ros.ros.parameters.joint_states import JOINT_STATE_ROWS, joint_state_rules
from flat_planner_ros.ros.parameters.row import DOUBLES, Row, Values


@dataclass(frozen=True, kw_only=True)
class TrackerNodeSettings:
    """
    What the tracker node does.

    Attributes
    ----------
    joints
        Names of the arm's joints, the passive one last.
    arm
        The nominal model.
    tracker
        The loop, its bandwidths, and when it gives up.
    joint_states
        How they are read.

    """

    joints: tuple[str, ...]
    arm: PlanarArm
    tracker: TrackerSettings
    joint_states: JointStateRules


ROWS = [
    *FIXED_MODEL_ROWS,
    Row(
        'rate',
        TrackerSettings.rate,
        'Hz',
        'joint states per second, and efforts',
        'the gains are made for it',
        lower=50.0,
        upper=2000.0,
        read_only=True,
    ),
    Row(
        'delay',
        TrackerSettings.delay,
        's',
        'from an effort computed until it acts',
        'the age of the joint states is known besides',
        lower=0.0,
        upper=0.05,
        read_only=True,
    ),
    Row(
        'bandwidth',
        TrackerSettings.bandwidth,
        'rad/s',
        'frequency of the poles of the closed loop',
        'refused if it cannot be certified; 0 = one by relative_bandwidth',
        lower=0.0,
        upper=1e4,
        read_only=True,
    ),
    Row(
        'relative_bandwidth',
        TrackerSettings.relative_bandwidth,
        '-',
        'the same in terms of the free oscillation',
        'or less: the fastest loop up to it that has the margin',
        lower=0.1,
        upper=10.0,
        read_only=True,
    ),
    Row(
        'damping',
        TrackerSettings.damping,
        '-',
        'damping ratio of these poles',
        lower=0.71,
        upper=2.0,
        read_only=True,
    ),
    Row(
        'observer_ratio',
        TrackerSettings.observer_ratio,
        '-',
        'bandwidth of the observer relative to that of the loop',
        lower=1.0,
        upper=100.0,
        read_only=True,
    ),
    Row(
        'uncertainty.stiffness',
        Uncertainty.stiffness,
        '-',
        'arms for which the loop must be stable: half-width as a share of the stiffness',
        lower=0.0,
        upper=0.99,
        read_only=True,
    ),
    Row(
        'uncertainty.damping',
        Uncertainty.damping,
        '-',
        'the same of the damping',
        lower=0.0,
        upper=0.99,
        read_only=True,
    ),
    Row(
        'uncertainty.inertia',
        Uncertainty.inertia,
        '-',
        'the same of all masses',
        lower=0.0,
        upper=0.99,
        read_only=True,
    ),
    Row(
        'uncertainty.samples',
        Uncertainty.samples,
        '',
        'samples by which efforts may act later than the loop knows',
        lower=0,
        upper=10,
        read_only=True,
    ),
    Row(
        'margin',
        TrackerSettings.margin,
        '-',
        'least distance of the frequency response from -1 for all these arms',
        lower=0.01,
        upper=0.99,
        read_only=True,
    ),
    Row(
        'limits.effort',
        DOUBLES,
        'N m',
        'largest effort per actuated joint',
        'none by default',
        lower=0.0,
        may_be_infinite=True,
        read_only=True,
    ),
    Row(
        'timeout',
        TrackerSettings.timeout,
        's',
        'age of the joint states at which it gives up',
        lower=1e-3,
        upper=1.0,
        read_only=True,
    ),
    Row(
        'max_age',
        TrackerSettings.max_age,
        's',
        'mean age of the joint states, when they are used, at which it gives up',
        '0 = as late as efforts may act by the certificate',
        lower=0.0,
        upper=1.0,
        read_only=True,
    ),
    Row(
        'jump',
        TrackerSettings.jump,
        'rad',
        'unexpected change of an angle, or distance of a start from the arm, at which it gives up',
        lower=1e-3,
        upper=10.0,
        read_only=True,
    ),
    Row(
        'max_error',
        TrackerSettings.max_error,
        'rad',
        'distance from the plan at which it gives up',
        lower=1e-3,
        upper=100.0,
        read_only=True,
    ),
    Row(
        'saturation_timeout',
        TrackerSettings.saturation_timeout,
        's',
        'time for which an effort may be at its limit',
        lower=1e-3,
        upper=60.0,
        read_only=True,
    ),
    Row(
        'ramp',
        TrackerSettings.ramp,
        's',
        'time in which the effort goes to zero once it has given up',
        lower=0.0,
        upper=10.0,
        read_only=True,
    ),
    Row(
        'hold',
        TrackerSettings.hold,
        '',
        'hold the final pose after a motion',
        'false = let go',
        read_only=True,
    ),
    *JOINT_STATE_ROWS,
]
"""All parameters of the tracker node."""


SAME_NAMES = (
    'rate',
    'delay',
    'bandwidth',
    'relative_bandwidth',
    'damping',
    'observer_ratio',
    'margin',
    'timeout',
    'max_age',
    'jump',
    'max_error',
    'saturation_timeout',
    'ramp',
    'hold',
)
"""Parameters that are settings of the core by the same names."""


def build(values: Values) -> TrackerNodeSettings:
    """
    Return the tracker's settings.

    Raises
    ------
    FlatPlannerError
        They contradict each other or the model.

    """
    joints, arm = arm_of(values)
    kinds = ('stiffness', 'damping', 'inertia', 'samples')
    tracker = TrackerSettings(
        uncertainty=Uncertainty(**{kind: values[f'uncertainty.{kind}'] for kind in kinds}),
        effort_limit=per_joint(values, 'limits.effort', arm.n - 1) or (inf,),
        **{name: values[name] for name in SAME_NAMES},
    )
    return TrackerNodeSettings(
        joints=joints, arm=arm, tracker=tracker, joint_states=joint_state_rules(values)
    )
