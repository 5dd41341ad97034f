#!/usr/bin/env python3
"""Opens a STEP file of several surfaces with Open CASCADE (package cadquery-ocp) and checks each against points of its own.

Usage: check_pieces.py MODEL.step POINTS1.csv POINTS2.csv ...

Each POINTS.csv has columns u,v,x,y,z. Checked are the transfer of one product, validity of the shape, that there are as many shells and
faces as files, and that the points of each file lie on one face of their own at their parameters, within 1e-9 of the diagonal. Exits with
1 at the first check that fails.
"""

import sys

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL

from check_step import AS_FACE, AS_SHELL, explore, fail, load

TOLERANCE = 1e-9


def main():
    path, *files = sys.argv[1:]
    shape = load(path)
    if not BRepCheck_Analyzer(shape).IsValid():
        fail("the shape is not valid")
    faces, shells = list(explore(shape, TopAbs_FACE, AS_FACE)), list(explore(shape, TopAbs_SHELL, AS_SHELL))
    if [len(faces), len(shells)] != [len(files)] * 2:
        fail(f"{len(faces)} faces and {len(shells)} shells, not {len(files)}")
    surfaces = [BRep_Tool.Surface_s(face) for face in faces]
    left = set(range(len(surfaces)))
    for file in files:
        rows = np.loadtxt(file, delimiter=",", skiprows=1)
        diagonal = np.linalg.norm(np.ptp(rows[:, 2:], axis=0))

        def off(k):
            at = [surfaces[k].Value(u, v) for u, v in rows[:, :2]]
            return np.abs(np.array([[p.X(), p.Y(), p.Z()] for p in at]) - rows[:, 2:]).max() / diagonal

        distance, nearest = min((off(k), k) for k in left)
        if distance > TOLERANCE:
            fail(f"{file}: the points are off the nearest face by {distance:.1e} of the diagonal")
        left.remove(nearest)
        print(f"{file}: {len(rows)} points off their face by {distance:.1e} of the diagonal at most")


if __name__ == "__main__":
    main()
