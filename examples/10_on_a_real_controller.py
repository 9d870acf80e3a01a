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

"""
On a real controller: the command as joint_trajectory_controller takes it, and how to send it.

The planner node does this for every goal; here it is done by hand, from the same parameter file
and with the same checks, so that the very first motion of a real arm can be read before it is
sent. The command has positions, velocities, accelerations and efforts every 5 ms.
"""

from dataclasses import replace
import json
from pathlib import Path
import sys

from flat_planner_ros.core import Goal, GoalPoint, PlannerSession, StartSource
from flat_planner_ros.ros.parameters.parameter_file import read_settings
from flat_planner_ros.ros.parameters.planner import build, ROWS
from flat_planner_ros.ros.wire.command_form import CommandForm
from flat_planner_ros.ros.wire.conversions import command_bytes
from matplotlib import pyplot as plt
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory

PARAMETERS = Path(__file__).resolve().parents[1] / 'config' / 'arm_2dof.yaml'
picture = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_suffix('.png')
file = picture.with_suffix('.yaml')

settings = read_settings(PARAMETERS, ROWS, build, node='flat_planner').session
at_rest = replace(settings, start_source=StartSource.PARAMETER, start_position=(0.0, 0.0))
session = PlannerSession(at_rest)
goal = Goal(joint_names=('joint1',), points=(GoalPoint(time=2.0, positions=(0.2,)),))
motion = session.submit(goal, now=1.0)  # a refused goal raises RequestRejected, with its reason
track = session.track(now=1.0)

# A stamp of zero plays on arrival; the planner node stamps with the time of its clock.
command = deserialize_message(
    command_bytes(track, settings.joints, CommandForm(absolute_stamp=False)), JointTrajectory
)
fields = ('positions', 'velocities', 'accelerations', 'effort')
points = []
for point in command.points:
    time = {'sec': point.time_from_start.sec, 'nanosec': point.time_from_start.nanosec}
    points.append(
        {name: list(getattr(point, name)) for name in fields} | {'time_from_start': time}
    )
# JSON is YAML, which is what "ros2 topic pub" reads.
file.write_text(json.dumps({'joint_names': list(command.joint_names), 'points': points}))

print(f'{len(command.points)} points for {", ".join(command.joint_names)} in {file.name}')
print(f'largest effort {motion.plan.peak_effort[0]:.2e} N m, ends with {points[-1]["effort"]}')
print(f"""
1. Limits first: limits.* in the parameter file, an emergency stop at hand.
2. ros2 control list_controllers               # flat_arm_controller is active
3. ros2 topic echo --once joint_states         # the arm rests at 0 rad
4. ros2 topic pub --once -w 1 --stdin flat_arm_controller/joint_trajectory \\
       trajectory_msgs/msg/JointTrajectory < {file.name}
5. ros2 topic echo --once flat_monitor/report  # what it left behind""")

figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7.0, 5.0))
axes[0].plot(track.times, track.positions, '.', markersize=2, label=command.joint_names)
axes[0].set_ylabel('positions [rad]')
axes[0].legend(frameon=False)
axes[1].plot(track.times, 1e3 * track.efforts[:, 0], '.', markersize=2)
axes[1].set_ylabel('effort [mN m]')
axes[1].set_xlabel('time from start [s]')
for axis in axes:
    axis.grid(alpha=0.3)
figure.tight_layout()
figure.savefig(picture, dpi=100)
