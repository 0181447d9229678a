"""All settings in one place: gathered from the rooms, read from YAML, checked and printed."""

from bsmap_cli.config.gathered import Settings
from bsmap_cli.config.load import DEFAULT_PROFILE, load_settings, profile_names
from bsmap_cli.config.show import dump_settings, settings_as_dict

__all__ = [
    "DEFAULT_PROFILE",
    "Settings",
    "dump_settings",
    "load_settings",
    "profile_names",
    "settings_as_dict",
]
