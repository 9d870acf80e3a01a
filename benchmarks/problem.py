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

"""The paper's problem, and its answer in multiple precision that every solver is measured by."""

import json
from math import pi
from pathlib import Path
from typing import NamedTuple

from flat_planner_ros.core import FlatModel, MotionRequest, PlanarArm, PlanningOptions, Strategy
from flat_planner_ros.core.arm import flat_map
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

REFERENCE = Path(__file__).parents[1] / 'test' / 'reference' / 'motion_laws.json'
"""Motion laws computed in multiple precision."""

CASE = 's2-min-control-effort'
"""The damped arm, least control effort with the paper's weight."""

DISTANCE = pi
"""Travel of the last link [rad]."""

DURATION = 1.0
"""Duration of the motion [s]."""

WEIGHT = 150.0
"""The paper's r; its eighth power multiplies the squared torque."""

SAMPLES = 1001
"""Points at which y to y^(6) and the torque are wanted."""

TIMES = np.linspace(0.0, DURATION, SAMPLES)
"""Their times [s]."""

ORDERS = 7
"""Value and six derivatives."""


class Answer(NamedTuple):
    """
    A motion law on the grid of times.

    Attributes
    ----------
    jet
        Derivatives 0 to 6, shape (7, 1001) [rad/s^k].
    effort
        Torque of joint 1, shape (1001,) [N m].

    """

    jet: FloatArray
    effort: FloatArray


def arm() -> PlanarArm:
    """Return the paper's arm, made anew."""
    return PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5)


def request(distance: float = DISTANCE, duration: float = DURATION) -> MotionRequest:
    """Return a motion of joint 1 from rest to rest."""
    return MotionRequest(
        start=np.zeros(2), final=np.array([distance, 0.0]), duration=float(duration)
    )


MODEL = FlatModel.APPROXIMATE
"""The reference numbers are those of the paper's torque."""

OPTIONS = PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT, r=WEIGHT, flat_model=MODEL)
"""What is minimised."""

EFFORT_ROW = flat_map(arm(), MODEL).effort
"""Torque as a combination of y to y^(5)."""


def effort(jet: FloatArray) -> FloatArray:
    """Return the torque of a jet of at least six rows."""
    torque: FloatArray = EFFORT_ROW @ jet[: len(EFFORT_ROW)]
    return torque


def error(answer: Answer) -> float:
    """Return the largest error of any derivative or the torque, relative to its peak [-]."""
    case = next(c for c in json.loads(REFERENCE.read_text()) if c['name'] == CASE)
    expected = np.array([*case['y'], case['tau']])
    at = np.rint(np.array(case['s']) * (SAMPLES - 1)).astype(int)
    found = np.vstack([answer.jet, answer.effort])
    peak = np.abs(expected).max(axis=1)
    return float((np.abs(found[:, at] - expected).max(axis=1) / peak).max())
