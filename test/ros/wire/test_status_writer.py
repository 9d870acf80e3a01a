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

"""Verdicts in serialised form against those that the middleware writes."""

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from flat_planner_ros.ros.wire.status_writer import array_bytes, Pair, Status
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header

words = st.text(st.characters(blacklist_categories=['Cs'], blacklist_characters='\0'))
levels = st.sampled_from(
    [DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.STALE]
)


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(
    levels,
    words,
    words,
    words,
    st.lists(st.tuples(words, words), max_size=9),
    st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1)),
)
def test_what_is_written_is_what_the_middleware_writes(level, name, message, part, pairs, stamp):
    written = array_bytes(
        Status(
            level=level,
            name=name,
            message=message,
            hardware_id=part,
            values=[Pair(*pair) for pair in pairs],
        ),
        stamp,
    )
    same = DiagnosticArray(
        header=Header(stamp=Time(sec=stamp[0], nanosec=stamp[1])),
        status=[
            DiagnosticStatus(
                level=level,
                name=name,
                message=message,
                hardware_id=part,
                values=[KeyValue(key=key, value=value) for key, value in pairs],
            )
        ],
    )
    assert deserialize_message(written, DiagnosticArray) == same
