"""A connection that must get on: time limits for a request's head, its body and its answer, and a limit of connections.

uvicorn has a time limit for a connection between two requests alone. Without these a few thousand sockets that say
nothing, or a request that never ends, keep the page from everybody else.
"""

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

HEAD = 10.0
"""Seconds in which the head of a request must come; a browser sends it at once."""
STALLED = 20.0
"""Seconds after which a body is ended of which less than `LEAST` bytes came, or an answer of which none was taken."""
LEAST = 10_000
"""Bytes of a body in `STALLED` seconds: a hundredth of the slowest line that a browser can be set to."""
LOOK = 1.0
"""Seconds between two looks at a connection."""
MOST = 128
"""Connections at a time; a browser opens six to a server."""


class Connection(H11Protocol):
    """An HTTP/1.1 connection of uvicorn's that is ended when it does not get on."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self._since = self.loop.time()
        self._came = 0
        self._look: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin; where there are too many connections, the one that has waited longest without a request is ended."""
        super().connection_made(transport)
        self._look = self.loop.call_later(LOOK, self._looked)
        if len(self.connections) > MOST:
            others = [one for one in self.connections if isinstance(one, Connection) and one.is_idle]
            min(others, key=lambda one: one._since).transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        if self._look is not None:
            self._look.cancel()
        super().connection_lost(exc)

    @property
    def is_idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def data_received(self, data: bytes) -> None:
        """Take bytes."""
        was_idle = self.is_idle
        self._came += len(data)
        super().data_received(data)
        if was_idle != self.is_idle:
            self._start()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        self._start()
        super().on_response_complete()

    def resume_writing(self) -> None:
        """Go on with an answer: some of it was taken."""
        self._start()
        super().resume_writing()

    def _start(self) -> None:
        """Count anew what a time limit counts."""
        self._since, self._came = self.loop.time(), 0

    def _looked(self) -> None:
        """End the connection if it is over a time limit."""
        waited = self.loop.time() - self._since
        is_late = waited > STALLED
        if self.cycle is not None and self.cycle.more_body and not self.flow.read_paused:
            is_over = is_late and self._came < LEAST
        elif self.flow.write_paused:
            is_over = is_late
        elif self.is_idle:
            is_over = waited > HEAD
        else:  # what takes long now is ours
            is_over, is_late = False, True
        if is_over:
            self.transport.abort()
            return
        if is_late:
            self._start()
        self._look = self.loop.call_later(LOOK, self._looked)
