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

"""A tracked motion is reported, recorded and adopted as what it is."""

import json
from math import pi

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from flat_planner_ros.ros.wire import interfaces, stamps
from flat_planner_ros.ros.wire.message_types import definition
import pytest
from rclpy.serialization import serialize_message
from ros.rig import ATTEMPTS, Late, on_time, values
from ros.tracked_arm import arguments, EFFORTS, Tracked
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

pytest.importorskip('mcap')

from flat_planner_ros.ros.programs import analyse  # noqa: E402, I100  It needs it.
from flat_planner_ros.ros.recording.recording import Recording, RecordingWriter  # noqa: E402

PUSH = '/flat_plant/push'
START = 100.0
TOPICS = {
    '/flat_planner/plan': 'trajectory_msgs/msg/JointTrajectory',
    '/joint_states': 'sensor_msgs/msg/JointState',
    '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    EFFORTS: 'std_msgs/msg/Float64MultiArray',
    PUSH: 'std_msgs/msg/Float64MultiArray',
}
SOFTER = {'mismatch.stiffness_scale': 0.9, 'mismatch.damping_scale': 0.9}
NEXT_TO_NONE = 5e-3
"""Error that is left where the model is the arm; feedback alone leaves more [rad]."""

MONITOR = {'use_sim_time': 'true', 'window': 1.0, 'timeout': 10.0, 'fit_model': 'true'}


def test_the_model_of_a_tracked_motion_is_adopted_and_the_next_one_needs_next_to_no_feedback(
    graph, tmp_path, capsys
):
    arm = Tracked(graph, **SOFTER)
    assert graph.set_parameters('flat_planner', auto_tune=True)[0].successful
    # In processes of their own, which are in time: of joint states none may be missed, and what
    # is sent has no stamps.
    graph.start('monitor_node', *arguments(MONITOR))
    arm.hear_monitor()
    adopted = graph.collect(DiagnosticArray, '/flat_planner/status', interfaces.VERDICTS)
    path = tmp_path / 'tracked.mcap'
    recorder = graph.start('record', '--output', str(path))
    graph.expect(lambda: path.exists() and path.stat().st_size, 'the recorder')
    graph.expect(lambda: '/diagnostics' in Recording(path).topics, 'the recorder on diagnostics')
    place, report = on_time(lambda: estimating_motion(arm))
    assert report['tracked'] == 'true'
    assert 'stiffness_estimate' not in report
    # What the efforts tell is the arm, 10 % softer, and is taken over.
    assert float(report['model.stiffness']) == pytest.approx(2.7e-3, rel=0.04)
    graph.expect(lambda: any(values(m)['state'] == 'ADOPTED' for m in adopted), 'an adoption')
    graph.expect(lambda: graph.logged('follows the adopted model'), 'a tracker for it')
    assert arm.errors(arm.end, place).max() > NEXT_TO_NONE
    # A motion whose efforts come late on a busy machine needs feedback whatever the model is.
    assert any(error_of_motion(arm) < NEXT_TO_NONE for _ in range(ATTEMPTS))
    graph.publish(PUSH, Float64MultiArray(data=[1e-3, 0.0]), readers=2)
    graph.expect(lambda: {EFFORTS, PUSH} <= set(Recording(path).topics), 'efforts and pushes')
    assert recorder.stop() == 0
    assert analyse.main(['analyse', str(path), '--json', '-']) == 0
    again = json.loads(capsys.readouterr().out)['reports'][0]
    assert again['values']['tracked'] is True
    assert 'stiffness_estimate' not in again['values']
    sent = again['sent']
    assert 0.0 < sent['feedback_rms.joint1'] < sent['feedback_peak.joint1']
    assert sent['feedback_rms.joint1'] < 0.5 * sent['planned_peak.joint1']


def elsewhere(arm):
    """Return the place of the two where the arm is not."""
    return 0.0 if arm.states[-1].position[0] > 1.0 else pi


def error_of_motion(arm):
    """Return the largest error that is left after a motion [rad]."""
    place = elsewhere(arm)
    arm.move(place)
    arm.wait_until(arm.end + 0.5)
    return arm.errors(arm.end, place).max()


def estimating_motion(arm):
    """Return where a motion led and its report; joint states missed may make the model vague."""
    place = elsewhere(arm)
    seen = len(arm.reports)
    arm.move(place)
    arm.graph.expect(lambda: len(arm.reports) > seen, 'a report')
    report = values(arm.reports[-1])
    if 'model.stiffness' not in report:
        arm.wait_until(arm.end)  # where it starts next
        raise Late(arm.reports[-1].status[0].message)
    return place, report


def test_what_feedback_added_and_who_pushed_is_told_by_the_clock_of_the_joint_states(
    tmp_path, capsys
):
    path, picture = tmp_path / 'written.mcap', tmp_path / 'written.png'
    write_motion(path)
    assert analyse.main(['analyse', str(path), '--plot', str(picture)]) == 0
    shown = capsys.readouterr().out
    assert 'carried out with feedback' in shown
    assert 'joint1: feedback up to 0.002 N m, RMS 0.001; the plan up to 0.01' in shown
    assert 'pushed from 0.2 to 0.3 s after the start, up to 0.03 N m' in shown
    assert picture.stat().st_size


def write_motion(path):
    """
    Write a motion of joint 1, played three times as fast as its stamps say.

    The tracker adds 0.002 N m in a quarter of the time; somebody pushes from 0.2 to 0.3 s.
    """
    writer = RecordingWriter(path)
    for topic, kind in TOPICS.items():
        writer.add_topic(topic, kind, definition(kind), [])

    def write(topic, time, message):
        writer.write(topic, round(1e9 * (5e4 + time / 3.0)), serialize_message(message))

    plan = JointTrajectory(joint_names=['joint1', 'joint2'])
    plan.header.stamp = stamps.time_msg(START)
    for time, effort in ((0.0, 0.01), (0.5, 0.0), (1.0, -0.01)):
        point = JointTrajectoryPoint(positions=[0.0, 0.0], effort=[effort, 0.0])
        point.time_from_start = stamps.duration_msg(time)
        plan.points.append(point)
    write('/flat_planner/plan', -0.5, plan)
    word = DiagnosticStatus(name=interfaces.TRACKER_NAME, hardware_id='/flat_tracker')
    word.values = [KeyValue(key='phase', value='tracking')]
    news = DiagnosticArray(status=[word])
    for step in range(-40, 501):
        time = 0.01 * step
        news.header.stamp = stamps.time_msg(START + time)
        if step % 100 == 0:
            write('/diagnostics', time, news)
        state = JointState(name=['joint1', 'joint2'], position=[0.0, 0.0], effort=[0.0, 0.0])
        state.header.stamp = stamps.time_msg(START + time)
        write('/joint_states', time, state)
        if 0.0 <= time < 3.995:
            planned = 0.01 * (1.0 - 2.0 * time) if time <= 1.0 else 0.0
            added = 0.002 if time < 0.995 else 0.0
            write(EFFORTS, time, Float64MultiArray(data=[planned + added]))
        if 0.195 < time < 0.305:
            write(PUSH, time, Float64MultiArray(data=[0.03, 0.0]))
    writer.close()
