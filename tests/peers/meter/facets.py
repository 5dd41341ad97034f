"""Triangles of a scan: samples by area, nearest points, and the band of the sagitta.

A scanned triangle is known up to its sagitta: the surface it was taken from may be the flat facet or the curved
triangle over it. Curved triangles are the PN triangles of Vlachos, Peters, Boyd and Mitchell (2001): cubic Bezier
triangles whose edges are perpendicular to the normals at the corners. A distance counts as far as it leaves the band
between the two.
"""

import igl
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

# Normals are not averaged across edges at which facets meet at a larger angle.
CREASE_DEGREES = 40.0
# Facets whose normals differ by less lie in one plane; that many facets in one plane stay flat.
PLANE_DEGREES, PLANE_FACETS = 0.1, 4
# Weight of the normal of a plane among those at a corner: it is the normal there.
PLANE_WEIGHT = 1e6
# Curved triangles are no exact surfaces either: the band is that much wider.
BAND_WIDENING = 1.15
# The band is at most that many tolerances wide, before it is widened.
BAND_TOLERANCES = 2.0
# Distances to both sides of the band that add up to its width, but for this share of it, are those of a surface between
# them.
BETWEEN_SHARE = 0.1
# Directions between the normals of two facets.
FAN = 9
# A band that is narrower than this share of the mean distance is none.
SAME_SHARE = 1e-3


def dot(a, b):
    """Scalar products of rows."""
    return np.einsum("ij,ij->i", a, b)


def unit(vectors):
    """Rows of length one; zero stays zero."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)[:, None]


def doubled_normals(points, triangles):
    """Normals of triangles, as long as twice their areas."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def areas(points, triangles):
    """Areas of triangles."""
    return 0.5 * np.linalg.norm(doubled_normals(points, triangles), axis=1)


def searcher(points, simplices):
    """A function that gives the distance of each of its places to triangles or segments, the nearest one, and the
    nearest point."""
    points, simplices = np.ascontiguousarray(points), np.ascontiguousarray(simplices)
    tree = igl.AABB()
    tree.init(points, simplices)

    def nearest(places):
        squared, which, near = tree.squared_distance(points, simplices, np.ascontiguousarray(places))
        return np.sqrt(np.maximum(squared, 0.0)), which, near

    return nearest


def distance_to_lines(places, ends):
    """Distances of places to the nearest of segments (n, 2, 3); infinite if there is none."""
    if not len(ends) or not len(places):
        return np.full(len(places), np.inf)
    return searcher(ends.reshape(-1, 3), np.arange(2 * len(ends), dtype=np.int64).reshape(-1, 2))(places)[0]


def at(points, triangles, which, weights):
    """The points with barycentric coordinates `weights` on the triangles `which`."""
    return np.einsum("ij,ijk->ik", weights, points[triangles[which]])


def barycentric(points, triangles, which, places):
    """Barycentric coordinates of places on the triangles `which`."""
    a, b, c = (points[triangles[which, k]] for k in range(3))
    u, v, w = b - a, c - a, places - a
    uu, uv, vv, wu, wv = dot(u, u), dot(u, v), dot(v, v), dot(w, u), dot(w, v)
    determinant = np.maximum(uu * vv - uv * uv, 1e-300)
    second, third = (vv * wu - uv * wv) / determinant, (uu * wv - uv * wu) / determinant
    return np.clip(np.column_stack([1 - second - third, second, third]), 0, 1)


def sample(points, triangles, count, seed):
    """`count` places evenly by area: triangles and barycentric coordinates. One place is drawn in each of `count` equal
    parts of the area, which scatters less than places drawn one by one."""
    random = np.random.default_rng(seed)
    total = np.cumsum(areas(points, triangles))
    drawn = (np.arange(count) + random.random(count)) / count * total[-1]
    which = np.minimum(np.searchsorted(total, drawn, side="right"), len(triangles) - 1)
    r, s = np.sqrt(random.random(count)), random.random(count)
    return which, np.column_stack([1 - r, r * (1 - s), r * s])


def split(points, triangles):
    """Each triangle cut regularly into n^2 parts, at least 4, of at most 0.01 % of the whole area (n is at most 100):
    the triangles, the barycentric coordinates of the middles, and the areas of all parts."""
    area = areas(points, triangles)
    cuts = np.clip(np.ceil(np.sqrt(area / (1e-4 * area.sum()))).astype(int), 2, 100)
    which, weights, sizes = [], [], []
    for n in np.unique(cuts):
        i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
        upward, downward = i + j < n, i + j < n - 1
        second = np.concatenate([i[upward] + 1 / 3, i[downward] + 2 / 3]) / n
        third = np.concatenate([j[upward] + 1 / 3, j[downward] + 2 / 3]) / n
        cut = np.flatnonzero(cuts == n)
        which.append(np.repeat(cut, n * n))
        weights.append(np.tile(np.column_stack([1 - second - third, second, third]), (len(cut), 1)))
        sizes.append(np.repeat(area[cut] / n**2, n * n))
    return np.concatenate(which), np.concatenate(weights), np.concatenate(sizes)


def edges_of(triangles):
    """All edges as (smaller, larger) vertex, 3 a triangle in its order, numbered without repetition, with the number of
    uses."""
    ends = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    keys, number, uses = np.unique(
        ends[:, 0] * (triangles.max() + 1) + ends[:, 1], return_inverse=True, return_counts=True
    )
    return ends, number.reshape(-1), uses, keys


def boundary(points, triangles):
    """The edges of one triangle only, as (n, 2, 3). Vertices with equal coordinates are one."""
    _, merged = np.unique(points, axis=0, return_inverse=True)
    ends, number, uses, _ = edges_of(merged.reshape(-1)[triangles])
    original = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    return points[original[uses[number] == 1]]


def along_outline(points, triangles, count, inward):
    """Places a little inside the outline and directions of places that have them as the nearest ones: `count` of them evenly along the
    edges of one triangle only, moved by `inward` into that triangle, with its unit normal; and on edges of two triangles that end on
    the outline, `inward` before their ends, with directions between the normals of both."""
    _, merged = np.unique(points, axis=0, return_inverse=True)
    ends, number, uses, _ = edges_of(merged.reshape(-1)[triangles])
    sides = np.flatnonzero(uses[number] == 1)
    if not len(sides):
        return np.zeros((0, 3)), np.zeros((0, 3))
    fans = fans_at_outline(points, triangles, ends, number, uses, merged.reshape(-1), inward)
    ends = points[triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)[sides]]
    normals = unit(doubled_normals(points, triangles[sides // 3]))
    total = np.cumsum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
    at_length = (np.arange(count) + 0.5) / count * total[-1]
    which = np.minimum(np.searchsorted(total, at_length, side="right"), len(sides) - 1)
    start, along = ends[which, 0], ends[which, 1] - ends[which, 0]
    length = np.linalg.norm(along, axis=1)
    share = 1 - (total[which] - at_length) / np.maximum(length, 1e-300)
    into = unit(np.cross(normals[which], along))
    places = start + share[:, None] * along + inward * into
    return np.concatenate([places, fans[0]]), np.concatenate([normals[which], fans[1]])


def fans_at_outline(points, triangles, ends, number, uses, merged, inward):
    """For edges of two triangles with an end on the outline: places `inward` before that end, and directions between the normals."""
    on_outline = np.zeros(merged.max() + 1, dtype=bool)
    on_outline[ends[uses[number] == 1].reshape(-1)] = True
    order = np.argsort(number, kind="stable")
    first = order[np.concatenate([[0], np.cumsum(uses)])[:-1][uses == 2]]
    other = order[np.concatenate([[0], np.cumsum(uses)])[:-1][uses == 2] + 1]
    normals = unit(doubled_normals(points, triangles))
    corners = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)[first]
    places, directions = [], []
    for end in (0, 1):
        here = on_outline[merged[corners[:, end]]]
        at_end, away = points[corners[here, end]], points[corners[here, 1 - end]]
        near = at_end + inward * unit(away - at_end)
        one, two = normals[first[here] // 3], normals[other[here] // 3]
        for share in np.linspace(0, 1, FAN):
            places.append(near)
            directions.append(unit((1 - share) * one + share * two))
    return np.concatenate(places), np.concatenate(directions)


def in_planes(triangles, normals):
    """Which facets lie in one plane with at least three others that they are connected to."""
    _, number, uses, _ = edges_of(triangles)
    order = np.argsort(number, kind="stable")
    first = np.concatenate([[0], np.cumsum(uses)])[:-1][uses == 2]
    one, other = order[first] // 3, order[first + 1] // 3
    flat = dot(normals[one], normals[other]) >= np.cos(np.radians(PLANE_DEGREES))
    links = coo_matrix((np.ones(flat.sum()), (one[flat], other[flat])), shape=(len(triangles),) * 2)
    label = connected_components(links, directed=False)[1]
    return np.bincount(label)[label] >= PLANE_FACETS


def corner_normals(points, triangles, creases=None):
    """Unit normals (n, 3, 3) at the corners of the triangles: means by area over the facets at the vertex that are not
    turned by more than the crease; where `creases` (n, 2) are given, over those that are reached round the vertex without
    crossing one of these edges. A facet of a plane has its own normal at all corners, and its neighbours have it where they
    touch it."""
    doubled = doubled_normals(points, triangles)
    normals = unit(doubled)
    plane = in_planes(triangles, normals)
    one, other = corners_alike(points, triangles, normals) if creases is None else corners_reached(triangles, creases)
    other = other // 3
    weight = np.where(plane[other], PLANE_WEIGHT, 1.0)
    sums = np.column_stack([np.bincount(one, weight * doubled[other, d], minlength=triangles.size) for d in range(3)])
    sums = unit(sums).reshape(-1, 3, 3)
    sums[plane] = normals[plane][:, None]
    return sums


def together(groups):
    """All pairs of positions of `groups` with one number, those of a position with itself among them."""
    order = np.argsort(groups, kind="stable")
    count = np.bincount(groups)
    start = np.cumsum(count) - count
    there = count[groups]
    one = np.repeat(np.arange(len(groups)), there)
    within = np.arange(len(one)) - np.repeat(np.cumsum(there) - there, there)
    return one, order[start[groups[one]] + within]


def corners_alike(points, triangles, normals):
    """Pairs of corners at one vertex whose facets are not turned by more than the crease."""
    one, other = together(triangles.reshape(-1))
    alike = dot(normals[one // 3], normals[other // 3]) >= np.cos(np.radians(CREASE_DEGREES))
    return one[alike], other[alike]


def corners_reached(triangles, creases):
    """Pairs of corners at one vertex, of facets that are joined there by edges of two facets that are no creases."""
    ends, number, uses, keys = edges_of(triangles)
    creases = np.sort(np.reshape(creases, (-1, 2)), axis=1)
    is_crease = np.isin(keys, creases[:, 0] * (triangles.max() + 1) + creases[:, 1])
    order = np.argsort(number, kind="stable")
    first = (np.cumsum(uses) - uses)[(uses == 2) & ~is_crease]
    links = []
    # Of each of the two facets the corners at both ends of the edge, the smaller vertex first.
    sides = [order[first], order[first + 1]]
    for end in (0, 1):
        links.append([3 * (side // 3) + (triangles[side // 3] == ends[side, end][:, None]).argmax(axis=1) for side in sides])
    one, other = np.concatenate(links, axis=1)
    linked = coo_matrix((np.ones(len(one)), (one, other)), shape=(triangles.size,) * 2)
    return together(connected_components(linked, directed=False)[1])


def curved_height(points, triangles, corners, which, weights, most=np.inf):
    """Signed height of the curved triangle over the facet, along its normal, at places; cut off at +- `most`."""
    p, n = points[triangles[which]], corners[which]
    result = sum(weights[:, i, None] ** 3 * p[:, i] for i in range(3))
    middle = np.zeros_like(result)
    for i in range(3):
        for j in range(3):
            if i != j:
                # The control point next to corner i on the edge to corner j, in the tangent plane of corner i.
                along = 2 * p[:, i] + p[:, j]
                b = (along - dot(p[:, j] - p[:, i], n[:, i])[:, None] * n[:, i]) / 3
                result += 3 * (weights[:, i] ** 2 * weights[:, j])[:, None] * b
                middle += b / 6
    middle += (middle - p.mean(axis=1)) / 2
    result += 6 * weights.prod(axis=1)[:, None] * middle
    flat = np.einsum("ij,ijk->ik", weights, p)
    return np.clip(dot(result - flat, unit(doubled_normals(points, triangles))[which]), -most, most)


def outside_band(distance, height):
    """How far signed distances from facets leave the band from 0 to the height, widened."""
    low, high = np.minimum(0, BAND_WIDENING * height), np.maximum(0, BAND_WIDENING * height)
    return np.maximum(0, np.maximum(low - distance, distance - high))


def distances_to_band(places, flat, normals, height, nearest):
    """Distances of places on facets to a surface, 0 where it passes between facet and curved triangle. `flat` are the
    distances of the places, `nearest` searches the surface."""
    shift = BAND_WIDENING * height
    # Where the two triangles are one, or nearly so, one distance will do.
    apart = np.abs(shift) > SAME_SHARE * flat.mean()
    curved = flat.copy()
    curved[apart] = nearest(places[apart] + shift[apart, None] * normals[apart])[0]
    between = np.abs(flat + curved - np.abs(shift)) < BETWEEN_SHARE * np.abs(shift)
    return np.where(between & apart, 0.0, np.minimum(flat, curved))
