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

"""An estimate is adopted once, where it belongs, and only if it says something new."""

from dataclasses import replace

from flat_planner_ros.core.arm.errors import InvalidRequest
from flat_planner_ros.core.monitor.adoption import AdoptionRefused, ModelTuner, ReportedEstimate
from flat_planner_ros.core.monitor.identification import ActuatedJoints, oscillating_inertia
import pytest


@pytest.fixture
def estimate(paper_arm):
    """Return an estimate 10 % above the model, known to 0.1 %."""
    case = ActuatedJoints.FREE
    return ReportedEstimate(
        start_time=1.7e9,
        joint='joint2',
        stiffness=1.1 * paper_arm.stiffness,
        stiffness_std=1e-3 * paper_arm.stiffness,
        damping=1.1 * paper_arm.damping,
        damping_std=1e-3 * paper_arm.damping,
        case=case,
        inertia=oscillating_inertia(paper_arm, case),
    )


@pytest.fixture
def tuner(estimate):
    """Return a tuner that has heard of the estimate."""
    tuner = ModelTuner()
    tuner.hear(estimate)
    return tuner


def test_an_adoption_changes_the_spring_and_the_damper_only(tuner, paper_arm, estimate):
    adoption = tuner.propose(paper_arm, 'joint2')
    assert (adoption.former, adoption.estimate) == (paper_arm, estimate)
    assert adoption.arm.stiffness == estimate.stiffness
    assert adoption.arm.damping == estimate.damping
    assert (adoption.arm.inertia == paper_arm.inertia).all()


def test_before_the_first_estimate_there_is_nothing_to_adopt(paper_arm):
    with pytest.raises(AdoptionRefused, match='no trustworthy estimate'):
        ModelTuner().propose(paper_arm, 'joint2')


def test_an_estimate_is_adopted_once_however_often_it_is_heard(tuner, paper_arm, estimate):
    first = tuner.propose(paper_arm, 'joint2')
    again = tuner.propose(paper_arm, 'joint2')  # a proposal that came to nothing
    assert again.arm.stiffness == first.arm.stiffness
    tuner.mark_adopted(first)
    tuner.hear(estimate)
    with pytest.raises(AdoptionRefused, match='adopted already'):
        tuner.propose(paper_arm, 'joint2')
    tuner.hear(replace(estimate))  # the report once more, received anew
    with pytest.raises(AdoptionRefused, match='adopted already'):
        tuner.propose(paper_arm, 'joint2')
    tuner.hear(replace(estimate, start_time=estimate.start_time + 1.0))
    assert tuner.propose(paper_arm, 'joint2').arm.stiffness == estimate.stiffness


def test_another_joint_or_inertia_is_refused(tuner, paper_arm):
    with pytest.raises(AdoptionRefused, match='of joint2, not of elbow'):
        tuner.propose(paper_arm, 'elbow')
    with pytest.raises(AdoptionRefused, match='same model'):
        tuner.propose(paper_arm.scaled(inertia=1.01), 'joint2')
    # What the estimate replaces may differ.
    assert tuner.propose(paper_arm.scaled(stiffness=2.0, damping=0.0), 'joint2')


@pytest.mark.parametrize(
    ('stiffness', 'damping', 'is_new'),
    [(0.0, 0.0, False), (2.9, -2.9, False), (3.2, 0.0, True), (0.0, -3.2, True)],
)
def test_what_the_errors_explain_is_nothing_new(paper_arm, estimate, stiffness, damping, is_new):
    shifted = replace(
        estimate,
        stiffness=paper_arm.stiffness + stiffness * estimate.stiffness_std,
        damping=paper_arm.damping + damping * estimate.damping_std,
    )
    assert shifted.agrees_with(paper_arm) is not is_new
    tuner = ModelTuner()
    tuner.hear(shifted)
    if is_new:
        assert tuner.propose(paper_arm, 'joint2')
    else:
        with pytest.raises(AdoptionRefused, match='nothing to adopt'):
            tuner.propose(paper_arm, 'joint2')


def test_a_motion_is_recognised_by_its_start(estimate):
    # Reports round to nanoseconds, seconds since 1970 to 0.2 microseconds.
    assert estimate.is_of_motion(1.7e9 + 4e-7)
    assert not estimate.is_of_motion(1.7e9 + 1e-3)


@pytest.mark.parametrize(
    'change',
    [
        {'stiffness': 0.0},
        {'stiffness': float('nan')},
        {'stiffness_std': -1.0},
        {'damping': -1e-9},
        {'damping_std': float('inf')},
        {'inertia': 0.0},
        {'start_time': float('inf')},
    ],
    ids=str,
)
def test_numbers_without_meaning_are_refused(estimate, change):
    with pytest.raises(InvalidRequest):
        replace(estimate, **change)
