#!/usr/bin/env python3
"""Opens a curve as DXF (package ezdxf) or as SVG, evaluates it with scipy or by its Bezier segments, and checks points.

Usage: check_curve.py MODEL.dxf|MODEL.svg POINTS.csv [TOLERANCE]

POINTS.csv has columns u,x,y or u,x,y,z, as `thb eval` prints them. Checked are
- DXF: an audit without errors or fixes, one SPLINE, each point at its parameter within TOLERANCE (1e-9) of the diagonal;
- SVG: each point of the plane lies within TOLERANCE (1e-4) of the path, after one shift and one scale for each axis.
Exits with 1 at the first check that fails.
"""

import re
import sys

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree


def fail(message):
    sys.exit(f"FAILED: {message}")


def check_dxf(path, u, points):
    import ezdxf

    document = ezdxf.readfile(path)
    auditor = document.audit()
    if auditor.errors or auditor.fixes:
        fail(f"audit: {[str(e.message) for e in auditor.errors + auditor.fixes][:3]}")
    splines = document.modelspace().query("SPLINE")
    if len(splines) != 1:
        fail(f"{len(splines)} splines")
    spline = splines[0]
    control = np.array([tuple(p) for p in spline.control_points])
    curve = BSpline(np.array(spline.knots), control, spline.dxf.degree)
    return np.abs(curve(u)[:, : points.shape[1]] - points).max()


def check_svg(path, points):
    text = open(path, encoding="utf-8").read()
    numbers = np.array([float(x) for x in re.findall(r"-?[\d.]+(?:e-?\d+)?", re.search(r' d="([^"]*)"', text)[1])])
    numbers = numbers.reshape(-1, 2)
    start, rest = numbers[0], numbers[1:].reshape(-1, 3, 2)
    t = np.linspace(0, 1, 201)[:, None]
    samples = []
    for b, c, d in rest:
        samples.append((1 - t) ** 3 * start + 3 * (1 - t) ** 2 * t * b + 3 * (1 - t) * t**2 * c + t**3 * d)
        start = d
    samples = np.concatenate(samples) * [1, -1]
    # Where the curve lies on the page is found by fitting it to the points, from the boxes on.
    scale = np.ptp(points, axis=0) / np.ptp(samples, axis=0)
    shift = points.min(axis=0) - scale * samples.min(axis=0)
    for _ in range(20):
        distances, nearest = cKDTree(scale * samples + shift).query(points)
        for k in range(2):
            scale[k], shift[k] = np.polyfit(samples[nearest, k], points[:, k], 1)
    return distances.max()


def main(model, table, tolerance=None):
    table = np.genfromtxt(table, delimiter=",", names=True)
    names = [name for name in "xyz" if name in table.dtype.names]
    points = np.column_stack([table[name] for name in names])
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    if model.endswith(".dxf"):
        worst, limit = check_dxf(model, table["u"], points), float(tolerance or 1e-9)
    else:
        # Samples of the path are about this far apart.
        worst, limit = check_svg(model, points[:, :2]), float(tolerance or 1e-4)
    if worst > limit * diagonal:
        fail(f"{model}: a point is {worst:.3e} away, {worst / diagonal:.1e} of the diagonal")
    print(f"{model}: within {worst / diagonal:.1e} of the diagonal")


if __name__ == "__main__":
    main(*sys.argv[1:])
