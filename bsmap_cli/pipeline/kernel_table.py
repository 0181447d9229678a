"""Which kernels Python calls, and the types of what it hands them: known before there are data.

numba compiles a kernel when it is first called. With its types written down it can be compiled
before, and several at a time. `kernel_table.json` is made by running every branch of the method
once; the kernels that take longest to compile come first.
"""

from __future__ import annotations

import json
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

PACKAGE = "bsmap_cli"
TABLE = Path(__file__).with_name("kernel_table.json")


class KernelEntry(NamedTuple):
    """in_slam : `slam` with default settings needs it. types : of its arguments, see `described`.

    A string is an array (`float64:2` has two dimensions) or a number, a list is a tuple, an object
    with one key a named tuple of that class.
    """

    in_slam: bool
    types: list[Any]


@lru_cache(maxsize=1)
def kernel_table() -> dict[str, KernelEntry]:
    """The entries by module and name, without that of the package."""
    entries = json.loads(TABLE.read_text(encoding="utf-8"))
    return {name: KernelEntry(**entry) for name, entry in entries.items()}


def named(name: str) -> Any:
    """A kernel, or the class of a named tuple, by module and name."""
    module, _, attribute = name.rpartition(".")
    return getattr(import_module(f"{PACKAGE}.{module}"), attribute)


def name_of(thing: Any) -> str:
    """Module and name, without that of the package."""
    return f"{thing.__module__}.{thing.__qualname__}".removeprefix(f"{PACKAGE}.")


def described(numba_type: Any) -> Any:
    """A type of numba, as the table has it."""
    types = _types_of_numba()
    if isinstance(numba_type, types.Array):
        access = "" if numba_type.mutable else ":readonly"
        return f"{numba_type.dtype}:{numba_type.ndim}{access}"
    if isinstance(numba_type, types.BaseTuple):
        parts = [described(part) for part in numba_type.types]
        made = getattr(numba_type, "instance_class", None)
        return {name_of(made): parts} if made else parts
    return str(numba_type)


def numba_type(description: Any) -> Any:
    """The type that an entry of the table describes."""
    types = _types_of_numba()
    if isinstance(description, dict):
        ((name, parts),) = description.items()
        found = [numba_type(part) for part in parts]
        if len(set(found)) == 1:
            return types.NamedUniTuple(found[0], len(found), named(name))
        return types.NamedTuple(found, named(name))
    if isinstance(description, list):
        return types.BaseTuple.from_types([numba_type(part) for part in description])
    scalar, *array = description.split(":")
    number = types.boolean if scalar == "bool" else getattr(types, scalar)
    if not array:
        return number
    return types.Array(number, int(array[0]), "C", readonly="readonly" in array)


def _types_of_numba() -> Any:
    """Imported late, and by name, as the types that numba gives to itself are incomplete."""
    return import_module("numba.core.types")
