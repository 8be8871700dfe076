"""Triangles of shapes, and fewer of them: vertices are drawn together cell by cell (Rossignac and Borrel 1993)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sysid_ros.sample import FloatArray

Triangles = NDArray[np.int64]
Mesh = tuple[FloatArray, Triangles]
"""Vertices, shape (V, 3) [m], and the three vertices of each triangle, shape (T, 3), counter-clockwise as seen from outside."""

_ROUND = 20
"""Sides of what is round."""


def reduced(mesh: Mesh, cell: float, most: int) -> Mesh:
    """The mesh with one vertex in each cube of edge ``cell`` [m], larger cubes where more than ``most`` vertices are left.

    A vertex is the mean of those in its cube, so that none is farther off than the cube's diagonal.
    """
    vertices, triangles = mesh
    if len(vertices) == 0 or len(triangles) == 0:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    while True:
        places = np.floor((vertices - vertices.min(axis=0)) / cell).astype(np.int64)
        across = places.max(axis=0) + 1
        cube = np.unique((places[:, 0] * across[1] + places[:, 1]) * across[2] + places[:, 2], return_inverse=True)[1]
        count = int(cube.max()) + 1
        if count <= most:
            break
        cell *= 1.25
    total = np.stack([np.bincount(cube, vertices[:, axis], count) for axis in range(3)], axis=1)
    means = total / np.bincount(cube, minlength=count)[:, None]
    corners = cube[triangles]
    apart = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    kept = corners[apart]
    # both sides of a thin wall end as the same three vertices: one of them is enough
    kept = kept[np.unique(np.sort(kept, axis=1), axis=0, return_index=True)[1]]
    used, at = np.unique(kept, return_inverse=True)
    return means[used], np.asarray(at, dtype=np.int64).reshape(-1, 3)


def box(size: FloatArray) -> Mesh:
    """A box of these edges, shape (3,), about the origin."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))], dtype=np.int64)


def turned(profile: FloatArray) -> Mesh:
    """The surface that a profile, shape (K, 2) of radius and height from bottom to top [m], makes about the z axis."""
    angle = 2.0 * np.pi * np.arange(_ROUND) / _ROUND
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    vertices = np.concatenate([np.column_stack([radius * ring, np.full(_ROUND, height)]) for radius, height in profile])
    a = np.arange(_ROUND)
    b = (a + 1) % _ROUND
    rows = []
    for k in range(len(profile) - 1):
        low, high = k * _ROUND, (k + 1) * _ROUND
        rows += [np.column_stack([low + a, low + b, high + b]), np.column_stack([low + a, high + b, high + a])]
    return vertices, np.concatenate(rows)


def cylinder(radius: float, length: float) -> Mesh:
    """A cylinder along z about the origin."""
    half = 0.5 * length
    return turned(np.array([[0.0, -half], [radius, -half], [radius, half], [0.0, half]]))


def capsule(radius: float, length: float) -> Mesh:
    """A cylinder of ``length`` along z about the origin with half a ball on each end; a ball where the length is 0."""
    rise = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 12)
    height = radius * np.sin(rise) + np.where(rise < 0.0, -0.5, 0.5) * length
    return turned(np.column_stack([radius * np.cos(rise), height]))


def cone(radius: float, length: float) -> Mesh:
    """A cone along z, its base at half its length below the origin."""
    half = 0.5 * length
    return turned(np.array([[0.0, -half], [radius, -half], [0.0, half]]))


def moved(mesh: Mesh, rotation: FloatArray, translation: FloatArray) -> Mesh:
    """The mesh turned, then moved: rotation (3, 3), translation (3,) [m]."""
    return mesh[0] @ np.asarray(rotation).T + translation, mesh[1]


def along(start: FloatArray, end: FloatArray, radius: float, flat: bool = False) -> Mesh:
    """A capsule from one point to another, shape (3,) each [m]; with ``flat`` ends a cylinder."""
    way = np.asarray(end) - np.asarray(start)
    length = float(np.linalg.norm(way))
    axis = way / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    aside = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    aside /= np.linalg.norm(aside)
    rotation = np.column_stack([aside, np.cross(axis, aside), axis])
    return moved(
        cylinder(radius, length) if flat else capsule(radius, length), rotation, 0.5 * (np.asarray(start) + np.asarray(end))
    )
