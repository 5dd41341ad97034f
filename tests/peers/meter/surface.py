"""Triangles over the faces of a STEP file, with a known chord error.

Open CASCADE reads the file. A face that fills its rectangle of parameters is evaluated span by span, each span on a
grid as fine as the chord asks; a trimmed one gets Open CASCADE's triangles, refined in its parameters.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineSurface, Geom_RectangularTrimmedSurface
from OCP.GeomConvert import GeomConvert
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from check_step import AS_FACE, TopAbs_FACE, edges_with_orientations, explore, load

# Quads along a span: 2^1 to 2^7.
FIRST_POWER, LAST_POWER = 1, 7
# Quads along a span where the farthest places are looked for.
FINER = 64
# Quads along a block, the unit in which crossings are sought.
BLOCK = 8
# Fewest pieces of a free edge.
EDGE_PIECES = 64
# A trimmed face is triangulated by Open CASCADE no finer than this share of the diagonal (it takes minutes), then
# refined.
COARSE_SHARE = 2e-4
# Halvings of the triangles of a trimmed face.
TRIMMED_HALVINGS = 4
# Parameters that differ by this share of a face's rectangle are one: curves on faces are projected by Open CASCADE.
SAME_PARAMETER = 1e-6
# Lengths below this share of the diagonal are round-off.
ROUND_OFF = 1e-9


@dataclass
class Surface:
    """Triangles, and the curves that bound the surface."""

    points: np.ndarray
    triangles: np.ndarray
    # Unit normals of the surface at the points; of one of the faces that meet there.
    normals: np.ndarray
    # Number of the block of each triangle.
    blocks: np.ndarray
    # Number of the span of each triangle, below 0 on trimmed faces; of the spans (number of the net, span in u, span in v); and the nets.
    span: np.ndarray
    spans: np.ndarray
    nets: list
    # Segments along the free edges, (n, 2, 3).
    rim: np.ndarray
    # Estimate of the largest distance between the free edges and these.
    rim_error: float
    # Estimate of the largest distance between surface and triangles.
    chord: float
    faces: int

    def move(self, by):
        """Moves the surface."""
        self.points, self.rim = self.points + by, self.rim + by
        self.nets = [(net + np.append(by, 0.0) * net[..., 3:], u, v) for net, u, v in self.nets]

    def finer(self, triangles):
        """Points and triangles of grids of FINER x FINER squares over the spans of some triangles and those beside them in their nets."""
        about = np.unique(self.spans[np.unique(self.span[triangles][self.span[triangles] >= 0])], axis=0).reshape(-1, 3)
        around = np.array([(0, i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
        wanted = np.unique((about[:, None] + around).reshape(-1, 3), axis=0)
        points, sides = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)]
        for number in np.unique(wanted[:, 0]):
            net, u, v = self.nets[number]
            of_net = wanted[wanted[:, 0] == number]
            there = (of_net >= 0).all(axis=1) & (of_net[:, 1] < len(spans(*u))) & (of_net[:, 2] < len(spans(*v)))
            grid = evaluated(net, u, v, *of_net[there, 1:].T, FINER, FINER)
            of_grid = grid_triangles(grid, False)
            sides.append(of_grid[1] + sum(map(len, points)))
            points.append(of_grid[0])
        return np.concatenate(points), np.concatenate(sides)


def read_surface(path, chord, most_triangles):
    """Triangles over all faces of a STEP file: `surface_of` its shape."""
    return surface_of(load(str(path)), chord, most_triangles)


def surface_of(shape, chord, most_triangles):
    """Triangles over all faces of a shape within `chord` of them, where `most_triangles` suffice; at a larger chord, which
    the result names, where they don't."""
    faces = list(explore(shape, TopAbs_FACE, AS_FACE))
    natural = [face for face in faces if fills_rectangle(face)]
    meshes, reached, nets = [], 0.0, []
    listed, of_triangles = [np.zeros((0, 3), dtype=np.int64)], []
    if natural:
        nets = [control_net(face) for face in natural]
        grids, reached = grids_over(nets, chord, most_triangles)
        for k, grid, of_net in grids:
            meshes.append(grid_triangles(grid, is_reversed(natural[k])))
            first_span = sum(map(len, listed))
            listed.append(np.column_stack([np.full(len(of_net), k), of_net]))
            of_triangles.append(first_span + np.repeat(np.arange(len(of_net)), len(meshes[-1][1]) // len(of_net)))
    for face in faces:
        if not any(face.IsSame(other) for other in natural):
            points, triangles, error = trimmed_triangles(face, chord)
            meshes.append((points, triangles, np.zeros(len(triangles), dtype=int), mean_normals(points, triangles)))
            of_triangles.append(np.full(len(triangles), -1))
            reached = max(reached, error)
    points, triangles, blocks, normals, first_point, first_block = [], [], [], [], 0, 0
    for some_points, some_triangles, some_blocks, some_normals in meshes:
        points.append(some_points)
        normals.append(some_normals)
        triangles.append(some_triangles + first_point)
        blocks.append(some_blocks + first_block)
        first_point += len(some_points)
        first_block += some_blocks.max() + 1
    points, triangles, kept, first = welded(np.concatenate(points), np.concatenate(triangles))
    blocks, normals = np.concatenate(blocks)[kept], np.concatenate(normals)[first]
    rim, rim_error = free_edges(faces, chord)
    span = np.concatenate(of_triangles)[kept]
    return Surface(points, triangles, normals, blocks, span, np.concatenate(listed), nets, rim, rim_error, reached, len(faces))


def is_reversed(face):
    """Whether the normal of a face is opposite to that of its surface."""
    return face.Orientation() == TopAbs_REVERSED


def welded(points, triangles):
    """Vertices at one place made one; triangles that have two corners there are left out. Points, triangles, which triangles are
    kept, and which of the given points are."""
    low = points.min(axis=0)
    step = ROUND_OFF * max(np.linalg.norm(np.ptp(points, axis=0)), 1e-300)
    _, first, number = np.unique(
        np.round((points - low) / step).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    triangles = number.reshape(-1)[triangles]
    a, b, c = triangles.T
    kept = (a != b) & (b != c) & (c != a)
    return points[first], np.ascontiguousarray(triangles[kept], dtype=np.int64), kept, first


def fills_rectangle(face):
    """Whether the edges of a face lie on the sides of its rectangle of parameters."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    for edge, _ in edges_with_orientations([face]):
        curve = BRepAdaptor_Curve2d(edge, face)
        first, last = curve.FirstParameter(), curve.LastParameter()
        places = [curve.Value(first + t * (last - first)) for t in (0.25, 0.5, 0.75)]
        u = np.array([(place.X() - u0) / (u1 - u0) for place in places])
        v = np.array([(place.Y() - v0) / (v1 - v0) for place in places])
        if not any(np.abs(x - side).max() < SAME_PARAMETER for x in (u, v) for side in (0, 1)):
            return False
    return True


def control_net(face):
    """A face's surface over its rectangle as a B-spline: homogeneous control points (m, n, 4), and knots and degree in
    u and v."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    surface = BRep_Tool.Surface_s(face)
    if not isinstance(surface, Geom_BSplineSurface) or not np.allclose(
        surface.Bounds(), (u0, u1, v0, v1), rtol=0, atol=SAME_PARAMETER * max(u1 - u0, v1 - v0)
    ):
        surface = GeomConvert.SurfaceToBSplineSurface_s(Geom_RectangularTrimmedSurface(surface, u0, u1, v0, v1))
    surface.SetUNotPeriodic()
    surface.SetVNotPeriodic()
    shape = (surface.NbUPoles(), surface.NbVPoles())
    net = np.empty((*shape, 4))
    for i, j in np.ndindex(shape):
        pole, weight = surface.Pole(i + 1, j + 1), surface.Weight(i + 1, j + 1)
        net[i, j] = pole.X() * weight, pole.Y() * weight, pole.Z() * weight, weight
    u = np.repeat(
        [surface.UKnot(k + 1) for k in range(surface.NbUKnots())],
        [surface.UMultiplicity(k + 1) for k in range(surface.NbUKnots())],
    )
    v = np.repeat(
        [surface.VKnot(k + 1) for k in range(surface.NbVKnots())],
        [surface.VMultiplicity(k + 1) for k in range(surface.NbVKnots())],
    )
    return net, (u, surface.UDegree()), (v, surface.VDegree())


def spans(knots, degree):
    """Numbers of the knots at which the spans that are not empty begin."""
    inner = np.arange(degree, len(knots) - degree - 1)
    return inner[knots[inner + 1] > knots[inner]]


def basis(knots, degree, span, count):
    """The B-splines that do not vanish on spans, at `count` + 1 even places of each: (spans, count + 1, degree + 1), by
    the recursion of Cox and de Boor."""
    x = knots[span, None] + np.linspace(0, 1, count + 1) * (knots[span + 1] - knots[span])[:, None]
    values = np.ones((len(span), count + 1, 1))
    for d in range(1, degree + 1):
        raised = np.zeros((len(span), count + 1, d + 1))
        for r in range(d):
            left, right = knots[span + 1 + r - d], knots[span + 1 + r]
            share = values[:, :, r] / (right - left)[:, None]
            raised[:, :, r] += share * (right[:, None] - x)
            raised[:, :, r + 1] += share * (x - left[:, None])
        values = raised
    return values


def grids_over(nets, chord, most_triangles):
    """For each span of each net a grid of points, as fine as the chord asks: [(number of the net, (spans, k + 1, l + 1, 3),
    numbers of the spans in u and v (spans, 2))], grids of one size together; and the largest estimate of the error."""
    open_cells = []
    cells_u, cells_v = ([len(spans(*net[direction])) for net in nets] for direction in (1, 2))
    for number, size in enumerate(zip(cells_u, cells_v)):
        for a, b in np.ndindex(*size):
            open_cells.append((number, a, b, FIRST_POWER, FIRST_POWER))
    open_cells = np.array(open_cells)
    done, reached, total = [], 0.0, 0
    while len(open_cells):
        number, k, l = open_cells[:, 0], open_cells[:, 3], open_cells[:, 4]
        planned = total + int(np.sum(2 ** (k + l + 3)))
        last = planned > most_triangles
        further = []
        for group in np.unique(np.column_stack([number, k, l]), axis=0):
            cells = open_cells[(number == group[0]) & (k == group[1]) & (l == group[2])]
            net, u, v = nets[group[0]]
            # Twice as fine as judged: halving the steps divides the error by four.
            grid = evaluated(net, u, v, cells[:, 1], cells[:, 2], 2 ** (group[1] + 1), 2 ** (group[2] + 1))
            along_u, along_v, across = (error / 4 for error in chord_errors(grid))
            a, b, ends = cells[:, 1], cells[:, 2], (cells_u[group[0]] - 1, cells_v[group[0]] - 1)
            on_sides = np.column_stack([a == 0, a == ends[0], b == 0, b == ends[1]])
            sides = np.where(on_sides, side_errors(grid) / 4, 0.0)
            along_u = np.maximum(along_u, sides[:, 2:].max(axis=1))
            along_v = np.maximum(along_v, sides[:, :2].max(axis=1))
            fine_u, fine_v = along_u <= chord / 3, along_v <= chord / 3
            met = fine_u & fine_v & (across <= chord)
            raised = np.column_stack([~fine_u | (fine_v & ~met), ~fine_v | (fine_u & ~met)]) & ~met[:, None]
            raised &= cells[:, 3:] < LAST_POWER
            accepted = ~raised.any(axis=1) | last
            if accepted.any():
                done.append((group[0], grid[accepted], cells[accepted, 1:3]))
                total += int(accepted.sum()) * 2 ** (group[1] + group[2] + 3)
                reached = max(reached, np.max([along_u[accepted], along_v[accepted], across[accepted]]))
            cells = cells[~accepted].copy()
            cells[:, 3:] += raised[~accepted]
            further.append(cells)
        open_cells = np.concatenate(further)
    return done, float(reached)


def evaluated(net, u, v, cell_u, cell_v, count_u, count_v):
    """Points on even grids over spans (cell_u[i], cell_v[i])."""
    first_u, first_v = spans(*u), spans(*v)
    basis_u, basis_v = basis(*u, first_u, count_u), basis(*v, first_v, count_v)
    rows = first_u[cell_u][:, None] - u[1] + np.arange(u[1] + 1)
    columns = first_v[cell_v][:, None] - v[1] + np.arange(v[1] + 1)
    local = net[rows[:, :, None], columns[:, None, :]]
    values = np.einsum("nap,npqc->naqc", basis_u[cell_u], local)
    values = np.einsum("naqc,nbq->nabc", values, basis_v[cell_v])
    return values[..., :3] / values[..., 3:]


def chord_errors(grid):
    """How far, at most on each grid, the points in between lie off the grid of every other point: in u, in v, and in
    the middle of quads on either diagonal. Along the normal where there is one: points may lie unevenly within the
    surface."""
    normal = np.cross(np.gradient(grid, axis=1), np.gradient(grid, axis=2))
    length = np.linalg.norm(normal, axis=3, keepdims=True)
    known = length[..., 0] > 1e-12 * length.max()
    normal = normal / np.maximum(length, 1e-300)

    def off(middle, one, other, place):
        vectors = middle - 0.5 * (one + other)
        along = np.abs(np.einsum("nabc,nabc->nab", vectors, normal[place]))
        return np.where(known[place], along, np.linalg.norm(vectors, axis=3)).max(axis=(1, 2))

    whole, odd, low, high = slice(None), slice(1, None, 2), slice(None, -1, 2), slice(2, None, 2)
    even = slice(None, None, 2)
    in_u = off(grid[:, odd, even], grid[:, low, even], grid[:, high, even], (whole, odd, even))
    in_v = off(grid[:, even, odd], grid[:, even, low], grid[:, even, high], (whole, even, odd))
    middle, place = grid[:, odd, odd], (whole, odd, odd)
    rising = off(middle, grid[:, low, low], grid[:, high, high], place)
    falling = off(middle, grid[:, low, high], grid[:, high, low], place)
    return in_u, in_v, np.maximum(rising, falling)


def off_chords(line):
    """Distances of every other point of lines (n, 2 k + 1, 3) to the chord of its neighbours, between which it may lie
    unevenly."""
    chords = line[:, 2::2] - line[:, :-2:2]
    chords = chords / np.maximum(np.linalg.norm(chords, axis=2, keepdims=True), 1e-300)
    return np.linalg.norm(np.cross(line[:, 1:-1:2] - line[:, :-2:2], chords), axis=2)


def side_errors(grid):
    """How far the points in between lie off the lines of every other point along the four sides of grids: u = 0, u = 1,
    v = 0, v = 1. Within the surface no triangle needs to be that near to its place, but on the rim of the surface."""
    return np.column_stack(
        [off_chords(line).max(axis=1) for line in (grid[:, 0], grid[:, -1], grid[:, :, 0], grid[:, :, -1])]
    )


def grid_triangles(grids, turned):
    """Points, triangles, blocks and normals of grids of one size."""
    # Differences of second order on the sides, too: on the rim of the surface there is nothing beyond.
    normals = np.cross(*(np.gradient(grids, axis=axis, edge_order=2) for axis in (1, 2)))
    normals = (-normals if turned else normals) / np.maximum(np.linalg.norm(normals, axis=3, keepdims=True), 1e-300)
    cells, rows, columns = grids.shape[:3]
    i, j = (index.reshape(-1) for index in np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij"))
    corner = i * columns + j
    quad = np.column_stack([corner, corner + columns, corner + columns + 1, corner, corner + columns + 1, corner + 1])
    if turned:
        quad = quad[:, ::-1]
    across = -(-(columns - 1) // BLOCK)
    block = np.repeat(i // BLOCK * across + j // BLOCK, 2)
    first = np.arange(cells)[:, None, None]
    triangles = (quad.reshape(-1, 3)[None] + first * rows * columns).reshape(-1, 3)
    blocks = (block[None] + first[:, :, 0] * (block.max() + 1)).reshape(-1)
    return grids.reshape(-1, 3), triangles, blocks, normals.reshape(-1, 3)


def mean_normals(points, triangles):
    """At each vertex the mean of the normals of its triangles."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    sums = np.zeros_like(points)
    for k in range(3):
        np.add.at(sums, triangles[:, k], np.cross(b - a, c - a))
    return sums / np.maximum(np.linalg.norm(sums, axis=1), 1e-300)[:, None]


def trimmed_triangles(face, chord):
    """Points, triangles and estimated error of a face that its edges cut out of its rectangle."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    surface = BRep_Tool.Surface_s(face)
    value = lambda uv: np.array([(p.X(), p.Y(), p.Z()) for p in (surface.Value(float(u), float(v)) for u, v in uv)])
    some = value([(u, v) for u in np.linspace(u0, u1, 9) for v in np.linspace(v0, v1, 9)])
    BRepMesh_IncrementalMesh(face, max(chord, COARSE_SHARE * np.linalg.norm(np.ptp(some, axis=0))), False, 0.5, False)
    mesh = BRep_Tool.Triangulation_s(face, TopLoc_Location())
    if mesh is None:
        raise ValueError("Open CASCADE makes no triangles over a trimmed face")
    uv = np.array([(p.X(), p.Y()) for p in (mesh.UVNode(k + 1) for k in range(mesh.NbNodes()))])
    triangles = np.array([mesh.Triangle(k + 1).Get() for k in range(mesh.NbTriangles())], dtype=np.int64) - 1
    points, error = value(uv), np.inf
    for halving in range(TRIMMED_HALVINGS + 1):
        ends, number = np.unique(
            np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0, return_inverse=True
        )
        middles = uv[ends].mean(axis=1)
        exact = value(middles)
        a, b, c = (points[triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        number = number.reshape(-1, 3)
        off = exact - points[ends].mean(axis=1)
        error = max(np.abs(np.einsum("ij,ij->i", off[number[:, k]], normal)).max() for k in range(3))
        if error <= chord or halving == TRIMMED_HALVINGS:
            break
        first = len(points)
        points, uv = np.concatenate([points, exact]), np.concatenate([uv, middles])
        p, (ab, bc, ca) = triangles.T, (first + number).T
        parts = [(p[0], ab, ca), (ab, p[1], bc), (ca, bc, p[2]), (ab, bc, ca)]
        triangles = np.concatenate([np.column_stack(part) for part in parts])
    return points, triangles[:, ::-1] if is_reversed(face) else triangles, error


def free_edges(faces, chord):
    """Segments along the edges that bound the surface, those of one face that are no seam of it, (n, 2, 3); and how far the edges lie
    off them at most."""
    found, error = [np.zeros((0, 2, 3))], 0.0
    for edge, uses in edges_with_orientations(faces):
        if len(uses) > 1 or BRep_Tool.Degenerated_s(edge):
            continue
        curve = BRepAdaptor_Curve(edge)
        count = EDGE_PIECES
        while True:
            parameters = np.linspace(curve.FirstParameter(), curve.LastParameter(), count + 1)
            line = np.array([(p.X(), p.Y(), p.Z()) for p in (curve.Value(float(t)) for t in parameters)])
            off = off_chords(line[None]).max() / 4
            if off <= chord or count >= 64 * EDGE_PIECES:
                break
            count *= 2
        error = max(error, off)
        found.append(np.stack([line[:-1], line[1:]], axis=1))
    return np.concatenate(found), error
