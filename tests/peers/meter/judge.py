"""Judgements: distances of a scan to a surface and of the surface to the scan, misses that gather, coverage, folds."""

import igl
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from . import facets
from .facets import dot, unit

# Neighbours from which the spacing of a cloud is taken, and to which points that miss are joined.
NEIGHBOURS = 6
# Spacings within which neighbouring points that miss belong together.
JOINED_SPACINGS = 3.0
# Fewest nodes of a patch of misses.
PATCH_NODES = 5
# Share of the area from which on a patch of misses is listed.
LISTED_PATCH = 1e-3
# Parts of triangles that touch have middles no farther apart than this share of the sum of their edges.
TOUCHING_PARTS = 0.8
# A point of a cloud counts for at most so many medians of the spacing: a lonely one would outvote all others.
MOST_SPACING = 3.0
# Places of the surface count by how far they lie outside balls of so many spacings around the points.
COVERED_SPACINGS = 1.0
# Farther than so many spacings from the nearest point the surface lies beyond the outline or over a hole.
BEYOND_SPACINGS = 2.0
# Triangles that may hold the farthest place, in which more places are taken, and how many in each.
FARTHEST, AGAIN = 2000, 60
# How near to the farthest place of each of these more are taken, as shares of the triangle, one after the other.
NEARER = (0.2, 0.05, 0.01)
# Change of the distance between scan and surface, per length, that is expected at most: they are all but parallel.
SLOPE = 0.2
# Points round a place, one of which may be the nearest close by.
OTHERS = 12
# Farthest places round which the surface is evaluated anew, since it may rise or end between the vertices of its triangles,
# and how often at most other places are then the farthest.
SEEN_AGAIN, MOST_TIMES = 20, 15
# A share by which the largest distance from a cloud may be missed.
NEAR_LARGEST = 5e-3
# Places along the outline of a scan, over which the surface may be farthest, and how often the place of the surface over each
# is looked for.
RIM_PLACES, RIM_STEPS = 20_000, 6
# Cosine of the largest angle between these normals and the surface's.
LEAST_ACROSS = 0.05
# A place lies on an outline if it is that near to it, as a share of the diagonal.
ON_OUTLINE = 1e-6


def statistics(distances, places, tolerance, weights=None, others=None):
    """Share within the tolerance, mean, RMS, quantiles and the largest distance with its place; weighed where weights
    are given. `others` are distances and places that count for the largest only."""
    if not len(distances):
        return None
    weights = np.ones(len(distances)) if weights is None else weights
    weights = weights / weights.sum()
    order = np.argsort(distances)
    total = np.cumsum(weights[order])
    quantile = lambda q: float(distances[order[min(np.searchsorted(total, q * total[-1]), len(order) - 1)]])
    largest = [(distances, places)] + ([others] if others is not None and len(others[0]) else [])
    worst, place = max(((d.max(), p[d.argmax()]) for d, p in largest), key=lambda found: found[0])
    return dict(
        within=float(weights[distances <= tolerance].sum()),
        mean=float(weights @ distances),
        rms=float(np.sqrt(weights @ distances**2)),
        median=quantile(0.5),
        p95=quantile(0.95),
        p99=quantile(0.99),
        max=float(worst),
        place=[float(x) for x in place],
    )


def patches(nodes, joined, sizes, distances, places):
    """Connected patches of nodes that miss, `joined` in pairs (one, other), as shares of the area: largest, sum of the
    listed ones, and the listed ones with area, largest distance and its place."""
    links = coo_matrix((np.ones(len(joined[0])), joined), shape=(nodes, nodes))
    count, label = connected_components(links, directed=False)
    share = np.bincount(label, sizes, minlength=count)
    share[np.bincount(label, minlength=count) < PATCH_NODES] = 0.0
    listed = []
    for k in np.argsort(-share)[: int((share > LISTED_PATCH).sum())]:
        at = np.flatnonzero(label == k)
        worst = at[distances[at].argmax()]
        listed.append(dict(area=float(share[k]), max=float(distances[worst]), place=[float(x) for x in places[worst]]))
    return dict(largest=float(share.max(initial=0.0)), total=float(share[share > LISTED_PATCH].sum()), listed=listed)


def gathered_parts(places, sizes, distances, tolerance):
    """Patches of misses among parts of triangles: middles, areas and distances of the parts."""
    miss = distances > tolerance
    if not miss.any():
        return dict(largest=0.0, total=0.0, listed=[])
    middles, total = places[miss], sizes.sum()
    # The edge of an equilateral triangle of the part's area; a part touches at most twelve others.
    edge = np.sqrt(sizes[miss] * 4 / np.sqrt(3))
    apart, other = cKDTree(middles).query(middles, k=min(13, len(middles)))
    apart, other = np.atleast_2d(apart.T).T, np.atleast_2d(other.T).T
    one = np.repeat(np.arange(len(middles)), apart.shape[1])
    apart, other = apart.reshape(-1), other.reshape(-1)
    touch = apart <= TOUCHING_PARTS * (edge[one] + edge[other])
    return patches(len(middles), (one[touch], other[touch]), sizes[miss] / total, distances[miss], middles)


def gathered_points(points, spacing, weights, distances, tolerance):
    """Patches of misses among the points of a cloud, whose weights add up to one."""
    miss = np.flatnonzero(distances > tolerance)
    if not len(miss):
        return dict(largest=0.0, total=0.0, listed=[])
    apart, other = cKDTree(points).query(points[miss], k=NEIGHBOURS + 1)
    number = np.full(len(points), -1)
    number[miss] = np.arange(len(miss))
    one = np.repeat(np.arange(len(miss)), NEIGHBOURS + 1)
    apart, other = apart.reshape(-1), number[other.reshape(-1)]
    near = (other >= 0) & (apart <= JOINED_SPACINGS * spacing[miss[one]])
    return patches(len(miss), (one[near], other[near]), weights[miss], distances[miss], points[miss])


def climbed(corners, triangles, which, distances, at_vertices, judge, number, slope, seed, expected=None):
    """Places in ever smaller surroundings of the farthest ones, with what `judge` finds of the places, the triangles and
    the barycentric coordinates: a list of arrays, of which `number` are the distances. `which` and `distances` are those of
    samples, `at_vertices` of vertices. Distances are expected to change by `slope` a length: triangles are taken by their
    farthest sample or vertex and their size, unless it is known better what is `expected` round each sample, and each goes
    on as long as it may hold the farthest place."""
    random = np.random.default_rng(seed)
    best = np.full(len(triangles), -np.inf)
    np.maximum.at(best, which, distances)
    best = np.maximum(best, at_vertices[triangles].max(axis=1))
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    size = np.max([np.linalg.norm(side, axis=1) for side in (b - a, c - b, a - c)], axis=0)
    promise = best + slope * size
    if expected is not None:
        promise = best.copy()
        np.maximum.at(promise, which, expected)
    chosen = np.argsort(-promise)[:FARTHEST]
    all_places, found, farthest = [], [], best.max()
    middles = None
    for reach in (1.0, *NEARER):
        chosen_again = np.repeat(np.arange(len(chosen)), AGAIN)
        r, s = np.sqrt(random.random(len(chosen_again))), random.random(len(chosen_again))
        weights = np.column_stack([1 - r, r * (1 - s), r * s])
        if middles is not None:
            weights = np.maximum(middles[chosen_again] + reach * (weights - 1 / 3), 0.0)
            weights /= weights.sum(axis=1, keepdims=True)
        of = chosen[chosen_again]
        places = facets.at(corners, triangles, of, weights)
        all_places.append(places)
        found.append(judge(places, of, weights))
        distances = found[-1][number].reshape(len(chosen), AGAIN)
        top = distances.argmax(axis=1)
        farthest = max(farthest, distances.max())
        # Places of the next round are within half of this one's distances from each other.
        kept = distances.max(axis=1) + 0.5 * slope * reach * size[chosen] >= farthest
        middles = weights.reshape(len(chosen), AGAIN, 3)[np.arange(len(chosen)), top][kept]
        chosen = chosen[kept]
        if not len(chosen):
            break
    return np.concatenate(all_places), [np.concatenate(parts) for parts in zip(*found)]


def uncovered(surface, tree, spacing, known):
    """Places of a surface that lie farther than `known` outside the balls of a spacing around the points of a cloud, each farther than
    the one before: triangles in which there may be one are cut into four, again and again. In a triangle of radius r about a place whose
    nearest point is d away, the nearest points are at most d + 2 r from that place and d + r from theirs."""
    pieces = surface.points[surface.triangles]
    places = [np.zeros((0, 3))]
    while len(pieces):
        middles = pieces.mean(axis=1)
        reach = np.linalg.norm(pieces - middles[:, None], axis=2).max(axis=1)
        apart, others = tree.query(middles, k=min(OTHERS, len(spacing)))
        excess = apart[:, 0] - COVERED_SPACINGS * spacing[others[:, 0]]
        if excess.max() > known:
            known = excess.max()
            places.append(middles[[excess.argmax()]])
        reachable = apart <= apart[:, :1] + 2 * reach[:, None]
        least = np.where(reachable, spacing[others], np.inf).min(axis=1)
        # Where all that were asked for can be the nearest there may be more of them.
        least[reachable.all(axis=1)] = spacing.min()
        promise = apart[:, 0] + reach - COVERED_SPACINGS * least
        pieces = pieces[(promise > known * (1 + NEAR_LARGEST)) & (reach > NEAR_LARGEST * known)]
        a, b, c = (pieces[:, k] for k in range(3))
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        pieces = np.concatenate([np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return np.concatenate(places)


def over_outline(points, triangles, diagonal, to_surface, surface_normals):
    """Places of a surface over the outline of a scan, a little inside it: on the normals of the outline's facets. Distances may grow
    towards the outline up to there, in a strip narrower than samples lie apart."""
    starts, normals = facets.along_outline(points, triangles, RIM_PLACES, 3 * ON_OUTLINE * diagonal)
    places = starts
    for _ in range(RIM_STEPS if len(starts) else 0):
        _, which, near = to_surface(places)
        # Where the normal meets the plane of the nearest triangle, unless they are all but parallel.
        across = dot(normals, surface_normals[which])
        across = np.where(np.abs(across) < LEAST_ACROSS, LEAST_ACROSS, across)
        places = starts + (dot(near - starts, surface_normals[which]) / across)[:, None] * normals
    return to_surface(places)[2] if len(starts) else starts


def spacing_of(points):
    """Mean distance of each point to its six nearest neighbours."""
    apart, _ = cKDTree(points).query(points, k=NEIGHBOURS + 1)
    return apart[:, 1:].mean(axis=1)


def beyond_rim(places, distance, near, normals, rim, slack):
    """For places whose nearest point lies on the rim of the surface: how far they lie beyond it, along the surface; and
    their distance across it. Elsewhere 0 and the distance."""
    on_rim = facets.distance_to_lines(near, rim) <= slack
    away = places - near
    across = np.abs(dot(away, normals))
    along = np.sqrt(np.maximum(0, distance**2 - across**2))
    return np.where(on_rim, along, 0.0), np.where(on_rim, across, distance)


def judge_mesh(points, triangles, surface, tolerance, count, seed):
    """All judgements against a mesh."""
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    normals = unit(facets.doubled_normals(points, triangles))
    corners = facets.corner_normals(points, triangles)
    to_surface = facets.searcher(surface.points, surface.triangles)
    surface_normals = unit(facets.doubled_normals(surface.points, surface.triangles))
    most = facets.BAND_TOLERANCES * tolerance

    # From the scan.
    which, weights = facets.sample(points, triangles, count, seed)
    places = facets.at(points, triangles, which, weights)

    def from_scan(places, which, weights):
        flat, near_triangle, near = to_surface(places)
        height = facets.curved_height(points, triangles, corners, which, weights, most)
        return flat, near_triangle, near, facets.distances_to_band(places, flat, normals[which], height, to_surface)

    flat, near_triangle, near, to_band = from_scan(places, which, weights)
    used = np.unique(triangles)
    at_vertices = to_surface(points[used])[0]
    of_all = np.full(len(points), -1.0)
    of_all[used] = at_vertices
    # Where a sample lies in the band the place beside it may not.
    more_places, further = climbed(points, triangles, which, to_band, of_all, from_scan, 3, SLOPE, seed, flat)
    vertices = (np.concatenate([at_vertices, further[3]]), np.concatenate([points[used], more_places]))
    result = dict(
        sagitta_p95=float(np.quantile(np.abs(facets.curved_height(points, triangles, corners, which, weights)), 0.95)),
        scan_to_surface=statistics(to_band, places, tolerance, others=vertices),
        points=statistics(at_vertices, points[used], tolerance),
    )
    facet_figures = dict(scan_to_surface=statistics(flat, places, tolerance, others=vertices))

    # Coverage of the scan.
    slack = 2 * (surface.chord + surface.rim_error) + ON_OUTLINE * diagonal
    along, _ = beyond_rim(places, flat, near, surface_normals[near_triangle], surface.rim, slack)
    # The spacing is the edge of an equilateral triangle of the same area.
    spacing = np.sqrt(4 / np.sqrt(3) * facets.areas(points, triangles)[which])
    beyond = along > tolerance + spacing
    coverage = dict(scan_beyond_rim=float(beyond.mean()))

    # Misses that gather.
    part, part_weights, sizes = facets.split(points, triangles)
    middles = facets.at(points, triangles, part, part_weights)
    missing = to_surface(middles)[0]
    suspect = np.flatnonzero(missing > tolerance)
    if len(suspect):
        height = facets.curved_height(points, triangles, corners, part[suspect], part_weights[suspect], most)
        missing[suspect] = facets.distances_to_band(
            middles[suspect], missing[suspect], normals[part[suspect]], height, to_surface
        )
    result["gathered"] = gathered_parts(middles, sizes, missing, tolerance)

    # From the surface: its samples first, behind them what counts for the largest only, its vertices and further places.
    nearest_on_scan = facets.searcher(points, triangles)
    outline = facets.boundary(points, triangles)

    def from_surface(places):
        distance, nearest_facet, near = nearest_on_scan(places)
        inside = facets.distance_to_lines(near, outline) > ON_OUTLINE * diagonal
        side = np.where(dot(places - near, normals[nearest_facet]) < 0, -1.0, 1.0)
        at_near = facets.barycentric(points, triangles, nearest_facet, near)
        height = facets.curved_height(points, triangles, corners, nearest_facet, at_near, most)
        return distance, nearest_facet, inside, at_near, facets.outside_band(side * distance, height)

    which, weights = facets.sample(surface.points, surface.triangles, count, seed + 1)
    places = np.concatenate([facets.at(surface.points, surface.triangles, which, weights), surface.points])
    found = from_surface(places)
    counted = np.where(found[2], found[4], 0.0)

    def counted_there(places, *_):
        there = from_surface(places)
        return *there, np.where(there[2], there[4], -np.inf)

    of_samples, of_vertices = counted[:count], counted[count:]
    more_places, further = climbed(
        surface.points, surface.triangles, which, of_samples, of_vertices, counted_there, 5, SLOPE, seed
    )
    found = [np.concatenate(pair) for pair in zip(found, further)]
    over = over_outline(points, triangles, diagonal, to_surface, surface_normals)
    if len(over):
        found = [np.concatenate(pair) for pair in zip(found, from_surface(over))]
    places = np.concatenate([places, more_places, over])
    distance, nearest_facet, inside, at_near, banded = found
    samples, extra = inside[:count], inside[count:]
    for kind, figures in ((banded, result), (distance, facet_figures)):
        others = (kind[count:][extra], places[count:][extra])
        figures["surface_to_scan"] = statistics(
            kind[:count][samples], places[:count][samples], tolerance, others=others
        )
    coverage["surface_beyond_outline"] = float(1 - samples.mean())
    coverage["surface_farthest"] = float(distance.max())
    result["facets"], result["coverage"] = facet_figures, coverage

    result["folds"] = folds(
        points,
        triangles,
        nearest_facet[:count],
        at_near[:count],
        samples,
        places[:count],
        surface_normals[which],
        distance[:count],
        tolerance,
    )
    return result


def folds(points, triangles, nearest_facet, weights, inside, places, normals, distances, tolerance):
    """Share of the surface inside the outline whose normal is more than 90 degrees from that of the scan at the nearest
    point, which is blended from the vertices, and from those of all facets no farther away by more than the tolerance. Each
    connected part of the scan may be oriented either way."""
    oriented, part = igl.bfs_orient(triangles)
    doubled = facets.doubled_normals(points, oriented)
    sums = np.column_stack(
        [np.bincount(oriented.reshape(-1), np.repeat(doubled[:, d], 3), minlength=len(points)) for d in range(3)]
    )
    # bfs_orient may exchange corners, so the weights are found by vertex.
    same = (triangles[nearest_facet][:, :, None] == oriented[nearest_facet][:, None, :]).argmax(axis=1)
    weights = np.take_along_axis(weights, same, axis=1)
    scan_normals = unit(np.einsum("ij,ijk->ik", weights, unit(sums)[oriented[nearest_facet]]))
    cosine = dot(scan_normals, normals)
    of_part = part[nearest_facet]
    majority = np.bincount(of_part[inside], np.sign(cosine[inside]), minlength=part.max() + 1)
    facing = np.where(majority[of_part] < 0, -1, 1)
    against = inside & (cosine * facing < 0)
    # At a sharp edge the surface may cut the corner by the tolerance, and the nearest facet is the other face's: a facet
    # round the place that faces as the surface does is enough.
    suspects = np.flatnonzero(against)
    facet_normals = unit(facets.doubled_normals(points, oriented))
    corners = points[oriented]
    middles = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
    for k in suspects:
        radius = distances[k] + tolerance
        like = (facet_normals @ normals[k]) * facing[k] >= 0
        like &= np.linalg.norm(middles - places[k], axis=1) <= radius + reach
        if like.any():
            squared = igl.point_mesh_squared_distance(places[k][None], points, np.ascontiguousarray(oriented[like]))[0]
            against[k] = squared.min() > radius**2
    place = None
    if against.any():
        # A place of the largest group, roughly: the one with most others near it.
        found = places[against]
        radius = 0.01 * np.linalg.norm(np.ptp(points, axis=0))
        crowd = cKDTree(found).query_ball_point(found, radius, return_length=True)
        place = [float(x) for x in found[np.argmax(crowd)]]
    return dict(share=float(against.sum() / max(inside.sum(), 1)), place=place)


def judge_cloud(points, surface, tolerance, count, seed):
    """All judgements against a cloud."""
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    spacing = spacing_of(points)
    weights = np.minimum(spacing, MOST_SPACING * np.median(spacing)) ** 2
    if not weights.any():
        weights = np.ones(len(points))
    distance, triangle, near = facets.searcher(surface.points, surface.triangles)(points)
    at_near = facets.barycentric(surface.points, surface.triangles, triangle, near)
    normals = unit(facets.at(surface.normals, surface.triangles, triangle, at_near))
    slack = 2 * (surface.chord + surface.rim_error) + ON_OUTLINE * diagonal
    along, across = beyond_rim(points, distance, near, normals, surface.rim, slack)
    beyond = along > tolerance + spacing
    evaluated = np.zeros(0, dtype=np.int64)
    vertices = cKDTree(surface.points)
    for _ in range(MOST_TIMES):
        some = np.argsort(-across)[:SEEN_AGAIN]
        # Where a surface is steep its nearest place is not always close to that of the triangles.
        close = np.isin(surface.triangles, vertices.query(points[some], OTHERS)[1]).any(axis=1)
        seen = np.union1d(evaluated, np.append(triangle[some], np.flatnonzero(close)))
        if len(seen) == len(evaluated):
            break
        finer = surface.finer(seen)
        if len(finer[1]) == 0:
            break
        across[some] = np.minimum(across[some], facets.searcher(*finer)(points[some])[0])
        evaluated = seen
    result = dict(
        scan_to_surface=statistics(across, points, tolerance, weights),
        points=statistics(distance, points, tolerance),
        gathered=gathered_points(points, spacing, weights / weights.sum(), across, tolerance),
    )
    which, sides = facets.sample(surface.points, surface.triangles, count, seed + 1)
    places = np.concatenate([facets.at(surface.points, surface.triangles, which, sides), surface.points])
    tree = cKDTree(points)

    def from_surface(places):
        away, nearest_point = tree.query(places)
        there = spacing[nearest_point]
        excess = np.maximum(0.0, away - COVERED_SPACINGS * there)
        return away, excess, (away > BEYOND_SPACINGS * there) & (excess > tolerance)

    found = from_surface(places)
    more_places = uncovered(surface, tree, spacing, found[1].max())
    high = np.argsort(-found[1][count:][surface.triangles].max(axis=1))
    # The highest triangle of each span.
    high = high[np.sort(np.unique(surface.span[high], return_index=True)[1])[:SEEN_AGAIN]]
    more_places = np.concatenate([more_places, surface.finer(high)[0]])
    further = from_surface(more_places)
    away, excess, outside = (np.concatenate(pair) for pair in zip(found, further))
    places = np.concatenate([places, more_places])
    others = (excess[count:], places[count:])
    result["surface_to_scan"] = statistics(excess[:count], places[:count], tolerance, others=others)
    result["coverage"] = dict(
        scan_beyond_rim=float(weights[beyond].sum() / weights.sum()),
        surface_beyond_outline=float(outside[:count].mean()),
        surface_farthest=float(away.max()),
    )
    return result
