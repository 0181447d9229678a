"""Settings from a profile, a file and the command line: what comes later wins."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from difflib import get_close_matches
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

from bsmap_cli.config.gathered import Leaf, Settings, leaves
from bsmap_cli.config.values import checked_value
from bsmap_cli.config.yaml_text import Given, read_override, read_yaml
from bsmap_cli.errors import ConfigError

DEFAULT_PROFILE = "default"  # the built-in values; it needs no file


def load_settings(
    profile: str = DEFAULT_PROFILE,
    file: str | Path | None = None,
    overrides: Iterable[str] = (),
) -> Settings:
    """Built-in values < profile < YAML file < `key=value` overrides.

    Raises
    ------
    ConfigError : an unknown key (with the nearest name and the line), a value out of its range,
        a file that cannot be read or is not YAML.
    """
    given = [*_profile_layer(profile)]
    if file is not None:
        given += _file_layer(Path(file))
    for override in overrides:
        given.append(read_override(override))
    return _build(given)


def profile_names() -> tuple[str, ...]:
    """The profiles that come with the package."""
    names = (Path(entry.name).stem for entry in _profile_folder().iterdir())
    return tuple(sorted({DEFAULT_PROFILE, *names}))


def _build(given: Iterable[Given]) -> Settings:
    settings = Settings()
    for item in given:
        value = checked_value(_leaf(item), item)
        section, _, name = item.key.rpartition(".")
        if section:
            name, value = section, replace(getattr(settings, section), **{name: value})
        settings = replace(settings, **{name: value})
    _check_together(settings)
    return settings


def _check_together(settings: Settings) -> None:
    ladder = settings.ladder
    falling = all(fine < coarse for coarse, fine in pairwise(ladder))
    if not ladder or min(ladder) <= 0.0 or not falling:
        raise ConfigError(
            "ladder must be one or more lengths above 0 that get smaller, such as "
            f"[0.4, 0.2, 0.1], not {list(ladder)}"
        )
    near, far = settings.sensor.range_min_m, settings.sensor.range_max_m
    if far is not None and near >= far:
        raise ConfigError(
            f"sensor.range_min_m ({near:g}) must be less than sensor.range_max_m ({far:g})"
        )


def _leaf(item: Given) -> Leaf:
    known = leaves()
    if item.key in known:
        return known[item.key]
    if item.key in _sections():
        inside = [key for key in known if key.startswith(f"{item.key}.")]
        raise ConfigError(f"{item.place}: {item.key} is a section: set one of {', '.join(inside)}")
    raise ConfigError(f"{item.place}: unknown setting {item.key!r}{_nearest(item.key)}")


def _nearest(key: str) -> str:
    """A hint at the setting that was probably meant: the nearest key, or nearest last part."""
    by_name = {known.rpartition(".")[2]: known for known in leaves()}
    close = get_close_matches(key, leaves(), n=1, cutoff=0.7)
    if not close:
        names = get_close_matches(key.rpartition(".")[2], by_name, n=1, cutoff=0.7)
        close = [by_name[name] for name in names]
    return f"; did you mean {close[0]!r}?" if close else "; `bsmap config show` lists them all"


def _profile_folder() -> Any:
    return files("bsmap_cli") / "profiles"


def _profile_layer(profile: str) -> Iterator[Given]:
    names = profile_names()
    if profile not in names:
        close = get_close_matches(profile, names, n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        raise ConfigError(
            f"no profile {profile!r}; {hint}there are: {', '.join(names)} "
            "(a settings file of your own goes with --config)"
        )
    if profile != DEFAULT_PROFILE:
        text = (_profile_folder() / f"{profile}.yaml").read_text(encoding="utf-8")
        yield from read_yaml(text, f"profile {profile}", _sections())


def _file_layer(path: Path) -> Iterator[Given]:
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot read the settings: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not a text file: settings are YAML in UTF-8") from error
    return read_yaml(text, str(path), _sections())


def _sections() -> frozenset[str]:
    return frozenset(key.partition(".")[0] for key in leaves() if "." in key)
