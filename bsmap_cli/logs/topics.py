"""Which topics are read: one candidate is taken, of several the user chooses."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from shlex import quote

from bsmap_cli.errors import LogError, UsageError
from bsmap_cli.logs.decoding import Kind

_LISTED = 12


def choose_scan_topics(
    name: str,
    kinds: Mapping[str, Kind | None],
    types: Mapping[str, str],
    asked: tuple[str, ...],
) -> tuple[str, ...]:
    """The scan topics to read, in the order asked for.

    name : of the log. kinds, types : of its topics that hold messages.
    Clouds are candidates only where no planar scan is. Raises UsageError with ready `--topic`
    lines where the choice is the user's, LogError where there is nothing to choose from.
    """
    scans = _of_kind(kinds, Kind.SCAN)
    candidates = scans or _of_kind(kinds, Kind.CLOUD)
    usable = scans + _of_kind(kinds, Kind.CLOUD)
    if asked:
        return tuple(dict.fromkeys(_named(name, topic, kinds, types, usable) for topic in asked))
    if not candidates:
        raise LogError(f"{name} has no scan topic{_listing(types)}")
    if len(candidates) > 1:
        raise UsageError(
            f"{name} has {len(candidates)} scan topics: choose one, or several of one robot, with\n"
            + _topic_lines(candidates)
        )
    return candidates


def choose_odometry_topic(
    name: str, kinds: Mapping[str, Kind | None], asked: str
) -> tuple[str | None, tuple[str, ...]]:
    """The odometry topic to read, or None, and the candidates for "auto".

    asked : "auto" or a topic; UsageError for a topic that holds no odometry.
    """
    candidates = _of_kind(kinds, Kind.ODOMETRY)
    if asked == "auto":
        return (candidates[0] if len(candidates) == 1 else None), candidates
    for topic in (asked, "/" + asked):
        if topic in candidates:
            return topic, candidates
    if candidates:
        lines = _flags("--odom", candidates)
        raise UsageError(f"{name} has no odometry topic {asked}: choose one with\n{lines}")
    raise UsageError(f"{name} has no odometry topic {asked}, nor any other: leave out --odom")


def _of_kind(kinds: Mapping[str, Kind | None], kind: Kind) -> tuple[str, ...]:
    return tuple(sorted(topic for topic, its in kinds.items() if its is kind))


def _named(
    name: str,
    asked: str,
    kinds: Mapping[str, Kind | None],
    types: Mapping[str, str],
    usable: tuple[str, ...],
) -> str:
    for topic in (asked, "/" + asked):
        if topic in usable:
            return topic
        if topic in types:
            raise UsageError(f"{topic} of {name} is {types[topic] or 'untyped'}, not a scan topic")
    close = get_close_matches(asked, usable, n=1)
    if close:
        raise UsageError(f"{name} has no topic {asked}: did you mean --topic {quote(close[0])}")
    if usable:
        raise UsageError(f"{name} has no topic {asked}: choose from\n" + _topic_lines(usable))
    raise LogError(f"{name} has no topic {asked}, nor any scan topic{_listing(types)}")


def _topic_lines(topics: tuple[str, ...]) -> str:
    return _flags("--topic", topics)


def _flags(flag: str, topics: tuple[str, ...]) -> str:
    """Lines ready for a shell; of very many the first few, and how to see the rest."""
    lines = [f"  {flag} {quote(topic)}" for topic in topics[:_LISTED]]
    if len(topics) > _LISTED:
        lines.append(f"  or one of {len(topics) - _LISTED} more: `bsmap info` lists them")
    return "\n".join(lines)


def _listing(types: Mapping[str, str]) -> str:
    if not types:
        return ": it holds no messages"
    listed = [f"{topic} ({kind})" for topic, kind in sorted(types.items())]
    more = f" and {len(listed) - _LISTED} more" if len(listed) > _LISTED else ""
    return ": it holds " + ", ".join(listed[:_LISTED]) + more
