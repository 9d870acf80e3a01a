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
What becomes of an exception in a callback: decided once for all nodes.

The executor would end the process, and with it all nodes in it. Instead, only what the callback
was at work on is lost: a message, a tick, a request, whose client is told so. If the callback is
one of ours, nothing that the node believes of its arm can be trusted: the effort goes to zero
until the next command. If it is one of rclpy's, somebody has sent what rclpy cannot read, and a
motion that is under way does not suffer from it.
"""

from collections.abc import Callable
from functools import wraps
from pathlib import Path
import traceback
from typing import Any

from flat_planner_ros.ros.nodes.all_or_nothing import AllOrNothing
from flat_planner_ros.ros.nodes.node_log import NodeLog
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node

LIBRARY = 'rclpy.'
"""Begin of the names of the modules whose callbacks are not ours."""


class GuardedNode(Node, metaclass=AllOrNothing):
    """A node that no message, no request and no error in a callback ends, nor a full console."""

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, **options)
        self._log = NodeLog(self)

    def rest(self) -> None:
        """Bring the effort that this node gives to zero, after an error of its own."""

    def create_subscription(  # type: ignore[override]
        self, kind: Any, topic: str, callback: Callable[..., Any], *args: Any, **options: Any
    ) -> Any:
        """Subscribe as rclpy does; a message that cannot be taken is lost."""
        guarded = self.guarded(callback, f'a message on {topic}')
        return super().create_subscription(kind, topic, guarded, *args, **options)

    def create_timer(  # type: ignore[override]
        self, period: float, callback: Callable[..., Any], *args: Any, **options: Any
    ) -> Any:
        """Make a timer as rclpy does; a tick that fails is lost."""
        guarded = self.guarded(callback, 'a tick')
        return super().create_timer(period, guarded, *args, **options)

    def create_service(  # type: ignore[override]
        self, kind: Any, name: str, callback: Callable[..., Any], *args: Any, **options: Any
    ) -> Any:
        """Offer a service as rclpy does; a request that cannot be served fails."""
        guarded = self.guarded(callback, f'a request to {name}', is_request=True)
        if kind is SetParameters:
            guarded = _one_by_one(guarded)
        return super().create_service(kind, name, guarded, *args, **options)

    def guarded(
        self, callback: Callable[..., Any], what: str, *, is_request: bool = False
    ) -> Callable[..., Any]:
        """Return a callback that raises nothing."""
        # With its signature: a subscription may ask for more than the message.
        copying = wraps(callback)

        @copying
        def call(*args: Any) -> Any:
            try:
                return callback(*args)
            except Exception as error:  # noqa: BLE001  The one place where a node lives on.
                # Where another thread has shut the context down there is nobody to be told.
                if self.context.ok():
                    self._lose(what, error, is_ours=not _is_of_library(callback))
                return _refused(args[-1], error) if is_request else None

        return call

    def _lose(self, what: str, error: Exception, is_ours: bool) -> None:
        """Say what is lost, and let the arm come to rest if the error is ours."""
        text = f'{what} is lost: {error!r}'
        if not is_ours:
            self._log.warning(text)
            return
        place = traceback.extract_tb(error.__traceback__)[-1]
        self._log.error(f'internal error, {text} ({Path(place.filename).name}:{place.lineno})')
        self.get_logger().debug(''.join(traceback.format_exception(error)))
        try:
            self.rest()
        except Exception as failure:  # noqa: BLE001  As above.
            self._log.error(f'internal error, the effort may not be zero: {failure!r}')


def _is_of_library(callback: Callable[..., Any]) -> bool:
    """Tell whether a callback is one that rclpy brings along."""
    return str(getattr(callback, '__module__', '')).startswith(LIBRARY)


def _one_by_one(callback: Callable[..., Any]) -> Callable[..., Any]:
    """Set each parameter of a request by itself: one that cannot be read fails alone."""

    def call(request: SetParameters.Request, response: SetParameters.Response) -> Any:
        for parameter in request.parameters:
            single = SetParameters.Request(parameters=[parameter])
            response.results += callback(single, SetParameters.Response()).results
        return response

    return call


def _refused(response: Any, error: Exception) -> Any:
    """Return a response that says no, as far as its type can."""
    reason = f'not served: {error!r}'
    if hasattr(response, 'success'):
        response.success = False
        response.message = reason
    elif isinstance(response, SetParameters.Response):
        response.results = [SetParametersResult(reason=reason)]
    elif hasattr(getattr(response, 'result', None), 'successful'):
        response.result = SetParametersResult(reason=reason)
    return response
