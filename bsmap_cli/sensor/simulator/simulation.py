"""A made-up log: a robot drives through a scene and measures, with the truth beside it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.errors import UsageError
from bsmap_cli.geometry.se2 import SE2, Vector
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.simulator.grid import Grid, grid_of, single_cell
from bsmap_cli.sensor.simulator.lidar import LIDARS, LidarModel
from bsmap_cli.sensor.simulator.motion import Motion
from bsmap_cli.sensor.simulator.odometry import OdometryModel, odometry_poses
from bsmap_cli.sensor.simulator.raycast import cast_rays
from bsmap_cli.sensor.simulator.scenes import SCENES, Scene
from bsmap_cli.sensor.simulator.world import World
from bsmap_cli.sensor.trajectory import Trajectory

FIRST_STAMP_NS = 100_000_000_000
TOPIC = "/scan"


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """One run through a scene; `scans` gives the same scans every time it is called.

    truth : base poses in the world frame, one a scan.
    odometry : (m, 3) x, y [m], yaw [rad] in the frame of the first base pose, or None.
    sweep : the base moves while the mirror turns; otherwise a scan is taken in one instant. What
        walks through the scene stands still during a scan either way.
    """

    scene: str
    lidar: LidarModel
    world: World
    motion: Motion
    truth: Trajectory
    odometry: NDArray[np.float64] | None
    pose_base_laser: SE2
    sweep: bool
    seed: int

    def __len__(self) -> int:
        return len(self.truth)

    def scans(self) -> Iterator[Scan]:
        """The scans in the order of their stamps, made one at a time."""
        grid = grid_of(self.world.standing)
        for index in range(len(self)):
            random = np.random.default_rng([self.seed, 1, index])
            yield Scan(
                stamp_ns=int(self.truth.stamps_ns[index]),
                ranges_m=self.lidar.measure(self._true_ranges(grid, index), random),
                angle_min_rad=self.lidar.angle_min_rad,
                angle_increment_rad=self.lidar.angle_increment_rad,
                range_min_m=float(np.float32(self.lidar.range_min_m)),
                range_max_m=float(np.float32(self.lidar.range_max_m)),
                time_increment_s=self.lidar.time_increment_s if self.sweep else 0.0,
                pose_base_laser=self.pose_base_laser,
                pose_odom_base=None
                if self.odometry is None
                else SE2.from_array(self.odometry[index]),
                topic=TOPIC,
            )

    def _true_ranges(self, grid: Grid, index: int) -> Vector:
        """(n,) exact ranges [m] of scan `index`, inf beyond the lidar's reach."""
        time_s = (int(self.truth.stamps_ns[index]) - FIRST_STAMP_NS) / 1e9
        poses = self.truth.poses[index : index + 1]
        if self.sweep:
            beams = np.arange(self.lidar.beams, dtype=np.float64)
            beam_times_s = time_s + beams * self.lidar.time_increment_s
            poses = self.motion.poses(beam_times_s)
        poses_world_laser = _mounted(poses, self.pose_base_laser)
        angles, ranges = self.lidar.beam_angles(), np.full(self.lidar.beams, math.inf)
        cast_rays(grid, poses_world_laser, angles, self.lidar.range_max_m, ranges)
        visitors = self.world.visitors(time_s)
        if len(visitors):
            moving = single_cell(visitors)
            cast_rays(moving, poses_world_laser, angles, self.lidar.range_max_m, ranges)
        return ranges


def simulate(
    scene: str | Scene,
    *,
    lidar: str = "ust10lx",
    noise_m: float | None = None,
    seed: int = 0,
    odometry: bool = True,
    rate_hz: float | None = None,
    step_m: float | None = None,
    pose_base_laser: SE2 = SE2(0.0, 0.0, 0.0),  # noqa: B008 (frozen)
    sweep: bool = False,
    outlier_share: float | None = None,
    dropout_share: float | None = None,
    resolution_m: float | None = None,
    odometry_model: OdometryModel | None = None,
) -> Simulation:
    """Drive through a scene.

    Parameters
    ----------
    scene, lidar : names in `SCENES` and `LIDARS`; or a scene that is none of them.
    noise_m : standard deviation of a range [m]; None for the lidar's own. 0 means exact ranges.
    seed : of everything random; the scene itself does not depend on it.
    odometry : whether the scans carry odometry.
    rate_hz : scans a second, up to the lidar's own rate and by default that.
    step_m : where given, only scans that lie this far (or half a radian) apart, as in logs that
        keep key frames alone.
    pose_base_laser : where the laser sits on the base.
    sweep : each beam is cast from where the base is at that beam's time, and the scans say so.
    outlier_share, dropout_share, resolution_m : instead of the lidar's own.

    Raises
    ------
    UsageError : unknown scene or lidar, or a number out of its range.
    """
    _refuse_negative(
        seed=seed,
        noise_m=noise_m,
        rate_hz=rate_hz,
        step_m=step_m,
        outlier_share=outlier_share,
        dropout_share=dropout_share,
        resolution_m=resolution_m,
    )
    plan = _scene(scene) if isinstance(scene, str) else scene
    model = _model(
        lidar,
        range_sigma_m=noise_m,
        range_sigma_share=None if noise_m is None else 0.0,
        rate_hz=rate_hz,
        outlier_share=outlier_share,
        dropout_share=dropout_share,
        resolution_m=resolution_m,
    )
    motion = plan.motion
    stamps_ns = FIRST_STAMP_NS + _ticks_ns(motion.duration_s, model.rate_hz)
    poses = motion.poses((stamps_ns - FIRST_STAMP_NS) / 1e9)
    wheels = None
    if odometry:
        random = np.random.default_rng([seed, 0])
        times_s = (stamps_ns - FIRST_STAMP_NS) / 1e9
        wheels = odometry_poses(motion, times_s, odometry_model or OdometryModel(), random)
    if step_m is not None:
        kept = _key_frames(poses, step_m)
        stamps_ns, poses = stamps_ns[kept], poses[kept]
        wheels = None if wheels is None else wheels[kept]
    poses[:, 2] = 0.0 - ((math.pi - poses[:, 2]) % math.tau - math.pi)  # (-pi, pi]
    return Simulation(
        scene=scene if isinstance(scene, str) else "",
        lidar=model,
        world=plan.world,
        motion=motion,
        truth=Trajectory(stamps_ns, poses),
        odometry=wheels,
        pose_base_laser=pose_base_laser,
        sweep=sweep,
        seed=seed,
    )


def _refuse_negative(**numbers: float | None) -> None:
    for name, value in numbers.items():
        if value is not None and not (math.isfinite(value) and value >= 0.0):
            raise UsageError(f"{name} is {value:g}: give a finite number that is not negative")


def _scene(name: str) -> Scene:
    if name not in SCENES:
        raise UsageError(f"unknown scene '{name}': choose one of {', '.join(SCENES)}")
    return SCENES[name].build()


def _model(name: str, **changes: float | None) -> LidarModel:
    """The lidar of that name with the given changes."""
    if name not in LIDARS:
        raise UsageError(f"unknown lidar '{name}': choose one of {', '.join(LIDARS)}")
    given = {key: value for key, value in changes.items() if value is not None}
    model = replace(LIDARS[name], **given)  # type: ignore[arg-type]
    fastest_hz = 1.0 / model.turn_s
    if not 0.0 < model.rate_hz <= fastest_hz * (1.0 + 1e-9):
        raise UsageError(f"rate_hz is {model.rate_hz:g}: {name} does up to {fastest_hz:g}")
    return model


def _ticks_ns(duration_s: float, rate_hz: float) -> NDArray[np.int64]:
    """Whole nanoseconds from 0 to the end at a constant rate."""
    count = math.floor(duration_s * rate_hz) + 1
    ticks: NDArray[np.int64] = np.round(np.arange(count) * (1e9 / rate_hz)).astype(np.int64)
    return ticks


def _key_frames(poses: NDArray[np.float64], step_m: float) -> NDArray[np.int64]:
    """Indices of the first pose and of each one `step_m` or half a radian from the last kept."""
    kept = [0]
    for index in range(1, len(poses)):
        x, y, heading = poses[index] - poses[kept[-1]]
        if math.hypot(x, y) >= step_m or abs(heading) >= 0.5:
            kept.append(index)
    return np.array(kept)


def _mounted(poses: NDArray[np.float64], mount: SE2) -> NDArray[np.float64]:
    """(m, 3) poses of the laser from poses of the base."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + cos * mount.x - sin * mount.y
    y = poses[:, 1] + sin * mount.x + cos * mount.y
    return np.stack((x, y, poses[:, 2] + mount.theta), axis=-1)
