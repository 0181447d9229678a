"""The registry of options: what several commands share is declared once, here."""

from bsmap_cli.cli.options.common import (
    READING,
    SENSOR,
    SETTINGS,
    TALKING,
    Force,
    Json,
    Logs,
    MapIn,
    Strict,
    TalkFlags,
    TrajectoryOut,
    box,
    numbers,
    option,
)
from bsmap_cli.cli.options.reading import ReadFlags, parse_laser_pose
from bsmap_cli.cli.options.settings import SensorFlags, SettingsFlags

__all__ = [
    "READING",
    "SENSOR",
    "SETTINGS",
    "TALKING",
    "Force",
    "Json",
    "Logs",
    "MapIn",
    "ReadFlags",
    "SensorFlags",
    "SettingsFlags",
    "Strict",
    "TalkFlags",
    "TrajectoryOut",
    "box",
    "numbers",
    "option",
    "parse_laser_pose",
]
