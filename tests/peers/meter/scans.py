"""Reads scans: points, and triangles where the file has some."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import igl
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

MESHES = {"off", "obj", "ply", "stl"}
TABLES = {"xyz", "txt", "csv", "pts", "dat"}
FORMATS = sorted(MESHES | TABLES | {"asc", "xml"})


def read_scan(path, kind=None, columns=None):
    """Points (m, 3) and triangles (n, 3), or None for a cloud.

    `kind` is one of FORMATS where the extension does not say it; `columns` are the three columns of a table that hold
    the coordinates, by name or by number from 0.
    """
    kind = kind or Path(path).suffix[1:].lower()
    if kind in MESHES:
        return read_mesh(path, kind)
    if kind == "asc":
        return read_height_field(path), None
    if kind == "xml":
        return read_gismo(path), None
    if kind in TABLES:
        return read_table(path, columns), None
    raise ValueError(f"{path}: none of the formats {', '.join(FORMATS)}")


def read_mesh(path, kind):
    """A mesh file; the corners of STL triangles that have the same coordinates become one vertex."""
    if kind == "off":
        points, triangles = read_off(path)
    elif kind == "ply":
        points, triangles = read_ply(path)
    else:
        points, triangles = igl.read_triangle_mesh(str(path))
    if kind == "stl":
        points, number = np.unique(points, axis=0, return_inverse=True)
        triangles = number.reshape(-1)[triangles]
    # Two corners at one vertex make no triangle.
    a, b, c = triangles.T if len(triangles) else np.zeros((3, 0), dtype=int)
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    return np.ascontiguousarray(points, dtype=float), np.ascontiguousarray(triangles, dtype=np.int64) if len(
        triangles
    ) else None


def largest_piece(points, triangles):
    """The triangles of the connected piece with the largest area; triangles are connected by vertices."""
    links = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(links)), links.T), shape=(len(points), len(points)))
    _, piece = connected_components(graph, directed=False)
    of_triangle = piece[triangles[:, 0]]
    a, b, c = (points[triangles[:, k]] for k in range(3))
    areas = np.bincount(of_triangle, np.linalg.norm(np.cross(b - a, c - a), axis=1))
    return triangles[of_triangle == areas.argmax()]


def fans(polygons):
    """Triangles of polygons, each cut from its first corner."""
    return np.array([(p[0], p[k], p[k + 1]) for p in polygons for k in range(1, len(p) - 1)], dtype=np.int64).reshape(
        -1, 3
    )


def read_off(path):
    """An OFF file without colours before the coordinates."""
    lines = [line.split("#")[0].split() for line in Path(path).read_text().splitlines()]
    lines = [line for line in lines if line]
    if lines[0][0].upper() == "OFF":
        lines[0] = lines[0][1:]
    lines = lines[0 if lines[0] else 1 :]
    vertices, faces = int(lines[0][0]), int(lines[0][1])
    points = np.array([line[:3] for line in lines[1 : 1 + vertices]], dtype=float)
    return points, fans(
        [[int(k) for k in line[1 : 1 + int(line[0])]] for line in lines[1 + vertices : 1 + vertices + faces]]
    )


PLY_TYPES = {
    **dict(char="i1", uchar="u1", short="i2", ushort="u2", int="i4", uint="u4", float="f4", double="f8"),
    **dict(int8="i1", uint8="u1", int16="i2", uint16="u2", int32="i4", uint32="u4", float32="f4", float64="f8"),
}


def read_ply(path):
    """A PLY file, in text or binary, whose vertices have no lists and whose faces have one list, all of triangles if
    binary."""
    data = Path(path).read_bytes()
    head, _, body = data.partition(b"end_header")
    body = body[body.index(b"\n") + 1 :]
    encoding, elements = None, []
    for line in head.decode("latin-1").splitlines():
        words = line.split()
        if words[:1] == ["format"]:
            encoding = words[1]
        elif words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            elements[-1][2].append(words[1:])
    if encoding == "ascii":
        lines = body.decode("latin-1").splitlines()
        rows = iter(line.split() for line in lines if line.strip())
        table = {name: [next(rows) for _ in range(count)] for name, count, _ in elements}
        places = [[words[-1] for words in properties] for name, _, properties in elements if name == "vertex"][0]
        take = [places.index(axis) for axis in "xyz"]
        points = np.array([[row[k] for k in take] for row in table["vertex"]], dtype=float)
        return points, fans([[int(k) for k in row[1 : 1 + int(row[0])]] for row in table.get("face", [])])
    order, points, triangles, at = "<" if "little" in encoding else ">", None, np.zeros((0, 3), dtype=np.int64), 0
    for name, count, properties in elements:
        fields = []
        for words in properties:
            if words[0] == "list":
                fields += [
                    (f"{words[-1]} size", order + PLY_TYPES[words[1]]),
                    (words[-1], order + PLY_TYPES[words[2]], 3),
                ]
            else:
                fields.append((words[-1], order + PLY_TYPES[words[0]]))
        rows = np.frombuffer(body, dtype=np.dtype(fields), count=count, offset=at)
        at += rows.nbytes
        if name == "vertex":
            points = np.column_stack([rows[axis] for axis in "xyz"]).astype(float)
        elif name == "face":
            listed = next(words[-1] for words in properties if words[0] == "list")
            if count and not (rows[f"{listed} size"] == 3).all():
                raise ValueError(f"{path}: a face is no triangle")
            triangles = rows[listed].astype(np.int64)
    return points, triangles


def read_table(path, columns):
    """Rows of numbers, separated by commas, semicolons or blanks. The columns are those asked for, else those named x,
    y, z in the first line, else the first three. Lines that are no such rows are left out."""
    take, rows = [0, 1, 2], []
    wanted = {str(name).lower() for name in columns or "xyz"}
    if columns and all(name.isdigit() for name in wanted):
        take, wanted = [int(k) for k in columns], {"no name"}
    with open(path, encoding="utf-8-sig", errors="replace") as lines:
        for line in lines:
            words = line.replace(",", " ").replace(";", " ").split()
            names = [word.lower() for word in words]
            if not rows and wanted <= set(names):
                take = [names.index(str(name).lower()) for name in columns or "xyz"]
                continue
            try:
                rows.append([float(words[k]) for k in take])
            except (ValueError, IndexError):
                continue
    points = np.array(rows, dtype=float).reshape(-1, 3)
    return points[np.isfinite(points).all(axis=1)]


def read_height_field(path):
    """An ESRI ASCII grid: the centres of the cells that have data."""
    head, values = {}, []
    for line in Path(path).read_text().splitlines():
        words = line.split()
        if words and not values and words[0][0].isalpha() and words[0].lower() != "nan":
            head[words[0].lower()] = float(words[1])
        else:
            values.extend(words)
    columns, rows = int(head["ncols"]), int(head["nrows"])
    heights = np.array(values, dtype=float).reshape(rows, columns)
    axes = []
    for axis, count in (("x", columns), ("y", rows)):
        step = head.get("cellsize", head.get("d" + axis))
        corner = f"{axis}llcorner" in head
        axes.append(head[f"{axis}llcorner" if corner else f"{axis}llcenter"] + step * (np.arange(count) + 0.5 * corner))
    x, y = np.meshgrid(axes[0], axes[1][::-1])
    known = np.isfinite(heights) & (heights != head.get("nodata_value", -9999.0))
    return np.column_stack([x[known], y[known], heights[known]])


def read_gismo(path):
    """The points of a G+Smo file: matrix 1, a column or a row each."""
    matrix = next(m for m in ElementTree.parse(path).iter("Matrix") if m.get("id", "").strip() == "1")
    values = np.array(matrix.text.split(), dtype=float).reshape(int(matrix.get("rows")), int(matrix.get("cols")))
    return np.ascontiguousarray(values.T if values.shape[0] == 3 else values)
