"""A forwarder from a port of this machine to another one, for tests of what stands behind a tunnel or a proxy."""
import asyncio
import contextlib
import threading


class Tunnel:
    """Forwards a free port, as `ssh -L` does; with a TLS context it is an encrypting proxy."""

    def __init__(self, target, tls=None):
        self._target, self._tls, self._writers = target, tls, set()
        self._loop = asyncio.new_event_loop()
        threading.Thread(target=self._loop.run_forever, daemon=True).start()
        self.port = asyncio.run_coroutine_threadsafe(self._listen(), self._loop).result()

    async def _listen(self):
        self._server = await asyncio.start_server(self._forward, '127.0.0.1', 0, ssl=self._tls)
        return self._server.sockets[0].getsockname()[1]

    async def _forward(self, reader, writer):
        far_reader, far_writer = await asyncio.open_connection('127.0.0.1', self._target)
        self._writers |= {writer, far_writer}
        await asyncio.gather(self._copy(reader, far_writer), self._copy(far_reader, writer))

    @staticmethod
    async def _copy(reader, writer):
        with contextlib.suppress(OSError):
            while data := await reader.read(65536):
                writer.write(data)
        writer.close()

    def close(self):
        """Break all connections."""
        def end():
            self._server.close()
            for writer in self._writers:
                writer.transport.abort()
        self._loop.call_soon_threadsafe(end)
