"""What is on the table before a shot: the scene, its table and cushions, and the starting positions (`layouts`)."""

from billiards_env.scene.scene import (
    CONTACT_GAP,
    CUSHION_NAMES,
    MOTION_NAMES,
    PARAMETERS,
    SCENES,
    Balls,
    Cue,
    NamedScene,
    Physics,
    Scene,
    ball_friction,
    check_positions,
    check_ranges,
    check_scene,
    law_numbers,
    register_scene,
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
    "NamedScene",
    "Physics",
    "Pocket",
    "Scene",
    "Table",
    "ball_friction",
    "check_positions",
    "check_ranges",
    "check_scene",
    "law_numbers",
    "register_scene",
]
