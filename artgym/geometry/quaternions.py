"""Unit quaternions (w, x, y, z) and vectors as plain floats, for what every control step does.

On three or four numbers numpy takes ten times as long. Everything else uses ``rotations``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]


def product(a: Sequence[float], b: Sequence[float]) -> Quaternion:
    """The rotation that does ``b`` first and then ``a``."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def quaternion_from_rotation_vector(x: float, y: float, z: float) -> Quaternion:
    """The turn by ``|v|`` radians about ``v``."""
    angle = math.sqrt(x * x + y * y + z * z)
    # sin(angle / 2) / angle, by its series near zero.
    scale = math.sin(0.5 * angle) / angle if angle > 1e-6 else 0.5 - angle * angle / 48.0
    return math.cos(0.5 * angle), scale * x, scale * y, scale * z


def x_axis(q: Sequence[float]) -> Vector:
    """First column of the rotation matrix."""
    w, x, y, z = q
    return 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)


def y_axis(q: Sequence[float]) -> Vector:
    """Second column of the rotation matrix."""
    w, x, y, z = q
    return 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)


def z_axis(q: Sequence[float]) -> Vector:
    """Third column of the rotation matrix."""
    w, x, y, z = q
    return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)


def rotate(q: Sequence[float], v: Sequence[float]) -> Vector:
    """The vector turned."""
    w, x, y, z = q
    a, b, c = v
    # v + 2 u x (u x v + w v), with u the quaternion's vector.
    i, j, k = y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c
    return (
        a + 2.0 * (y * k - z * j),
        b + 2.0 * (z * i - x * k),
        c + 2.0 * (x * j - y * i),
    )


def quaternion_from_rows(rows: Sequence[Sequence[float]]) -> Quaternion:
    """The unit quaternion, w >= 0, of a rotation matrix given by its rows."""
    (a, b, c), (d, e, f), (g, h, i) = rows
    # Four times the squared components; the largest one is the well-conditioned choice.
    squares = (1 + a + e + i, 1 + a - e - i, 1 - a + e - i, 1 - a - e + i)
    best = squares.index(max(squares))
    w, x, y, z = (
        (squares[0], h - f, c - g, d - b),
        (h - f, squares[1], d + b, c + g),
        (c - g, d + b, squares[2], h + f),
        (d - b, c + g, h + f, squares[3]),
    )[best]
    scale = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    if w < 0:
        scale = -scale
    return scale * w, scale * x, scale * y, scale * z


def rows_from_quaternion(q: Sequence[float]) -> tuple[Vector, Vector, Vector]:
    """The rows of the rotation matrix of a quaternion, normalised here."""
    w, x, y, z = q
    scale = 2.0 / (w * w + x * x + y * y + z * z)
    sx, sy, sz = scale * x, scale * y, scale * z
    xx, xy, xz, yy, yz, zz = sx * x, sx * y, sx * z, sy * y, sy * z, sz * z
    wx, wy, wz = sx * w, sy * w, sz * w
    return (
        (1.0 - yy - zz, xy - wz, xz + wy),
        (xy + wz, 1.0 - xx - zz, yz - wx),
        (xz - wy, yz + wx, 1.0 - xx - yy),
    )
