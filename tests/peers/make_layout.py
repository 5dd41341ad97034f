#!/usr/bin/env python3
"""Writes an ellipsoid as a mesh and a layout of six patches, the faces of a cube: make_layout.py MESH.off LAYOUT.json [--cube]."""

import argparse
import json

import numpy as np

N = 10


def on_cube(face, s, t):
    point = np.zeros(3)
    point[face % 3] = 1.0 if face < 3 else -1.0
    point[(face + 1) % 3], point[(face + 2) % 3] = (s, t) if face < 3 else (t, s)
    return point


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mesh")
    parser.add_argument("layout")
    parser.add_argument("--cube", action="store_true", help="the cube itself, with its edges")
    options = parser.parse_args()
    known, vertices, corners, quads, triangles = {}, [], [], [], []
    for face in range(6):

        def at(i, j):
            point = on_cube(face, 2 * i / N - 1, 2 * j / N - 1)
            key = tuple(np.round(point * N).astype(int))
            if key not in known:
                known[key] = len(vertices)
                bent = np.tan(np.pi / 4 * point)
                round_one = np.array([30.0, 24.0, 18.0]) * bent / np.linalg.norm(bent)
                vertices.append((20.0 * point if options.cube else round_one).tolist())
            return known[key]

        tri = []
        for j in range(N):
            for i in range(N):
                a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
                tri += [[a, b, c], [a, c, d]]
        sides = [
            [at(k, 0) for k in range(N + 1)],
            [at(N, k) for k in range(N + 1)],
            [at(N - k, N) for k in range(N + 1)],
            [at(0, N - k) for k in range(N + 1)],
        ]
        for side in sides:
            if side[0] not in corners:
                corners.append(side[0])
        grid = [(i, j) for j in range(N + 1) for i in range(N + 1)]
        quads.append(
            {
                "corners": [corners.index(side[0]) for side in sides],
                "paths": sides,
                "tri": tri,
                "vid": [at(i, j) for i, j in grid],
                "uv": [[i / N, j / N] for i, j in grid],
            }
        )
        triangles += tri
    with open(options.mesh, "w", encoding="utf-8") as out:
        out.write(f"OFF\n{len(vertices)} {len(triangles)} 0\n")
        out.writelines(" ".join(map(repr, vertex)) + "\n" for vertex in vertices)
        out.writelines("3 " + " ".join(map(str, triangle)) + "\n" for triangle in triangles)
    with open(options.layout, "w", encoding="utf-8") as out:
        json.dump({"vertices": vertices, "corners": corners, "quads": quads}, out)


if __name__ == "__main__":
    main()
