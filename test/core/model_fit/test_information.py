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

"""What a motion will tell: against difference quotients of an arm that SciPy integrates."""

from dataclasses import replace

from core.conftest import first_links
from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.model_fit import (
    first_misprediction,
    fit_model,
    foresee,
    information,
    Measurements,
    misprediction,
    NAMES,
)
from free_arm import measured, pushes, simulated
import numpy as np
import pytest

BOTH, LAST, STIFFNESS, DAMPING, VISCOUS = 7e-4, 3e-5, 2.7e-3, 2.5e-5, 2e-4
ARM = PlanarArm.reduced(
    inertia_star=(BOTH, LAST), stiffness=STIFFNESS, damping=DAMPING, viscous_friction=[VISCOUS]
)
TIMES = np.arange(0.0, 1.5, 0.005)
NOISE = np.array([1e-4, 3e-4])


def angles(values):
    """Return what sensors show, shape (m, 2): five parameters, an offset, and a start (4,)."""
    both, last, k, c, viscous, offset, *start = values
    shown = simulated(
        pushes,
        TIMES,
        both=both,
        last=last,
        spring=lambda q, rate: k * q + c * rate,
        viscous=viscous,
        start=start,
    )
    return shown + [0.0, offset]


def test_a_motion_is_foreseen_as_scipy_integrates_it():
    motion = foresee(ARM, TIMES, pushes(TIMES))
    exact = angles([BOTH, LAST, STIFFNESS, DAMPING, VISCOUS, 0.0, *np.zeros(4)])
    # Efforts go straight from sample to sample.
    assert motion.states[:, :2] == pytest.approx(exact, abs=1e-4)


def test_friction_acts_on_what_joint_n_1_turns_relative_to_the_base():
    """A base that turns as link n-1 does without friction leaves it none."""
    effort = pushes(TIMES)
    smooth = foresee(replace(ARM, viscous_friction=np.zeros(1)), TIMES, effort)
    carried = foresee(ARM, TIMES, effort, base=smooth.states[:, 2])
    assert carried.states == pytest.approx(smooth.states, abs=2e-4)
    assert np.abs(foresee(ARM, TIMES, effort).states - smooth.states).max() > 0.01


def test_first_links_of_another_inertia_mispredict_efforts_by_as_much():
    """Second route: the arm's own efforts of a smooth motion in a plane, without friction."""
    arm = PlanarArm.reduced(
        inertia_star=(7e-4, 1e-4), stiffness=8e-3, damping=6e-5, **first_links()
    )
    speeds = 4.0 * np.pi * np.array([1.0, 2.0, 2.0])
    phases = np.outer(TIMES, speeds)
    q, dq, ddq = np.sin(phases), speeds * np.cos(phases), -(speeds**2) * np.sin(phases)
    efforts = arm.inverse_dynamics(q, dq, ddq)[:, :-1]
    seen = Measurements(times=TIMES, positions=q, efforts=efforts)
    assert first_misprediction(arm, seen, 0.0) == pytest.approx([0.0], abs=1e-3)
    inertia = arm.inertia * np.diag([1.25, 1.0, 1.0])
    assert first_misprediction(replace(arm, inertia=inertia), seen, 0.0) == pytest.approx(
        [0.25], abs=0.02
    )


def test_the_information_is_that_of_difference_quotients():
    here = np.array([BOTH, LAST, STIFFNESS, DAMPING, VISCOUS, 0.0, *np.zeros(4)])
    steps = 1e-4 * np.array([BOTH, LAST, STIFFNESS, DAMPING, VISCOUS, *np.ones(5)])
    columns = []
    for row in np.diag(steps):
        slope = (angles(here + row) - angles(here - row)) / (2 * row.sum())
        columns.append((slope / NOISE).ravel())
    columns = np.array(columns).T
    own, starts = columns[:, :6], columns[:, 6:]
    left = own - starts @ np.linalg.lstsq(starts, own, rcond=None)[0]
    known = [NAMES.index(name) for name in (*NAMES[:5], 'offset')]
    found, _ = information(ARM, foresee(ARM, TIMES, pushes(TIMES)), NOISE)
    sizes = np.sqrt(np.diag(left.T @ left))
    assert found[np.ix_(known, known)] / np.outer(sizes, sizes) == pytest.approx(
        left.T @ left / np.outer(sizes, sizes), abs=3e-3
    )


def test_a_fit_reaches_the_errors_that_were_foreseen():
    times = np.arange(0.0, 6.0, 0.005)
    noise = 1e-3
    arm = {'both': BOTH, 'last': LAST, 'viscous': VISCOUS, 'noise': noise}
    seen = measured(pushes, times, spring=lambda q, v: STIFFNESS * q + DAMPING * v, **arm)
    found, _ = information(ARM, foresee(ARM, times, pushes(times)), np.full(2, noise))
    foreseen = np.sqrt(np.diag(np.linalg.inv(found)))
    reached = np.array([estimate.std for estimate in fit_model(seen, ARM).estimates[: len(NAMES)]])
    assert ((foreseen < 1.2 * reached) & (reached < 3.0 * foreseen)).all()


def test_a_wrong_model_mispredicts_as_much_as_it_is_wrong():
    seen = measured(
        pushes,
        np.arange(0.0, 6.0, 0.01),
        both=BOTH,
        last=LAST,
        viscous=VISCOUS,
        noise=1e-5,
        spring=lambda q, v: STIFFNESS * q + DAMPING * v,
    )
    assert misprediction(ARM, seen).max() < 1e-3
    wrong = ARM.scaled(stiffness=0.7)
    right_link, wrong_passive = misprediction(wrong, seen)
    assert wrong_passive > 0.1
    assert right_link < wrong_passive
