"""The scenes that `simulate` knows."""

from bsmap_cli.sensor.simulator.scenes import buildings, corridors, living, outdoors, rooms
from bsmap_cli.sensor.simulator.scenes.scene import Scene, SceneEntry

__all__ = ["SCENES", "Scene", "SceneEntry"]

SCENES = {
    "wall": SceneEntry("12 m along a wall with niches and pilasters", rooms.wall),
    "spin": SceneEntry("360 degrees on the spot in a room", rooms.spin),
    "shapes": SceneEntry("geometric shapes in a room of 10 m by 8 m", rooms.shapes),
    "loop": SceneEntry("a ring of corridors, 30 m by 20 m, twice round", corridors.loop),
    "corridor": SceneEntry("bare parallel walls without an end in sight", corridors.corridor),
    "twins": SceneEntry("two identical rooms joined by a corridor", corridors.twins),
    "hallway": SceneEntry("a corridor of 110 m between two lobbies, and back", buildings.hallway),
    "office": SceneEntry("a corridor and the furnished rooms beside it", buildings.office),
    "campus": SceneEntry("2 km round a campus", outdoors.campus),
    "people": SceneEntry("a hall through which people walk", living.people),
    "yard": SceneEntry("a loading yard with vans that come and go", living.yard),
    "changes": SceneEntry("a room where a box is taken away half way", living.changes),
}
