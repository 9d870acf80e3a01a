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
A wire between two network namespaces that delays, loses and reorders frames; needs root.

Usage: wire.py NAMESPACE NAMESPACE. Lines `DELAY JITTER LOSS` [s, s, -] on standard input change
it; its end removes the namespaces. The kernel's netem does the same where there is one.
"""

import fcntl
import heapq
from itertools import count
import os
from random import Random
import selectors
import struct
import subprocess
import sys
from time import monotonic

ADDRESS = '10.90.0.{}/24'
FRAME = 65536
PATIENCE = 0.02
SET_INTERFACE, TAP, NO_HEADER = 0x400454CA, 0x0002, 0x1000


def ip(*words):
    """Configure the network."""
    subprocess.run(['ip', *words], check=True)


def end_of_wire(namespace, number):
    """Return the file descriptor of an interface that has been moved to a new namespace."""
    ip('netns', 'add', namespace)
    device = f'w{os.getpid()}{number}'
    end = os.open('/dev/net/tun', os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(end, SET_INTERFACE, struct.pack('16sH', device.encode(), TAP | NO_HEADER))
    ip('link', 'set', device, 'netns', namespace)
    inside = ('-n', namespace)
    ip(*inside, 'link', 'set', 'lo', 'up')
    ip(*inside, 'addr', 'add', ADDRESS.format(number + 1), 'dev', device)
    ip(*inside, 'link', 'set', device, 'up')
    ip(*inside, 'route', 'add', '224.0.0.0/4', 'dev', device)
    return end


class Wire:
    """Two ends, and the frames that are on their way."""

    def __init__(self, ends):
        """Join the ends with a wire that does no harm."""
        self.other = {ends[0]: ends[1], ends[1]: ends[0]}
        self.due, self.order, self.random = [], count(), Random(1)
        self.delay = self.jitter = self.loss = 0.0

    def take(self, end):
        """Take frames from an end; some are lost."""
        while True:
            try:
                frame = os.read(end, FRAME)
            except (BlockingIOError, OSError):
                return
            if self.random.random() >= self.loss:
                arrival = monotonic() + self.delay + self.random.random() * self.jitter
                heapq.heappush(self.due, (arrival, next(self.order), self.other[end], frame))

    def deliver(self):
        """Give what is due to the other end; return the time until the next one is [s]."""
        while self.due and self.due[0][0] <= monotonic():
            *_, end, frame = heapq.heappop(self.due)
            try:
                os.write(end, frame)
            except OSError:
                continue
        return min(PATIENCE, self.due[0][0] - monotonic()) if self.due else PATIENCE


def main(names):
    """Carry frames until standard input ends."""
    try:
        wire = Wire([end_of_wire(name, number) for number, name in enumerate(names)])
        ready = selectors.DefaultSelector()
        ready.register(sys.stdin, selectors.EVENT_READ)
        for end in wire.other:
            ready.register(end, selectors.EVENT_READ)
        print('ready', flush=True)
        while True:
            for key, _ in ready.select(max(0.0, wire.deliver())):
                if key.fileobj is not sys.stdin:
                    wire.take(key.fileobj)
                    continue
                line = sys.stdin.readline()
                if not line:
                    return
                wire.delay, wire.jitter, wire.loss = map(float, line.split())
    finally:
        for name in names:
            subprocess.run(['ip', 'netns', 'del', name], stderr=subprocess.DEVNULL)


if __name__ == '__main__':
    main(sys.argv[1:])
