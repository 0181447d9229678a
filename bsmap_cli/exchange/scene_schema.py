"""The part of `foxglove.SceneUpdate` that we write, as a JSON schema."""

from __future__ import annotations

from typing import Any

SCENE_UPDATE = "foxglove.SceneUpdate"
LINE_STRIP = 0


def _object(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


def _array(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


_NUMBER, _INTEGER = {"type": "number"}, {"type": "integer"}
_STRING, _BOOLEAN = {"type": "string"}, {"type": "boolean"}
_TIME = _object(sec=_INTEGER, nsec=_INTEGER)
_POINT = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_COLOUR = _object(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_LINE = _object(
    type=_INTEGER,
    pose=_object(position=_POINT, orientation=_QUATERNION),
    thickness=_NUMBER,
    scale_invariant=_BOOLEAN,
    points=_array(_POINT),
    color=_COLOUR,
    colors=_array(_COLOUR),
    indices=_array(_INTEGER),
)
_ENTITY = _object(
    timestamp=_TIME,
    frame_id=_STRING,
    id=_STRING,
    lifetime=_TIME,
    frame_locked=_BOOLEAN,
    metadata=_array(_object(key=_STRING, value=_STRING)),
    lines=_array(_LINE),
)
_DELETION = _object(timestamp=_TIME, type=_INTEGER, id=_STRING)

SCENE_UPDATE_SCHEMA: dict[str, Any] = {
    "title": SCENE_UPDATE,
    **_object(deletions=_array(_DELETION), entities=_array(_ENTITY)),
}
