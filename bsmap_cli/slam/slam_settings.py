"""The settings of Sec. IV and beyond, gathered from the files that use them."""

from __future__ import annotations

from dataclasses import dataclass, field

from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.slam.final_map import FinalMapSettings
from bsmap_cli.slam.keyframes import KeyframeSettings
from bsmap_cli.slam.loop_closure import LoopSettings
from bsmap_cli.slam.prediction import PredictionSettings
from bsmap_cli.slam.recovery import RecoverySettings
from bsmap_cli.slam.registration import RegistrationSettings
from bsmap_cli.slam.submap import SubmapSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class SlamSettings(MappingSettings):
    """What SLAM needs, and mapping with it."""

    registration: RegistrationSettings = field(default_factory=RegistrationSettings)
    prediction: PredictionSettings = field(default_factory=PredictionSettings)
    recovery: RecoverySettings = field(default_factory=RecoverySettings)
    keyframes: KeyframeSettings = field(default_factory=KeyframeSettings)
    submaps: SubmapSettings = field(default_factory=SubmapSettings)
    loops: LoopSettings = field(default_factory=LoopSettings)
    final_map: FinalMapSettings = field(default_factory=FinalMapSettings)
