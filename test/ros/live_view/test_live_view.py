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

"""The live view by its protocol."""

import asyncio
from pathlib import Path
import re
import signal
import socket
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import pytest
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

aiohttp = pytest.importorskip('aiohttp')

from flat_planner_ros.ros import live_view as live  # noqa: E402, I100  They need it.
from flat_planner_ros.ros.live_view import live_node  # noqa: E402
from flat_planner_ros.ros.live_view.server import MAX_BROWSERS, RATE  # noqa: E402
from flat_planner_ros.ros.wire import interfaces  # noqa: E402
from ros.live_view.viewer import Browser, is_ready, PAGE, start_demo, View  # noqa: E402


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
        # What the plots need to set the two beside each other.
        accepted = browser.values['verdicts'][-1]['values']
        assert float(accepted['start_time']) - browser.values['epoch'] == pytest.approx(start)
        assert float(accepted['predicted_residual_worst']) > 0.01
        assert browser.values['plan']['way'][0] == [0.0, 0.0]
        assert (await browser.ask(do='call', service='reset'))['ok']
        reply = await browser.ask(do='call', service='adopt')
        assert reply['text']

    view.run(act)
    assert view.process.stop(signal.SIGINT) == 0
    assert 'Traceback' not in view.process.stderr


def test_via_points_limits_and_parameters_without_a_value(graph):
    limits = ['-p', 'flat_planner:limits.effort:=[0.5, .inf]']
    start_demo(graph, *limits)
    view = View(graph)

    async def act(browser: Browser) -> None:
        await browser.expect(lambda: is_ready(browser), 'three nodes')
        await browser.expect(lambda: 'limits' in browser.values, 'limits')
        assert browser.values['limits'] == {
            'position_min': None,
            'position_max': None,
            'velocity': None,
            'effort': [0.5, None],
        }
        known = browser.values['settings of flat_plant']
        # The imbalance has no value, the others are known all the same.
        assert 'mismatch.imbalance' not in known
        assert (known['noise.position_std'], known['drive']) == (0.0, 'effort')
        via = [{'positions': [-0.2], 'time': 0.4}]
        reply = await browser.ask(do='goal', positions=[0.3], duration=0.9, via=via)
        assert reply['ok'], reply
        await browser.expect(lambda: 'plan' in browser.values, 'a plan')
        # The angle of the last link passes it.
        assert min(sum(pose) for pose in browser.values['plan']['way']) < -0.19
        # All of a change is taken, or none: here there is one bound too many.
        values = {'insensitivity.weight': 10.0, 'insensitivity.max_residual': 0.1}
        reply = await browser.ask(do='set', node='flat_planner', values=values)
        assert not reply['ok']
        after = browser.values['settings of flat_planner']
        assert (after['insensitivity.weight'], after['insensitivity.max_residual']) == (0.0, 0.0)

    view.run(act)


def test_the_simulated_arm_is_pushed_and_a_tracker_shown_while_it_speaks(graph):
    start_demo(graph)
    view = View(graph)
    diagnostics = graph.probe.create_publisher(DiagnosticArray, interfaces.DIAGNOSTICS, 10)

    def say(owner: str, phase: str) -> None:
        status = DiagnosticStatus(name=interfaces.TRACKER_NAME, hardware_id=owner, level=b'\0')
        status.values = [KeyValue(key='phase', value=phase)]
        diagnostics.publish(DiagnosticArray(status=[status]))

    async def act(browser: Browser) -> None:
        await browser.expect(lambda: is_ready(browser), 'three nodes')
        reply = await browser.ask(do='push', efforts=[0.0, 1e-4])
        assert reply['ok'], reply
        await browser.expect(lambda: browser.streams['measured'][-1][4] != 0.0, 'a swing')
        assert not (await browser.ask(do='push', efforts=[0.0, 1e-4, 0.0]))['ok']
        assert not (await browser.ask(do='push', efforts=[0.0, '1']))['ok']
        await browser.expect(lambda: 'tracker' in browser.values, 'word of a tracker')
        assert browser.values['tracker'] is None
        graph.expect(diagnostics.get_subscription_count, 'the live view')

        def is_shown() -> bool:
            # It speaks again and again, or a browser that is late would see its end only.
            say('/other/flat_tracker', 'idle')
            say('/flat_tracker', 'tracking')
            return browser.values['tracker'] is not None

        await browser.expect(is_shown, 'a tracker')
        assert browser.values['tracker']['values']['phase'] == 'tracking'
        await browser.expect(lambda: browser.values['tracker'] is None, 'the end of its words')

    view.run(act)


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
        ({'do': 'goal', 'positions': [1.0], 'duration': 1.0, 'via': 'x'}, 'via must be a list'),
        ({'do': 'goal', 'positions': [1.0], 'duration': 1.0, 'via': 51 * [{}]}, 'at most 50'),
        ({'do': 'goal', 'positions': [1.0], 'duration': 1.0, 'via': [1.0]}, 'is an object'),
        ({'do': 'goal', 'positions': [1.0], 'duration': 1.0, 'via': [{}]}, 'needs 1 positions'),
        (
            {'do': 'set', 'node': 'flat_plant', 'values': {'mismatch.imbalance': [1e-3, 0.0]}},
            'full form',
        ),
        ({'do': 'set', 'node': 'flat_plant', 'values': {'mismatch.imbalance': 1}}, 'a list'),
        ({'do': 'set', 'node': 'flat_plant', 'values': {'noise.position_std': -1}}, 'in [0, 10]'),
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
        # What the test before has killed stays listed for up to 20 s.
        await browser.expect(
            lambda: 'nodes' in browser.values and not any(browser.values['nodes'].values()),
            'a graph without nodes',
        )
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
