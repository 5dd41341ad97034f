#!/usr/bin/env python3
"""Tests measure_step.py on surfaces and scans whose figures are known in closed form.

Usage: check_measure.py          exits with 1 at the first figure that is wrong
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp_Ax2, gp_Circ, gp_Dir, gp_Pln, gp_Pnt
from OCP.Message import Message
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer


# Compiled modules name the folders of the machine; `cargo xtask tidy` would find them.
sys.dont_write_bytecode = True

from measure_step import measure
from meter import facets
from meter.scans import read_scan
from meter.surface import read_surface

try:
    from OCP.TColgp import TColgp_Array2OfPnt as Poles
    from OCP.TColStd import TColStd_Array1OfInteger as Integers
    from OCP.TColStd import TColStd_Array1OfReal as Reals
except ImportError:  # from version 8 of Open CASCADE
    from OCP.collections import Array1_double as Reals
    from OCP.collections import Array1_int as Integers
    from OCP.collections import Array2_gp_Pnt as Poles


def expect(name, found, right, slack):
    """Fails unless a figure is right, but for `slack`."""
    if not abs(found - right) <= slack:
        sys.exit(f"FAILED: {name} is {found:.6g}, not {right:.6g} +- {slack:.2g}")


def written(folder, shape):
    """The shape in a STEP file."""
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_AsIs)
    path = str(Path(folder) / "model.step")
    writer.Write(path)
    return path


def sheet(values, degree):
    """A face over a B-spline surface with the control points `values` (m, n, 3) and uniform inner knots."""
    poles = Poles(1, values.shape[0], 1, values.shape[1])
    for i, j in np.ndindex(values.shape[:2]):
        poles.SetValue(i + 1, j + 1, gp_Pnt(*map(float, values[i, j])))
    sides = []
    for count, d in zip(values.shape, degree):
        knots, multiplicities = Reals(1, count - d + 1), Integers(1, count - d + 1)
        for k in range(count - d + 1):
            knots.SetValue(k + 1, k / (count - d))
            multiplicities.SetValue(k + 1, d + 1 if k in (0, count - d) else 1)
        sides.append((knots, multiplicities))
    (u, times_u), (v, times_v) = sides
    surface = Geom_BSplineSurface(poles, u, v, times_u, times_v, *degree)
    return BRepBuilderAPI_MakeFace(surface, 1e-9).Face()


def rectangle(size, height=0.0):
    """A plane face from the origin."""
    return BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, height), gp_Dir(0, 0, 1)), 0.0, size[0], 0.0, size[1]).Face()


def grid(size, cells, height=0.0):
    """A mesh over a rectangle from the origin, two triangles a cell."""
    x, y = np.meshgrid(*(np.linspace(0, s, n + 1) for s, n in zip(size, cells)), indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, height)])
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    triangles = [np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))]
    return points, np.concatenate(triangles)


def icosphere(halvings):
    """Triangles inscribed in the unit sphere."""
    g = (1 + 5**0.5) / 2
    points = np.array([(s, t * g, 0) for s in (-1, 1) for t in (-1, 1)], dtype=float)
    points = facets.unit(np.concatenate([np.roll(points, k, axis=1) for k in range(3)]))
    edge = np.sort(np.linalg.norm(points[0] - points, axis=1))[1]
    near = np.abs(np.linalg.norm(points[:, None] - points[None], axis=2) - edge) < 1e-9
    triangles = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]
    ]
    triangles = np.array(triangles)
    inward = facets.dot(facets.doubled_normals(points, triangles), points[triangles[:, 0]]) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    for _ in range(halvings):
        ends, number = np.unique(
            np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_inverse=True
        )
        p, (ab, bc, ca) = triangles.T, (len(points) + number.reshape(-1, 3)).T
        points = np.concatenate([points, facets.unit(points[ends].mean(axis=1))])
        parts = [(p[0], ab, ca), (ab, p[1], bc), (ca, bc, p[2]), (ab, bc, ca)]
        triangles = np.concatenate([np.column_stack(part) for part in parts])
    return points, triangles


def check_planes(folder):
    """A plane and its mesh at a distance; one that is larger, and one that is smaller than the other."""
    points, triangles = grid((10, 6), (20, 12), height=0.03)
    # Far from the origin nothing changes.
    for move in (0.0, 4e6):
        far = points + move
        face = BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(move, move, move), gp_Dir(0, 0, 1)), 0.0, 10.0, 0.0, 6.0).Face()
        for tolerance, share in ((0.02, 0.0), (0.04, 1.0)):
            found = measure(written(folder, face), far, triangles, tolerance)
            for side in (found["scan_to_surface"], found["surface_to_scan"], found["facets"]["scan_to_surface"]):
                expect("share within of a plane at a distance", side["within"], share, 1e-9)
                for key in ("mean", "rms", "median", "p95", "p99", "max"):
                    expect(f"{key} of a plane at a distance", side[key], 0.03, 2e-8)
            expect("box of a plane", found["box"], 1.0, 1e-6)
            expect("crossings of a plane", found["crossings"]["pairs"], 0, 0)
            expect("misses that gather", found["gathered"]["largest"], 1.0 - share, 1e-9)
    found = measure(written(folder, rectangle((12, 6))), points, triangles, 0.04)
    expect("surface beyond the outline", found["coverage"]["surface_beyond_outline"], 2 / 12, 2e-3)
    expect("largest distance inside the outline", found["surface_to_scan"]["max"], 0.03, 1e-9)
    expect("largest distance wherever", found["coverage"]["surface_farthest"], np.hypot(2, 0.03), 1e-6)
    found = measure(written(folder, rectangle((8, 6))), points, triangles, 0.04)
    # A triangle of half a cell of 0.5 x 0.5 has the area of an equilateral one with this edge.
    edge = np.sqrt(4 / np.sqrt(3) * 0.125)
    expect("scan beyond the rim", found["coverage"]["scan_beyond_rim"], (2 - 0.04 - edge) / 10, 2e-3)
    # Lines of points at 8.5, 9, 9.5 and 10 count as met across a plane that ends at 8, but not as covered, if farther
    # than a spacing.
    found = measure(written(folder, rectangle((8, 6), 0.01)), points, None, 0.04)
    expect("largest distance across the rim", found["scan_to_surface"]["max"], 0.02, 1e-9)
    expect("points beyond the rim", found["coverage"]["scan_beyond_rim"], 3 / 21, 0.03)


def check_sphere(folder):
    """A sphere and its facets: flat they are off by the sagitta, with the band they are not."""
    points, triangles = icosphere(3)
    step = written(folder, BRepPrimAPI_MakeSphere(1.0).Shape())
    which, weights = facets.sample(points, triangles, 200_000, 7)
    height = 1 - np.linalg.norm(facets.at(points, triangles, which, weights), axis=1)
    tolerance = 0.6 * height.max()
    found = measure(step, points, triangles, tolerance)
    flat = found["facets"]["scan_to_surface"]
    # The surface is measured on triangles up to 2 % of the tolerance inside it.
    low, high = ((height <= k * tolerance).mean() for k in (0.98, 1.02))
    expect("share of flat facets", flat["within"], (low + high) / 2, (high - low) / 2 + 3e-3)
    expect("mean height over facets", flat["mean"], height.mean(), 0.02 * height.max())
    expect("largest height over facets", flat["max"], height.max(), 0.03 * height.max())
    expect("heights of curved triangles", found["sagitta_p95"], np.quantile(height, 0.95), 0.1 * height.max())
    for side in ("scan_to_surface", "surface_to_scan"):
        expect(f"share with the band, {side}", found[side]["within"], 1.0, 1e-9)
        expect(f"largest distance with the band, {side}", found[side]["max"], 0.0, 0.1 * height.max())
    expect("box of a sphere", found["box"], 1.0, 1e-3)
    for what, figure in (
        ("crossings at seam and poles", found["crossings"]["pairs"]),
        ("folds of a sphere", found["folds"]["share"]),
        ("outline of a closed surface", found["coverage"]["surface_beyond_outline"]),
        ("rim of a closed surface", found["coverage"]["scan_beyond_rim"]),
    ):
        expect(what, figure, 0, 0)
    # The triangles over the surface keep the chord, and say so.
    for chord in (1e-2, 1e-3, 1e-4):
        surface = read_surface(step, chord, 2_000_000)
        which, weights = facets.sample(surface.points, surface.triangles, 50_000, 1)
        off = np.abs(1 - np.linalg.norm(facets.at(surface.points, surface.triangles, which, weights), axis=1)).max()
        expect("error of the triangles, in chords", off / chord, 0.5, 0.55)
        expect("error that is told, in true ones", surface.chord / off, 1.1, 0.5)
    expect("triangles where few are allowed", min(len(read_surface(step, 1e-7, 20_000).triangles), 10**6), 10**5, 10**5)


def check_folded_tube(folder):
    """A prism with 48 sides that runs from 0 to 6, back to 4 and on to 10: 2 of 14 are folded."""
    angle = 2 * np.pi * np.arange(49) / 48
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    values = np.array([[(*p, z) for z in (0, 6, 4, 10)] for p in ring])
    points = np.array([(*p, z) for z in np.linspace(0, 10, 41) for p in ring[:-1]])
    number = np.arange(len(points)).reshape(41, 48)
    a, b = number[:-1], np.roll(number[:-1], -1, axis=1)
    c, d = np.roll(number[1:], -1, axis=1), number[1:]
    triangles = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    found = measure(written(folder, sheet(values, (1, 1))), points, triangles, 0.01)
    expect("folded share of a tube", found["folds"]["share"], 2 / 14, 3e-3)
    expect("place of the fold", found["folds"]["place"][2], 5, 1.05)
    expect("crossings of sheets that lie on each other", found["crossings"]["pairs"], 0, 0)
    expect("share within of a folded tube", found["scan_to_surface"]["within"], 1, 1e-9)
    values[:, :, 2] = np.linspace(0, 10, 4)
    found = measure(written(folder, sheet(values, (1, 1))), points, triangles, 0.01)
    expect("folded share of a tube without folds", found["folds"]["share"], 0, 0)
    # The normals of scan and surface may be opposite throughout.
    found = measure(written(folder, sheet(values, (1, 1))), points, triangles[:, ::-1], 0.01)
    expect("folded share of a tube inside out", found["folds"]["share"], 0, 0)


def check_crossings(folder):
    """A figure of eight, swept by 2, crosses itself along a line; a ring whose ends meet, and two near sheets,
    don't."""
    for turns, seed in ((0.0, 0), (0.7, 1)):
        t = np.linspace(-0.75 * np.pi, 1.2 * np.pi, 60)
        eight = np.column_stack([np.sin(t), np.sin(t) * np.cos(t)])
        turn = np.array([[np.cos(turns), -np.sin(turns)], [np.sin(turns), np.cos(turns)]])
        values = np.array([[(*p, z) for z in np.linspace(0, 2, 5)] for p in eight @ turn.T])
        found = measure(written(folder, sheet(values, (3, 3))), values.reshape(-1, 3), None, 0.01)["crossings"]
        expect("length of a crossing", found["length"], 2, 0.05)
        expect("place of a crossing", np.linalg.norm(found["place"][:2]), 0, 0.02)
        # Thin: the sides of a blade, 0.003 apart, are as far apart as a third of the tolerance.
        s = np.linspace(0, 2 * np.pi, 80)
        for name, ring in (
            ("a ring whose ends meet", np.column_stack([np.cos(s), np.sin(s)])),
            ("a thin blade", np.column_stack([np.cos(s), 0.0015 * np.sign(np.sin(s)) * np.abs(np.sin(s)) ** 0.3])),
        ):
            values = np.array([[(*p, z) for z in np.linspace(0, 2, 5)] for p in ring @ turn.T])
            found = measure(written(folder, sheet(values, (3, 3))), values.reshape(-1, 3), None, 0.01)["crossings"]
            expect(f"crossings of {name}", found["pairs"], 0, 0)


def check_holes(folder):
    """A hole in the scan, and one in the face."""
    points, triangles = grid((10, 10), (40, 40), height=0.5)
    middle = points[triangles].mean(axis=1)
    open_scan = triangles[~((np.abs(middle[:, 0] - 5) < 2) & (np.abs(middle[:, 1] - 5) < 1))]
    found = measure(written(folder, rectangle((10, 10))), points, open_scan, 1.0)
    expect("surface over a hole", found["coverage"]["surface_beyond_outline"], 0.08, 2e-3)
    expect("share within beside a hole", found["surface_to_scan"]["within"], 1, 1e-9)
    expect("largest distance beside a hole", found["surface_to_scan"]["max"], 0.5, 1e-6)
    circle = BRepBuilderAPI_MakeEdge(gp_Circ(gp_Ax2(gp_Pnt(5, 5, 0), gp_Dir(0, 0, -1)), 2.0)).Edge()
    face = BRepBuilderAPI_MakeFace(rectangle((10, 10)), BRepBuilderAPI_MakeWire(circle).Wire()).Face()
    surface = read_surface(written(folder, face), 1e-3, 10**6)
    expect("area of a face with a hole", facets.areas(surface.points, surface.triangles).sum(), 100 - 4 * np.pi, 0.05)
    rim = np.linalg.norm(surface.rim[:, 1] - surface.rim[:, 0], axis=1).sum()
    expect("rim of a face with a hole", rim, 40 + 4 * np.pi, 0.01)


def check_patches(folder):
    """Misses of a cloud and of a mesh that gather: 36 points of 1600 in one patch, 4 in another, which is too few."""
    points, triangles = grid((39, 39), (39, 39))
    number = np.arange(1600).reshape(40, 40)
    raised = points.copy()
    raised[np.concatenate([number[10:16, 20:26].ravel(), number[30:32, 5:7].ravel()]), 2] = 0.1
    step = written(folder, rectangle((39, 39)))
    found = measure(step, raised, None, 0.05)["gathered"]
    # Points on the outline have a larger spacing, and thereby weight.
    expect("largest patch of a cloud", found["largest"], 36 / 1600, 0.1 * 36 / 1600)
    expect("patches of a cloud", len(found["listed"]), 1, 0)
    expect("place of the patch", np.abs(np.array(found["listed"][0]["place"]) - (12.5, 22.5, 0.1)).max(), 1.25, 1.3)
    found = measure(step, raised, triangles, 0.02)["gathered"]
    # 5 x 5 cells, and what of those around is higher than the tolerance: four fifths, less half at two of the corners.
    expect("largest patch of a mesh", found["largest"], (25 + 4 * 5 * 0.8 + 4 * 0.6) / 39**2, 0.1 * 25 / 39**2)
    expect("patches of a mesh", len(found["listed"]), 2, 0)


def check_formats(folder):
    """One scan in every format."""
    points, triangles = grid((3, 2), (3, 2))
    points[:, 2] = np.arange(len(points)) * 0.5
    rows = [" ".join(map(repr, map(float, p))) for p in points]
    sides = [f"3 {a} {b} {c}" for a, b, c in triangles]
    counts = f"element vertex {len(points)}\nproperty {{}} x\nproperty {{}} y\nproperty uchar red\nproperty {{}} z\n"
    counts += f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    types = [(axis, "<f8") for axis in "xy"] + [("red", "u1"), ("z", "<f8")]
    vertices = np.zeros(len(points), dtype=types)
    for axis, values in zip("xyz", points.T):
        vertices[axis] = values
    listed = np.zeros(len(triangles), dtype=[("n", "u1"), ("corners", "<i4", 3)])
    listed["n"], listed["corners"] = 3, triangles
    binary = ("ply\nformat binary_little_endian 1.0\n" + counts.format(*["double"] * 3)).encode()
    coloured = [" ".join([*row.split()[:2], "7", row.split()[2]]) for row in rows]
    text = "ply\nformat ascii 1.0\n" + counts.format(*["double"] * 3) + "\n".join(coloured + sides)
    # Heights: two rows of three columns, the northern one first, one cell without data.
    heights = "ncols 3\nnrows 2\nxllcorner 10\nyllcorner 20\ncellsize 2\nNODATA_value -9999\n4 5 -9999\n1 2 3\n"
    matrix = " ".join(map(repr, map(float, points.T.ravel())))
    files = {
        "a.off": ("\n".join(["OFF", f"{len(points)} {len(triangles)} 0", *rows, *sides]), True),
        "a.obj": (
            "\n".join([*(f"v {r}" for r in rows), *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles)]),
            True,
        ),
        "text.ply": (text, True),
        "binary.ply": (binary + vertices.tobytes() + listed.tobytes(), True),
        "a.xyz": ("\n".join(rows), False),
        "a.csv": ("\n".join(["id,z,Y,x", *(f"{k},{p[2]},{p[1]},{p[0]}" for k, p in enumerate(points))]), False),
        "a.xml": (f'<xml><Matrix rows="3" cols="{len(points)}" id="1">{matrix}</Matrix></xml>', False),
    }
    for name, (content, is_mesh) in files.items():
        path = Path(folder) / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        found, corners = read_scan(path)
        expect(f"points of {name}", np.abs(found - points).max(), 0, 1e-12)
        if (corners is not None) != is_mesh or (is_mesh and (corners != triangles).any()):
            sys.exit(f"FAILED: triangles of {name}")
    path = Path(folder) / "a.asc"
    path.write_text(heights)
    right = [(11, 23, 4), (13, 23, 5), (11, 21, 1), (13, 21, 2), (15, 21, 3)]
    expect("heights", np.abs(read_scan(path)[0] - right).max(), 0, 1e-12)
    path.write_text("# 1 2\n9 1 2 3\n8 4 5 6\n")
    expect("columns by number", np.abs(read_scan(path, "txt", ["1", "2", "3"])[0] - [(1, 2, 3), (4, 5, 6)]).max(), 0, 0)


def main():
    # Open CASCADE tells of each file that it writes.
    Message.DefaultMessenger_s().ChangePrinters().Clear()
    with tempfile.TemporaryDirectory() as folder:
        checks = (
            check_formats,
            check_planes,
            check_sphere,
            check_folded_tube,
            check_crossings,
            check_holes,
            check_patches,
        )
        for check in checks:
            check(folder)
            print(f"measure_step.py: {check.__name__[6:].replace('_', ' ')} as planted")


if __name__ == "__main__":
    main()
