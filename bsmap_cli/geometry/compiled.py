"""How hot loops are compiled: once for this machine, kept on disk, by the rules of numpy.

A division by zero gives inf or nan, as in numpy, so that no division carries a branch that could
raise; products may be fused with sums.

Each time compiled code takes an array out of a map level, numba counts one more reference to it,
by an atomic addition that costs as much as a foot point. What runs point by point is therefore
compiled without counting (`inlined`, `lean`, `lean_part`) and must not allocate.

What only compiled code calls (`inlined`, `part`, `lean_part`) is compiled without the code by
which Python would call it: for a map level that code is longer than most loops. Called from
Python, such a function runs as it is written, slowly. It is not kept on disk by itself: what calls
it holds it. What is kept on disk is therefore good for one state of all sources (`_sources`):
numba by itself asks after the file of the kernel alone, and would run old parts after an upgrade.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit, types
from numba.core.typing.templates import infer_global

from bsmap_cli.geometry.quick_compiler import quick_compilers

Function = TypeVar("Function", bound=Callable[..., object])


# `_nrt=False` leaves numba's reference counting out: known to its compiler, not to its stubs
_RULES = {
    "cache": True,
    "error_model": "numpy",
    "fastmath": {"contract"},
    "no_cfunc_wrapper": True,
}

ROOMS = ("geometry", "sensor", "mapping", "slam")
"""Where kernels are, and the records and constants that are compiled into them."""

_OF_KERNELS, _OF_PARTS = quick_compilers()

PARTS: list[Any] = []
"""What numba made of the parts: it holds them by weak references only."""


def kernel(function: Function) -> Function:
    """Compile a function on plain arrays and numbers, when it is first called."""
    return _compile(function)


def lean(function: Function) -> Function:
    """The same for a loop that allocates nothing: no references are counted in it."""
    return _compile(function, _nrt=False)


def part(function: Function) -> Function:
    """Compile a function that only compiled code calls."""
    return _compile_part(function)


def lean_part(function: Function) -> Function:
    """The same for a loop that allocates nothing."""
    return _compile_part(function, _nrt=False)


def inlined(function: Function) -> Function:
    """The same for what is done for one point, compiled into the loop that calls it."""
    return _compile_part(function, _nrt=False, forceinline=True)


def _compile(function: Function, **options: Any) -> Function:
    rules: dict[str, Any] = {**_RULES, "pipeline_class": _OF_KERNELS, **options}
    compiled = njit(**rules)(function)
    if rules["cache"]:
        with suppress(AttributeError):  # a numba that keeps its files otherwise
            file = compiled._cache._cache_file
            file._source_stamp = file._source_stamp, _sources()
    return cast(Function, compiled)


@cache
def _sources() -> str:
    """A digest of all that kernels are made of."""
    package = Path(__file__).parent.parent
    digest = hashlib.sha256()
    for room in ROOMS:
        for path in sorted((package / room).rglob("*.py")):
            digest.update(path.relative_to(package).as_posix().encode() + b"\0")
            digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()


def _compile_part(function: Function, **options: bool) -> Function:
    compiled = _compile(
        function, no_cpython_wrapper=True, cache=False, pipeline_class=_OF_PARTS, **options
    )
    PARTS.append(_for_any_number(compiled))
    infer_global(function, types.Dispatcher(compiled))  # type: ignore[no-untyped-call]
    return function


def _for_any_number(compiled: Any) -> Any:
    """Called with a literal, it is what it is for other numbers, and no variant of its own."""
    resolve = compiled.get_call_template

    unliteral: Any = types.unliteral

    def resolve_numbers(args: Any, kws: Any) -> Any:
        named = {name: unliteral(value) for name, value in kws.items()}
        return resolve(tuple(unliteral(value) for value in args), named)

    compiled.get_call_template = resolve_numbers
    return compiled
