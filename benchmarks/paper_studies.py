"""The parameters of Sec. III-E where a box is taken away half-way, and the bytes of Fig. 3."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from cases import SimulatedLog
from paper_missions import beginning_of, update_seconds
from scipy.spatial import KDTree

from bsmap_cli.config import Settings, load_settings
from bsmap_cli.evaluation.map_quality import COVER_M
from bsmap_cli.evaluation.map_statistics import MapStatistics, map_statistics, sizes_of
from bsmap_cli.evaluation.trajectory_error import rms
from bsmap_cli.evaluation.true_surfaces import TrueSurfaces, cut_surfaces
from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.sampling import sample_level
from bsmap_cli.pipeline import run_map, run_slam
from bsmap_cli.sensor.simulator.simulation import Simulation, simulate
from bsmap_cli.sensor.trajectory import Trajectory

RATE_HZ = 20.0
GHOST_M = 0.05  # a curve farther from all that stands is of something that has gone, or never was
STEP_M = 0.01
VARIED = {
    "Delta": ("ladder", ("[0.4]", "[0.2]", "[0.1]")),
    "gamma_track": ("association.track_dist", ("0.25", "0.5", "1", "2", "4")),
    "gamma_weight": ("merging.max_weight", ("1", "5", "20", "50", "255")),
}
STUDIED = {"paper": 0.0, "default": 0.01}  # range noise [m] with which each profile is studied


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRun:
    """One value of one parameter, the others as the profile has them, Delta 0.2 m.

    rms_m, p95_m : from the curves to what stands at the end. standing_share, new_share : of what
    stands, and of the box that came half-way, the part within 3 cm of a curve. drawn_m : length of
    the curves; ghost_m : of those farther than 5 cm from all that stands.
    """

    profile: str
    parameter: str
    value: str
    curves: int
    control_points: int
    bytes: int
    rms_m: float
    p95_m: float
    standing_share: float
    new_share: float
    drawn_m: float
    ghost_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ShapesRun:
    """Fig. 3 once: map with known poses, or slam."""

    profile: str
    noise_m: float
    verb: str
    document: MapDocument
    statistics: MapStatistics
    compressed_bytes: int
    update_ms: float


def parameter_runs(*, every: int) -> Iterator[ParameterRun]:
    """Vary Delta, gamma_track and gamma_weight one at a time, with true poses.

    every : take one value of so many.
    """
    for profile, noise_m in STUDIED.items():
        simulation = simulate("changes", noise_m=noise_m, odometry=False, rate_hz=RATE_HZ)
        for parameter, (key, values) in VARIED.items():
            for value in values[::every]:
                settings = load_settings(profile, overrides=["ladder=[0.2]", f"{key}={value}"])
                yield _parameter_run(simulation, settings, profile, parameter, value)


def _parameter_run(
    simulation: Simulation, settings: Settings, profile: str, parameter: str, value: str
) -> ParameterRun:
    document = _map(simulation, settings)
    level = document.finest
    start = SE2.from_array(simulation.truth.poses[0])
    surfaces = simulation.world.surfaces()
    standing = cut_surfaces([s.points for s in surfaces if np.isinf(s.to_s)])
    new = cut_surfaces([s.points for s in surfaces if np.isfinite(s.from_s)])
    samples = sample_level(level, STEP_M)
    points = start.transform(samples.points)
    distances = standing.distances(points)
    chords = np.hypot(*np.diff(points, axis=0).T) * (np.diff(samples.piece) == 0)
    return ParameterRun(
        profile=profile,
        parameter=parameter,
        value=value,
        curves=len(level),
        control_points=len(level.weights),
        bytes=sizes_of(document).level_bytes[-1],
        rms_m=rms(distances),
        p95_m=float(np.percentile(distances, 95)),
        standing_share=_covered(standing, points),
        new_share=_covered(new, points),
        drawn_m=float(chords.sum()),
        ghost_m=float(chords[distances[1:] > GHOST_M].sum()),
    )


def _covered(surfaces: TrueSurfaces, points: Points) -> float:
    distance, _ = KDTree(points).query(surfaces.middles)
    return float(np.mean(distance <= COVER_M))


def _map(simulation: Simulation, settings: Settings) -> MapDocument:
    """Algorithm 1 with the true poses, in the frame of the first one."""
    reader = SimulatedLog(simulation, np.ones(len(simulation), bool))
    start = SE2.from_array(simulation.truth.poses[0]).inverse()
    poses = np.array([(start @ SE2.from_array(p)).as_array() for p in simulation.truth.poses])
    return run_map(reader, Trajectory(simulation.truth.stamps_ns, poses), settings).document


def shapes_runs(share: float) -> Iterator[ShapesRun]:
    """`shapes` at Delta 0.2 m: both profiles, without and with noise, poses known and not."""
    for noise_m in (0.0, 0.01):
        simulation = beginning_of(simulate("shapes", noise_m=noise_m, odometry=False), share)
        for profile in STUDIED:
            settings = replace(load_settings(profile), ladder=(0.2,))
            document = _map(simulation, settings)
            yield _shapes_run(("map", profile, noise_m), document, simulation, settings)
        reader = SimulatedLog(simulation, np.ones(len(simulation), bool))
        document = run_slam(reader, settings).document
        yield _shapes_run(("slam", "default", noise_m), document, simulation, settings)


def _shapes_run(
    what: tuple[str, str, float], document: MapDocument, simulation: Simulation, settings: Settings
) -> ShapesRun:
    verb, profile, noise_m = what
    return ShapesRun(
        profile=profile,
        noise_m=noise_m,
        verb=verb,
        document=document,
        statistics=map_statistics(document, sizes_of(document)),
        compressed_bytes=sizes_of(document, compress=True).level_bytes[-1],
        update_ms=1e3 * update_seconds(simulation, settings) / len(simulation),
    )
