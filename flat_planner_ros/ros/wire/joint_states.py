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
"""The one way from messages of joint states to samples of an arm, whatever drivers send."""

from array import array
from collections.abc import Callable, Sequence
from math import inf
from typing import NamedTuple

from flat_planner_ros.core.arm import (
    FloatArray,
    InvalidRequest,
    JointMerger,
    JointSample,
    JointStateRules,
    SampleTable,
    TurnCounter,
)
from flat_planner_ros.core.monitor import joint_indices
from flat_planner_ros.ros.wire import stamps
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

Places = NDArray[np.intp] | slice
"""Where wanted joints stand in the arrays of a message."""

MOST_PARTS = 16
"""Lists of names that are remembered; sources repeat theirs."""

NO_STAMP = 'joint states have no stamp: the time of their arrival is taken'
"""Remark on stamps of 0, which mean "now" to most of ROS."""

WHOLE = 1.0
"""Time around a message with all joints in which parts say nothing new [s]."""


DEFAULT_RULES = JointStateRules()


class _Layout(NamedTuple):
    """
    What a list of names says of the joints.

    Attributes
    ----------
    places
        Where the arm's joints stand in it.
    part
        Which joints these are, None for all.
    counter
        Of their turns.

    """

    places: Places
    part: list[int] | None
    counter: TurnCounter


class JointStateReader:
    """
    Reads joint states of one source that names all joints, or of several with some each.

    Names are looked up once, and compared as a whole from then on: at 1 kHz that counts.

    Parameters
    ----------
    joints
        Joints whose states are wanted, in this order.
    rules
        How they are read; may be replaced at any time.

    """

    def __init__(self, joints: Sequence[str], rules: JointStateRules = DEFAULT_RULES) -> None:
        self.joints = list(joints)
        self._merger = JointMerger(joints)
        self._counters: dict[tuple[int, ...], TurnCounter] = {}
        self._place: FloatArray | None = None
        self.rules = rules
        self._names: list[str] | None = None
        self._layout = _Layout(slice(None), None, TurnCounter())
        self._known: dict[tuple[str, ...], _Layout] = {}
        self._remarks: dict[str, bool] = {}
        self._has_remarks = False
        self._whole = -inf
        self._said: FloatArray | None = None

    @property
    def rules(self) -> JointStateRules:
        """Return how joint states are read."""
        return self._rules

    @rules.setter
    def rules(self, rules: JointStateRules) -> None:
        self._rules = rules
        self._merger.tolerance = rules.tolerance

    @property
    def is_in_parts(self) -> bool:
        """Tell whether the last message named some of the joints only."""
        return self._layout.part is not None

    @property
    def lack(self) -> str:
        """Return why parts give no present sample, a clause; empty where they do."""
        return self._merger.lack

    @property
    def has_remarks(self) -> bool:
        """Tell whether something is to be said of the messages."""
        return self._has_remarks

    def take_remarks(self) -> list[str]:
        """Return what is remarkable about the messages, a sentence each, each once."""
        self._has_remarks = False
        new = [remark for remark, is_told in self._remarks.items() if not is_told]
        self._remarks.update(dict.fromkeys(new, True))
        return new

    def read(self, msg: JointState, arrival: Callable[[], float]) -> list[JointSample]:
        """
        Return measured states in the order of the arm's joints.

        The arrays of a sample may be views of the message's.

        Parameters
        ----------
        msg
            Joints by name, in any order, perhaps with others among them; velocity and effort may
            be empty or NaN.
        arrival
            Tells when the message has come [s]; asked where its stamp is 0.

        Returns
        -------
        list of JointSample
            One for a message with all joints; for a part, those that are complete with it.

        Raises
        ------
        InvalidRequest
            None of the joints is named, or some are beside messages that name all, or the arrays
            do not fit the names.

        """
        names = msg.name
        if names != self._names:
            self._layout = self._layout_of(names)
            self._names = names
        places, part, counter = self._layout
        count = len(names)
        if len(msg.position) != count:
            raise InvalidRequest(f'{len(msg.position)} positions for {count} joint names')
        sample = JointSample(
            time=stamps.seconds(msg.header.stamp) or self._arrived(arrival),
            positions=np.frombuffer(msg.position)[places],
            velocities=_optional(msg.velocity, count, places),
            efforts=_optional(msg.effort, count, places),
        )
        if self._rules.unwrap:
            raw, sample = sample, counter.unwrapped(sample)
            if sample is not raw:
                self._remark_turns(part, counter)
        if part is None:
            self._whole = sample.time
            return [sample]
        if abs(sample.time - self._whole) <= WHOLE:
            joint_indices(names, self.joints)  # refuses it
        named = ', '.join(self.joints[index] for index in part)
        self._remark(
            f'joint states come in parts ({named} by itself): they are merged within '
            f'joint_states.tolerance {self.rules.tolerance:g} s'
        )
        return self._merger.add(part, sample)

    def read_table(self, names: list[str], samples: SampleTable) -> SampleTable | None:
        """
        Return the states of the arm's joints in messages that all have the same joints.

        Parameters
        ----------
        names
            Joints in the messages.
        samples
            Their states, stamped.

        Returns
        -------
        SampleTable or None
            None, and nothing is taken, where the messages are to be read one by one.

        """
        if names != self._names:
            return None  # the first of them is to be read by itself
        places, part, counter = self._layout
        if part is not None:
            return None
        chosen = samples.joints(places)
        if self._rules.unwrap:
            turned = counter.unwrapped_table(chosen)
            if turned is None:
                return None
            chosen = turned
        self._whole = float(chosen.times[-1])
        return chosen

    def align(self, pose: FloatArray) -> None:
        """
        Count turns from those of a planned pose near which the arm is, shape (n,) [rad].

        Encoders that are wrapped do not tell how often they have turned before.
        """
        self._place = pose
        for part, counter in self._counters.items():
            counter.align(pose[list(part)])

    def _counter(self, part: Sequence[int]) -> TurnCounter:
        """Return the counter of joints that come together."""
        key = tuple(part)
        if key not in self._counters:
            self._counters[key] = TurnCounter()
            if self._place is not None:
                self._counters[key].align(self._place[list(key)])
        return self._counters[key]

    def _remark_turns(self, part: Sequence[int] | None, counter: TurnCounter) -> None:
        """Say, once, of which joints turns are counted."""
        if counter.turns is self._said:
            return
        self._said = counter.turns
        indices = part or range(len(self.joints))
        for place, (index, turns) in enumerate(zip(indices, counter.turns, strict=True)):
            if turns:
                self._remark(
                    f'{self.joints[index]} is wrapped to {counter.range_of(place)} in joint '
                    'states: its turns are counted (joint_states.unwrap)'
                )

    def _layout_of(self, names: list[str]) -> _Layout:
        """Return where a message with these names has the joints, and which if not all."""
        key = tuple(names)
        if key not in self._known:
            if len(self._known) == MOST_PARTS:
                self._known.clear()
            self._known[key] = self._looked_up(names)
        return self._known[key]

    def _looked_up(self, names: list[str]) -> _Layout:
        """Return the layout of a message with these names."""
        whole = range(len(self.joints))
        if names == self.joints:
            return _Layout(slice(None), None, self._counter(whole))
        there = [name for name in self.joints if name in names] or self.joints
        places = joint_indices(names, there)
        if len(there) == len(self.joints):
            return _Layout(places, None, self._counter(whole))
        part = [self.joints.index(name) for name in there]
        return _Layout(places, part, self._counter(part))

    def _arrived(self, arrival: Callable[[], float]) -> float:
        """Return the time of arrival of a message without a stamp."""
        self._remark(NO_STAMP)
        return arrival()

    def _remark(self, remark: str) -> None:
        """Keep a remark that is new."""
        if remark not in self._remarks:
            self._remarks[remark] = False
            self._has_remarks = True


def _optional(values: 'array[float]', count: int, places: Places) -> FloatArray | None:
    """Return the wanted entries of an array that may be empty."""
    if len(values) != count:
        return None
    return np.frombuffer(values)[places]
