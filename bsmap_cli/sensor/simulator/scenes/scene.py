"""What a scene is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from bsmap_cli.sensor.simulator.motion import Motion
from bsmap_cli.sensor.simulator.world import World


@dataclass(frozen=True, slots=True)
class Scene:
    """A world and how the base moves through it, both in the world frame."""

    world: World
    motion: Motion


@dataclass(frozen=True, slots=True)
class SceneEntry:
    """How to make a scene, and one line about it."""

    summary: str
    build: Callable[[], Scene]
