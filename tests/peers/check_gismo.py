#!/usr/bin/env python3
"""Opens an XML model with G+Smo (package pygismo) and compares points.

Usage: check_gismo.py MODEL.xml POINTS.csv      (columns u,v,x,y,z, or u,x,y,z for a curve)

Exits with 1 if a point is off by more than 1e-12 of the diagonal of the points' box.
"""

import os
import re
import sys

import numpy as np
import pygismo

TOLERANCE = 1e-12


def load(path):
    """The geometry with id 0, by the type that the file names."""
    with open(path, encoding="utf-8") as file:
        kind = re.search(r'<Geometry[^>]*type="([^"]+)"', file.read()).group(1)
    module = pygismo.hsplines if "HBSpline" in kind else pygismo.nurbs
    geometry = getattr(module, "gs" + kind)()
    # G+Smo reports what it reads on standard output, the whole file included.
    silent, saved = os.open(os.devnull, os.O_WRONLY), os.dup(1)
    os.dup2(silent, 1)
    try:
        pygismo.io.gsFileData(path).getId(0, geometry)
    finally:
        os.dup2(saved, 1)
    return kind, geometry


def main(path, points):
    table = np.genfromtxt(points, delimiter=",", names=True)
    names = [name for name in ("u", "v") if name in table.dtype.names]
    parameters = np.vstack([table[name] for name in names])
    expected = np.vstack([table[name] for name in ("x", "y", "z")])
    kind, geometry = load(path)
    error = np.abs(geometry.eval(parameters) - expected).max()
    relative = error / np.linalg.norm(np.ptp(expected, axis=1))
    print(f"{path}: {kind}, {geometry.coefs().shape[0]} coefficients, {relative:.2e} of the diagonal off")
    return 0 if relative <= TOLERANCE else 1


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
