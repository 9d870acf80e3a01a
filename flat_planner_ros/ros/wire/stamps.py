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

"""Stamps and durations: messages to seconds and back."""

from builtin_interfaces.msg import Duration, Time
from flat_planner_ros.ros.wire.point_writer import NANOSECONDS
from rclpy.clock import Clock, ROSClock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header


def seconds(time: Time | Duration) -> float:
    """Return a stamp or a duration in seconds."""
    return float(time.sec + time.nanosec / NANOSECONDS)


def time_msg(time: float) -> Time:
    """Return the stamp of an absolute time [s]."""
    sec, nanosec = sec_and_nanosec(time)
    return Time(sec=sec, nanosec=nanosec)


def duration_msg(duration: float) -> Duration:
    """Return the message of a duration [s]."""
    sec, nanosec = divmod(round(duration * NANOSECONDS), NANOSECONDS)
    return Duration(sec=sec, nanosec=nanosec)


def now(clock: Clock) -> float:
    """Return the present time of a clock [s]."""
    sec, nanosec = divmod(clock.now().nanoseconds, NANOSECONDS)
    return float(sec + nanosec / NANOSECONDS)


def is_simulated(clock: Clock) -> bool:
    """Tell whether a clock shows what is heard on `/clock`."""
    return isinstance(clock, ROSClock) and clock.ros_time_is_active


def sec_and_nanosec(time: float) -> tuple[int, int]:
    """Return an absolute time [s] in seconds and nanoseconds."""
    # Split first: a product of some 1e18 would round off the last hundred nanoseconds.
    sec, fraction = divmod(time, 1.0)
    carry, nanosec = divmod(round(fraction * NANOSECONDS), NANOSECONDS)
    return int(sec) + carry, nanosec


def header_at(header: Header, time: float) -> Header:
    """Return a header of an absolute time [s], the given one if it is of that time."""
    if seconds(header.stamp) == time:
        return header
    return Header(stamp=time_msg(time), frame_id=header.frame_id)


def is_stamped(msg: JointState) -> bool:
    """Return whether the message says when it was measured."""
    stamp = msg.header.stamp
    return bool(stamp.sec or stamp.nanosec)
