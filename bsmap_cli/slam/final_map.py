"""The map once more, with all poses known: Algorithm 1, then poses and curves in turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bsmap_cli.beside import halves
from bsmap_cli.geometry.se2 import Points
from bsmap_cli.mapping.cleanup import drop_unconfirmed, tidy
from bsmap_cli.mapping.compact_clusters import unpacked_scans
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.insertion import draw_scans
from bsmap_cli.mapping.map_document import MapLevel
from bsmap_cli.mapping.scan_levels import ScanLevels
from bsmap_cli.mapping.thaw import thaw_level
from bsmap_cli.mapping.trimming import remove_guessed
from bsmap_cli.settings import setting
from bsmap_cli.slam.contradicted import remove_contradicted
from bsmap_cli.slam.keyframes import Keyframe, every_nth
from bsmap_cli.slam.ladder import register_near
from bsmap_cli.slam.uncertainty import isotropic_information

if TYPE_CHECKING:
    from bsmap_cli.slam.slam_settings import SlamSettings


FEW_KEYFRAMES = 20  # a log with fewer has no views to spare
WORTH_SHARING = 500  # keyframes: fewer are registered sooner than a process is begun


@dataclass(frozen=True, slots=True, kw_only=True)
class FinalMapSettings:
    """How the finished map is made."""

    rounds: int = setting(
        2, "times that every keyframe is registered against the whole map", minimum=0
    )
    min_views: int = setting(
        3, "a curve that fewer keyframes met does not enter the finished map", minimum=0
    )
    rebuild: bool = setting(
        True, "build the map anew with the final poses; off: keep what tracking built"
    )
    all_levels: bool = setting(
        False, "make the coarser levels of the finished map too, not the finest alone"
    )
    levels: int = setting(
        2, "levels of the ladder, from the finest up, that the first round uses", minimum=1
    )


def build_map(
    poses: Points,
    keyframes: list[Keyframe],
    ladder: tuple[float, ...],
    settings: SlamSettings,
    sigma_m: float,
    old: Sequence[MapLevel] = (),
    *,
    sparse: bool = False,
) -> list[CurveMap]:
    """Algorithm 1 over all keyframes; one map for each knot step of `ladder`.

    old : levels that the keyframes go on with, one for each knot step; empty: from nothing.
    sparse : draw coarser levels from as few keyframes as it takes.
    """
    levels = [thaw_level(level) for level in old]
    levels = levels or [CurveMap(step, settings.degree) for step in ladder]
    packed = [keyframe.clusters for keyframe in keyframes]
    fewest = settings.segmentation.faint_points
    for above, level in enumerate(reversed(levels)):
        apart = every_nth(ladder[-1 - above], settings.ladder[-1]) if sparse else 1
        scans, at = packed[::apart], poses[::apart]
        draw_scans(level, scans, at, settings, sigma_m, above=above, fewest=fewest)
    return levels


def refine_poses(
    poses: Points,
    levels: list[CurveMap],
    keyframes: list[Keyframe],
    settings: SlamSettings,
    sigma_m: float,
    *,
    cores: int = 1,
) -> Points:
    """Register every keyframe against the whole map, held softly to where the graph put it."""
    ladder = tuple(level.knot_step_m for level in levels)
    prior = isotropic_information((0.3 * ladder[-1], 0.02))

    def refined(begin: int, end: int) -> Points:
        found = poses[begin:end].copy()
        packed = [keyframe.clusters for keyframe in keyframes[begin:end]]
        for finest, pose in zip(
            unpacked_scans(packed, settings.ladder[-1], sigma_m), found, strict=True
        ):
            result = register_near(
                levels,
                ScanLevels(finest, ladder, settings.fitting, sigma_m),
                pose.copy(),
                pose.copy(),
                prior,
                enough=settings.registration.shortcut,
                sigma_m=sigma_m,
                settings=settings.registration,
            )
            if result.inlier_ratio >= settings.recovery.search_below:
                pose[:] = result.pose
        return found

    if cores > 1 and len(keyframes) >= WORTH_SHARING:
        return halves(refined, len(keyframes))
    return refined(0, len(keyframes))


def final_map(
    poses: Points,
    keyframes: list[Keyframe],
    settings: SlamSettings,
    sigma_m: float,
    old: Sequence[MapLevel] = (),
    *,
    cores: int = 1,
) -> tuple[Points, list[CurveMap]]:
    """Refined poses and the levels of the finished map.

    old : a map that is gone on with, in the frame of the poses: a level for each knot step.
    cores : with more than one, half of the keyframes are registered in a process beside this one.
    """
    for turn in range(settings.final_map.rounds):
        # once all poses agree with one map, none needs to be drawn in from farther off
        ladder = settings.ladder[-(settings.final_map.levels if turn == 0 else 1) :]
        before = old[-len(ladder) :]
        levels = build_map(poses, keyframes, ladder, settings, sigma_m, before, sparse=True)
        poses = refine_poses(poses, levels, keyframes, settings, sigma_m, cores=cores)
    written = settings.ladder if settings.final_map.all_levels else settings.ladder[-1:]
    before = old[-len(written) :]
    drawn = settings.without_faint()
    levels = build_map(poses, keyframes, written, drawn, sigma_m, before)
    old_curves = [len(level) for level in before] or [0] * len(levels)
    remove_contradicted(levels, keyframes, poses, settings, sigma_m, old_curves=old_curves)
    for level in levels:
        if len(keyframes) >= FEW_KEYFRAMES:
            drop_unconfirmed(level, settings.final_map.min_views)
        remove_guessed(level, min_length=settings.segmentation.min_length)
        tidy(level, min_length=settings.segmentation.min_length)
    return poses, levels
