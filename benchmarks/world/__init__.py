"""The synthetic drive: a road in daylight, rendered with the truth about road and shadow.

Each ray of the camera meets the ground, where reflectance and the sun's visible share are read
from maps of the world; things beside the road are painted on flat panels over it. Light is
a direct sun, cut by everything between it and a surface with the penumbra of its disc, plus a
bluish sky. Road truth is where most of a pixel is asphalt or its markings; shadow truth is
where less than half of the sun's disc is seen from the surface, while the sun itself is not
behind a cloud (`light.is_shadow`).

Simplifications: trees stand in their own shade but not in their neighbours'; the share of hidden
sky is guessed from the share of hidden sun; light is reflected once; nothing moves while the
shutter is open.
"""

from benchmarks.world.drive import (
    DEMO,
    IMAGE_TOPIC,
    ROAD_TOPIC,
    SHADOW_TOPIC,
    DriveError,
    RenderSettings,
    SynthFrame,
    render_drive,
    write_drive,
)

__all__ = [
    "DEMO",
    "IMAGE_TOPIC",
    "ROAD_TOPIC",
    "SHADOW_TOPIC",
    "DriveError",
    "RenderSettings",
    "SynthFrame",
    "render_drive",
    "write_drive",
]
