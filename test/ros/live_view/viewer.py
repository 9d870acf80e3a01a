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

"""A live view in a process of its own, and what browsers of it know."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
import re
from time import monotonic

import pytest

aiohttp = pytest.importorskip('aiohttp')

from flat_planner_ros.ros import live_view as live  # noqa: E402, I100  They need it.
from ros.conftest import TIMEOUT  # noqa: E402

PAGE = Path(live.__file__).parent / 'page'


class Browser:
    """What a page knows and can ask for."""

    def __init__(self, ws: aiohttp.ClientWebSocketResponse) -> None:
        """Know nothing."""
        self.ws = ws
        self.values: dict = {}
        self.streams: dict = {}
        self.replies: dict = {}
        self.messages = 0

    async def hear(self) -> None:
        """Take one message."""
        news = await self.ws.receive_json()
        self.messages += 1
        self.values |= news.get('values', {})
        if news.get('restart'):
            self.streams = {}
        for name, rows in news.get('streams', {}).items():
            self.streams.setdefault(name, []).extend(rows)
        if 'reply' in news:
            self.replies[news['reply']['id']] = news['reply']

    async def expect(self, condition: Callable[[], object], what: str) -> None:
        """Hear messages until a condition holds."""
        deadline = monotonic() + TIMEOUT
        while not condition():
            left = deadline - monotonic()
            try:
                await asyncio.wait_for(self.hear(), left)
            except asyncio.TimeoutError:
                pytest.fail(f'not within {TIMEOUT:g} s: {what}; known: {self.values}')

    async def ask(self, **command: object) -> dict:
        """Return the reply to a command."""
        number = len(self.replies) + 1
        await self.ws.send_json({**command, 'id': number})
        await self.expect(lambda: number in self.replies, f'a reply to {command}')
        return self.replies[number]


class View:
    """A live view in a process of its own."""

    def __init__(self, graph, *arguments: str) -> None:
        """Start it."""
        self.process = graph.start('live_view', '--port', '0', *arguments)
        graph.expect(lambda: '(until' in self.process.stdout, 'the address')
        self.url = re.search(r'http://\S+/', self.process.stdout)[0]

    @property
    def host(self) -> str:
        """Return host and port."""
        return self.url.removeprefix('http://').removesuffix('/')

    @asynccontextmanager
    async def browser(self, **headers: str):
        """Give a browser that watches."""
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(self.url + 'ws', headers=headers) as ws,
        ):
            yield Browser(ws)

    def run(self, act: Callable[[Browser], Awaitable[None]]) -> None:
        """Do something in a browser."""

        async def watch() -> None:
            async with self.browser() as browser:
                await act(browser)

        asyncio.run(watch())


def start_demo(graph, *arguments: str):
    """Return the three nodes in a process."""
    return graph.start('demo', '--ros-args', '-p', 'flat_monitor:window:=1.0', *arguments)


def is_ready(browser: Browser) -> bool:
    """Return whether all three nodes are there and the arm is seen."""
    return bool(
        all(browser.values.get('nodes', {'': False}).values())
        and browser.values.get('settings of flat_plant')
        and browser.streams.get('measured')
    )
