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

"""Web server of the live view: one page, one websocket, and nobody else's pages."""

import asyncio
from collections.abc import Awaitable, Callable, Collection, Mapping
from contextlib import suppress
from importlib.resources import files
from ipaddress import ip_address
import json
from pathlib import PurePath
import socket
from threading import Thread
from typing import Any
from urllib.parse import urlsplit

from aiohttp import web, WSMsgType
from flat_planner_ros.ros.live_view.feed import Cursor, Feed

RATE = 30.0
"""Most messages to a browser per second [Hz]."""

MAX_BROWSERS = 16
"""Browsers that are served at the same time [-]."""

MAX_COMMAND = 16 * 1024
"""Longest command of a browser [bytes]."""

PATIENCE = 10.0
"""Silence after which a browser is taken for gone [s]."""

START_PAGE = 'index.html'

KINDS = {'.html': 'text/html', '.css': 'text/css', '.js': 'text/javascript'}
"""Kinds of the page's files by the ends of their names."""

HEADERS = {
    'Content-Security-Policy': "default-src 'none'; script-src 'self'; style-src 'self'; "
    "connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    'X-Content-Type-Options': 'nosniff',
    'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Resource-Policy': 'same-origin',
    'Cache-Control': 'no-store',
}
"""Nothing but the own files, and no frame of another page around them."""

Obey = Callable[[Mapping[str, Any]], Awaitable[tuple[bool, str]]]
"""Carries out a browser's command; returns whether it did, and a sentence."""

FEED = web.AppKey('feed', Feed)
OBEY: web.AppKey[Obey] = web.AppKey('obey')
HOSTS: web.AppKey[Collection[str]] = web.AppKey('hosts')
BROWSERS: web.AppKey[set[web.WebSocketResponse]] = web.AppKey('browsers')


def application(feed: Feed, obey: Obey, hosts: Collection[str] = ()) -> web.Application:
    """
    Return the application.

    Parameters
    ----------
    feed
        News for browsers.
    obey
        Carries out a browser's command.
    hosts
        Names besides `localhost` and plain addresses by which the server may be called.

    """
    app = web.Application(middlewares=[_guard])
    app[FEED], app[OBEY], app[HOSTS], app[BROWSERS] = feed, obey, frozenset(hosts), set()
    for file in (files('flat_planner_ros.ros.live_view') / 'page').iterdir():
        kind = KINDS.get(PurePath(file.name).suffix)
        if kind is not None:
            path = '/' if file.name == START_PAGE else f'/{file.name}'
            app.router.add_get(path, _page(file.read_text('utf-8'), kind))
    app.router.add_get('/ws', _converse)
    app.on_shutdown.append(_dismiss)
    return app


class ServerThread:
    """
    Serves an application in a thread of its own.

    Parameters
    ----------
    app
        The application.
    host, port
        Address to listen at; port 0 takes any that is free.

    Raises
    ------
    OSError
        The address cannot be had.

    """

    def __init__(self, app: web.Application, host: str, port: int) -> None:
        family = socket.AF_INET6 if ':' in host else socket.AF_INET
        self._socket = socket.create_server((host, port), family=family)
        self.port: int = self._socket.getsockname()[1]
        self._app = app
        self._loop = asyncio.new_event_loop()
        self._end = asyncio.Event()
        self._thread = Thread(target=self._run, name='live view')
        self._thread.start()

    def close(self) -> None:
        """Say goodbye to all browsers and end."""
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join()

    def _run(self) -> None:
        """Serve until told to end."""
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        finally:
            self._loop.close()

    async def _serve(self) -> None:
        """Serve until told to end."""
        runner = web.AppRunner(self._app, access_log=None, shutdown_timeout=1.0)
        await runner.setup()
        try:
            await web.SockSite(runner, self._socket).start()
            await self._end.wait()
        finally:
            await runner.cleanup()


@web.middleware
async def _guard(
    request: web.Request, handler: Callable[[web.Request], Awaitable[web.StreamResponse]]
) -> web.StreamResponse:
    """Refuse calls under a foreign name (DNS rebinding) and from foreign pages."""
    if not _is_own_name(request.host, request.app[HOSTS]):
        raise web.HTTPForbidden(text='unknown host name; see --allow-host')
    origin = request.headers.get('Origin')
    is_foreign = origin is not None and urlsplit(origin).netloc != request.host
    # Browsers name the origin of every websocket; what names none is no page's doing.
    if is_foreign:
        raise web.HTTPForbidden(text='a foreign page must not call this one')
    return await handler(request)


def _is_own_name(host: str, names: Collection[str]) -> bool:
    """Return whether a Host header can only be meant for this server."""
    name = urlsplit(f'//{host}').hostname or ''
    if name == 'localhost' or name in names:
        return True
    # An address cannot be made to point here by somebody else, a name can.
    with suppress(ValueError):
        return bool(ip_address(name))
    return False


def _page(text: str, kind: str) -> Callable[[web.Request], Awaitable[web.Response]]:
    """Return a handler that shows a file."""

    async def show(_: web.Request) -> web.Response:
        return web.Response(text=text, content_type=kind, charset='utf-8', headers=HEADERS)

    return show


async def _converse(request: web.Request) -> web.WebSocketResponse:
    """Tell a browser the news, and carry out its commands one after the other."""
    browsers = request.app[BROWSERS]
    if len(browsers) >= MAX_BROWSERS:
        raise web.HTTPServiceUnavailable(text=f'{MAX_BROWSERS} browsers are watching already')
    ws = web.WebSocketResponse(max_msg_size=MAX_COMMAND, heartbeat=PATIENCE, timeout=1.0)
    browsers.add(ws)
    try:
        await ws.prepare(request)
        teller = asyncio.create_task(_tell(ws, request.app[FEED]))
        try:
            async for message in ws:
                if message.type is not WSMsgType.TEXT:
                    break
                reply = await _reply(message.data, request.app[OBEY])
                await ws.send_str(json.dumps({'reply': reply}))
        finally:
            teller.cancel()
            with suppress(asyncio.CancelledError, ConnectionError):
                await teller
    except ConnectionError:
        pass
    finally:
        browsers.discard(ws)
    return ws


async def _tell(ws: web.WebSocketResponse, feed: Feed) -> None:
    """Send news, at most so often; a slow browser gets the same news in fewer messages."""
    cursor = Cursor()
    while not ws.closed:
        news = feed.news(cursor)
        if news is not None:
            await ws.send_str(json.dumps(news, allow_nan=False, separators=(',', ':')))
        await asyncio.sleep(1.0 / RATE)


async def _reply(text: str, obey: Obey) -> dict[str, Any]:
    """Return what became of a command."""
    number = None
    try:
        command = json.loads(text)
        number = command.get('id') if isinstance(command, dict) else None
        done, sentence = await obey(command)
    except (ValueError, RecursionError) as error:
        done, sentence = False, f'not understood: {error}'
    return {'id': number if isinstance(number, int) else None, 'ok': done, 'text': sentence}


async def _dismiss(app: web.Application) -> None:
    """Close all connections."""
    browsers = app[BROWSERS]
    for ws in list(browsers):
        await ws.close(code=1001, message=b'the live view has ended')
