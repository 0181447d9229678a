"""Options about settings, and short names for some of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from bsmap_cli.cli.options.common import SENSOR, SETTINGS, numbers, option

if TYPE_CHECKING:
    from bsmap_cli.config import Settings


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingsFlags:
    """Settings: built-in < profile < file < --set."""

    profile: Annotated[
        str,
        option(
            "--profile",
            metavar="NAME",
            panel=SETTINGS,
            help="Start from a named set of settings: default, or paper (as printed).",
        ),
    ] = "default"
    config: Annotated[
        str | None,
        option(
            "--config",
            "-c",
            metavar="FILE",
            panel=SETTINGS,
            help="Read settings from a YAML file; `bsmap config init` writes one.",
        ),
    ] = None
    set_: Annotated[
        list[str] | None,
        option(
            "--set",
            metavar="KEY=VALUE",
            panel=SETTINGS,
            help="Change one setting, such as ladder=[0.2,0.1]; may be repeated.",
        ),
    ] = None

    def settings(self, extra: tuple[str, ...] = ()) -> Settings:
        """The settings these flags ask for; `extra` overrides come last."""
        from bsmap_cli.config import load_settings

        return load_settings(self.profile, self.config, (*(self.set_ or ()), *extra))


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorFlags:
    """Short names for settings of the sensor."""

    range_: Annotated[
        str | None,
        option(
            "--range",
            metavar="MIN,MAX",
            panel=SENSOR,
            help="Use returns between these distances [m] only.",
        ),
    ] = None
    ignore_angles: Annotated[
        list[str] | None,
        option(
            "--ignore-angles",
            metavar="A,B",
            panel=SENSOR,
            help="Ignore beams from A to B degrees, where the robot sees itself; repeatable.",
        ),
    ] = None

    def overrides(self) -> tuple[str, ...]:
        """The same as `key=value` overrides."""
        given = []
        if self.range_ is not None:
            near, far = numbers("--range", self.range_, "0.1,30")
            given += [f"sensor.range_min_m={near!r}", f"sensor.range_max_m={far!r}"]
        if self.ignore_angles:
            pairs = [numbers("--ignore-angles", pair, "80,100") for pair in self.ignore_angles]
            given.append(f"sensor.ignore_angles_deg={pairs}")
        return tuple(given)
