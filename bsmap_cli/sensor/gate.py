"""Which beams of a scan are returns."""

from __future__ import annotations

from dataclasses import dataclass

from bsmap_cli.settings import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSettings:
    """Limits of the sensor, where the log does not state better ones."""

    range_min_m: float = setting(0.0, "shorter ranges are not returns", minimum=0.0)
    range_max_m: float = setting(30.0, "longer ranges are not returns; also where the log states no limit", minimum=0.0)
    range_sigma_m: float = setting(0.01, "standard deviation of the range noise", minimum=1e-5)
    ignore_angles_deg: tuple[tuple[float, float], ...] = setting((), "sectors of the laser frame, from, to, in which the robot sees itself")
    deskew: str = setting("auto", "correct the motion during one sweep", choices=("auto", "off"))
