"""The synthetic drive: a road in daylight, rendered with the truth about road and shadow."""

from roadeval.synth.drive import (
    IMAGE_TOPIC,
    ROAD_TOPIC,
    SHADOW_TOPIC,
    DriveError,
    DriveSettings,
    SynthFrame,
    render_drive,
    write_drive,
)

__all__ = [
    "IMAGE_TOPIC",
    "ROAD_TOPIC",
    "SHADOW_TOPIC",
    "DriveError",
    "DriveSettings",
    "SynthFrame",
    "render_drive",
    "write_drive",
]
