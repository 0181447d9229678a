"""From local metres to longitude and latitude: a plane that touches the WGS 84 ellipsoid."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bsmap_cli.errors import UsageError
from bsmap_cli.geometry.se2 import Points

SEMI_MAJOR_M = 6378137.0
FLATTENING = 1.0 / 298.257223563
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)
ITERATIONS = 6  # of latitude; each gains three digits


@dataclass(frozen=True, slots=True)
class GeoOrigin:
    """Where the map's origin lies on Earth.

    latitude_deg, longitude_deg : WGS 84; heading_deg : the compass direction of the map's x axis,
    clockwise from true north (90: x points east, y north).
    """

    latitude_deg: float
    longitude_deg: float
    heading_deg: float

    def __post_init__(self) -> None:
        if not (abs(self.latitude_deg) <= 90.0 and abs(self.longitude_deg) <= 180.0):
            raise UsageError(
                f"no place on Earth: latitude {self.latitude_deg}, longitude"
                f" {self.longitude_deg}; give latitude,longitude,heading in degrees"
            )

    def longitude_latitude(self, points: Points) -> Points:
        """(m, 2) longitude, latitude [deg] of points of the map's plane [m]."""
        heading = math.radians(self.heading_deg)
        latitude, longitude = math.radians(self.latitude_deg), math.radians(self.longitude_deg)
        east = points[:, 0] * math.sin(heading) - points[:, 1] * math.cos(heading)
        north = points[:, 0] * math.cos(heading) + points[:, 1] * math.sin(heading)
        sin, cos = math.sin(latitude), math.cos(latitude)
        normal = SEMI_MAJOR_M / math.sqrt(1.0 - ECCENTRICITY_SQUARED * sin * sin)
        # in the meridian plane of the origin: away from the axis, and along it
        away = normal * cos - sin * north
        along = normal * (1.0 - ECCENTRICITY_SQUARED) * sin + cos * north
        radius = np.hypot(away, east)
        found = np.arctan2(along, radius * (1.0 - ECCENTRICITY_SQUARED))
        for _ in range(ITERATIONS):
            sine = np.sin(found)
            curvature = SEMI_MAJOR_M / np.sqrt(1.0 - ECCENTRICITY_SQUARED * sine * sine)
            found = np.arctan2(along + ECCENTRICITY_SQUARED * curvature * sine, radius)
        turned = np.degrees(longitude + np.arctan2(east, away))
        wrapped = np.mod(turned + 180.0, 360.0) - 180.0
        return np.column_stack((wrapped, np.degrees(found)))
