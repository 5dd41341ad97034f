#!/usr/bin/env python3
"""Opens a STEP file with Open CASCADE (packages cadquery-ocp, libigl) and measures it as a solid against the mesh it was made of.

Usage: check_solid.py MODEL.step MESH [--smooth | --crease DEGREES | --creases FILE] [--json OUT.json] [--open]

Knows nothing of how the file was made. Creases of the mesh are its edges above --crease, those of FILE (two vertices a line), or
none (--smooth). Printed, and written as JSON, are
- valid (BRepCheck_Analyzer), solids, free edges, edges of more than two faces, faces, control points of all faces (poles),
  knots inside faces, largest tolerance, genus by Euler's formula (every edge and vertex counted once), seconds;
- volume against the mesh's, and whether it lies between the mesh's and that of the curved triangles over its facets, both
  widened by 0.3 %;
- angles, in degrees, between the oriented normals of the two faces at 21 points of each edge, ends included; edges are smooth
  unless they lie, at all of these points, within 0.3 % of the diagonal of creases of the mesh;
- corners: the smallest and the largest angle of a face at a corner, in degrees; vertices of two faces with two smooth edges;
- creases: recall, the share of the length of the mesh's within 0.3 % of where faces meet at 20 degrees or more, and precision, the
  share of the length of these within 0.3 % of creases of the mesh;
- folds: places, of 5 x 5 in each Bezier element, at which the face's oriented normal turns by more than 90 degrees from that of
  the mesh's nearest facet (of several about as near the one that agrees best; a facet that stands for something round is as near
  as a surface that bulges over it by the height of its curved triangle);
- distances by area both ways, in % of the diagonal: of points of the mesh from the solid's fine triangulation, and of points of
  the faces from the mesh, in both cases as far as they leave the band between the flat facets and the curved triangles over them
  (meter/facets.py); `facets` has the same for the flat facets alone;
- crossings: pairs of triangles of the fine triangulation that pass through each other.
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
from OCP.GeomAbs import GeomAbs_SurfaceType
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_RetDone
from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_SHELL, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS
from OCP.gp import gp_Pnt, gp_Vec
from scipy.spatial import cKDTree

# Compiled modules name the folders of the machine; `cargo xtask tidy` would find them.
sys.dont_write_bytecode = True

from meter import facets
from meter.crossings import self_crossings
from meter.surface import surface_of

PLACES = 21
FOLDS = 5
NEAR_CREASE = 0.003
# Facets that are by this share of the diagonal farther away than the nearest: at creases the wrong side may be the nearest.
AS_NEAR = 5e-4
# Faces that meet at so many degrees are sharp there.
SHARP = 20.0
# The tolerance, as a share of the diagonal: the band of the curved triangles is at most twice that wide, and volumes are widened by
# that share.
TOLERANCE = 0.003
# Largest distance of the fine triangulation from the faces, in tolerances, and its triangles at most.
CHORD, MOST_TRIANGLES = 0.01, 3_000_000
# Places on the mesh, and along each side of a facet where the largest height of its curved triangle is looked for.
SAMPLES, HEIGHTS = 60_000, 4


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
        self.place_of = places.reshape(-1)
        triangles = self.place_of[triangles]
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

    def mark_creases(self, degrees, path):
        """Takes the edges of a file, or else those that are sharper than some degrees, for creases."""
        if path:
            listed = np.loadtxt(path, dtype=np.int64, ndmin=2)
            self.creases = np.sort(self.place_of[listed.reshape(-1, 2)], axis=1)
        else:
            ends, pairs = self.edges()
            a, b = self.normals[pairs[:, 0]], self.normals[pairs[:, 1]]
            angles = np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b)))
            self.creases = ends[angles > degrees]
        self.curved = facets.corner_normals(self.vertices, self.triangles, self.creases)

    def heights(self, which, weights):
        """Signed heights of the curved triangles over facets, at most as wide as the band."""
        most = facets.BAND_TOLERANCES * TOLERANCE * self.diagonal
        return facets.curved_height(self.vertices, self.triangles, self.curved, which, weights, most)

    def sagittas(self):
        """The largest height of the curved triangle over each facet, either way."""
        i, j = np.meshgrid(np.arange(HEIGHTS + 1), np.arange(HEIGHTS + 1))
        shares = np.stack([i, j, HEIGHTS - i - j], axis=-1)[i + j <= HEIGHTS] / HEIGHTS
        every = np.arange(len(self.triangles))
        heights = [np.abs(self.heights(every, np.broadcast_to(w, (len(every), 3)))) for w in shares]
        return facets.BAND_WIDENING * np.max(heights, axis=0)

    def euler(self):
        ends = np.sort(self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        return len(np.unique(self.triangles)) - len(np.unique(ends, axis=0)) + len(self.triangles)


def crease_points(mesh):
    """Points along the creases of the mesh, as close to one another as a tenth of the limit."""
    ends = mesh.vertices[mesh.creases]
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


def count_folds(mesh, points, normals, of_face):
    """Places whose normal turns by more than 90 degrees from all facets that are about as near as the nearest one. A facet that stands
    for something round is as near as a surface that bulges over it. Also the distances, and how far they leave the band."""
    distances, nearest, places = facets.searcher(mesh.vertices, mesh.triangles)(points)
    at_nearest = facets.barycentric(mesh.vertices, mesh.triangles, nearest, places)
    side = np.where(np.einsum("ij,ij->i", points - places, mesh.normals[nearest]) < 0, -1.0, 1.0)
    banded = facets.outside_band(side * distances, mesh.heights(nearest, at_nearest))
    sagittas = mesh.sagittas()
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
    return len(folded), len(set(folded)), distances, banded


def crease_rates(creases, edges, reach):
    """Recall and precision of the creases: points of the mesh's that are near places where faces meet sharply, and shares by length of
    these places near points of the mesh's. Without any of one kind the share that it is of is 1."""
    places, lengths = [np.zeros((0, 3))], [np.zeros(0)]
    for points, angles in edges:
        middles, sharp = 0.5 * (points[1:] + points[:-1]), np.minimum(angles[1:], angles[:-1]) >= SHARP
        steps = np.linalg.norm(points[1:] - points[:-1], axis=1)
        # As close to one another as the reach.
        for part in np.linspace(-0.4, 0.4, 5):
            places.append((middles + part * (points[1:] - points[:-1]))[sharp])
            lengths.append(steps[sharp] / 5)
    places, lengths = np.concatenate(places), np.concatenate(lengths)
    if not len(creases) or not len(places):
        return float(len(creases) == 0), float(len(places) == 0), float(lengths.sum())
    recall = (cKDTree(places).query(creases)[0] <= reach + 0.1 * lengths.max()).mean()
    precision = lengths[cKDTree(creases).query(places)[0] <= reach].sum() / lengths.sum()
    return float(recall), float(precision), float(lengths.sum())


def corner_angles(faces):
    """Angles of the faces at the four corners of their rectangles of parameters, in degrees."""
    angles = []
    for face in faces:
        surface = BRepAdaptor_Surface(face, False)
        us, vs, _ = elements(surface)
        for u, away_u in ((us[0], 1), (us[-1], -1)):
            for v, away_v in ((vs[0], 1), (vs[-1], -1)):
                point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
                surface.D1(float(u), float(v), point, du, dv)
                a, b = away_u * xyz(du), away_v * xyz(dv)
                angles.append(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))
    return angles


def smooth_valences_of_two(ends_of_smooth, ends_of_all, near):
    """Vertices at which two edges end, both of them smooth."""
    tree = cKDTree(ends_of_all)
    count = tree.query_ball_point(ends_of_smooth, near, return_length=True)
    smooth = cKDTree(ends_of_smooth).query_ball_point(ends_of_smooth, near, return_length=True)
    return int(((count == 2) & (smooth == 2)).sum() // 2)


def by_area(distances, weights):
    order = np.argsort(distances)
    summed = np.cumsum(weights[order]) / weights.sum()
    return {
        "rms": float(np.sqrt((weights * distances**2).sum() / weights.sum())),
        "p99": float(distances[order][np.searchsorted(summed, 0.99)]),
        "max": float(distances.max()),
        "within_0.3%": float(weights[distances <= 0.3].sum() / weights.sum()),
    }


def measure(path, mesh):
    start = time.time()
    shape = load(path)
    result = {"valid": BRepCheck_Analyzer(shape).IsValid()}
    for name, kind in (("solids", TopAbs_SOLID), ("shells", TopAbs_SHELL), ("faces", TopAbs_FACE), ("edges", TopAbs_EDGE)):
        result[name] = count(shape, kind)
    euler = count(shape, TopAbs_VERTEX) - result["edges"] + result["faces"]
    result["genus"], result["mesh_genus"] = (2 - euler) / 2, (2 - mesh.euler()) / 2
    result["largest_tolerance_%"] = 100 * ShapeAnalysis_ShapeTolerance().Tolerance(shape, 1) / mesh.diagonal
    which, weights = facets.sample(mesh.vertices, mesh.triangles, SAMPLES, 0)
    heights = mesh.heights(which, weights)
    result |= volumes(shape, mesh, heights)
    result |= along_edges(shape, mesh)
    faces = faces_of(shape)
    corners = corner_angles(faces)
    result["corner_min"], result["corner_max"] = float(min(corners)), float(max(corners))

    points, normals, areas, of_face, result["poles"] = sample_faces(faces)
    result["folds"], result["folded_faces"], flat, banded = count_folds(mesh, points, normals, of_face)
    percent = 100 / mesh.diagonal
    result["surface_to_mesh_%"] = by_area(percent * banded, areas)
    of_facets = {"surface_to_mesh_%": by_area(percent * flat, areas)}

    fine = surface_of(shape, CHORD * TOLERANCE * mesh.diagonal, MOST_TRIANGLES)
    to_fine = facets.searcher(fine.points, fine.triangles)
    places = facets.at(mesh.vertices, mesh.triangles, which, weights)
    flat = to_fine(places)[0]
    banded = facets.distances_to_band(places, flat, mesh.normals[which], heights, to_fine)
    evenly = np.ones(len(places))
    result["mesh_to_surface_%"] = by_area(percent * banded, evenly)
    of_facets["mesh_to_surface_%"] = by_area(percent * flat, evenly)
    result["facets"] = of_facets
    pairs = self_crossings(fine.points, fine.triangles, fine.blocks, fine.rim, fine.chord)[0]
    result["crossings"], result["seconds"] = len(pairs), time.time() - start
    return result


def volumes(shape, mesh, heights):
    """The volume against the mesh's, and whether it is between that and the volume of the curved triangles. `heights` are those of
    places evenly by area."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    volume = properties.Mass()
    between = sorted([mesh.volume, mesh.volume + mesh.areas.sum() * heights.mean()])
    fits = (1 - TOLERANCE) * between[0] <= volume <= (1 + TOLERANCE) * between[1]
    return {
        "volume_error_%": 100 * (volume / mesh.volume - 1),
        "volume_of_curved_%": 100 * heights.mean() * mesh.areas.sum() / mesh.volume,
        "volume_fits": bool(fits),
    }


def along_edges(shape, mesh):
    """What the edges of the shape show: how many are free, at what angles faces meet, which are sharp."""
    creases = crease_points(mesh)
    reach = NEAR_CREASE * mesh.diagonal
    tree = cKDTree(creases) if len(creases) else None
    free, many, smooth, at_ends, sharp, gaps, measured = 0, 0, [], [], 0, [0.0], []
    ends_of_smooth, ends_of_all = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for edge, faces in edges_with_faces(shape):
        if len(faces) != 2:
            free, many = free + (len(faces) < 2), many + (len(faces) > 2)
            continue
        points, angles, gap = edge_angles(edge, faces)
        gaps.append(gap)
        measured.append((points, angles))
        ends_of_all.append(points[[0, -1]])
        if tree is not None and np.all(tree.query(points)[0] <= reach):
            sharp += 1
            continue
        ends_of_smooth.append(points[[0, -1]])
        smooth.append(angles)
        at_ends += [angles[0], angles[-1]]
    smooth = np.concatenate(smooth) if smooth else np.zeros(1)
    recall, precision, length = crease_rates(creases, measured, reach)
    near = max(max(gaps), 1e-9 * mesh.diagonal)
    return {
        "free_edges": free,
        "edges_of_many": many,
        "sharp_edges": sharp,
        "angle_max": float(smooth.max()),
        "angle_p99": float(np.quantile(smooth, 0.99)),
        "angle_at_vertices": float(max(at_ends, default=0.0)),
        "gap_%": 100 * max(gaps) / mesh.diagonal,
        "crease_recall": recall,
        "crease_precision": precision,
        "sharp_length_%": 100 * length / mesh.diagonal,
        "smooth_of_two": smooth_valences_of_two(np.concatenate(ends_of_smooth), np.concatenate(ends_of_all), near),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("mesh")
    parser.add_argument("--crease", type=float, default=40.0, help="angle from which on edges of the mesh are sharp")
    parser.add_argument("--creases", help="the sharp edges of the mesh, two vertices a line, numbered from 0")
    parser.add_argument("--smooth", action="store_true", help="the mesh has no creases")
    parser.add_argument("--open", action="store_true", help="an open shell is expected")
    parser.add_argument("--json", help="file for the figures")
    options = parser.parse_args()
    mesh = Mesh.read(options.mesh)
    mesh.mark_creases(181.0 if options.smooth else options.crease, options.creases)
    result = measure(options.model, mesh)
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
