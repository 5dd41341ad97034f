#!/usr/bin/env python3
"""Opens a STEP file with Open CASCADE (package cadquery-ocp) and checks shape and points.

Usage: check_step.py MODEL.step POINTS.csv [TOLERANCE] [--faces N] [--unit millimetre|metre|inch] [--flipped]
                     [--closed u|v|uv] [--tips N] [--holes RIMS.csv] [--gmsh]

POINTS.csv has columns u,v,x,y,z (u,x,y,z for a curve), in the unit of the file. Checked are
- the transfer; validity of the shape (BRepCheck_Analyzer);
- one shell, shared edges used once in each direction, free edges in one closed wire; number of faces where given;
- of a closed surface: two closed wires of free edges, less one for each side that is a point, or none at all and then a
  closed shell; a single face is closed in its parameters, with one seam edge for each closed direction;
- that each point lies on the face of its parameters, at these parameters, within TOLERANCE (1e-9) of the diagonal;
- that the area of all faces together is that of the surface as given by the points, roughly: no face is trimmed away. With
  holes, within 1 %, theirs taken off; each has a closed wire of its own.
Exits with 1 at the first check that fails.
"""

import argparse
import sys

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools
from OCP.GProp import GProp_GProps
from OCP.gp import gp_Pnt
from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_SHELL
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import TopoDS

MILLIMETRES = {"millimetre": 1.0, "metre": 1000.0, "inch": 25.4}
# Points at which the slower projection to the shape is checked besides the evaluation at the parameters.
PROJECTED = 60


def fail(message):
    sys.exit(f"FAILED: {message}")


def cast(kind):
    """The downcast to a kind of shape, by its name in Open CASCADE before and from version 8."""
    return getattr(TopoDS, kind + "_s", None) or getattr(TopoDS, kind)


AS_EDGE, AS_FACE, AS_SHELL = cast("Edge"), cast("Face"), cast("Shell")


def explore(shape, kind, cast):
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield cast(explorer.Current())
        explorer.Next()


def load(path):
    reader = STEPControl_Reader()
    if reader.ReadFile(path) != IFSelect_RetDone:
        fail(f"{path} cannot be read")
    if reader.TransferRoots() != 1:
        fail("not exactly one root is transferred")
    return reader.OneShape()


def check_seam(face, edges, closed):
    surface = BRep_Tool.Surface_s(face)
    for direction, is_closed in (("u", surface.IsUClosed()), ("v", surface.IsVClosed())):
        if is_closed != (direction in closed):
            fail(f"the surface of the face is{'' if is_closed else ' not'} closed in {direction}")
    seams = sum(BRep_Tool.IsClosed_s(edge, face) for edge, _ in edges)
    if seams != len(closed):
        fail(f"{seams} seam edges, not {len(closed)}")


def check_shell(shape, faces_expected, flipped, closed, tips, holes):
    if not BRepCheck_Analyzer(shape).IsValid():
        fail("the shape is not valid")
    shells = list(explore(shape, TopAbs_SHELL, AS_SHELL))
    faces = list(explore(shape, TopAbs_FACE, AS_FACE))
    # A single face may come without a shell.
    if len(shells) > 1 or (not shells and len(faces) != 1):
        fail(f"{len(shells)} shells")
    if faces_expected is not None and len(faces) != faces_expected:
        fail(f"{len(faces)} faces, not {faces_expected}")
    if any((face.Orientation() == TopAbs_REVERSED) != flipped for face in faces):
        fail("a face has the wrong orientation")
    shared, free, ends = 0, 0, {}
    edges = edges_with_orientations(faces)
    for number, (edge, orientations) in enumerate(edges):
        if BRep_Tool.Degenerated_s(edge):
            continue
        if len(orientations) > 1:
            shared += 1
            if sorted(orientations) != [False, True]:
                fail("an edge is used by more than two faces, or twice in the same direction")
            continue
        free += 1
        for vertex in (TopExp.FirstVertex_s(edge), TopExp.LastVertex_s(edge)):
            # By identity, not by place: opposite sides of a closed surface coincide, and stay two edges.
            ends.setdefault(hash(vertex.Oriented(TopAbs_FORWARD)), []).append(number)
    if any(len(edges) % 2 for edges in ends.values()):
        fail("the free edges are no closed wires")
    wires = count_wires(list(ends.values()))
    # A side that is a point has no edge.
    if wires != {0: 1, 1: 2 - tips, 2: 0}[len(closed)] + holes:
        fail(f"{wires} boundaries: the faces are not connected all over")
    if closed and len(faces) == 1:
        check_seam(faces[0], edges, closed)
    if len(closed) == 2 and not all(BRep_Tool.IsClosed_s(shell) for shell in shells):
        fail("the shell is not closed")
    return faces, shared, free


def edges_with_orientations(faces):
    """Each edge, with one entry for each use: whether it is used against its direction."""
    buckets = {}
    for face in faces:
        for edge in explore(face, TopAbs_EDGE, AS_EDGE):
            bucket = buckets.setdefault(hash(edge.Oriented(TopAbs_FORWARD)), [])
            used = next((entry for entry in bucket if entry[0].IsSame(edge)), None)
            if used is None:
                used = (edge, [])
                bucket.append(used)
            used[1].append(edge.Orientation() == TopAbs_REVERSED)
    return [entry for bucket in buckets.values() for entry in bucket]


def count_wires(groups):
    """Number of connected sets of edges, given the edges at each vertex."""
    parent = {}

    def root(i):
        parent.setdefault(i, i)
        while parent[i] != i:
            i = parent[i]
        return i

    for first, *others in groups:
        for other in others:
            parent[root(other)] = root(first)
    return len({root(i) for i in list(parent)})


def check_surface_points(faces, parameters, points, tolerance):
    """Each point against the surface of every face whose box of parameters holds (u, v)."""
    patches = [(BRepTools.UVBounds_s(face), BRep_Tool.Surface_s(face)) for face in faces]
    worst = 0.0
    for (u, v), point in zip(parameters, points):
        found = 0
        for (u0, u1, v0, v1), surface in patches:
            slack = 1e-9
            if u0 - slack <= u <= u1 + slack and v0 - slack <= v <= v1 + slack:
                value = surface.Value(float(u), float(v))
                worst = max(worst, np.linalg.norm(np.array([value.X(), value.Y(), value.Z()]) - point))
                found += 1
        if found == 0:
            fail(f"no face has the parameters ({u}, {v})")
    if worst > tolerance:
        fail(f"the surface is {worst:.3e} off at given parameters, tolerance {tolerance:.3e}")
    return worst


def check_distance(shape, points, tolerance):
    worst = 0.0
    for point in points[:: max(1, len(points) // PROJECTED)]:
        vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*map(float, point))).Vertex()
        distance = BRepExtrema_DistShapeShape(vertex, shape)
        if not distance.IsDone():
            fail("no distance to the shape")
        worst = max(worst, distance.Value())
    if worst > tolerance:
        fail(f"a point is {worst:.3e} away from the shape, tolerance {tolerance:.3e}")
    return worst


def check_area(shape, points, grid, cut, share):
    """Area against the triangles of the grid of points, less those of cells that `cut` names: it tells a face that a loop turned
    inside out from a whole one."""
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(shape, properties)
    p = points.reshape(*grid, 3)
    a, b, c = p[1:, :-1] - p[:-1, :-1], p[:-1, 1:] - p[:-1, :-1], p[1:, 1:] - p[:-1, :-1]
    cells = 0.5 * (np.linalg.norm(np.cross(a, c), axis=-1) + np.linalg.norm(np.cross(b, c), axis=-1))
    area = (cells * (1.0 - cut)).sum()
    if not abs(properties.Mass() / area - 1.0) < share:
        fail(f"the area is {properties.Mass():.6g}, that of the grid of points {area:.6g}")
    return properties.Mass() / area


def inside(polygon, uv):
    """Whether points lie in a polygon, both in the parameter plane: the parity of crossings of a ray along u."""
    (x, y), count = uv.T, np.zeros(len(uv), dtype=int)
    for (u0, v0), (u1, v1) in zip(polygon, np.roll(polygon, -1, axis=0)):
        across = (v0 > y) != (v1 > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            count += across & (x < u0 + (y - v0) * (u1 - u0) / (v1 - v0))
    return count % 2 == 1


def share_cut(outlines, parameters, grid):
    """Share of each cell of the grid of parameters that lies in a hole, on 8 x 8 samples."""
    nodes = parameters.reshape(*grid, 2)
    low, high = nodes[:-1, :-1], nodes[1:, 1:]
    cut = np.zeros(low.shape[:2])
    for s in (np.arange(8) + 0.5) / 8:
        for t in (np.arange(8) + 0.5) / 8:
            places = (low + (high - low) * np.array([s, t])).reshape(-1, 2)
            cut += np.any([inside(outline, places) for outline in outlines], axis=0).reshape(cut.shape) / 64
    return cut


def check_gmsh(path, faces):
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.importShapes(path)
    gmsh.model.occ.synchronize()
    found = len(gmsh.model.getEntities(2))
    gmsh.finalize()
    if found != faces:
        fail(f"gmsh finds {found} faces, not {faces}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("points")
    parser.add_argument("tolerance", nargs="?", type=float, default=1e-9)
    parser.add_argument("--faces", type=int)
    parser.add_argument("--unit", choices=MILLIMETRES, default="millimetre")
    parser.add_argument("--flipped", action="store_true")
    parser.add_argument("--closed", choices=["", "u", "v", "uv"], default="")
    parser.add_argument("--tips", type=int, default=0, help="sides of a closed surface that are points")
    parser.add_argument("--holes", help="table of points in order along the rims of holes: columns hole, u, v")
    parser.add_argument("--gmsh", action="store_true")
    options = parser.parse_args()

    table = np.genfromtxt(options.points, delimiter=",", names=True)
    # Open CASCADE reads every unit as millimetres.
    points = np.column_stack([table[name] for name in "xyz"]) * MILLIMETRES[options.unit]
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    tolerance = options.tolerance * diagonal
    shape = load(options.model)
    if "v" not in table.dtype.names:
        edges = list(explore(shape, TopAbs_EDGE, AS_EDGE))
        if len(edges) != 1 or not BRepCheck_Analyzer(shape).IsValid():
            fail(f"{len(edges)} edges, or not valid")
        away = check_distance(shape, points, tolerance)
        print(f"{options.model}: a curve, {away / diagonal:.1e} of the diagonal away")
        return
    outlines = []
    if options.holes:
        rims = np.genfromtxt(options.holes, delimiter=",", names=True)
        outlines = [np.column_stack([rims["u"], rims["v"]])[rims["hole"] == k] for k in np.unique(rims["hole"])]
    faces, shared, free = check_shell(shape, options.faces, options.flipped, options.closed, options.tips, len(outlines))
    parameters = np.column_stack([table["u"], table["v"]])
    off = check_surface_points(faces, parameters, points, tolerance)
    in_hole = np.any([inside(outline, parameters) for outline in outlines], axis=0) if outlines else None
    away = check_distance(shape, points if in_hole is None else points[~in_hole], tolerance)
    grid = (len(np.unique(table["v"])), len(np.unique(table["u"])))
    area = ""
    if len(points) == grid[0] * grid[1]:
        cut, share = (share_cut(outlines, parameters, grid), 0.01) if outlines else (0.0, 0.1)
        area = f"area ratio {check_area(shape, points, grid, cut, share):.4f}, "
    if options.gmsh:
        check_gmsh(options.model, len(faces))
    print(
        f"{options.model}: {len(faces)} faces, {shared} shared and {free} free edges, {area}"
        f"{off / diagonal:.1e} of the diagonal off at parameters, {away / diagonal:.1e} away"
    )


if __name__ == "__main__":
    main()
