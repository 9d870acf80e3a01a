"""A session answers goals by time and measurement, without a clock and without ROS."""

from dataclasses import replace
from math import nan, pi

from flat_planner_ros.core.arm import PlanarArm
from flat_planner_ros.core.cost import Strategy
from flat_planner_ros.core.errors import InvalidRequest
from flat_planner_ros.core.goal import Goal, GoalPoint, Reason, RequestRejected
from flat_planner_ros.core.motion_record import JointSample
from flat_planner_ros.core.planning import PlanningOptions
from flat_planner_ros.core.session import PlannerSession, SessionSettings, StartSource
import numpy as np
import pytest

SETTINGS = SessionSettings(
    joints=('joint1', 'joint2'),
    arm=PlanarArm.reduced(inertia_star=(6.4e-4, 3.3e-5), stiffness=3e-3, damping=2e-5),
    options=PlanningOptions(strategy=Strategy.MIN_CONTROL_EFFORT),
)
NOW = 100.0
GOAL = Goal(joint_names=('joint1',), points=(GoalPoint(time=1.0, positions=(pi,)),))


def sample(position=(0.5, 0.0), velocity=(0.0, 0.0), time=NOW) -> JointSample:
    """Return a measured state."""
    return JointSample(time=time, positions=np.array(position), velocities=np.array(velocity))


def session(**changes: object) -> PlannerSession:
    """Return a session that has seen the arm at rest."""
    result = PlannerSession(replace(SETTINGS, **changes))
    result.measure(sample())
    return result


def reason_of(call, *args: object) -> RequestRejected:
    """Return how a call is refused."""
    with pytest.raises(RequestRejected) as caught:
        call(*args)
    return caught.value


def test_a_motion_goes_from_the_measured_start_to_the_goal():
    motion = session().submit(GOAL, NOW)
    assert motion.samples.positions[0] == pytest.approx([0.5, 0.0], abs=0.0)
    assert motion.samples.positions[-1] == pytest.approx([pi, 0.0], abs=0.0)
    assert motion.start == pytest.approx(NOW + SETTINGS.start_delay)
    assert motion.end == motion.start + 1.0
    assert motion.plan_id == 1


def test_planning_time_does_not_eat_the_start_delay():
    planner = session()
    planner.submit(GOAL, NOW)
    assert planner.launched(NOW + 2.0).start == NOW + 2.0 + SETTINGS.start_delay
    planner = session()
    planner.submit(replace(GOAL, stamp=NOW + 7.0), NOW)
    assert planner.launched(NOW + 2.0).start == NOW + 7.0


def test_a_small_measured_deflection_does_not_enter_the_plan():
    planner = session()
    planner.measure(sample(position=(0.5, 0.008)))
    assert planner.submit(GOAL, NOW).samples.positions[0].tolist() == [0.5, 0.0]


def test_a_stamp_in_the_future_is_the_start():
    assert session().submit(replace(GOAL, stamp=NOW + 7.0), NOW).start == NOW + 7.0


def test_a_stamp_in_the_past_is_refused():
    error = reason_of(session().submit, replace(GOAL, stamp=NOW - 2.0), NOW)
    assert error.reason is Reason.OLD_HEADER_TIMESTAMP
    assert error.value == NOW - 2.0
    assert error.limit == NOW


def test_a_goal_without_a_time_takes_the_default_duration():
    goal = replace(GOAL, points=(replace(GOAL.points[0], time=0.0),))
    assert session(default_duration=1.5).submit(goal, NOW).plan.request.duration == 1.5
    error = reason_of(session().submit, goal, NOW)
    assert error.reason is Reason.DURATION_OUT_OF_RANGE


@pytest.mark.parametrize(('time', 'limit'), [(0.1, 0.2), (30.0, 20.0)])
def test_a_duration_outside_the_range_is_refused(time, limit):
    goal = replace(GOAL, points=(replace(GOAL.points[0], time=time),))
    error = reason_of(session(min_duration=0.2, max_duration=20.0).submit, goal, NOW)
    assert error.reason is Reason.DURATION_OUT_OF_RANGE
    assert (error.value, error.limit) == (time, limit)


def test_a_goal_in_motion_is_refused_and_disturbs_nothing():
    planner = session()
    motion = planner.submit(GOAL, NOW)
    planner.measure(sample(time=motion.end - 0.01))
    assert reason_of(planner.submit, GOAL, motion.end - 0.01).reason is Reason.BUSY
    assert planner.motion is motion
    assert planner.finished(motion.end - 0.01) is None
    assert planner.finished(motion.end) is motion
    assert planner.finished(motion.end + 1.0) is None


def test_a_new_goal_is_answered_after_the_end():
    planner = session()
    end = planner.submit(GOAL, NOW).end
    planner.measure(sample(position=(pi, 0.0), time=end))
    back = replace(GOAL, points=(replace(GOAL.points[0], positions=(0.0,)),))
    second = planner.submit(back, end)
    assert second.plan_id == 2
    assert second.samples.positions[0, 0] == pi


def test_plans_that_are_not_executed_keep_nothing_busy():
    planner = session(execute=False)
    first = planner.submit(GOAL, NOW)
    assert planner.submit(GOAL, NOW).plan_id == first.plan_id + 1
    assert planner.finished(first.end) is None


def test_the_last_goal_is_planned_again_with_changed_settings():
    planner = session(execute=False)
    planner.submit(replace(GOAL, stamp=NOW + 1.0), NOW)
    planner.settings = replace(
        planner.settings, options=PlanningOptions(strategy=Strategy.POLYNOMIAL)
    )
    again = planner.submit(planner.last_goal, NOW + 0.2)
    assert again.plan.options.strategy is Strategy.POLYNOMIAL
    assert again.start == pytest.approx(NOW + 0.2 + SETTINGS.start_delay)


def test_there_is_no_last_goal_before_the_first():
    planner = session()
    assert reason_of(lambda: planner.last_goal).reason is Reason.EMPTY_GOAL
    reason_of(planner.submit, replace(GOAL, stamp=1.0), NOW)
    assert reason_of(lambda: planner.last_goal).reason is Reason.EMPTY_GOAL


def test_without_a_measurement_there_is_no_start():
    error = reason_of(PlannerSession(SETTINGS).submit, GOAL, NOW)
    assert error.reason is Reason.START_STATE_UNKNOWN


def test_an_old_measurement_is_stale():
    error = reason_of(session().submit, GOAL, NOW + 0.6)
    assert error.reason is Reason.START_STATE_STALE
    assert error.value == pytest.approx(0.6)
    assert error.limit == SETTINGS.measurement_timeout


def test_a_measurement_by_another_clock_is_no_start():
    planner = session()
    planner.measure(sample(time=NOW + 1e9))
    error = reason_of(planner.submit, GOAL, NOW)
    assert error.reason is Reason.START_STATE_STALE
    assert 'use_sim_time' in str(error)


def test_nothing_starts_before_there_is_a_time():
    error = reason_of(session().submit, GOAL, 0.0)
    assert error.reason is Reason.START_STATE_UNKNOWN
    assert '/clock' in str(error)


@pytest.mark.parametrize(
    ('measured', 'reason', 'joint'),
    [
        (sample(velocity=(0.2, 0.0)), Reason.NOT_AT_REST, 'joint1'),
        (sample(velocity=(0.0, -0.2)), Reason.NOT_AT_REST, 'joint2'),
        (sample(position=(0.5, 0.02)), Reason.START_STATE_MISMATCH, 'joint2'),
        (sample(position=(0.5, nan)), Reason.START_STATE_MISMATCH, 'joint2'),
    ],
)
def test_an_arm_that_is_not_at_rest_does_not_start(measured, reason, joint):
    planner = session()
    planner.measure(measured)
    error = reason_of(planner.submit, GOAL, NOW)
    assert (error.reason, error.joint) == (reason, joint)


@pytest.mark.parametrize('velocities', [None, np.array([nan, nan])])
def test_unknown_velocities_are_tolerated(velocities):
    planner = session()
    planner.measure(JointSample(time=NOW, positions=np.array([0.5, 0.0]), velocities=velocities))
    assert planner.submit(GOAL, NOW).plan_id == 1


def test_a_measured_position_that_is_not_finite_is_no_start():
    planner = session()
    planner.measure(sample(position=(nan, 0.0)))
    assert reason_of(planner.submit, GOAL, NOW).reason is Reason.START_STATE_MISMATCH


def test_the_start_may_be_given():
    changes = {'start_source': StartSource.PARAMETER, 'start_position': (0.25, 0.0)}
    planner = PlannerSession(replace(SETTINGS, **changes))
    assert planner.submit(GOAL, NOW).samples.positions[0, 0] == 0.25
    # A measured state, where there is one, must agree.
    error = reason_of(session(**changes).submit, GOAL, NOW)
    assert error.reason is Reason.START_STATE_MISMATCH
    assert error.value == 0.5


def test_the_start_may_be_the_end_of_the_last_motion():
    planner = PlannerSession(replace(SETTINGS, start_source=StartSource.REFERENCE))
    assert reason_of(planner.submit, GOAL, NOW).reason is Reason.START_STATE_UNKNOWN
    planner.settings = replace(
        SETTINGS, start_source=StartSource.PARAMETER, start_position=(0.0, 0.0)
    )
    end = planner.submit(GOAL, NOW).end
    planner.settings = replace(SETTINGS, start_source=StartSource.REFERENCE)
    assert planner.submit(GOAL, end).samples.positions[0, 0] == pi


def test_the_reference_is_at_rest_before_and_after():
    motion = session().submit(GOAL, NOW)
    before, after = motion.reference(NOW - 5.0), motion.reference(motion.end + 5.0)
    assert before.positions[0].tolist() == [0.5, 0.0]
    assert after.positions[0].tolist() == [pi, 0.0]
    assert not before.efforts.any()
    assert not after.efforts.any()
    middle = motion.reference(0.5 * (motion.start + motion.end))
    assert middle.velocities[0, 0] > 1.0


@pytest.mark.parametrize(
    'changes',
    [
        {'joints': ('joint1',)},
        {'joints': ('joint1', 'joint1')},
        {'min_duration': 2.0, 'max_duration': 1.0},
        {'start_source': StartSource.PARAMETER},
        {'start_source': StartSource.PARAMETER, 'start_position': (0.0, 0.1)},
    ],
)
def test_contradictory_settings_are_refused(changes):
    with pytest.raises(InvalidRequest):
        replace(SETTINGS, **changes)


def test_a_request_beyond_double_precision_is_ill_conditioned(monkeypatch):
    monkeypatch.setattr('flat_planner_ros.core.planning.BOUNDARY_TOLERANCE', 0.0)
    error = reason_of(session().submit, GOAL, NOW)
    assert error.reason is Reason.ILL_CONDITIONED
    assert error.value > 0.0
