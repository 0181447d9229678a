"""Settings as text a person can edit, and as plain values."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

from bsmap_cli.config.gathered import Leaf, Settings, leaves


def settings_as_dict(settings: Any) -> dict[str, Any]:
    """Nested plain values (JSON) of `Settings` or a part of them, keys sorted."""
    names = sorted(entry.name for entry in fields(settings))
    return {name: _plain(getattr(settings, name)) for name in names}


def dump_settings(settings: Settings) -> str:
    """All settings as commented YAML that `load_settings` reads back unchanged."""
    lines: list[str] = []
    section = ""
    for leaf in leaves().values():
        parent, _, name = leaf.key.rpartition(".")
        owner = getattr(settings, parent) if parent else settings
        if parent != section:
            section = parent
            lines += ["", f"# {_summary(owner)}", f"{section}:"]
        indent = "  " if parent else ""
        lines += [f"{indent}# {_explain(leaf)}", f"{indent}{name}: {_yaml(getattr(owner, name))}"]
    return "\n".join(lines) + "\n"


def _yaml(value: Any) -> str:
    import yaml

    text = yaml.safe_dump(_plain(value), default_flow_style=True, width=1000)
    return text.removesuffix("...\n").strip()


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return settings_as_dict(value)
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    return value


def _summary(section: Any) -> str:
    return (section.__doc__ or "").strip().splitlines()[0].rstrip(".")


def _explain(leaf: Leaf) -> str:
    extras = []
    if leaf.choices:
        extras.append(f"one of {', '.join(leaf.choices)}")
    elif leaf.minimum is not None and leaf.maximum is not None:
        extras.append(f"{leaf.minimum:g} to {leaf.maximum:g}")
    if leaf.symbol:
        extras.append(f"the paper's {leaf.symbol}")
    return leaf.meaning + (f" ({'; '.join(extras)})" if extras else "")
