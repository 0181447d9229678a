"""The sqlite3 files of ROS 2 bags (`.db3`), also alone, also cut."""

from __future__ import annotations

import errno
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from urllib.parse import quote

from bsmap_cli.errors import LogError
from bsmap_cli.logs.byte_streams import DamagedBytesError
from bsmap_cli.logs.messages import Channel, ContainerIndex, RawMessage, normal_type
from bsmap_cli.logs.reader import ReadReport
from bsmap_cli.logs.sources import Source

MAGIC = b"SQLite format 3\0"
_COUNTS = (
    "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages GROUP BY topic_id"
)


class SqliteContainer:
    """One sqlite3 file of a ROS 2 bag; a stream is copied to a temporary file first."""

    format = "ROS 2 bag (sqlite3)"

    def __init__(self, source: Source) -> None:
        self.name = source.name
        self._source = source
        self._is_cut = False

    def index(self) -> ContainerIndex | None:
        """Counted by the database; None for a stream or a damaged file."""
        path = self._source.plain_path
        if path is None or _is_cut_file(path):
            return None
        try:
            with self._connect() as database:
                channels = _channels(database)
                rows = list(database.execute(_COUNTS))
        except (sqlite3.Error, DamagedBytesError, OSError):
            return None  # damage is told when the messages are read
        if not all(isinstance(number, int) for row in rows for number in row):
            return None
        counts = {topic: count for topic, count, _, _ in rows}
        return ContainerIndex(
            counts={channel: counts.get(topic, 0) for topic, channel in channels.items()},
            start_ns=min((start for _, _, start, _ in rows), default=0),
            end_ns=max((end for _, _, _, end in rows), default=0),
        )

    def messages(
        self, wants: Callable[[Channel], bool], report: ReadReport
    ) -> Iterator[RawMessage]:
        """See `Container`; the order is that of writing, not that of the stamps."""
        try:
            with self._connect() as database:
                channels = _channels(database)
                wanted = {key: channel for key, channel in channels.items() if wants(channel)}
                marks = ",".join("?" * len(wanted))
                rows = database.execute(
                    "SELECT topic_id, timestamp, data FROM messages"
                    f" WHERE topic_id IN ({marks}) ORDER BY rowid",
                    tuple(wanted),
                )
                for topic, log_time_ns, data in rows:
                    if isinstance(data, bytes) and isinstance(log_time_ns, int):
                        yield wanted[topic], log_time_ns, data
                if self._is_cut:
                    raise DamagedBytesError("the file is cut off")
        except (sqlite3.Error, DamagedBytesError, OSError) as error:
            report.lose(f"{self.name}: {error}; what comes before is used")

    @contextmanager
    def _connect(self) -> Iterator[sqlite3.Connection]:
        with ExitStack() as stack:
            path = self._source.plain_path
            if path is None or _is_cut_file(path):
                path = stack.enter_context(self._copied())
            yield stack.enter_context(closing(_open_database(path)))

    @contextmanager
    def _copied(self) -> Iterator[Path]:
        """A temporary copy, unpacked; of a cut file the whole pages, as a torn one reads as 0."""
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "log.db3"
            with self._source.open() as stream, copy.open("wb") as file:
                try:
                    shutil.copyfileobj(stream, file, 1 << 20)
                except DamagedBytesError:
                    self._is_cut = True
                except OSError as error:
                    if error.errno not in (errno.ENOSPC, errno.EDQUOT):
                        raise
                    raise LogError(
                        f"no room for a copy of {self.name} in {folder}: set TMPDIR to a folder"
                        " that has"
                    ) from error
            if _is_cut_file(copy):
                self._is_cut = True
                with copy.open("r+b") as file:
                    file.truncate(copy.stat().st_size // _page_bytes(copy) * _page_bytes(copy))
            yield copy


def _page_bytes(path: Path) -> int:
    with path.open("rb") as file:
        size = int.from_bytes(file.read(18)[16:], "big")
    return 65536 if size == 1 else max(size, 1)


def _is_cut_file(path: Path) -> bool:
    """Whether a file has fewer pages than its header says."""
    with path.open("rb") as file:
        pages = int.from_bytes(file.read(32)[28:], "big")
    return path.stat().st_size < pages * _page_bytes(path)


def _open_database(path: Path) -> sqlite3.Connection:
    """Read only; a journal that a crashed recorder left behind is read along."""
    journal = path.with_name(path.name + "-wal")
    mode = "mode=ro" if journal.exists() and journal.stat().st_size else "immutable=1"
    database = sqlite3.connect(f"file:{quote(str(path.absolute()))}?{mode}", uri=True)
    database.execute("PRAGMA writable_schema = ON")  # else sqlite refuses a cut file outright
    return database


def _channels(database: sqlite3.Connection) -> dict[int, Channel]:
    try:
        rows = database.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        )
        definitions = {str(name): (str(kind), str(text)) for name, kind, text in rows}
    except sqlite3.Error:
        definitions = {}  # bags older than Iron carry none
    channels = {}
    topics = database.execute("SELECT id, name, type, serialization_format FROM topics")
    for key, topic, type_name, encoding in topics:
        kind, text = definitions.get(str(type_name), ("", ""))
        channels[key] = Channel(
            topic=str(topic),
            type=normal_type(str(type_name)),
            encoding=str(encoding),
            schema_encoding=kind,
            schema=text.encode("utf-8", "replace"),
        )
    return channels
