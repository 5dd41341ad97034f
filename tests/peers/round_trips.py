#!/usr/bin/env python3
"""Writes a bent sheet with other people's libraries, in all formats and dialects that they know, and reads it with thb.

Usage: round_trips.py THB        THB is the program; packages of round_trips.txt

Of each file `thb info` has to tell the numbers of points and triangles, and the box; `thb param` has to give the same points, row for
row, to the precision in which the library wrote them. Exits with 1 at the first file that differs.
"""

import csv
import gzip
import json
import pathlib
import subprocess
import sys
import tempfile
import zipfile

import laspy
import meshio
import numpy as np
import plyfile
import pye57
import pypcd4
import rasterio
import trimesh

SINGLE, DOUBLE = 1e-6, 1e-12


def sheet(columns=13, rows=9):
    """Points in rows, and triangles over them."""
    i, j = np.meshgrid(np.arange(columns), np.arange(rows))
    x, y = 5.0 * i.ravel(), 5.0 * j.ravel()
    points = np.column_stack([x, y, 4 * np.sin(x / 15) + 2 * np.cos(y / 12) + 0.01 * x * y])
    corner = (np.arange(columns - 1) + columns * np.arange(rows - 1)[:, None]).ravel()
    a, b, c, d = corner, corner + 1, corner + columns + 1, corner + columns
    return points, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


POINTS, TRIANGLES = sheet()


def of_trimesh(path, **options):
    trimesh.Trimesh(POINTS, TRIANGLES, process=False).export(path, **options)


def cloud_of_trimesh(path):
    trimesh.PointCloud(POINTS).export(path)


def moved_scene(path):
    """A scene whose node puts the sheet elsewhere: exact in single precision."""
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.Trimesh(POINTS - [64, -32, 8], TRIANGLES, process=False), transform=shift(64, -32, 8))
    scene.export(path)


def shift(x, y, z):
    matrix = np.eye(4)
    matrix[:3, 3] = [x, y, z]
    return matrix


def of_meshio(path, **options):
    meshio.Mesh(POINTS, [("triangle", TRIANGLES)]).write(path, **options)


def of_plyfile(path, text, order, kind="f8"):
    vertices = np.array([tuple(p) for p in POINTS], dtype=[(axis, kind) for axis in "xyz"])
    faces = np.empty(len(TRIANGLES), dtype=[("vertex_indices", "i4", (3,)), ("quality", "f4")])
    faces["vertex_indices"], faces["quality"] = TRIANGLES, 1
    elements = [plyfile.PlyElement.describe(vertices, "vertex"), plyfile.PlyElement.describe(faces, "face")]
    plyfile.PlyData(elements, text=text, byte_order=order).write(path)


def of_pypcd4(path, encoding, nan=False):
    points = POINTS.astype(np.float32)
    if nan:
        points[nan] = np.nan
    cloud = pypcd4.PointCloud.from_xyz_points(points)
    cloud.save(path, encoding=getattr(pypcd4.Encoding, encoding))


def of_laspy(path, version, point_format, crs=None):
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.offsets, header.scales = [0, 0, -10], [1e-4] * 3
    header.add_extra_dim(laspy.ExtraBytesParams("deviation", "f4"))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = POINTS.T
    cloud.write(path)


def of_pye57(path, rotation=None):
    file = pye57.E57(path, mode="w")
    data = {f"cartesian{axis}": POINTS[:, k].copy() for k, axis in enumerate("XYZ")}
    # w, x, y, z: half a turn about z, which the points are turned back by before.
    if rotation is not None:
        data["cartesianX"], data["cartesianY"] = -data["cartesianX"], -data["cartesianY"]
        file.write_scan_raw(data, rotation=np.array(rotation), translation=np.zeros(3))
    else:
        file.write_scan_raw(data)
    file.close()


def of_rasterio(path, kind="float64", north=True, blind=(), **options):
    """The heights as a raster whose first line is the northern one, or the southern."""
    heights = POINTS[:, 2].copy()
    heights[list(blind)] = options.get("nodata", 0)
    heights = heights.reshape(9, 13)
    step, top = (-5.0, 42.5) if north else (5.0, -2.5)
    place = rasterio.Affine(5.0, 0.0, -2.5, 0.0, step, top)
    shape = {"width": 13, "height": 9, "count": 1, "dtype": kind, "transform": place}
    with rasterio.open(path, "w", driver="GTiff", **shape, **options) as out:
        out.write((heights[::-1] if north else heights).astype(kind), 1)


def packed(path, inner, write):
    """A file of a name, written and then compressed by gzip or put into a zip archive."""
    with tempfile.TemporaryDirectory() as folder:
        plain = pathlib.Path(folder) / inner
        write(str(plain))
        if path.endswith(".zip"):
            with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
                archive.write(plain, inner)
                archive.writestr("read me.txt", "about the scan")
        else:
            with gzip.open(path, "wb") as out:
                out.write(plain.read_bytes())


# Name, how it is written, tolerance, whether it has triangles (or begins with its northern row), and rows left out.
BLIND = [0, 5, 64, 116]
TILES = {"tiled": True, "blockxsize": 16, "blockysize": 16}
CASES = [
    ("trimesh.ply", of_trimesh, SINGLE, True),
    ("trimesh_text.ply", lambda p: of_trimesh(p, encoding="ascii"), 1e-7, True),
    ("trimesh_cloud.ply", cloud_of_trimesh, SINGLE, False),
    ("trimesh.obj", of_trimesh, 1e-7, True),
    ("trimesh.off", of_trimesh, 1e-7, True),
    ("trimesh.stl", of_trimesh, SINGLE, "soup"),
    ("trimesh_text.stl", lambda p: of_trimesh(p, file_type="stl_ascii"), 1e-7, "soup"),
    ("trimesh.glb", of_trimesh, SINGLE, True),
    ("trimesh_moved.glb", moved_scene, 4e-6, True),
    ("trimesh.3mf", of_trimesh, 1e-7, True),
    ("trimesh_moved.3mf", moved_scene, 4e-6, True),
    ("meshio.ply", of_meshio, DOUBLE, True),
    ("meshio_text.ply", lambda p: of_meshio(p, binary=False), DOUBLE, True),
    ("meshio.obj", of_meshio, 1e-7, True),
    ("meshio.off", of_meshio, 1e-7, True),
    ("meshio.stl", of_meshio, SINGLE, "soup"),
    ("meshio_binary.stl", lambda p: of_meshio(p, binary=True), SINGLE, "soup"),
    ("plyfile_text.ply", lambda p: of_plyfile(p, True, "="), 1e-7, True),
    ("plyfile_little.ply", lambda p: of_plyfile(p, False, "<"), DOUBLE, True),
    ("plyfile_big.ply", lambda p: of_plyfile(p, False, ">"), DOUBLE, True),
    ("plyfile_single.ply", lambda p: of_plyfile(p, False, "<", "f4"), SINGLE, True),
    ("pypcd4_text.pcd", lambda p: of_pypcd4(p, "ASCII"), SINGLE, False),
    ("pypcd4_binary.pcd", lambda p: of_pypcd4(p, "BINARY"), SINGLE, False),
    ("pypcd4_compressed.pcd", lambda p: of_pypcd4(p, "BINARY_COMPRESSED"), SINGLE, False),
    ("pypcd4_blind.pcd", lambda p: of_pypcd4(p, "BINARY", BLIND), SINGLE, False, BLIND),
    *[
        (f"laspy_{version}_{kind}.{end}".replace(".", "_", 1), lambda p, v=version, k=kind: of_laspy(p, v, k), 1e-4, False)
        for end in ["las", "laz"]
        for version, kind in [("1.2", 0), ("1.2", 3), ("1.4", 6), ("1.4", 7)]
    ],
    ("pye57.e57", of_pye57, SINGLE, False),
    ("pye57_turned.e57", lambda p: of_pye57(p, [0.0, 0.0, 0.0, 1.0]), SINGLE, False),
    ("rasterio.tif", of_rasterio, DOUBLE, "north"),
    ("rasterio_south.tif", lambda p: of_rasterio(p, north=False), DOUBLE, False),
    ("rasterio_single.tif", lambda p: of_rasterio(p, "float32", crs="EPSG:25832"), SINGLE, "north"),
    ("rasterio_whole.tif", lambda p: of_rasterio(p, "int16"), 0.02, "north"),
    *[
        (f"rasterio_{name}_{predictor}.tif", lambda p, c=name, k=predictor: of_rasterio(p, "float32", compress=c, predictor=k), SINGLE, "north")
        for name in ["deflate", "lzw"]
        for predictor in [1, 3]
    ],
    ("rasterio_tiles.tif", lambda p: of_rasterio(p, compress="deflate", **TILES), DOUBLE, "north"),
    ("rasterio_big.tif", lambda p: of_rasterio(p, BIGTIFF="YES", crs="EPSG:25832"), DOUBLE, "north"),
    ("rasterio_blind.tif", lambda p: of_rasterio(p, "float32", blind=BLIND, nodata=-9999.0, north=False), SINGLE, False, BLIND),
    ("rasterio_nan.tif", lambda p: of_rasterio(p, blind=BLIND, nodata=float("nan"), north=False), DOUBLE, False, BLIND),
    ("zipped.zip", lambda p: packed(p, "sheet.stl", of_trimesh), SINGLE, "soup"),
    ("zipped.ply.gz", lambda p: packed(p, "sheet.ply", of_trimesh), SINGLE, True),
]


def run(thb, *arguments):
    done = subprocess.run([thb, *arguments], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"FAILED: thb {' '.join(arguments)}: {done.stderr}")
    return done.stdout


def check(thb, folder, name, write, tolerance, mesh, blind=()):
    path = str(folder / name)
    write(path)
    info = json.loads(run(thb, "info", path))
    kept = np.delete(np.arange(len(POINTS)), list(blind))
    points = POINTS[TRIANGLES].reshape(-1, 3) if mesh == "soup" else POINTS
    if mesh == "north":
        points, mesh = POINTS.reshape(9, 13, 3)[::-1].reshape(-1, 3), False
    found = {"points": info["points"], "triangles": info["triangles"]}
    expected = {"points": len(points) - len(blind), "triangles": len(TRIANGLES) if mesh else None}
    if found != expected:
        sys.exit(f"FAILED: {name}: {found}, not {expected}")
    size = np.abs(POINTS).max()
    box = np.abs(np.array(info["bounds"]) - [POINTS[kept].min(axis=0), POINTS[kept].max(axis=0)]).max() / size
    if box > tolerance:
        sys.exit(f"FAILED: {name}: the box is off by {box:.1e} of its size")
    out = str(folder / "uv.csv")
    run(thb, "param", path, "-o", out, "--clean", "none", "--report", str(folder / "report.json"))
    with open(out) as table:
        rows = list(csv.DictReader(table))
    if len(rows) != len(kept):
        sys.exit(f"FAILED: {name}: {len(rows)} of {len(kept)} points are laid out")
    off = max(abs(float(row[axis]) - points[int(row["row"])][k]) for row in rows for k, axis in enumerate("xyz")) / size
    if off > tolerance:
        sys.exit(f"FAILED: {name}: points are off by {off:.1e} of the size")
    print(f"{name}: {info['format']}, {info['points']} points, off by {off:.1e}")


def main():
    thb = sys.argv[1]
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            check(thb, pathlib.Path(folder), *case)
    print(f"{len(CASES)} files of other libraries: passed")


if __name__ == "__main__":
    main()
