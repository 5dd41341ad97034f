#!/usr/bin/env python3
"""Measures the surface in a STEP file against a scan, with other code than the product's: Open CASCADE reads the file,
libigl finds nearest points, SciPy does the rest.

Usage: measure_step.py PART.step SCAN [--tol LENGTH|PERCENT%] [--scan-format FORMAT] [--columns X,Y,Z]

SCAN is a mesh (.off .obj .ply .stl), points (.xyz .txt .csv .pts), heights (.asc) or a cloud in G+Smo's XML. Prints one
JSON object. Lengths are in the unit of the files, shares from 0 to 1.

- tol, chord: the tolerance (0.1 % of the scan's diagonal unless given); the largest distance between the surface and
  the triangles it is measured on, at most 2 % of the tolerance unless that takes more than --triangles.
- scan_to_surface, surface_to_scan: share of area within the tolerance, mean, rms, median, p95, p99, max and its place.
  Of a mesh, what lies between a flat facet and the curved triangle over it is met (facets.py); the surface counts
  inside the outline and not over holes. Of a cloud, points weigh spacing^2 (mean distance to 6 neighbours, at most 3
  medians), and beyond the rim count by their distance across the surface; places of the surface count by their distance
  from the nearest point less the spacing there.
- facets: the same for the flat facets; points: vertices or points as they are, unweighed.
- sagitta_p95: heights of curved triangles over facets.
- gathered: connected patches of misses: largest and sum of those above 0.1 % of the area, and these with place.
- coverage: the scan beyond the surface's rim by more than tolerance + spacing; the surface beyond the scan's outline or
  over its holes; the surface's largest distance from the scan, wherever.
- box: the diagonal of the surface's bounding box by that of the scan's.
- crossings: pairs of triangles that pass through each other, unless they do so along less than half a tolerance; the length along which they do so; how far corners reach
  through the other plane, which is less the smaller the triangles are; a place.
- folds (meshes): share of the surface whose normal is more than 90 degrees from the scan's.
"""

import argparse
import json
import sys
import time

import numpy as np

# Compiled modules name the folders of the machine; `cargo xtask tidy` would find them.
sys.dont_write_bytecode = True

from meter.crossings import self_crossings
from meter.judge import judge_cloud, judge_mesh
from meter.scans import FORMATS, largest_piece, read_scan
from meter.surface import read_surface

# Largest chord, in tolerances.
CHORD_TOLERANCES = 0.02
# A chord error below this share of the surface's box is round-off.
ROUND_OFF_CHORD = 1e-6
# Crossings that are shorter all together, in tolerances, count as none: a point where a fold begins.
SHORT_CROSSING = 0.5
# Places on each side, and triangles of the surface at most.
SAMPLES, MOST_TRIANGLES = 150_000, 1_500_000


def measure(step, points, triangles, tolerance=None, samples=SAMPLES, most_triangles=MOST_TRIANGLES, seed=0):
    """All figures for a STEP file and a scan, as a dictionary. `tolerance` is a length."""
    start = time.perf_counter()
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    tolerance = tolerance or 1e-3 * diagonal
    surface = read_surface(step, CHORD_TOLERANCES * tolerance, most_triangles)
    # Near the origin: squares of large coordinates would lose the digits that distances stand in.
    origin = points.mean(axis=0)
    points = points - origin
    surface.move(-origin)
    if triangles is None:
        figures = judge_cloud(points, surface, tolerance, samples, seed)
    else:
        figures = judge_mesh(points, triangles, surface, tolerance, samples, seed)
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    pairs, places, lengths, depths = self_crossings(
        surface.points, surface.triangles, surface.blocks, surface.rim, max(surface.chord, ROUND_OFF_CHORD * size)
    )
    is_short = lengths.sum() <= SHORT_CROSSING * tolerance
    crossings = dict(
        pairs=0 if is_short else len(pairs), triangles=len(np.unique(pairs)), length=float(lengths.sum()), depth=0.0, place=None
    )
    if len(pairs):
        crossings.update(depth=float(depths.max()), place=[float(x) for x in places[lengths.argmax()]])
    result = dict(
        schema=1,
        scan=dict(
            kind="cloud" if triangles is None else "mesh",
            points=len(points),
            triangles=0 if triangles is None else len(triangles),
            diagonal=diagonal,
        ),
        tol=tolerance,
        chord=surface.chord,
        faces=surface.faces,
        triangles=len(surface.triangles),
        **figures,
        box=size / diagonal,
        crossings=crossings,
        seconds=time.perf_counter() - start,
    )
    return moved(result, origin)


def moved(figures, origin):
    """Figures with all places moved by `origin`."""
    if isinstance(figures, list):
        return [moved(one, origin) for one in figures]
    if not isinstance(figures, dict):
        return figures
    place = lambda values: None if values is None else [float(x + o) for x, o in zip(values, origin)]
    return {key: place(value) if key == "place" else moved(value, origin) for key, value in figures.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("step")
    parser.add_argument("scan")
    parser.add_argument("--tol", default="0.1%", help="a length, or a percentage of the scan's diagonal")
    parser.add_argument("--scan-format", choices=FORMATS, help="where the extension does not say it")
    parser.add_argument("--columns", help="three columns of a table, by name or number from 0; x,y,z by default")
    parser.add_argument("--samples", type=int, default=SAMPLES)
    parser.add_argument("--triangles", type=int, default=MOST_TRIANGLES)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--largest-piece", action="store_true", help="measure against the largest piece of a mesh alone")
    options = parser.parse_args()
    points, triangles = read_scan(options.scan, options.scan_format, options.columns and options.columns.split(","))
    if options.largest_piece and triangles is not None:
        triangles = largest_piece(points, triangles)
        used = np.unique(triangles)
        points, triangles = points[used], np.searchsorted(used, triangles)
    tolerance = options.tol
    if tolerance.endswith("%"):
        tolerance = float(tolerance[:-1]) / 100 * np.linalg.norm(np.ptp(points, axis=0))
    print(
        json.dumps(
            measure(options.step, points, triangles, float(tolerance), options.samples, options.triangles, options.seed)
        )
    )


if __name__ == "__main__":
    main()
