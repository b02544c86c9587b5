"""What is on the table before a shot: the scene, its table and cushions, and the starting positions (`layouts`)."""

from billiards_env.scene.scene import (
    CONTACT_GAP,
    CUSHION_NAMES,
    MOTION_NAMES,
    PARAMETERS,
    SCENES,
    Balls,
    Cue,
    Physics,
    Scene,
    ball_friction,
    check_positions,
    check_ranges,
    check_scene,
    law_numbers,
)
from billiards_env.scene.table import TABLES, Pocket, Table

__all__ = [
    "CONTACT_GAP",
    "CUSHION_NAMES",
    "MOTION_NAMES",
    "PARAMETERS",
    "SCENES",
    "TABLES",
    "Balls",
    "Cue",
    "Physics",
    "Pocket",
    "Scene",
    "Table",
    "ball_friction",
    "check_positions",
    "check_ranges",
    "check_scene",
    "law_numbers",
]
