#!/usr/bin/env python3
"""Fits a thousand files, 12 % of them hostile, in one run under a bound of memory: every good one is fitted, and every file has a line.

Usage: big_batch.py THB [FILES]      THB is the program; standard library only

Prints the seconds, the largest resident size and how the parts ended. Exits with 1 at the first thing that is not as it should be.
"""

import gzip
import json
import math
import pathlib
import random
import resource
import struct
import subprocess
import sys
import tempfile
import time
import zipfile

LIMIT_KIB = 4_000_000
JOBS = 8


def sheet(seed):
    """A bent sheet of some hundred points, and its size."""
    draw = random.Random(seed)
    n, m = draw.randint(9, 24), draw.randint(9, 24)
    a, b, size = draw.uniform(0.5, 3), draw.uniform(0.1, 0.5), draw.choice([1, 10, 1000])
    point = lambda i, j: (5.0 * i, 5.0 * j, a * math.sin(b * i) * math.cos(0.2 * j) + 0.01 * i * j)
    return [tuple(size * c for c in point(i, j)) for j in range(m) for i in range(n)], (n, m)


def good(folder, k):
    points, (n, m) = sheet(k)
    lines = "".join(f"{x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in points)
    faces = [(j * n + i, j * n + i + 1, j * n + i + n + 1, j * n + i + n) for j in range(m - 1) for i in range(n - 1)]
    kind = k % 6
    path = folder / f"good{k:04}.{['off', 'csv', 'xyz', 'ply', 'obj', 'stl'][kind]}"
    if kind == 0:
        path.write_text(f"OFF\n{len(points)} {len(faces)} 0\n{lines}" + "".join(f"4 {a} {b} {c} {d}\n" for a, b, c, d in faces))
    elif kind == 1:
        path.write_text("i,j,x,y,z\n" + "".join(f"{r // n},{r % n},{x},{y},{z}\n" for r, (x, y, z) in enumerate(points)))
    elif kind == 2:
        path.write_text("//X Y Z\n" + lines)
    elif kind == 3:
        head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
        head += "".join(f"property double {axis}\n" for axis in "xyz")
        head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
        body = b"".join(struct.pack("<3d", *p) for p in points) + b"".join(struct.pack("<B4i", 4, *f) for f in faces)
        path.write_bytes(head.encode() + body)
    elif kind == 4:
        path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in points) + "".join("f " + " ".join(str(c + 1) for c in f) + "\n" for f in faces))
    else:
        triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
        body = b"".join(struct.pack("<12fH", 0, 0, 1, *[v for c in t for v in points[c]], 0) for t in triangles)
        path.write_bytes(b" " * 80 + struct.pack("<I", len(triangles)) + body)
    return path


def hostile(folder, k):
    draw = random.Random(k)
    las = bytearray(227)
    las[:4], las[24:26], las[94:96], las[96:100] = b"LASF", b"\x01\x02", struct.pack("<H", 227), struct.pack("<I", 227)
    las[105:107], las[107:111] = struct.pack("<H", draw.randint(0, 65535)), b"\xff" * 4
    huge = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    ways = [
        ("ply", huge.encode()),
        ("las", bytes(las)),
        ("off", b"OFF\n4000000000 4000000000 0\n0 0 0\n"),
        ("xyz", b"0 0 0\n1 0 0\n0 1 1e300\n1 1 0\n2 2 2\n"),
        ("xyz", "".join(f"{k} {k} {k}\n" for k in range(99)).encode()),
        ("csv", b""),
        ("xyz.gz", gzip.compress(b"1 2 3\n" * 10_000_000, 9)),
        ("stl", bytes(draw.randrange(256) for _ in range(5000))),
        ("xml", b"<xml>" + b"<a x='1'>" * 20_000),
        ("pcd", b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nDATA ascii\nnan nan nan\nnan nan nan\n"),
        ("asc", b"ncols 3\nnrows 3\nxllcorner 1.7e308\nyllcorner 0\ncellsize 1e308\n1 2 3\n4 5 6\n7 8 9\n"),
        ("tif", b"II*\0\x08\0\0\0" + bytes(draw.randrange(256) for _ in range(300))),
        ("e57", b"ASTM-E57" + bytes(draw.randrange(256) for _ in range(3000))),
        ("txt", b"0,5,1,5,2,5\n1,5,1,05,2,5\n" * 20),
    ]
    kind, content = ways[k % len(ways)]
    path = folder / f"hostile{k:04}.{kind}"
    if k % 29 == 0:
        path = path.with_suffix(".zip")
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("a.xyz", b"0" * 300_000_000)
    else:
        path.write_bytes(content)
    return path


def main():
    thb, count = str(pathlib.Path(sys.argv[1]).resolve()), int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        # Three of 25 are hostile: 12 %.
        inputs = [hostile(folder, k) if k % 25 in (3, 11, 19) else good(folder, k) for k in range(count)]
        bound = lambda: resource.setrlimit(resource.RLIMIT_AS, (1024 * LIMIT_KIB,) * 2)
        start = time.time()
        command = [thb, "fit", *map(str, inputs), "-o", str(folder / "out"), "--summary", str(folder / "all.jsonl"), "--jobs", str(JOBS)]
        done = subprocess.run([*command, "--quiet"], preexec_fn=bound, capture_output=True, text=True)
        seconds = time.time() - start
        if done.returncode != 1:
            sys.exit(f"FAILED: exit code {done.returncode}: {done.stderr[-2000:]}")
        summary = [json.loads(line) for line in (folder / "all.jsonl").read_text().splitlines()]
        if [line["input"] for line in summary] != [str(path) for path in inputs]:
            sys.exit(f"FAILED: {len(summary)} lines for {count} inputs")
        told = {path.name: [line for line in done.stderr.splitlines() if path.name in line] for path in inputs}
        for line, path in zip(summary, inputs):
            is_good = path.name.startswith("good")
            is_written = (folder / "out" / f"{path.stem}.step").is_file()
            if is_good and not (line["status"] == "fitted" and is_written):
                sys.exit(f"FAILED: {path.name}: {line}")
            if not is_good and not (line["status"] == "failed" and len(told[path.name]) == 1):
                sys.exit(f"FAILED: {path.name}: {line}, {told[path.name]}")
        if any(path.name.endswith(".part") for path in (folder / "out").iterdir()):
            sys.exit("FAILED: files under temporary names are left")
        verdicts = [line.get("verdict", line["status"]) for line in summary]
        counts = {verdict: verdicts.count(verdict) for verdict in ("good", "usable", "failed")}
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        print(f"{count} files, {JOBS} jobs, at most {LIMIT_KIB} KiB of address space: {seconds:.0f} s, {used.ru_utime:.0f} s of CPU,")
        print(f"{used.ru_maxrss / 1024:.0f} MiB resident at most; verdicts and failures {counts}: passed")


if __name__ == "__main__":
    main()
