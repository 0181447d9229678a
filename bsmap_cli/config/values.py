"""One setting's value: from what the user wrote to the setting's own type, within its range."""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import NoneType
from typing import Any, get_args

from bsmap_cli.config.gathered import Leaf
from bsmap_cli.config.yaml_text import Given, flat
from bsmap_cli.errors import ConfigError

NOUNS = {int: "a whole number", float: "a number", bool: "true or false", str: "a word"}


def checked_value(leaf: Leaf, item: Given) -> Any:
    """The value for `leaf`.

    Raises
    ------
    ConfigError : it is of another type, not finite, out of range or not one of the choices.
    """
    value = _coerced(leaf, item)
    for number in _numbers(value):
        if not math.isfinite(number):
            raise _refusal(leaf, item, f"must be finite, not {number}")
        if leaf.minimum is not None and number < leaf.minimum:
            raise _refusal(leaf, item, f"must be at least {leaf.minimum:g}, not {number:g}")
        if leaf.maximum is not None and number > leaf.maximum:
            raise _refusal(leaf, item, f"must be at most {leaf.maximum:g}, not {number:g}")
    if leaf.choices and value not in leaf.choices:
        raise _refusal(leaf, item, f"must be one of {', '.join(leaf.choices)}; not {value!r}")
    return value


def _coerced(leaf: Leaf, item: Given) -> Any:
    """The value in the setting's own type; `1e-3`, which YAML takes for a word, is a number."""
    import yaml
    from pydantic import TypeAdapter, ValidationError

    if leaf.type is str and isinstance(item.node, yaml.ScalarNode):
        return item.node.value  # `off` and `no` are words here, not false
    try:
        value = yaml.SafeLoader("").construct_object(item.node, deep=True)
    except (yaml.YAMLError, ValueError) as error:
        raise ConfigError(f"{item.place}: {leaf.key}: {flat(error)}") from error
    if value is None and not _optional(leaf):
        raise _refusal(leaf, item, f"has no value; it takes {_noun(leaf)}")
    try:
        if isinstance(value, bool) and leaf.type is not bool:
            raise ValueError(value)
        return TypeAdapter(leaf.type).validate_python(value)
    except (ValidationError, ValueError) as error:
        written = item.node.value if isinstance(item.node, yaml.ScalarNode) else value
        raise _refusal(leaf, item, f"takes {_noun(leaf)}, not {written!r}") from error


def _refusal(leaf: Leaf, item: Given, why: str) -> ConfigError:
    return ConfigError(f"{item.place}: {leaf.key} {why}")


def _optional(leaf: Leaf) -> bool:
    return NoneType in get_args(leaf.type)


def _noun(leaf: Leaf) -> str:
    kinds = get_args(leaf.type) if _optional(leaf) else (leaf.type,)
    if kinds[0] in NOUNS:
        return NOUNS[kinds[0]] + (" or null" if _optional(leaf) else "")
    if leaf.type == tuple[float, ...]:
        return "a list of numbers such as [0.4, 0.2, 0.1]"
    return "a list of pairs such as [[170, 190]]"


def _numbers(value: Any) -> Iterator[float]:
    if isinstance(value, tuple):
        for part in value:
            yield from _numbers(part)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield value
