"""Whether a surface passes through itself, on its triangles.

Triangles stand in blocks. Blocks that touch and are nearly flat together cannot cross (Volino and Magnenat-Thalmann
1994); of the others, those whose boxes meet are compared triangle by triangle. Two triangles cross where each reaches
through the plane of the other. In blocks that touch, and on the rim of the surface, they must do so by more than the
chord error: there slivers, gaps of that width between grids of different size, and rims that lie on each other pass
through one another without any sheet that crosses another.
"""

import numpy as np
from scipy.sparse import csr_matrix

from .facets import dot, distance_to_lines, unit

# Normals of two touching blocks within this angle of one direction cannot belong to a crossing.
FLAT_DEGREES = 80.0
# Depth, as a share of the chord error, that is no round-off.
SHALLOW = 1e-3
# Pairs of triangles compared at once.
AT_ONCE = 2_000_000


def self_crossings(points, triangles, blocks, rim, chord):
    """Pairs of triangles that cross: (pairs (n, 2), places (n, 3), lengths (n,) of what they have in common, and how far
    (n,) corners of each reach through the plane of the other). `rim` are segments (n, 2, 3) along the rim, `chord` is the
    largest distance of the triangles from the surface."""
    corners = points[triangles]
    normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    order = np.argsort(blocks, kind="stable")
    names, first = np.unique(blocks[order], return_index=True)
    members = np.split(order, first[1:])
    low, high = corners.min(axis=1), corners.max(axis=1)
    box_low = np.array([low[some].min(axis=0) for some in members])
    box_high = np.array([high[some].max(axis=0) for some in members])
    axis = unit(np.array([normals[some].sum(axis=0) for some in members]))
    spread = np.array([np.arccos(np.clip(normals[some] @ axis[k], -1, 1)).max() for k, some in enumerate(members)])
    touching = blocks_that_touch(np.searchsorted(names, blocks), triangles, len(points))
    one, other = meeting_boxes(box_low, box_high)
    between = np.arccos(np.clip(dot(axis[one], axis[other]), -1, 1))
    # A cone around both cones of normals.
    cone = np.maximum(0.5 * (between + spread[one] + spread[other]), np.maximum(spread[one], spread[other]))
    may_cross = cone >= np.radians(FLAT_DEGREES)
    may_cross[~may_cross] = ~touching(one[~may_cross], other[~may_cross])
    pairs = zip(one[may_cross], other[may_cross])
    waiting, count = [], 0
    found = [(np.zeros((0, 2), dtype=int), np.zeros((0, 3)), np.zeros(0), np.zeros(0))]
    for a, b in pairs:
        # Triangles whose boxes reach into the common part of the boxes of the blocks.
        lower, upper = np.maximum(box_low[a], box_low[b]), np.minimum(box_high[a], box_high[b])
        some, others = (
            m[(low[m] <= upper).all(axis=1) & (high[m] >= lower).all(axis=1)] for m in (members[a], members[b])
        )
        i, j = (index.reshape(-1) for index in np.meshgrid(some, others, indexing="ij"))
        meet = (low[i] <= high[j]).all(axis=1) & (low[j] <= high[i]).all(axis=1)
        if a == b:
            meet &= i < j
        waiting.append((i[meet], j[meet]))
        count += meet.sum()
        if count > AT_ONCE:
            found.append(crossing(points, triangles, normals, waiting, SHALLOW * chord))
            waiting, count = [], 0
    if count:
        found.append(crossing(points, triangles, normals, waiting, SHALLOW * chord))
    crossed, places, lengths, depths = (np.concatenate(part) for part in zip(*found))
    number = np.searchsorted(names, blocks)
    near = touching(number[crossed[:, 0]], number[crossed[:, 1]]) | (distance_to_lines(places, rim) <= 2 * chord)
    kept = ~near | (depths > 2 * chord)
    return crossed[kept], places[kept], lengths[kept], depths[kept]


def blocks_that_touch(blocks, triangles, vertices):
    """A function that tells of which pairs of blocks both have a vertex in common."""
    rows, columns = np.repeat(blocks, 3), triangles.reshape(-1)
    used = csr_matrix((np.ones(len(rows), dtype=np.int32), (rows, columns)), shape=(blocks.max() + 1, vertices))
    common = (used @ used.T).tocsr()
    return lambda one, other: np.asarray(common[one, other]).reshape(-1) > 0 if len(one) else np.zeros(0, dtype=bool)


def meeting_boxes(low, high):
    """Pairs of boxes that meet, each box with itself too, by sweeping along x: arrays of first and second boxes."""
    order = np.argsort(low[:, 0], kind="stable")
    low, high = low[order], high[order]
    end = np.searchsorted(low[:, 0], high[:, 0], side="right")
    ones, others = [], []
    for k in range(len(order)):
        after = np.arange(k, end[k])
        meet = (low[after, 1:] <= high[k, 1:]).all(axis=1) & (high[after, 1:] >= low[k, 1:]).all(axis=1)
        others.append(order[after[meet]])
        ones.append(np.full(meet.sum(), order[k]))
    return np.concatenate(ones), np.concatenate(others)


def crossing(points, triangles, normals, candidates, depth):
    """Those of the candidates that cross: pairs, places, lengths of the common line, depths."""
    i, j = (np.concatenate(part) for part in zip(*candidates))
    apart = ~(triangles[i][:, :, None] == triangles[j][:, None, :]).any(axis=(1, 2))
    i, j = i[apart], j[apart]
    # Heights of the corners of each over the plane of the other.
    over_j = np.einsum("nkc,nc->nk", points[triangles[i]] - points[triangles[j, 0]][:, None], normals[j])
    over_i = np.einsum("nkc,nc->nk", points[triangles[j]] - points[triangles[i, 0]][:, None], normals[i])
    through = np.minimum.reduce([over_j.max(axis=1), -over_j.min(axis=1), over_i.max(axis=1), -over_i.min(axis=1)])
    deep = through > depth
    i, j, over_j, over_i, through = i[deep], j[deep], over_j[deep], over_i[deep], through[deep]
    line = np.cross(normals[i], normals[j])
    low_i, high_i, ends_i = on_line(points[triangles[i]], over_j, line)
    low_j, high_j, ends_j = on_line(points[triangles[j]], over_i, line)
    common = (np.minimum(high_i, high_j) - np.maximum(low_i, low_j)) / np.maximum(dot(line, line), 1e-300) ** 0.5
    meet = common > 0
    places = np.where((low_i > low_j)[:, None], ends_i, ends_j)
    return np.column_stack([i, j])[meet], places[meet], common[meet], through[meet]


def on_line(corners, heights, line):
    """The part of the common line that lies in a triangle: its ends as products with the line's direction, and its
    lower end. `heights` are those over the other plane, of both signs."""
    values, places = [], []
    for k in range(3):
        a, b = heights[:, k], heights[:, (k + 1) % 3]
        opposite = (a > 0) != (b > 0)
        share = np.where(opposite, a / np.where(opposite, a - b, 1), 0)
        place = corners[:, k] + share[:, None] * (corners[:, (k + 1) % 3] - corners[:, k])
        values.append(np.where(opposite, dot(place, line), np.nan))
        places.append(place)
    values, places = np.array(values), np.array(places)
    at = np.nanargmin(values, axis=0)
    return np.nanmin(values, axis=0), np.nanmax(values, axis=0), places[at, np.arange(places.shape[1])]
