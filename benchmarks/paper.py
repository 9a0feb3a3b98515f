"""What the ICAF-4 paper reports (Table 1, ArtImage), to be printed beside what is measured here.

Other objects, other pictures, other labels: a place to stand, not a contest. The rotation error of
a grasp is not defined there, and translations are in units of its normalised clouds.
"""

from __future__ import annotations

#: Of ICAF-4, by category and by the name that the metric has here.
TABLE_1: dict[str, dict[str, float]] = {
    "laptop": {
        "part_miou": 0.95,
        "part_rotation_deg": 2.2,
        "part_translation": 0.035,
        "object_rotation_deg": 2.1,
        "object_translation": 0.037,
        "affordance_miou": 0.95,
        "grasp/network/error_deg": 14.7,
    },
    "drawer": {
        "part_miou": 0.69,
        "part_rotation_deg": 2.7,
        "part_translation": 0.098,
        "object_rotation_deg": 2.5,
        "object_translation": 0.089,
        "affordance_miou": 0.89,
        "grasp/network/error_deg": 14.3,
    },
}
