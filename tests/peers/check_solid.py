#!/usr/bin/env python3
"""Opens a STEP file with Open CASCADE (packages cadquery-ocp, libigl) and measures it as a solid against the mesh it was made of.

Usage: check_solid.py MODEL.step MESH [--smooth] [--crease DEGREES] [--json OUT.json] [--open] [--angle-max A] [--within SHARE TOL]

Knows nothing of how the file was made. Printed, and written as JSON, are
- valid (BRepCheck_Analyzer), solids, free edges, edges of more than two faces, faces, control points of all faces (poles),
  knots inside faces, largest tolerance, genus by Euler's formula (every edge and vertex counted once), seconds;
- volume against the mesh's;
- angles, in degrees, between the oriented normals of the two faces at 21 points of each edge, ends included; edges are smooth
  unless they lie, at all of these points, within 0.3 % of the diagonal of edges of the mesh that are sharper than --crease;
- folds: places, of 5 x 5 in each Bezier element, at which the face's oriented normal turns by more than 90 degrees from that of
  the mesh's nearest facet (of several about as near the one that agrees best);
- distances by area both ways, in % of the diagonal: of points of the mesh from the solid's fine triangulation, and of points of
  the faces from the mesh.
Exits with 1 if the shape is not valid, is not one solid (--open: one shell), has free edges (unless --open), or folds.
"""

import argparse
import json
import sys
import time

import igl
import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.GeomAbs import GeomAbs_SurfaceType
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_RetDone
from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_SHELL, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS
from OCP.gp import gp_Pnt, gp_Vec
from scipy.spatial import cKDTree

PLACES = 21
FOLDS = 5
NEAR_CREASE = 0.003
# Facets that are by this share of the diagonal farther away than the nearest: at creases the wrong side may be the nearest.
AS_NEAR = 5e-4


def cast(kind):
    return getattr(TopoDS, kind + "_s", None) or getattr(TopoDS, kind)


AS_EDGE, AS_FACE = cast("Edge"), cast("Face")


def xyz(point):
    return np.array([point.X(), point.Y(), point.Z()])


def load(path):
    reader = STEPControl_Reader()
    if reader.ReadFile(path) != IFSelect_RetDone or reader.TransferRoots() < 1:
        sys.exit(f"FAILED: {path} cannot be read")
    return reader.OneShape()


def explore(shape, kind):
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def different(shapes):
    """Shapes with all their occurrences, those that are the same but for orientation together."""
    buckets = {}
    for shape in shapes:
        bucket = buckets.setdefault(hash(shape.Oriented(TopAbs_FORWARD)), [])
        known = next((entry for entry in bucket if entry[0].IsSame(shape)), None)
        if known is None:
            bucket.append((shape, [shape]))
        else:
            known[1].append(shape)
    return [entry for bucket in buckets.values() for entry in bucket]


def count(shape, kind):
    return len(different(explore(shape, kind)))


def faces_of(shape):
    return [AS_FACE(face) for face in explore(shape, TopAbs_FACE)]


def jet(surface, reverse, u, v):
    """Point and oriented unit normal of a face."""
    point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    surface.D1(float(u), float(v), point, du, dv)
    normal = np.cross(xyz(du), xyz(dv)) * (-1.0 if reverse else 1.0)
    return xyz(point), normal / max(np.linalg.norm(normal), 1e-300)


def edges_with_faces(shape):
    """Each edge with the faces that use it, once for each use."""
    uses, owner = [], {}
    for face in faces_of(shape):
        for edge in explore(face, TopAbs_EDGE):
            uses.append(edge)
            owner[len(uses) - 1] = face
    numbers = {id(edge): number for number, edge in enumerate(uses)}
    for edge, occurrences in different(uses):
        if not BRep_Tool.Degenerated_s(AS_EDGE(edge)):
            yield AS_EDGE(edge), [owner[numbers[id(use)]] for use in occurrences]


def edge_angles(edge, faces):
    """Points along an edge, and angles between the oriented normals of its two faces."""
    sides = []
    for face in faces:
        curve, surface = BRepAdaptor_Curve2d(edge, face), BRepAdaptor_Surface(face, False)
        parameters = np.linspace(curve.FirstParameter(), curve.LastParameter(), PLACES)
        places = [curve.Value(float(t)) for t in parameters]
        reverse = face.Orientation() == TopAbs_REVERSED
        sides.append([jet(surface, reverse, place.X(), place.Y()) for place in places])
    angles = [
        np.degrees(np.arctan2(np.linalg.norm(np.cross(a[1], b[1])), a[1] @ b[1])) for a, b in zip(sides[0], sides[1])
    ]
    gap = max(np.linalg.norm(a[0] - b[0]) for a, b in zip(sides[0], sides[1]))
    return np.array([a[0] for a in sides[0]]), np.array(angles), gap


class Mesh:
    """Triangles whose vertices in one place are one vertex."""

    def __init__(self, vertices, triangles):
        self.vertices, places = np.unique(np.round(vertices, 12), axis=0, return_inverse=True)
        triangles = places.reshape(-1)[triangles]
        corners = self.vertices[triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1)
        self.triangles, self.areas = triangles[lengths > 0], 0.5 * lengths[lengths > 0]
        self.normals = normals[lengths > 0] / lengths[lengths > 0][:, None]
        self.corners = self.vertices[self.triangles]
        self.diagonal = np.linalg.norm(np.ptp(self.vertices, axis=0))
        a, b, c = self.corners.transpose(1, 0, 2)
        self.volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0

    @classmethod
    def read(cls, path):
        if path.endswith(".off"):
            with open(path, encoding="utf-8") as lines:
                words = " ".join(line.split("#")[0] for line in lines).replace("OFF", "", 1).split()
            n, m = int(words[0]), int(words[1])
            vertices = np.array(words[3 : 3 + 3 * n], dtype=float).reshape(n, 3)
            triangles, at = [], 3 + 3 * n
            for _ in range(m):
                k = int(words[at])
                face = [int(v) for v in words[at + 1 : at + 1 + k]]
                triangles += [[face[0], face[i], face[i + 1]] for i in range(1, k - 1)]
                at += 1 + k
            return cls(vertices, np.array(triangles))
        vertices, triangles = igl.read_triangle_mesh(path)
        return cls(vertices, triangles)

    def edges(self):
        """The ends of each edge with two facets, and the facets."""
        ends = np.sort(self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        facets = np.repeat(np.arange(len(self.triangles)), 3)
        order = np.lexsort(ends.T)
        ends, facets = ends[order], facets[order]
        same = np.flatnonzero(np.all(ends[1:] == ends[:-1], axis=1))
        return ends[same], np.stack([facets[same], facets[same + 1]], axis=1)

    def sagittas(self, degrees):
        """How far a smooth surface would bulge over each facet, from the angles below `degrees` to its neighbours."""
        ends, facets = self.edges()
        a, b = self.normals[facets[:, 0]], self.normals[facets[:, 1]]
        angles = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
        lengths = np.linalg.norm(self.vertices[ends[:, 0]] - self.vertices[ends[:, 1]], axis=1)
        widths = 2.0 * self.areas[facets].min(axis=1) / np.maximum(lengths, 1e-300)
        bulges = np.where(angles < np.radians(degrees), widths * angles / 8.0, 0.0)
        result = np.zeros(len(self.triangles))
        for side in range(2):
            np.maximum.at(result, facets[:, side], bulges)
        return result

    def euler(self):
        ends = np.sort(self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        return len(np.unique(self.triangles)) - len(np.unique(ends, axis=0)) + len(self.triangles)

    def nearest(self, points):
        """Distances of points, nearest facets, and nearest points."""
        squares, facets, nearest = igl.point_mesh_squared_distance(points, self.vertices, self.triangles)
        return np.sqrt(squares), facets, nearest

    def samples(self, count):
        """Points spread over the area, with the area that each stands for."""
        parts = np.clip(np.ceil(np.sqrt(self.areas / (self.areas.sum() / count))).astype(int), 1, 60)
        points, weights = [], []
        for (a, b, c), area, k in zip(self.corners, self.areas, parts):
            i, j = np.meshgrid(np.arange(k), np.arange(k))
            lower = np.stack([i, j], axis=-1)[i + j < k] + 1 / 3
            upper = np.stack([i, j], axis=-1)[i + j < k - 1] + 2 / 3
            w = np.concatenate([lower, upper]) / k
            points.append(a + w[:, :1] * (b - a) + w[:, 1:] * (c - a))
            weights.append(np.full(len(w), area / len(w)))
        return np.concatenate(points), np.concatenate(weights)


def crease_points(mesh, degrees):
    """Points along the sharp edges of the mesh, as close to one another as a tenth of the limit."""
    ends, facets = mesh.edges()
    a, b = mesh.normals[facets[:, 0]], mesh.normals[facets[:, 1]]
    angles = np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b)))
    ends = mesh.vertices[ends[angles > degrees]]
    step = 0.1 * NEAR_CREASE * mesh.diagonal
    points = [a + np.linspace(0, 1, max(2, int(np.linalg.norm(b - a) / step) + 2))[:, None] * (b - a) for a, b in ends]
    return np.concatenate(points) if points else np.zeros((0, 3))


def elements(surface):
    """Knot spans of a face, in both directions."""
    if surface.GetType() != GeomAbs_SurfaceType.GeomAbs_BSplineSurface:
        ends = surface.FirstUParameter(), surface.LastUParameter(), surface.FirstVParameter(), surface.LastVParameter()
        return np.array(ends[:2]), np.array(ends[2:]), 0
    spline = surface.BSpline()
    u = np.array([spline.UKnot(i) for i in range(1, spline.NbUKnots() + 1)])
    v = np.array([spline.VKnot(i) for i in range(1, spline.NbVKnots() + 1)])
    return u, v, spline.NbUPoles() * spline.NbVPoles()


def sample_faces(faces):
    """Points, oriented normals and areas at FOLDS x FOLDS places of each Bezier element, and the number of poles."""
    points, normals, areas, of_face, poles = [], [], [], [], 0
    inside = np.linspace(1e-3, 1 - 1e-3, FOLDS)
    for number, face in enumerate(faces):
        surface = BRepAdaptor_Surface(face, False)
        reverse = face.Orientation() == TopAbs_REVERSED
        us, vs, own = elements(surface)
        poles += own
        for u0, u1 in zip(us, us[1:]):
            for v0, v1 in zip(vs, vs[1:]):
                for s in inside:
                    for t in inside:
                        u, v = u0 + s * (u1 - u0), v0 + t * (v1 - v0)
                        point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
                        surface.D1(float(u), float(v), point, du, dv)
                        normal = np.cross(xyz(du), xyz(dv)) * (-1.0 if reverse else 1.0)
                        points.append(xyz(point))
                        normals.append(normal)
                        areas.append(np.linalg.norm(normal) * (u1 - u0) * (v1 - v0) / FOLDS**2)
                        of_face.append(number)
    return np.array(points), np.array(normals), np.array(areas), np.array(of_face), poles


def count_folds(mesh, points, normals, of_face, crease):
    """Places whose normal turns by more than 90 degrees from all facets that are about as near as the nearest one. A facet that stands
    for something round is as near as a surface that bulges over it."""
    distances, nearest, _ = mesh.nearest(points)
    sagittas = mesh.sagittas(crease)
    folded = []
    for k in np.flatnonzero(np.einsum("ij,ij->i", normals, mesh.normals[nearest]) <= 0):
        reach = distances[k] + AS_NEAR * mesh.diagonal + sagittas
        boxes = np.stack([mesh.corners.min(axis=1) - reach[:, None], mesh.corners.max(axis=1) + reach[:, None]])
        near = np.flatnonzero(np.all((points[k] >= boxes[0]) & (points[k] <= boxes[1]), axis=1))
        near = [
            facet
            for facet in near
            if igl.point_mesh_squared_distance(points[k : k + 1], mesh.vertices, mesh.triangles[facet : facet + 1])[0]
            <= reach[facet] ** 2
        ]
        if np.all(mesh.normals[near] @ normals[k] <= 0):
            folded.append(of_face[k])
    return len(folded), len(set(folded)), distances


def triangulate(shape, deflection):
    BRepMesh_IncrementalMesh(shape, deflection, False, 0.2, True)
    vertices, triangles, first = [], [], 0
    for face in faces_of(shape):
        location = TopLoc_Location()
        mesh = BRep_Tool.Triangulation_s(face, location)
        if mesh is None:
            continue
        moved = location.Transformation()
        vertices += [xyz(mesh.Node(i).Transformed(moved)) for i in range(1, mesh.NbNodes() + 1)]
        flip = face.Orientation() == TopAbs_REVERSED
        for i in range(1, mesh.NbTriangles() + 1):
            a, b, c = mesh.Triangle(i).Get()
            triangles.append([first + k - 1 for k in ((a, c, b) if flip else (a, b, c))])
        first = len(vertices)
    return Mesh(np.array(vertices), np.array(triangles))


def by_area(distances, weights):
    order = np.argsort(distances)
    summed = np.cumsum(weights[order]) / weights.sum()
    return {
        "rms": float(np.sqrt((weights * distances**2).sum() / weights.sum())),
        "p99": float(distances[order][np.searchsorted(summed, 0.99)]),
        "max": float(distances.max()),
        "within_0.3%": float(weights[distances <= 0.3].sum() / weights.sum()),
    }


def measure(path, mesh, crease):
    start = time.time()
    shape = load(path)
    result = {"valid": BRepCheck_Analyzer(shape).IsValid()}
    for name, kind in (("solids", TopAbs_SOLID), ("shells", TopAbs_SHELL), ("faces", TopAbs_FACE), ("edges", TopAbs_EDGE)):
        result[name] = count(shape, kind)
    euler = count(shape, TopAbs_VERTEX) - result["edges"] + result["faces"]
    result["genus"], result["mesh_genus"] = (2 - euler) / 2, (2 - mesh.euler()) / 2
    result["largest_tolerance_%"] = 100 * ShapeAnalysis_ShapeTolerance().Tolerance(shape, 1) / mesh.diagonal

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    result["volume_error_%"] = 100 * (properties.Mass() / mesh.volume - 1)

    creases = crease_points(mesh, crease)
    tree = None
    if len(creases):
        tree = cKDTree(creases)
    free, many, smooth, at_ends, sharp, gaps = 0, 0, [], [], 0, [0.0]
    for edge, faces in edges_with_faces(shape):
        if len(faces) != 2:
            free, many = free + (len(faces) < 2), many + (len(faces) > 2)
            continue
        points, angles, gap = edge_angles(edge, faces)
        gaps.append(gap)
        if tree is not None and np.all(tree.query(points)[0] <= NEAR_CREASE * mesh.diagonal):
            sharp += 1
            continue
        smooth.append(angles)
        at_ends += [angles[0], angles[-1]]
    smooth = np.concatenate(smooth) if smooth else np.zeros(1)
    result |= {"free_edges": free, "edges_of_many": many, "sharp_edges": sharp}
    result["angle_max"], result["angle_p99"] = float(smooth.max()), float(np.quantile(smooth, 0.99))
    result["angle_at_vertices"] = float(max(at_ends, default=0.0))
    result["gap_%"] = 100 * max(gaps) / mesh.diagonal

    faces = faces_of(shape)
    points, normals, areas, of_face, result["poles"] = sample_faces(faces)
    result["folds"], result["folded_faces"], away = count_folds(mesh, points, normals, of_face, crease)
    result["surface_to_mesh_%"] = by_area(100 * away / mesh.diagonal, areas)

    fine = triangulate(shape, 2e-5 * mesh.diagonal)
    samples, weights = mesh.samples(30000)
    result["mesh_to_surface_%"] = by_area(100 * fine.nearest(samples)[0] / mesh.diagonal, weights)
    result["seconds"] = time.time() - start
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("mesh")
    parser.add_argument("--crease", type=float, default=40.0, help="angle from which on edges of the mesh are sharp")
    parser.add_argument("--smooth", action="store_true", help="the mesh has no creases")
    parser.add_argument("--open", action="store_true", help="an open shell is expected")
    parser.add_argument("--json", help="file for the figures")
    options = parser.parse_args()
    mesh = Mesh.read(options.mesh)
    result = measure(options.model, mesh, 181.0 if options.smooth else options.crease)
    text = json.dumps(result, indent=1, default=float)
    print(text)
    if options.json:
        with open(options.json, "w", encoding="utf-8") as out:
            out.write(text + "\n")
    whole = result["shells"] == 1 if options.open else result["solids"] == 1 and result["free_edges"] == 0
    if not (result["valid"] and whole and result["edges_of_many"] == 0 and result["folds"] == 0):
        sys.exit("FAILED: not one valid solid without free edges and folds")


if __name__ == "__main__":
    main()
