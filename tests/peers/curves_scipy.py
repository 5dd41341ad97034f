#!/usr/bin/env python3
"""Compares `thb fit-curve` with scipy on sequences of points, and prints a table.

Usage: curves_scipy.py THB FILE[:graph[:TOL]]...

Each file is fitted by `thb fit-curve --closed no --corners none --lambda 0 --tol TOL` (0.1%). At its control points and
parameters scipy then fits
- lsq: make_lsq_spline on the same knots: the same problem, so the same errors but for round-off;
- fitpack: splprep or splrep, whose own knots come from a smoothing condition s, with s as large as gives at most as many
  control points as thb has; and the number of control points that it needs to get below the MAX of thb;
- joint: `--method joint`, whose parameters move, until TOL.
A second table compares the smoothing splines of graphs: make_smoothing_spline with its weight from cross-validation, and
`thb fit-curve --knots N` with the same weight, for several N.
Files hold x and y, one point a line; graphs a function y of x.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline, make_lsq_spline, make_smoothing_spline, splev, splprep, splrep


def read(path):
    rows = []
    for line in Path(path).read_text(encoding="utf-8").splitlines():
        try:
            rows.append([float(x) for x in line.replace(",", " ").split()[:2]])
        except ValueError:
            continue
    return np.array(rows)


def run(thb, path, arguments):
    with tempfile.TemporaryDirectory() as folder:
        report = f"{folder}/report.json"
        done = subprocess.run([thb, "fit-curve", path, "--report", report, *arguments], capture_output=True, text=True)
        if done.returncode not in (0, 3):
            sys.exit(done.stderr)
        return json.loads(Path(report).read_text(encoding="utf-8"))["result"]


def errors(difference):
    distances = np.linalg.norm(np.atleast_2d(difference.T).T, axis=-1)
    return distances.max(), np.sqrt(np.mean(distances**2))


def fitpack(u, points, s):
    """Control points, and errors, of FITPACK's smoothing with a bound s on the sum of squares."""
    if points.shape[1] == 1:
        spline = splrep(u, points[:, 0], s=s, quiet=1)
        return len(spline[0]) - 4, errors((splev(u, spline) - points[:, 0])[:, None])
    spline, _ = splprep(points.T, u=u, s=s, quiet=1)
    return len(spline[0]) - 4, errors(np.array(splev(u, spline)).T - points)


def search(u, points, good):
    """The largest s of a fine ladder whose result is good, with what it gives."""
    for s in np.geomspace(10.0, 1e-9, 400) * np.var(points, axis=0).sum() * len(points):
        found = fitpack(u, points, s)
        if good(*found):
            return found
    return None


def compare(thb, file):
    path, *kind = file.split(":")
    graph, tolerance = "graph" in kind[:1], (kind[1:] or ["0.1%"])[0]
    points = read(path)
    if graph:
        points = points[np.argsort(points[:, 0], kind="stable")]
        u, points = points[:, 0], points[:, 1:]
    else:
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        points = points[np.concatenate([[True], steps > 0])]
        u = np.concatenate([[0], np.cumsum(steps[steps > 0])])
        u /= u[-1]
    common = ["--corners", "none", "--tol", tolerance, *(["--graph"] if graph else ["--closed", "no"])]
    ours = run(thb, path, [*common, "--lambda", "0"])
    lsq = make_lsq_spline(u, points, np.array(ours["knots"]))
    lsq = errors(lsq(u) - points)
    n = ours["control_points"]
    count, their = max(
        (f for f in (fitpack(u, points, s) for s in ladder(points)) if f[0] <= n), key=lambda f: (f[0], -f[1][1])
    )
    needed = search(u, points, lambda _, e: e[0] <= ours["max"])
    joint = None if graph else run(thb, path, [*common, "--method", "joint"])
    cells = [
        f"`{Path(path).name}`", tolerance, n, *(f"{x:.3e}" for x in (ours["max"], ours["rmse"], *lsq)),
        count, *(f"{x:.3e}" for x in their),
        "–" if needed is None else needed[0],
        "–" if joint is None else f"{joint['control_points']} ({joint['max']:.1e})",
    ]
    print("| " + " | ".join(map(str, cells)) + " |")


def ladder(points):
    return np.geomspace(10.0, 1e-9, 400) * np.var(points, axis=0).sum() * len(points)


def smooth(thb, path):
    points = read(path)
    x, y = points[np.argsort(points[:, 0], kind="stable")].T
    places, index = np.unique(x, return_inverse=True)
    weights = np.bincount(index).astype(float)
    means = np.bincount(index, y) / weights
    spline = make_smoothing_spline(places, means, weights)
    # Along the fit itself the sum of weighted residuals is the weight times the energy, which gives the weight back.
    grid = np.linspace(x[0], x[-1], 100001)
    energy = np.trapezoid(spline.derivative(2)(grid) ** 2, grid)
    weight = (weights * (means - spline(places)) * spline(places)).sum() / energy
    weight /= (x[-1] - x[0]) ** 3
    theirs = errors((spline(x) - y)[:, None])
    for inner in (10, 20, 40, len(places) - 4):
        with tempfile.TemporaryDirectory() as folder:
            output = ["-o", f"{folder}/curve.json", "--knots", str(inner), "--lambda", f"{weight:.17g}"]
            result = run(thb, path, ["--graph", *output])
            model = json.loads(Path(f"{folder}/curve.json").read_text(encoding="utf-8"))
        ours = BSpline(model["knots"][0], np.array(model["coefficients"])[:, 1], 3)
        apart = np.abs(ours(grid) - spline(grid)).max() / np.ptp(y)
        numbers = (theirs[0], theirs[1], result["max"], result["rmse"], apart)
        cells = [f"`{Path(path).name}`", f"{weight:.3e}", len(places) + 2, result["control_points"]]
        print("| " + " | ".join([*map(str, cells), *(f"{x:.3e}" for x in numbers)]) + " |")


def main(thb, *files):
    print("| data | tolerance | control points | thb MAX | RMSE | lsq MAX | RMSE | fitpack control points | MAX | RMSE "
          "| fitpack for the same MAX | joint control points (MAX) |")
    print("|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|")
    for file in files:
        compare(thb, file)
    print("\n| data | weight | scipy control points | thb | scipy MAX | RMSE | thb MAX | RMSE | curves apart, of the range |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    for path in dict.fromkeys(file.split(":")[0] for file in files if ":graph" in file):
        smooth(thb, path)


if __name__ == "__main__":
    main(*sys.argv[1:])
