"""A map as MCAP for viewers: curves as line strips, the path, a grid, and scans along the path."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from itertools import zip_longest
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.evaluation.occupancy import FREE, OCCUPIED, Occupancy, fitting_resolution
from bsmap_cli.evaluation.pose_arrays import nearest_stamps
from bsmap_cli.exchange.flatten import TOLERANCE_M
from bsmap_cli.exchange.line_colours import LINE_PIXELS, coloured_lines
from bsmap_cli.exchange.mcap_file import McapFile
from bsmap_cli.exchange.nav2 import RESOLUTION_M, selected_occupancy
from bsmap_cli.exchange.scan_messages import BASE_FRAME, ScanMessages
from bsmap_cli.exchange.scene_schema import LINE_STRIP, SCENE_UPDATE, SCENE_UPDATE_SCHEMA
from bsmap_cli.exchange.selection import SelectedLevel, Selection
from bsmap_cli.sensor.scan import Scan

_SECOND_NS = 1_000_000_000


def write_viewer_mcap(
    stream: BinaryIO,
    selection: Selection,
    *,
    scans: Iterable[Scan] = (),
    tolerance_m: float = TOLERANCE_M,
) -> None:
    """Write `/map/curves` (foxglove.SceneUpdate), `/map/path` and `/map/grid` (ROS 2 messages).

    The curves of a large map are parted: what is too much for one message goes to
    `/map/curves/2` and so on. Each has a topic of its own, as a viewer that jumps in time shows
    the last message of each.

    scans : written along the selection's trajectory with the transform from the map to the base,
    so that a viewer replays the run; each takes the pose whose stamp is nearest. Map messages
    bear the first stamp of the trajectory, 0 where there is none.
    """
    file = McapFile(stream)
    stamps = selection.stamps_ns if selection.stamps_ns is not None else np.zeros(1, np.int64)
    first_ns = max(int(stamps.min(initial=2**62)) if len(stamps) else 0, 0)
    messages = _Messages(file, selection.frame, first_ns)
    for number, scene in enumerate(messages.scenes(selection, tolerance_m), 1):
        topic = "/map/curves" if number == 1 else f"/map/curves/{number}"
        file.add_json(topic, SCENE_UPDATE, first_ns, scene, SCENE_UPDATE_SCHEMA)
    if len(selection.path):
        file.add_ros("/map/path", "nav_msgs/msg/Path", first_ns, messages.path(selection.path))
    if any(len(selected.pieces.curve) for selected in selection.levels):
        levels = [selected.level for selected in selection.levels]
        cell_m = fitting_resolution(levels, RESOLUTION_M)
        grid = messages.grid(selected_occupancy(selection, resolution_m=cell_m))
        file.add_ros("/map/grid", "nav_msgs/msg/OccupancyGrid", first_ns, grid)
    if len(selection.path) and selection.stamps_ns is not None:
        _add_scans(file, messages, selection.path, selection.stamps_ns, scans)
    file.finish()


def _add_scans(
    file: McapFile,
    messages: _Messages,
    poses: NDArray[np.float64],
    stamps_ns: NDArray[np.int64],
    scans: Iterable[Scan],
) -> None:
    for count, outgoing in enumerate(ScanMessages(file.typestore).of(scans)):
        stamp = outgoing.stamp_ns
        if outgoing.type == "sensor_msgs/msg/LaserScan":
            row = int(nearest_stamps(stamps_ns, np.array([stamp]))[0][0])
            transform = messages.transform(stamp, poses[row])
            file.add_ros("/tf", "tf2_msgs/msg/TFMessage", stamp, transform)
        if outgoing.topic != "/odom":  # its frame would have two parents
            file.add_ros(outgoing.topic, outgoing.type, stamp, outgoing.message, count)


class _Messages:
    """The messages of one map, in its frame."""

    def __init__(self, file: McapFile, frame: str, stamp_ns: int) -> None:
        self._types = file.typestore.types
        self._frame = frame
        self._stamp_ns = stamp_ns

    def scenes(self, selection: Selection, tolerance_m: float) -> Iterator[dict[str, Any]]:
        """Messages of one entity a level, with one line strip for each drawn piece of a curve."""
        most = selection.document.max_weight
        numbered = zip_longest(*(level.portions() for level in selection.levels))
        for portions in numbered:
            entities = [self._entity(part, most, tolerance_m) for part in portions if part]
            yield {"deletions": [], "entities": entities}
        if selection.is_empty:
            yield {"deletions": [], "entities": []}

    def _entity(self, selected: SelectedLevel, max_weight: int, tolerance_m: float) -> Any:
        seconds, nanoseconds = divmod(self._stamp_ns, _SECOND_NS)
        return {
            "timestamp": {"sec": seconds, "nsec": nanoseconds},
            "frame_id": self._frame,
            "id": f"curves {selected.level.knot_step_m:g}",
            "lifetime": {"sec": 0, "nsec": 0},
            "frame_locked": True,
            "metadata": [],
            "lines": _line_strips(selected, max_weight, tolerance_m),
        }

    def path(self, poses: NDArray[np.float64]) -> Any:
        """The path as nav_msgs/Path."""
        types = self._types
        header = self._header(self._stamp_ns)
        stamped = [
            types["geometry_msgs/msg/PoseStamped"](header=header, pose=self._pose(x, y, yaw))
            for x, y, yaw in poses.tolist()
        ]
        return types["nav_msgs/msg/Path"](header=header, poses=stamped)

    def grid(self, grid: Occupancy) -> Any:
        """The cells as nav_msgs/OccupancyGrid: 100 occupied, 0 free, -1 unknown."""
        types, frame = self._types, grid.frame
        data = np.full(grid.cells.shape, -1, np.int8)
        data[grid.cells == OCCUPIED] = 100
        data[grid.cells == FREE] = 0
        info = types["nav_msgs/msg/MapMetaData"](
            map_load_time=self._time(self._stamp_ns),
            resolution=frame.resolution_m,
            width=frame.columns,
            height=frame.rows,
            origin=self._pose(frame.x_m, frame.y_m, 0.0),
        )
        header = self._header(self._stamp_ns)
        return types["nav_msgs/msg/OccupancyGrid"](header=header, info=info, data=data.ravel())

    def transform(self, stamp_ns: int, pose: NDArray[np.float64]) -> Any:
        """The base in the map as tf2_msgs/TFMessage."""
        types = self._types
        x, y, yaw = pose.tolist()
        transform = types["geometry_msgs/msg/Transform"](
            translation=types["geometry_msgs/msg/Vector3"](x=x, y=y, z=0.0),
            rotation=self._quaternion(yaw),
        )
        stamped = types["geometry_msgs/msg/TransformStamped"](
            header=self._header(stamp_ns), child_frame_id=BASE_FRAME, transform=transform
        )
        return types["tf2_msgs/msg/TFMessage"](transforms=[stamped])

    def _time(self, stamp_ns: int) -> Any:
        seconds, nanoseconds = divmod(stamp_ns, _SECOND_NS)
        return self._types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)

    def _header(self, stamp_ns: int) -> Any:
        return self._types["std_msgs/msg/Header"](stamp=self._time(stamp_ns), frame_id=self._frame)

    def _quaternion(self, yaw: float) -> Any:
        return self._types["geometry_msgs/msg/Quaternion"](
            x=0.0, y=0.0, z=math.sin(0.5 * yaw), w=math.cos(0.5 * yaw)
        )

    def _pose(self, x: float, y: float, yaw: float) -> Any:
        types = self._types
        return types["geometry_msgs/msg/Pose"](
            position=types["geometry_msgs/msg/Point"](x=x, y=y, z=0.0),
            orientation=self._quaternion(yaw),
        )


def _line_strips(
    selected: SelectedLevel, max_weight: int, tolerance_m: float
) -> list[dict[str, Any]]:
    return [
        {
            "type": LINE_STRIP,
            "pose": {
                "position": {"x": 0.0, "y": 0.0, "z": 0.0},
                "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
            },
            "thickness": LINE_PIXELS,
            "scale_invariant": True,
            "points": [{"x": x, "y": y, "z": 0.0} for x, y in np.round(line, 5).tolist()],
            "color": {**dict(zip("rgb", colour, strict=True)), "a": 1.0},
            "colors": [],
            "indices": [],
        }
        for line, colour in coloured_lines(selected, max_weight, tolerance_m)
    ]
