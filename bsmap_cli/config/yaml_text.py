"""Settings as a user writes them: YAML lines and `key=value`, with the place of each kept."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from bsmap_cli.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Given:
    """One value as the user wrote it: a YAML node, and where it stands, for messages."""

    key: str
    node: Any
    place: str


def read_override(override: str) -> Given:
    """`key=value`, the value in YAML."""
    key, equals, text = override.partition("=")
    place = f"--set {' '.join(override.split())}"
    if not equals or not key.strip():
        raise ConfigError(f"{place}: write key=value, such as segmentation.rel_gap=3")
    node = _compose(text, place, numbered=False)
    if node is None:
        raise ConfigError(f"{place}: no value behind the equals sign")
    return Given(key.strip(), node, place)


def read_yaml(text: str, place: str, sections: frozenset[str]) -> Iterator[Given]:
    """Every value of a settings file, in its order, with its dotted key and its line."""
    node = _compose(text, place, numbered=True)
    if node is not None:
        yield from _flattened(node, place, sections, prefix="", seen=set())


def flat(error: Exception) -> str:
    """The message of an error on one line."""
    return " ".join(str(error).split())


def _flattened(
    node: Any, place: str, sections: frozenset[str], *, prefix: str, seen: set[str]
) -> Iterator[Given]:
    import yaml

    if isinstance(node, yaml.ScalarNode) and node.value in {"", "~", "null"}:
        return  # a section with nothing in it
    if not isinstance(node, yaml.MappingNode):
        what = prefix.rstrip(".") or "the file"
        raise ConfigError(f"{_line(place, node)}: {what} must hold `name: value` lines")
    for name, value in node.value:
        key, where = f"{prefix}{name.value}", _line(place, name)
        if key in seen:
            raise ConfigError(f"{where}: {key} is given twice")
        seen.add(key)
        if key in sections or (isinstance(value, yaml.MappingNode) and value.value):
            yield from _flattened(value, place, sections, prefix=f"{key}.", seen=seen)
        else:
            yield Given(key, value, where)


def _compose(text: str, place: str, *, numbered: bool) -> Any:
    import yaml

    try:
        return yaml.compose(text, Loader=yaml.SafeLoader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f"{place}:{mark.line + 1}" if numbered and mark else place
        problem = getattr(error, "problem", None) or flat(error)
        raise ConfigError(f"{where}: not YAML: {problem}") from error


def _line(place: str, node: Any) -> str:
    return f"{place}:{node.start_mark.line + 1}"
