#!/usr/bin/env python3
"""Fits the cloud of crates/fit-ls/tests/golden.rs adaptively with G+Smo (package pygismo) and prints each iteration.

Usage: peaks_gismo.py [POINTS [ITERATIONS]]

G+Smo solves; the loop around it is the one of its class gsHFitting, which the binding does not have: every cell with a
point whose error is at least the threshold is refined, extended by two cells of the next level.
"""

import sys

import numpy as np
import pygismo

DEGREE, ELEMENTS, SMOOTHING, THRESHOLD, EXTENSION = 2, 8, 1e-7, 1e-4, 2


def random_parameters(count):
    """The linear congruential generator of the test."""
    state, numbers = 1, []
    for _ in range(2 * count):
        state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
        numbers.append((state >> 11) / 2**53)
    return np.array(numbers).reshape(count, 2)


def peaks(parameters):
    x, y = 2 * parameters.T - 1
    cusps = [np.exp(-np.hypot(10 * x + shift, 10 * y + shift)) for shift in (-3, 3, 0)]
    return np.column_stack([x, y, 2 / 3 * sum(cusps)])


def boxes(basis, parameters):
    """The cells of the next level that hold points, extended, as G+Smo wants them: level, lower and upper corner."""
    levels = np.array(basis.asElements(np.repeat(parameters, 2, axis=0).T, 0)).reshape(-1, 5)[:, 0]
    result = set()
    for level, uv in zip(levels, parameters):
        cells = ELEMENTS << int(level)
        corner = np.floor(uv * cells).astype(int)
        low, high = np.maximum(corner - EXTENSION, 0), np.minimum(corner + EXTENSION + 1, cells)
        result.add((int(level), *map(int, low), *map(int, high)))
    return [number for box in sorted(result) for number in box]


def main(count=3000, iterations=5):
    parameters = random_parameters(count)
    points = peaks(parameters)
    breaks = [i / ELEMENTS for i in range(ELEMENTS + 1)]
    knots = pygismo.nurbs.gsKnotVector([0.0] * DEGREE + breaks + [1.0] * DEGREE, DEGREE)
    basis = pygismo.hsplines.gsTHBSplineBasis2(pygismo.nurbs.gsTensorBSplineBasis2(knots, knots))
    for iteration in range(iterations):
        fit = pygismo.modelling.gsFitting(parameters.T, points.T, basis)
        fit.compute(SMOOTHING)
        errors = np.linalg.norm(fit.result().eval(parameters.T).T - points, axis=1)
        print(f"{iteration} {basis.size():6} {errors.max():.9e} {np.mean(errors**2):.9e}")
        basis.refineElements(boxes(basis, parameters[errors >= THRESHOLD]))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
