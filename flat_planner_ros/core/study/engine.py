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
Engine: work on numbered rows, cut into chunks that any `concurrent.futures.Executor` takes.

Chunks are the same whoever does them, so that results are too. They come back in order, however
they are finished; few are under way or wait at a time, so that memory does not grow with the rows.
"""

from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from typing import NamedTuple, TypeVar

from flat_planner_ros.core.arm import FlatPlannerError

Result = TypeVar('Result')

WAITING = 3
"""Chunks that are under way or wait for their turn, for each worker."""

BREAKS = 5
"""Executors that may break, one after the other, without a chunk that is done."""


class EngineBroken(FlatPlannerError):
    """Workers die again and again on the same chunk."""


class Chunk(NamedTuple):
    """Rows from one to before another."""

    first: int
    stop: int


def chunks_of(first: int, stop: int, size: int) -> Iterator[Chunk]:
    """Return chunks of rows; all but the last one end at multiples of a size."""
    while first < stop:
        end = min(stop, first - first % size + size)
        yield Chunk(first, end)
        first = end


def here(
    work: Callable[[int, int], Result], chunks: Iterator[Chunk]
) -> Generator[tuple[Chunk, Result], None, None]:
    """Return what comes of chunks that this process does itself, one after the other."""
    for chunk in chunks:
        yield chunk, work(*chunk)


def on_executor(
    work: Callable[[int, int], Result],
    chunks: Iterator[Chunk],
    executor: Callable[[], Executor],
    workers: int,
) -> Generator[tuple[Chunk, Result], None, None]:
    """
    Return what comes of chunks that others do, in the order of the chunks.

    Parameters
    ----------
    work
        Called with the first row and the one after the last; what it and its results are made of
        must survive pickling.
    chunks
        What is to be done.
    executor
        Makes an executor, and another one in the place of one that broke because a worker was
        killed.
    workers
        How many it has: some chunks for each are under way at a time.

    Raises
    ------
    EngineBroken
        Executors break without getting on.

    """
    pending: deque[tuple[Chunk, Future[Result]]] = deque()
    pool, breaks = executor(), 0
    try:
        while True:
            while len(pending) < WAITING * workers and (chunk := next(chunks, None)) is not None:
                pending.append((chunk, _submitted(pool, work, chunk)))
            if not pending:
                return
            chunk, future = pending[0]
            try:
                result = future.result()
            except BrokenExecutor as error:
                breaks += 1
                if breaks > BREAKS:
                    raise EngineBroken(
                        f'{breaks} times a worker died before the rows {chunk.first} to '
                        f'{chunk.stop - 1} were done: is there enough memory?'
                    ) from error
                pool.shutdown(wait=False)
                pool = executor()
                pending = deque((old, _again(pool, work, old, done)) for old, done in pending)
                continue
            breaks = 0
            pending.popleft()
            yield chunk, result
    finally:
        for _, future in pending:
            future.cancel()
        pool.shutdown(wait=True)


def _submitted(
    pool: Executor, work: Callable[[int, int], Result], chunk: Chunk
) -> 'Future[Result]':
    """Return the future of a chunk; one that failed where the executor has just broken."""
    try:
        return pool.submit(work, *chunk)
    except BrokenExecutor as error:
        failed: Future[Result] = Future()
        failed.set_exception(error)
        return failed


def _again(
    pool: Executor, work: Callable[[int, int], Result], chunk: Chunk, future: 'Future[Result]'
) -> 'Future[Result]':
    """Return a chunk's future, submitted anew unless it was done before the executor broke."""
    is_done = future.done() and not future.cancelled() and future.exception() is None
    return future if is_done else _submitted(pool, work, chunk)
