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

"""The live view: by its protocol, and in a real browser where there is one."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import asynccontextmanager
import json
from math import pi
from pathlib import Path
import re
import shutil
import signal
import socket
import subprocess
from time import monotonic

import pytest
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

aiohttp = pytest.importorskip('aiohttp')

from flat_planner_ros.ros import live_view as live  # noqa: E402, I100  They need it.
from flat_planner_ros.ros.live_view import live_node  # noqa: E402
from flat_planner_ros.ros.live_view.server import MAX_BROWSERS, RATE  # noqa: E402

PAGE = Path(live.__file__).parent / 'page'

TIMEOUT = 20.0
"""Time in which anything must happen that happens at all [s]."""

CHROMIUM = next(filter(None, map(shutil.which, ('chromium', 'chromium-browser'))), None)

NODE = shutil.which('node')

BROWSER_ARGUMENTS = [
    '--no-sandbox',
    '--disable-gpu',
    '--disable-quic',
    '--no-first-run',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-sync',
]


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


def test_a_goal_leaves_a_verdict_and_a_residual_on_the_page(graph):
    start_demo(graph)
    view = View(graph)

    async def act(browser: Browser) -> None:
        await browser.expect(lambda: is_ready(browser), 'three nodes')
        assert browser.values['settings of flat_plant']['drive'] == 'effort'
        reply = await browser.ask(
            do='set', node='flat_plant', values={'mismatch.stiffness_scale': 1.1}
        )
        assert reply['ok'], reply
        await browser.expect(
            lambda: browser.values['settings of flat_plant']['mismatch.stiffness_scale'] == 1.1,
            'the stiffness',
        )
        values = {'strategy': 'polynomial', 'weights.r': 100}
        assert (await browser.ask(do='set', node='flat_planner', values=values))['ok']
        await browser.expect(
            lambda: browser.values['settings of flat_planner']['strategy'] == 'polynomial',
            'the strategy',
        )
        assert (await browser.ask(do='goal', positions=[1.0], duration=0.5))['ok']
        await browser.expect(lambda: 'report' in browser.values, 'a report')

        def states() -> set[str]:
            return {verdict['state'] for verdict in browser.values['verdicts']}

        # It may swing on for longer than the planner waits for it.
        await browser.expect(lambda: states() & {'FINISHED', 'FAILED'}, 'an end')
        assert 'ACCEPTED' in states()
        report = browser.values['report']
        assert float(report['values']['amplitude']) > 0.01
        assert report['level'] in ('warn', 'error')
        start, end = browser.values['plan']['start'], browser.values['plan']['end']
        assert end - start == pytest.approx(0.5, abs=1e-5)
        during = [r for r in browser.streams['measured'] if start <= r[0] <= end]
        assert len(during[0]) == 7  # time, then positions, velocities, efforts of two joints
        assert max(abs(row[5]) for row in during) > 1e-3
        assert any(abs(row[2]) > 0.01 for row in browser.streams['residual'])
        assert browser.streams['reference'][-1][1] == pytest.approx(1.0, abs=1e-3)
        assert (await browser.ask(do='call', service='reset'))['ok']
        reply = await browser.ask(do='call', service='adopt')
        assert reply['text']

    view.run(act)
    assert view.process.stop(signal.SIGINT) == 0
    assert 'Traceback' not in view.process.stderr


def test_what_makes_no_sense_is_refused_with_a_reason(graph):
    start_demo(graph)
    view = View(graph)
    refused = [
        ({'do': 'goal', 'positions': [1.0, 2.0], 'duration': 1.0}, 'needs 1 positions'),
        ({'do': 'goal', 'positions': ['1'], 'duration': 1.0}, 'joint1 must be a number'),
        ({'do': 'goal', 'positions': [True], 'duration': 1.0}, 'joint1 must be a number'),
        ({'do': 'goal', 'positions': [float('nan')], 'duration': 1.0}, 'joint1 must be'),
        ({'do': 'goal', 'positions': [1.0], 'duration': -1.0}, 'duration must be'),
        ({'do': 'goal', 'positions': [1.0], 'duration': 10**400}, 'duration must be'),
        ({'do': 'goal'}, 'needs 1 positions'),
        ({'do': 'set', 'node': 'flat_planner', 'values': {'strategy': 'x'}}, 'one of'),
        ({'do': 'set', 'node': 'flat_planner', 'values': {'strategy': 1}}, 'must be a str'),
        ({'do': 'set', 'node': 'flat_planner', 'values': {'weights.r': -1}}, 'in [0, 1000]'),
        ({'do': 'set', 'node': 'flat_planner', 'values': {'execute': False}}, 'cannot be set'),
        ({'do': 'set', 'node': 'flat_planner', 'values': {}}, 'no parameters'),
        ({'do': 'set', 'node': 'other', 'values': {'x': 1}}, 'no such node'),
        ({'do': 'set', 'node': [], 'values': {'x': 1}}, 'internal error'),
        ({'do': 'call', 'service': 'shutdown'}, 'no such service'),
        ({'do': 'dance'}, 'unknown command'),
        ({}, 'unknown command'),
    ]

    async def act(browser: Browser) -> None:
        await browser.expect(lambda: is_ready(browser), 'three nodes')
        for command, reason in refused:
            reply = await browser.ask(**command)
            assert not reply['ok'], command
            assert reason in reply['text'], command
        for text in ('', '{', '[]', 'null', '[' * 10000, '"x"'):
            await browser.ws.send_str(text)
            await browser.expect(lambda: None in browser.replies, f'a reply to {text[:10]}')
            assert not browser.replies.pop(None)['ok']
        assert (await browser.ask(do='goal', positions=[0.1], duration=0.5))['ok']

    view.run(act)
    assert 'Traceback' not in view.process.stderr


def test_a_command_that_is_too_long_ends_its_connection_only(graph):
    view = View(graph)

    async def act(browser: Browser) -> None:
        async with view.browser() as other:
            await browser.ws.send_str('x' * 100_000)
            async for _ in browser.ws:
                pass
            assert browser.ws.close_code == aiohttp.WSCloseCode.MESSAGE_TOO_BIG
            await other.expect(lambda: 'namespace' in other.values, 'the other browser')

    view.run(act)


def test_the_page_is_whole_and_needs_nothing_from_elsewhere(graph):
    view = View(graph)

    async def look() -> None:
        async with aiohttp.ClientSession() as session:
            for name in sorted(path.name for path in PAGE.iterdir()):
                path = '' if name == 'index.html' else name
                async with session.get(view.url + path) as response:
                    assert response.status == 200, name
                    assert await response.text() == (PAGE / name).read_text('utf-8')
                    policy = response.headers['Content-Security-Policy']
                    assert "default-src 'none'" in policy
                    assert response.headers['X-Content-Type-Options'] == 'nosniff'
            async with session.get(view.url + 'live.py') as response:
                assert response.status == 404
            async with session.post(view.url) as response:
                assert response.status == 405

    asyncio.run(look())
    for path in PAGE.iterdir():
        assert not re.search(r'https?://|//\w+\.\w+/', path.read_text('utf-8')), path.name


def test_foreign_pages_and_names_are_refused(graph):
    view = View(graph, '--allow-host', 'robot.local')
    port = view.host.rpartition(':')[2]
    expected = {
        (f'127.0.0.1:{port}', None): True,
        (f'localhost:{port}', f'http://localhost:{port}'): True,
        (f'[::1]:{port}', None): True,
        (f'robot.local:{port}', f'http://robot.local:{port}'): True,
        (f'evil.example:{port}', None): False,
        (f'evil.example:{port}', f'http://evil.example:{port}'): False,
        (f'127.0.0.1:{port}', 'http://evil.example'): False,
        (f'127.0.0.1:{port}', f'http://localhost:{port}'): False,
        (f'127.0.0.1:{port}', 'http://127.0.0.1:1'): False,
        (f'127.0.0.1:{port}', 'null'): False,
        (f'127.0.0.1.evil.example:{port}', None): False,
    }

    async def knock() -> None:
        async with aiohttp.ClientSession() as session:
            for (host, origin), is_welcome in expected.items():
                headers = {'Host': host} | ({'Origin': origin} if origin else {})
                async with session.get(view.url, headers=headers) as response:
                    assert (response.status == 200) is is_welcome, (host, origin)
                try:
                    async with session.ws_connect(view.url + 'ws', headers=headers):
                        status = 200
                except aiohttp.WSServerHandshakeError as refusal:
                    status = refusal.status
                assert status == (200 if is_welcome else 403), (host, origin)

    asyncio.run(knock())


def test_several_browsers_see_the_same_and_there_is_an_end_to_them(graph):
    start_demo(graph)
    view = View(graph)

    async def act(browser: Browser) -> None:
        await browser.expect(lambda: is_ready(browser), 'three nodes')
        async with view.browser() as late:
            await late.expect(lambda: is_ready(late), 'the late one')
            first = late.streams['measured'][0]
            assert first == browser.streams['measured'][0]
            async with aiohttp.ClientSession() as session:
                more = [await session.ws_connect(view.url + 'ws') for _ in range(MAX_BROWSERS - 2)]
                with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
                    await session.ws_connect(view.url + 'ws')
                assert refusal.value.status == 503
                for ws in more:
                    await ws.close()
            async with view.browser() as again:
                await again.expect(lambda: is_ready(again), 'one that takes a free place')

    view.run(act)


def test_nodes_may_come_late_and_again(graph):
    view = View(graph)

    async def act(browser: Browser) -> None:
        await browser.expect(lambda: 'nodes' in browser.values, 'nodes')
        assert not any(browser.values['nodes'].values())
        reply = await browser.ask(do='goal', positions=[1.0], duration=1.0)
        assert not reply['ok']
        reply = await browser.ask(do='call', service='replan')
        assert reply['text'] == 'flat_planner/replan is not there'
        for _ in range(2):
            demo = start_demo(graph)
            await browser.expect(lambda: is_ready(browser), 'three nodes')
            assert (await browser.ask(do='goal', positions=[0.1], duration=0.2))['ok']
            await browser.expect(lambda: browser.values.get('verdicts'), 'a verdict')
            assert demo.stop(signal.SIGINT) == 0
            await browser.expect(
                lambda: not any(browser.values['nodes'].values()), 'the end of the nodes'
            )
            browser.streams.clear()
            browser.values.pop('verdicts')

    view.run(act)


def test_a_namespace_is_followed(graph):
    start_demo(graph, '-r', '__ns:=/arm1')
    view = View(graph, '--ros-args', '-r', '__ns:=/arm1')

    async def act(browser: Browser) -> None:
        await browser.expect(lambda: is_ready(browser), 'three nodes')
        assert browser.values['namespace'] == '/arm1'
        assert (await browser.ask(do='goal', positions=[0.1], duration=0.5))['ok']
        await browser.expect(lambda: browser.values.get('verdicts'), 'a verdict')

    view.run(act)


def test_fast_joint_states_are_thinned_out(graph):
    """A thousand per second at least for as long as a browser hears a hundred messages."""
    view = View(graph)
    states = graph.probe.create_publisher(JointState, '/joint_states', QoSProfile(depth=1))
    graph.expect(states.get_subscription_count, 'the live view')
    msg = JointState(name=['joint1', 'joint2'], position=[0.0, 0.0])

    async def act(browser: Browser) -> None:
        is_over = False
        sent = 0

        async def publish() -> None:
            nonlocal sent
            while not is_over:
                for _ in range(10):
                    sent += 1
                    msg.header.stamp.sec, msg.header.stamp.nanosec = divmod(sent * 10**6, 10**9)
                    states.publish(msg)
                await asyncio.sleep(0.005)

        publishing = asyncio.create_task(publish())
        await browser.expect(lambda: 'measured' in browser.streams, 'joint states')
        begin, before = monotonic(), len(browser.streams['measured'])
        first = browser.messages
        await browser.expect(lambda: browser.messages - first >= 100, 'a hundred messages')
        elapsed = monotonic() - begin
        is_over = True
        await publishing
        rows = len(browser.streams['measured']) - before
        assert sent > 3 * rows
        # Late messages may come in a row, hence some to spare.
        assert rows <= elapsed / live_node.ROW_PERIOD + 10
        assert browser.messages - first <= RATE * elapsed + 5

    view.run(act)


def test_time_that_begins_again_begins_a_new_page(graph):
    view = View(graph)

    states = graph.probe.create_publisher(JointState, '/joint_states', 10)
    msg = JointState(name=['joint1', 'joint2'], position=[1.0, 0.0])
    msg.header.stamp.sec = 1000

    async def publish() -> None:
        while True:
            states.publish(msg)
            await asyncio.sleep(0.02)

    async def act(browser: Browser) -> None:
        publishing = asyncio.create_task(publish())
        await browser.expect(lambda: browser.streams.get('measured'), 'joint states')
        msg.header.stamp.sec, msg.position[0] = 3, 2.0
        await browser.expect(
            lambda: browser.streams.get('measured', [[0, 0]])[-1][1] == 2.0, 'later ones'
        )
        publishing.cancel()
        assert {row[1] for row in browser.streams['measured']} == {2.0}
        assert browser.streams['measured'][0][0] == 0.0

    view.run(act)


def test_an_address_in_use_is_one_line(graph):
    with socket.create_server(('127.0.0.1', 0)) as taken:
        port = taken.getsockname()[1]
        process = graph.start('live_view', '--port', str(port))
        assert process.wait() == 1
    assert process.stderr == f'cannot start: 127.0.0.1, port {port}: Address already in use\n'


def test_a_missing_library_is_one_line(graph, tmp_path):
    (tmp_path / 'aiohttp.py').write_text('raise ModuleNotFoundError("none", name="aiohttp")')
    paths = f'{tmp_path}:{Path(live.__file__).parents[3]}'
    process = graph.start('live_view', PYTHONPATH=paths)
    assert process.wait() == 1
    expected = (
        "aiohttp is not installed: pip install '.[live]' in the checkout, or aiohttp itself\n"
    )
    assert process.stderr == expected


def test_other_machines_are_let_in_only_if_asked_for(graph):
    assert View(graph).host.startswith('127.0.0.1:')
    open_view = View(graph, '--host', '0.0.0.0')
    assert 'no password' in open_view.process.stderr
    assert open_view.process.stop(signal.SIGTERM) == 0


@pytest.mark.skipif(CHROMIUM is None, reason='no Chromium')
def test_a_goal_through_the_page_in_a_browser(graph, tmp_path):
    playwright = pytest.importorskip('playwright.sync_api')
    expect = playwright.expect
    # A busy machine needs time to plan a stop.
    start_demo(graph, '-p', 'flat_planner:replan.lookahead:=1.0')
    view = View(graph)
    complaints: list[str] = []
    patience = 1000 * TIMEOUT
    with playwright.sync_playwright() as library:
        chromium = library.chromium.launch(executable_path=CHROMIUM, args=BROWSER_ARGUMENTS)
        page = chromium.new_page(viewport={'width': 1280, 'height': 900})
        page.on('pageerror', lambda error: complaints.append(str(error)))
        page.on('console', lambda message: complaints.append(message.text))
        page.goto(view.url)
        expect(page.locator('#connection')).to_have_text('live', timeout=patience)
        stiffness = page.locator('[name="mismatch.stiffness_scale"]')
        expect(stiffness).to_have_value('1', timeout=patience)
        stiffness.fill('1.1')
        page.click('[data-node=flat_plant] .main')
        expect(page.locator('[data-node=flat_plant] .answer')).to_have_text(
            'mismatch.stiffness_scale = 1.1', timeout=patience
        )
        # A goal starts where the arm is, and shows degrees beside radians.
        expect(page.locator('#goal-joints input')).to_have_value('0', timeout=patience)
        page.fill('#goal-joints input', '1.0')
        expect(page.locator('#goal-joints .degrees')).to_have_text('57.3°')
        page.fill('#duration', '0.5')
        page.click('#goal .main')
        expect(page.locator('#goal-answer')).to_contain_text('plan 1', timeout=patience)
        expect(page.locator('#goal-answer')).to_contain_text(re.compile('starts in 0'))
        expect(page.locator('#prediction')).to_contain_text('mrad', timeout=patience)
        expect(page.locator('#verdicts')).to_contain_text(
            re.compile('finished|failed'), timeout=patience
        )
        expect(page.locator('#report-level')).to_have_class(
            re.compile('warn|error'), timeout=patience
        )
        assert float(page.inner_text('#amplitude')) > 10.0  # mrad
        page.click('[data-service=reset]')
        expect(page.locator('#goal-answer')).to_contain_text('at rest at', timeout=patience)
        # What is no number is marked, and what follows it counts.
        for field, right in (('#goal-joints input', '90°'), ('#duration', '4')):
            page.fill(field, 'nonsense')
            page.press(field, 'Enter')
            expect(page.locator(f'{field}:invalid')).to_have_count(1)
            page.fill(field, right)
            expect(page.locator(f'{field}:invalid')).to_have_count(0)
        page.press('#duration', 'Enter')
        expect(page.locator('#goal-answer')).to_contain_text('plan 2', timeout=patience)
        page.keyboard.press('Escape')
        expect(page.locator('#goal-answer')).to_contain_text('comes to rest', timeout=patience)
        picture = page.screenshot(path=tmp_path / 'page.png')
        expect(page.locator('#report-level')).to_contain_text('earlier', timeout=patience)
        stiffness.fill('nonsense')
        stiffness.press('Enter')
        expect(page.locator('[name="mismatch.stiffness_scale"]:invalid')).to_have_count(1)
        stiffness.fill('1.2')
        stiffness.press('Enter')
        expect(page.locator('[data-node=flat_plant] .answer')).to_have_text(
            'mismatch.stiffness_scale = 1.2', timeout=patience
        )
        # A refusal stands beside the button.
        page.fill('#duration', '0.01')
        page.press('#duration', 'Enter')
        expect(page.locator('#goal-answer')).to_contain_text('rejected', timeout=patience)
        assert complaints == []
        # The server goes and comes back: so does the page.
        port = view.host.rpartition(':')[2]
        assert view.process.stop(signal.SIGINT) == 0
        expect(page.locator('#connection')).to_contain_text('not connected', timeout=patience)
        View(graph, '--port', port)
        expect(page.locator('#connection')).to_have_text('live', timeout=patience)
        chromium.close()
    assert picture.startswith(b'\x89PNG')


@pytest.mark.skipif(NODE is None, reason='no Node.js')
def test_the_words_of_the_page(tmp_path):
    """Angles as people write them, and times as they say them."""
    module = shutil.copy(PAGE / 'words.js', tmp_path / 'words.mjs')
    script = f"""
        import {{angle, inDegrees, number, readable}} from '{module.as_uri()}';
        console.log(JSON.stringify([
            ['1.57', '90deg', '-45 °', 'pi/2', '−3*π/4', '2pi', '1,5 rad'].map(angle),
            ['abc', '', 'deg', 'pi/0'].map(angle),
            ['0.4', '−1,5', ' ', '1e-3', '1x'].map(number),
            [inDegrees(Math.PI / 3), inDegrees(-1), inDegrees(null)],
            readable('plan 3, starts at 1795780633.296 s, in 0.050 s; not x'),
            readable('wait for its end at 1795780633.296 s'),
        ]));
    """
    answer = subprocess.run(
        [NODE, '--input-type=module', '--eval', script], capture_output=True, text=True, check=True
    )
    angles, wrong, numbers, degrees, start, end = json.loads(answer.stdout)
    expected = [1.57, pi / 2, -pi / 4, pi / 2, -3 * pi / 4, 2 * pi, 1.5]
    assert angles == pytest.approx(expected)
    assert wrong == [None] * 4
    assert numbers == [0.4, -1.5, None, 1e-3, None]
    assert degrees == ['60°', '−57.3°', '']
    assert start == 'plan 3, starts in 0.050 s; not x'
    assert re.fullmatch(r'wait for its end at \d+:\d+:\d+', end)
