"""Look for loops in a second process while tracking goes on: the same loops, sooner.

Tracking asks for no loop before the log has ended, so that it does not matter when one is found.
The search is half Python, which runs one thread at a time: hence a process. It is forked, with all
that is loaded and compiled; other systems than Linux cannot promise that this is safe.
"""

from __future__ import annotations

import io
import pickle
import signal
import sys
import warnings
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

from bsmap_cli.mapping.compact_clusters import CompactClusters
from bsmap_cli.slam.loop_closure import LoopCloser
from bsmap_cli.slam.loop_tasks import LoopTask
from bsmap_cli.slam.slam_settings import SlamSettings

BATCH = 16  # tasks that are handed on at a time
END = b""
HEARD = {getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)}
CAN_FORK = sys.platform == "linux"


class LoopsBeside:
    """A copy of a closer that works elsewhere; should it come to grief, the closer does it all.

    Raises
    ------
    OSError : there is no process to be had.
    """

    def __init__(self, closer: LoopCloser) -> None:
        self._closer = closer
        self._tasks: list[LoopTask] = []
        self._packer = _Packer(closer.settings)
        context = get_context("fork")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(
            target=_work, args=(theirs, self._pipe, closer), daemon=True
        )
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, HEARD)
        try:
            with warnings.catch_warnings():
                # threads that numpy or a progress bar have started hold nothing a search needs
                warnings.simplefilter("ignore", DeprecationWarning)
                self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
            theirs.close()

    def process(self, task: LoopTask) -> None:
        """Hand on the task of one keyframe; waits where the other process is far behind."""
        self._tasks.append(task)
        if len(self._tasks) % BATCH == 0:
            self._send(self._packer.pack(self._tasks[-BATCH:]))

    def finish(self) -> None:
        """Wait for all loops; the closer then knows them."""
        closer, left = self._closer, len(self._tasks) % BATCH
        self._send(self._packer.pack(self._tasks[-left:] if left else []))
        self._send(END)
        try:
            closer.loops, closer.tried = self._pipe.recv()
        except (OSError, EOFError):
            for task in self._tasks:
                closer.process(task)
        self._pipe.close()
        self._process.join()

    def _send(self, message: bytes | memoryview) -> None:
        try:
            self._pipe.send_bytes(message)
        except OSError:  # it has ended, which is seen when its answer is read
            return


def _work(pipe: Connection, of_the_other: Connection, closer: LoopCloser) -> None:
    """Do what comes through the pipe, and tell in the end; without a word where that fails."""
    of_the_other.close()  # or its end would never be seen
    for number in HEARD:  # Ctrl-C is for the other process, which ends this one
        signal.signal(number, signal.SIG_IGN if number == signal.SIGINT else signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, HEARD)
    unpack = _Unpacker(closer.settings).unpack
    try:
        while (message := pipe.recv_bytes()) != END:
            for task in unpack(message):
                closer.process(task)
        pipe.send((closer.loops, closer.tried))
    except Exception:  # the other process comes to the same point, and says what is wrong there
        return


class _Packer:
    """Tasks as bytes. Settings, and clusters that went before, are told by a number."""

    def __init__(self, settings: SlamSettings) -> None:
        self._numbers = {id(settings): 0}

    def pack(self, tasks: list[LoopTask]) -> memoryview:
        """The next tasks; whoever packs them keeps them, so that no identity comes twice."""
        stream = io.BytesIO()
        pickler = _Pickler(stream, pickle.HIGHEST_PROTOCOL)
        pickler.numbers = self._numbers
        pickler.dump(tasks)
        for task in tasks:
            self._numbers[id(task.clusters)] = len(self._numbers)
        return stream.getbuffer()


class _Pickler(pickle.Pickler):
    numbers: dict[int, int]

    def persistent_id(self, part: Any) -> int | None:
        return self.numbers.get(id(part))


class _Unpacker:
    """What a `_Packer` has packed, where its settings are known."""

    def __init__(self, settings: SlamSettings) -> None:
        self._parts: list[SlamSettings | CompactClusters] = [settings]

    def unpack(self, message: bytes) -> list[LoopTask]:
        """The next tasks."""
        unpickler = _Unpickler(io.BytesIO(message))
        unpickler.parts = self._parts
        tasks: list[LoopTask] = unpickler.load()
        self._parts += (task.clusters for task in tasks)
        return tasks


class _Unpickler(pickle.Unpickler):
    parts: list[SlamSettings | CompactClusters]

    def persistent_load(self, number: int) -> SlamSettings | CompactClusters:
        return self.parts[number]
