"""How a function becomes a command: flag groups are spread out, errors end at the door."""

from __future__ import annotations

import inspect
import logging
import warnings
from collections.abc import Callable
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import partial
from typing import Any, get_type_hints

from bsmap_cli.cli.compiled_code import keep_compiled_code
from bsmap_cli.cli.door import guarded
from bsmap_cli.cli.talk import Talk

Command = Callable[..., Any]


def command(function: Command) -> Command:
    """Wrap a command for the parser.

    A parameter whose type is a dataclass of flags is replaced by one option for each field, and
    handed over filled. A group with a `talk` method says how loud the command is.
    """
    signature = inspect.signature(function, eval_str=True)
    parameters: list[inspect.Parameter] = []
    for parameter in signature.parameters.values():
        if is_dataclass(parameter.annotation):
            parameters += _spread(parameter.annotation)
        else:
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))

    def run(**values: Any) -> int:
        filled = {
            name: _filled(parameter.annotation, values)
            if is_dataclass(parameter.annotation)
            else values[name]
            for name, parameter in signature.parameters.items()
        }
        talk = next((group.talk() for group in filled.values() if hasattr(group, "talk")), Talk())
        _route_logging(talk)
        keep_compiled_code(talk)
        return guarded(partial(function, **filled), talk)

    run.__doc__ = function.__doc__
    run.__name__ = function.__name__
    run.__module__ = function.__module__
    run.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


def _spread(group: Any) -> list[inspect.Parameter]:
    hints = get_type_hints(group, include_extras=True)
    return [
        inspect.Parameter(
            entry.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=_default(entry),
            annotation=hints[entry.name],
        )
        for entry in fields(group)
    ]


def _default(entry: Field[Any]) -> Any:
    return inspect.Parameter.empty if entry.default is MISSING else entry.default


def _filled(group: Any, values: dict[str, Any]) -> Any:
    return group(**{entry.name: values[entry.name] for entry in fields(group)})


def _route_logging(talk: Talk) -> None:
    """What the library logs is said as warnings and details; other libraries only with -vv."""
    warnings.simplefilter("default" if talk.level >= 2 else "ignore")
    logging.getLogger().handlers[:] = [_Router(talk)]
    logging.getLogger("bsmap_cli").setLevel(logging.DEBUG if talk.level >= 2 else logging.INFO)


class _Router(logging.Handler):
    def __init__(self, talk: Talk) -> None:
        super().__init__()
        self.talk = talk

    def emit(self, record: logging.LogRecord) -> None:
        ours = record.name.split(".")[0] == "bsmap_cli"
        if ours and record.levelno >= logging.WARNING:
            self.talk.warn(record.getMessage())
        elif ours or self.talk.level >= 2:
            self.talk.detail(f"{record.name}: {record.getMessage()}")
