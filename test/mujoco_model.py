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

"""A two-joint arm as MuJoCo wants it, for second opinions that share no code with ours."""

MODEL = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{step}" gravity="0 0 0" integrator="RK4"/>
  <worldbody>
    <body>
      <joint name="motor" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="0.1" diaginertia="{across} {across} {inner}"/>
      <body>
        <joint name="spring" axis="0 0 1" stiffness="{stiffness}" damping="{damping}"/>
        <inertial pos="0 0 0" mass="0.1" diaginertia="{across} {across} {last}"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
"""
Two balanced links are two rotors on one axis ((7) of docs/derivation.md).

Their inertias about the other axes play no part.
"""


def mujoco_model(arm, step):
    """Return the XML of a flat arm of two joints, integrated in steps [s]."""
    both, last = arm.inertia_star
    return MODEL.format(
        step=step,
        inner=both - last,
        last=last,
        across=both,
        stiffness=arm.stiffness,
        damping=arm.damping,
    )
