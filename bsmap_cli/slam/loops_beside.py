"""Look for loops in a second process while tracking goes on: the same loops, sooner.

Tracking asks for no loop before the log has ended, so that it does not matter when one is found.
"""

from __future__ import annotations

import io
import pickle
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.beside import Beside
from bsmap_cli.mapping.compact_clusters import CompactClusters
from bsmap_cli.slam.loop_closure import LoopCloser
from bsmap_cli.slam.loop_tasks import LoopTask
from bsmap_cli.slam.slam_settings import SlamSettings

BATCH = 16  # tasks that are handed on at a time
END = b""


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
        self._other = Beside(_work, closer)

    def process(self, task: LoopTask) -> None:
        """Hand on the task of one keyframe; waits where the other process is far behind."""
        self._tasks.append(task)
        if len(self._tasks) % BATCH == 0:
            self._other.send(self._packer.pack(self._tasks[-BATCH:]))

    def finish(self) -> None:
        """Wait for all loops; the closer then knows them."""
        closer, left = self._closer, len(self._tasks) % BATCH
        self._other.send(self._packer.pack(self._tasks[-left:] if left else []))
        self._other.send(END)
        try:
            closer.loops, closer.tried = self._other.pipe.recv()
        except (OSError, EOFError):
            for task in self._tasks:
                closer.process(task)
        self._other.end()


def _work(pipe: Connection, closer: LoopCloser) -> None:
    """Do what comes through the pipe, and tell in the end."""
    unpack = _Unpacker(closer.settings).unpack
    while (message := pipe.recv_bytes()) != END:
        for task in unpack(message):
            closer.process(task)
    pipe.send((closer.loops, closer.tried))


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

    def reducer_override(self, part: Any) -> Any:
        """An array as its bytes: numpy's own way takes three times as long."""
        if type(part) is np.ndarray:
            return _array, (part.tobytes(), part.dtype.char, part.shape)
        return NotImplemented


def _array(data: bytes, kind: str, shape: tuple[int, ...]) -> NDArray[Any]:
    """Kernels are compiled for arrays that can be written."""
    return np.frombuffer(bytearray(data), kind).reshape(shape)


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
