"""What the ICAF-4 paper reports, to be printed beside what is measured here.

Other objects, other pictures, other labels: a place to stand, not a contest. The rotation error of
a grasp is not defined there, and translations are in units of its normalised clouds.
"""

from __future__ import annotations

from collections.abc import Mapping

#: The methods of Table 1 and what ours is compared with beside them, as they are printed.
METHOD_LABELS: Mapping[str, str] = {
    "icaf4": "ICAF-4",
    "no_faces": "without faces",
    "another_seed": "another seed",
    "ah_where": "AH-Where",
    "daisy": "DAISY",
    "fpfh": "FPFH",
}

#: Columns of Table 1, by the names that the metrics have here.
_TABLE_1_COLUMNS = (
    "part_miou",
    "part_rotation_deg",
    "part_translation",
    "object_rotation_deg",
    "object_translation",
    "affordance_miou",
    "grasp/network/error_deg",
)

_NO = float("nan")

#: Table 1, ArtImage: a row a method, its columns for each category.
_TABLE_1_ROWS = {
    "icaf4": {
        "eyeglasses": (0.97, 4.1, 0.100, 4.2, 0.107, 0.98, 16.9),
        "scissors": (0.84, 6.1, 0.044, 5.8, 0.038, 0.84, 17.1),
        "laptop": (0.95, 2.2, 0.035, 2.1, 0.037, 0.95, 14.7),
        "dishwasher": (0.98, 2.3, 0.076, 2.1, 0.062, 0.98, 15.1),
        "drawer": (0.69, 2.7, 0.098, 2.5, 0.089, 0.89, 14.3),
    },
    "ah_where": {
        "eyeglasses": (0.93, 16.4, 0.229, _NO, _NO, 0.96, 37.1),
        "scissors": (0.85, 2.5, 0.030, _NO, _NO, 0.85, 27.6),
        "laptop": (0.90, 4.4, 0.049, _NO, _NO, 0.90, 27.8),
        "dishwasher": (0.95, 4.4, 0.091, _NO, _NO, 0.95, 24.8),
        "drawer": (0.68, 3.3, 0.108, _NO, _NO, 0.87, 25.6),
    },
    "daisy": {
        "eyeglasses": (0.37, 31.5, 0.344, 31.6, 0.286, 0.39, 36.8),
        "scissors": (0.40, 26.5, 0.101, 26.8, 0.089, 0.41, 28.6),
        "laptop": (0.51, 30.2, 0.229, 29.3, 0.187, 0.45, 27.3),
        "dishwasher": (0.61, 28.9, 0.358, 28.8, 0.201, 0.67, 23.8),
        "drawer": (0.48, 28.3, 0.369, 28.8, 0.212, 0.47, 24.6),
    },
    "fpfh": {
        "eyeglasses": (0.34, 32.7, 0.367, 32.4, 0.296, 0.34, 38.1),
        "scissors": (0.37, 27.1, 0.107, 27.1, 0.096, 0.37, 30.0),
        "laptop": (0.45, 30.8, 0.240, 31.6, 0.207, 0.45, 27.8),
        "dishwasher": (0.60, 30.9, 0.379, 30.6, 0.229, 0.60, 25.0),
        "drawer": (0.43, 30.0, 0.395, 29.4, 0.235, 0.46, 25.2),
    },
}

#: Table 1 by method, category and metric; what the paper leaves out is left out.
TABLE_1: Mapping[str, Mapping[str, Mapping[str, float]]] = {
    method: {
        category: {
            name: value
            for name, value in zip(_TABLE_1_COLUMNS, values, strict=True)
            if value == value
        }
        for category, values in rows.items()
    }
    for method, rows in _TABLE_1_ROWS.items()
}

#: Table 2, ArtImage, by category and by the rows of ``benchmarks.anchor_table``: affordance, and
#: grasp rotation error in degrees.
TABLE_2: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "laptop": {
        "direct": (0.9, 27.8),
        "axis_10": (0.93, 15.2),
        "axis_20": (0.94, 14.9),
        "axis_30": (0.95, 14.7),
        "axis_45": (0.95, 14.7),
    },
    "eyeglasses": {
        "direct": (0.96, 37.1),
        "axis_10": (0.97, 17.5),
        "axis_20": (0.98, 17.2),
        "axis_30": (0.97, 17.1),
        "axis_45": (0.98, 16.9),
    },
    "dishwasher": {
        "direct": (0.95, 24.8),
        "axis_10": (0.97, 15.6),
        "axis_20": (0.96, 15.3),
        "axis_30": (0.97, 15.1),
        "axis_45": (0.98, 15.1),
    },
    "drawer": {
        "direct": (0.87, 25.6),
        "axis_10": (0.85, 14.7),
        "axis_20": (0.86, 14.7),
        "axis_30": (0.87, 14.4),
        "axis_45": (0.89, 14.3),
    },
    "scissors": {
        "direct": (0.85, 27.6),
        "axis_10": (0.84, 17.9),
        "axis_20": (0.84, 17.4),
        "axis_30": (0.85, 17.2),
        "axis_45": (0.85, 17.1),
    },
}

#: Columns of Table 3, by the names of ``benchmarks.scene_table``.
_TABLE_3_COLUMNS = (
    "part_segmentation@75",
    "part_pose@5deg5cm",
    "object_pose@5deg5cm",
    "affordance@75",
    "affordance@95",
    "grasp@5deg",
    "grasp@10deg",
)

_TABLE_3_ROWS = {
    "box": (0.98, 0.91, 0.89, 0.98, 0.78, 0.22, 0.42),
    "cutter": (0.99, 0.67, 0.66, 0.99, 0.84, 0.24, 0.44),
    "drawer": (0.98, 0.93, 0.91, 0.98, 0.87, 0.23, 0.44),
    "scissors": (0.99, 0.80, 0.76, 0.99, 0.93, 0.24, 0.43),
    "stapler": (0.99, 0.62, 0.60, 0.99, 0.98, 0.24, 0.45),
}

#: Table 3, ReArtMix scenes: mean average precision by category and column.
TABLE_3: Mapping[str, Mapping[str, float]] = {
    category: dict(zip(_TABLE_3_COLUMNS, values, strict=True))
    for category, values in _TABLE_3_ROWS.items()
}
