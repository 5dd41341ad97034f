#!/usr/bin/env python3
"""Draws a scan beside the surface that was fitted to it, with the cells of its mesh.

Usage: face.py THB SCAN.off MODEL.json PICTURE.png      (THB: the program; needs numpy, matplotlib and Pillow)
"""

import csv
import io
import json
import subprocess
import sys
import tempfile

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.collections import LineCollection, PolyCollection
from PIL import Image

# Quads per direction of the drawn surface, and samples along each edge of a cell.
QUADS, EDGE = 160, 9
# From where the surface is seen, and from where the light comes.
TURN, LIGHT = np.radians([-24.0, -8.0]), np.array([-0.45, 0.4, 0.8])


def read_off(path):
    with open(path, encoding="utf-8") as file:
        words = [w for line in file for w in line.split("#")[0].split()]
    vertices, faces = int(words[1]), int(words[2])
    points = np.array(words[4 : 4 + 3 * vertices], float).reshape(-1, 3)
    triangles = np.array(words[4 + 3 * vertices :][: 4 * faces], int).reshape(-1, 4)[:, 1:]
    return points, triangles


def leaf_cells(model):
    """Boxes (u0, v0, u1, v1) of the cells that are not split."""
    breaks = [np.unique(knots) for knots in model["knots"]]
    cells = {(0, i, j) for i in range(len(breaks[0]) - 1) for j in range(len(breaks[1]) - 1)}
    for group in model["splits"]:
        for i, j in group["cells"]:
            level = group["level"]
            cells.remove((level, i, j))
            cells |= {(level + 1, 2 * i + a, 2 * j + b) for a in (0, 1) for b in (0, 1)}

    def corner(level, index, direction):
        coarse = np.arange(len(breaks[direction]))
        return np.interp(index / 2**level, coarse, breaks[direction])

    return [(corner(k, i, 0), corner(k, j, 1), corner(k, i + 1, 0), corner(k, j + 1, 1)) for k, i, j in sorted(cells)]


def evaluate(program, model, parameters):
    with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
        file.write("u,v\n" + "".join(f"{u!r},{v!r}\n" for u, v in parameters.tolist()))
        file.flush()
        text = subprocess.run([program, "eval", model, file.name], check=True, capture_output=True, text=True).stdout
    rows = list(csv.DictReader(io.StringIO(text)))
    return np.array([[float(row[name]) for name in "xyz"] for row in rows])


def view(points):
    (a, b), (x, y, z) = TURN, points.T
    x, z = x * np.cos(a) + z * np.sin(a), z * np.cos(a) - x * np.sin(a)
    y, z = y * np.cos(b) - z * np.sin(b), z * np.cos(b) + y * np.sin(b)
    return np.column_stack([x, y, z])


def shade(axes, points, triangles, edge):
    corners = view(points)[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    light = 0.3 + 0.7 * np.abs(normals @ (LIGHT / np.linalg.norm(LIGHT)))
    colours = light[:, None] * np.array([0.93, 0.84, 0.72])
    order = np.argsort(corners[:, :, 2].mean(axis=1))
    face = colours[order]
    axes.add_collection(PolyCollection(corners[order][:, :, :2], facecolors=face, edgecolors=edge or face, linewidths=0.4))


def main(program, scan, model, picture):
    points, triangles = read_off(scan)
    with open(model, encoding="utf-8") as file:
        cells = leaf_cells(json.load(file))
    s = np.linspace(0, 1, QUADS + 1)
    surface = evaluate(program, model, np.array([(u, v) for v in s for u in s]))
    a = (np.arange(QUADS)[:, None] * (QUADS + 1) + np.arange(QUADS)).ravel()
    quads = np.concatenate([np.column_stack([a, a + 1, a + QUADS + 2]), np.column_stack([a, a + QUADS + 2, a + QUADS + 1])])
    t = np.linspace(0, 1, EDGE)
    edges = np.array([
        np.concatenate([
            np.column_stack([u0 + t * (u1 - u0), np.full(EDGE, v0)]), np.column_stack([np.full(EDGE, u1), v0 + t * (v1 - v0)]),
            np.column_stack([u1 + t * (u0 - u1), np.full(EDGE, v1)]), np.column_stack([np.full(EDGE, u0), v1 + t * (v0 - v1)]),
        ])
        for u0, v0, u1, v1 in cells
    ])
    lines = view(evaluate(program, model, edges.reshape(-1, 2))).reshape(len(cells), -1, 3)

    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4.6), sharex=True, sharey=True)
    shade(left, points, triangles, edge=(0.25, 0.25, 0.25, 0.6))
    left.set_title(f"scan: {len(points)} points", fontsize=11)
    shade(right, surface, quads, edge=None)
    right.add_collection(LineCollection(lines[:, :, :2], colors=(0.05, 0.2, 0.45, 0.75), linewidths=0.6))
    right.set_title(f"THB-spline surface: {len(cells)} cells", fontsize=11)
    for axes in (left, right):
        axes.set_aspect("equal")
        axes.autoscale_view()
        axes.axis("off")
    figure.tight_layout(pad=0.4)
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=130)
    # A palette takes a third of the bytes.
    Image.open(buffer).convert("RGB").quantize(128).save(picture, optimize=True)


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
