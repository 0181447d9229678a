"""Rebuild the sample logs, their truth and their surfaces: `python sample_logs/make.py [FOLDER]`.

The same versions of bsmap, numpy, zstandard and lz4 give the same bytes.
"""

from __future__ import annotations

import gzip
import io
import sys
from pathlib import Path
from typing import Any

from bsmap_cli.exchange.log_writers import write_log
from bsmap_cli.exchange.surfaces import surfaces_geojson
from bsmap_cli.exchange.tum import write_tum
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.simulation import simulate

MILLIMETRE = 0.001  # what such lidars report; it also makes the logs half as large

SAMPLES: dict[str, dict[str, Any]] = {
    "wall.mcap": dict(scene="wall", rate_hz=8.0, odometry=False),
    "spin.bag": dict(scene="spin", rate_hz=5.0, odometry=False),
    "shapes.mcap": dict(scene="shapes", rate_hz=3.0),
    "loop.csv.gz": dict(scene="loop", lidar="lms200", rate_hz=2.5),
    "loop-sparse.mcap": dict(
        scene="loop", lidar="lms200", step_m=1.0, pose_base_laser=SE2(0.8, 0.0, 0.0)
    ),
    "corridor.mcap": dict(scene="corridor", lidar="lms200", rate_hz=4.0),
    "twins.bag": dict(scene="twins", lidar="lms200", rate_hz=3.0),
}


def make(name: str, folder: Path) -> None:
    """Write one log, its truth under the same stem, and the surfaces under the scene's name."""
    simulation = simulate(**SAMPLES[name], seed=1, resolution_m=MILLIMETRE)
    path = folder / name
    if name.endswith(".csv.gz"):
        text = io.BytesIO()
        write_log(text, simulation.scans(), "csv")
        path.write_bytes(gzip.compress(text.getvalue(), compresslevel=9, mtime=0))
    elif name.endswith(".bag"):
        write_log(path, simulation.scans(), "bag")
    else:
        write_log(path, simulation.scans(), "mcap")
    stem = name.partition(".")[0]
    with (folder / f"{stem}.truth.tum").open("w", newline="\n") as stream:
        write_tum(stream, simulation.truth)
    surfaces = surfaces_geojson(simulation.world.surfaces())
    (folder / f"{simulation.scene}.surfaces.geojson").write_text(surfaces, newline="\n")


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for sample in SAMPLES:
        make(sample, target)
