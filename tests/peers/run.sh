#!/usr/bin/env bash
# Opens what is written, fitted fixtures and constructed models, in other software: STEP in Open CASCADE and
# Gmsh, XML in G+Smo, DXF with ezdxf. Points at the same parameters must agree. The meter of docs/results/truth.md is tested on
# planted figures, and on a fit.
#
# Usage: run.sh [PYTHON]      an interpreter with the packages of requirements.txt; python3 unless named
set -euo pipefail
cd "$(dirname "$0")/../.."
python=$(command -v "${1:-python3}")
target=${CARGO_TARGET_DIR:-target}
thb=$target/release/thb
cargo build --release --quiet -p cli --bin thb
# Writes models that are hard on a format: deep meshes, sides that are points, curves. With the features of the whole workspace, as
# in its other tests: the packages are built once.
cargo test --quiet --workspace --test geom_io model_peers
models=$target/tmp/peers
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

gmsh=(--gmsh)
if ! "$python" -c "import gmsh" 2>"$work/import"; then
    # Its wheel needs X11 and OpenGL libraries of the system.
    echo "SKIPPED: Gmsh cannot be loaded: $(tail -n 1 "$work/import")"
    gmsh=()
fi

"$python" tests/peers/check_measure.py

if "$python" -c "import laspy, meshio, plyfile, pye57, pypcd4, rasterio, trimesh" 2>"$work/import"; then
    "$python" tests/peers/round_trips.py "$thb"
else
    echo "SKIPPED: files of other libraries (tests/peers/round_trips.txt): $(tail -n 1 "$work/import")"
fi

# A lattice of parameters, boundary included; 2^-5 is a cell boundary on many levels, 1/40 on none.
awk 'BEGIN {
    print "u,v"
    for (j = 0; j <= 32; j++) for (i = 0; i <= 40; i++) printf "%.17g,%.17g\n", i / 40, j / 32
}' >"$work/uv.csv"

# What a file says of itself, in both schemas.
since=$(date +%s)
"$thb" fit fixtures/wigley_900.off --tol 1% --name "Rumpf ß" -o "$work/named.step" --quiet
"$python" tests/peers/check_product.py "$work/named.step" --name "Rumpf ß" --schema AUTOMOTIVE_DESIGN --system "thb " --since "$since"
"$thb" fit fixtures/wigley_900.off --tol 1% --schema ap242 -o "$work/hull.step" -o "$work/hull.json" --quiet
"$python" tests/peers/check_product.py "$work/hull.step" --name hull --schema AP242_MANAGED --system "thb " --since "$since"
"$thb" eval "$work/hull.json" "$work/uv.csv" >"$work/hull.csv"
"$python" tests/peers/check_step.py "$work/hull.step" "$work/hull.csv" --faces 1 --unit millimetre "${gmsh[@]}"

# check NAME UNIT LIMIT OPTION...: fits with the options; the surface as one face, and as several of at most LIMIT
# control points each.
check() {
    local name=$1 unit=$2 limit=$3 file=$work/$1
    shift 3
    # What is written is looked at here, not how near it is: a surface that failed (exit code 3) is written, too.
    "$thb" fit "$@" -o "$file.json" -o "$file.step" -o "$file.xml" --max-step-control-points 1000000 \
        --report "$file.report.json" --quiet || [[ $? == 3 ]]
    "$thb" eval "$file.json" "$work/uv.csv" >"$file.csv"
    local flip=() flipped=()
    if [[ " $* " == *" --flip "* ]]; then
        flip=(--flip) flipped=(--flipped)
    fi
    "$thb" convert "$file.json" -o "$file-faces.step" --max-step-control-points "$limit" "${flip[@]}"
    "$python" tests/peers/check_step.py "$file.step" "$file.csv" --faces 1 --unit "$unit" "${gmsh[@]}" "${flipped[@]}"
    "$python" tests/peers/check_step.py "$file-faces.step" "$file.csv" --unit "$unit" "${gmsh[@]}" "${flipped[@]}"
    "$python" tests/peers/check_gismo.py "$file.xml" "$file.csv"
    # Back from XML: the same numbers to the last digit.
    "$thb" eval "$file.xml" "$work/uv.csv" | cmp - "$file.csv"
    echo "$name: passed"
}

check face millimetre 100 fixtures/nefertiti_299.off --tol 0.5%
check peaks metre 400 fixtures/peaks_4k.csv --degree 2,3 --mesh 5x6 --tol 0.02% --units m
# Fixed parameters need a deep hierarchy.
check blade inch 800 fixtures/blade_1600.ply --method ls --tol 0.02% --units inch --flip

# It must be deep enough for these checks to mean something.
levels=$("$thb" info "$work/blade.json" | awk '/"levels"/ { print $2 + 0 }')
if ((levels < 5)); then
    echo "the blade has $levels levels; at least 5 are needed here" >&2
    exit 1
fi

# The meter reads what is written: a face is met nearly everywhere, and nothing of it is far away.
"$python" tests/peers/measure_step.py "$work/face.step" fixtures/nefertiti_299.off --tol 0.5% >"$work/face.measured.json"
"$python" - "$work/face.measured.json" <<'CHECK'
import json, sys

found = json.load(open(sys.argv[1]))
within, farthest = found["points"]["within"], found["coverage"]["surface_farthest"] / found["tol"]
if not (within > 0.94 and farthest < 20 and 0.95 < found["box"] < 1.05 and found["crossings"]["pairs"] == 0):
    sys.exit(f"FAILED: {found}")
print(f"face: {within:.1%} of the vertices measured within the tolerance, the surface at most {farthest:.1f} tolerances away")
CHECK

for model in biquadratic:millimetre bicubic:inch mixed:metre hierarchical:millimetre spots:millimetre dome:millimetre; do
    name=${model%:*} unit=${model#*:} file=$models/${model%:*}
    "$python" tests/peers/check_step.py "${file}_one.step" "$file.csv" --faces 1 --unit "$unit" "${gmsh[@]}"
    "$python" tests/peers/check_step.py "${file}_many.stp" "$file.csv" --unit "$unit" --flipped "${gmsh[@]}"
    "$python" tests/peers/check_gismo.py "$file.xml" "$file.csv"
    echo "$name: passed"
done
for model in tube:u:0 torus:uv:0 cap:u:1; do
    IFS=: read -r name closed tips <<<"$model"
    file=$models/$name ring=(--closed "$closed" --tips "$tips")
    "$python" tests/peers/check_step.py "${file}_one.step" "$file.csv" --faces 1 "${ring[@]}" "${gmsh[@]}"
    "$python" tests/peers/check_step.py "${file}_many.stp" "$file.csv" --flipped "${ring[@]}" "${gmsh[@]}"
    "$python" tests/peers/check_gismo.py "$file.xml" "$file.csv"
    echo "$name: passed"
done
for model in pierced-sheet: pierced-tube:u; do
    IFS=: read -r name closed <<<"$model"
    file=$models/$name pierced=(--holes "$models/$name-holes.csv" --closed "$closed")
    "$python" tests/peers/check_step.py "${file}_one.step" "$file.csv" --faces 1 "${pierced[@]}" "${gmsh[@]}"
    "$python" tests/peers/check_step.py "${file}_many.stp" "$file.csv" --flipped "${pierced[@]}" "${gmsh[@]}"
    echo "$name: passed"
done
"$python" tests/peers/check_step.py "$models/curve.step" "$models/curve.csv" --unit metre
"$python" tests/peers/check_gismo.py "$models/curve.xml" "$models/curve.csv"
echo "curve: passed"

# Three sheets in one file, each fitted for itself.
awk 'BEGIN {
    split("8 12 6", sizes, " ")
    for (p = 1; p <= 3; p++) for (j = 0; j <= sizes[p]; j++) for (i = 0; i <= sizes[p]; i++)
        vertices = vertices sprintf("v %.9f %.9f %.9f\n", 100 * p + i, j, sin(0.3 * i) * p + 0.01 * i * j)
    for (p = 1; p <= 3; p++) { n = sizes[p]; for (j = 0; j < n; j++) for (i = 0; i < n; i++) {
        a = base + j * (n + 1) + i + 1; faces = faces sprintf("f %d %d %d %d\n", a, a + 1, a + n + 2, a + n + 1) }
        base += (n + 1) * (n + 1) }
    printf "%s%s", vertices, faces
}' >"$work/sheets.obj"
"$thb" fit "$work/sheets.obj" --piece all -o "$work/sheets.step" -o "$work/sheets.json" --quiet || [[ $? == 3 ]]
for piece in 1 2 3; do
    "$thb" eval "$work/sheets.piece-$piece.json" "$work/uv.csv" >"$work/sheets.$piece.csv"
done
"$python" tests/peers/check_pieces.py "$work/sheets.step" "$work"/sheets.[123].csv
echo "pieces: passed"

# A section with a sharp tail, fitted and drawn.
awk 'BEGIN {
    for (k = 0; k <= 120; k++) { t = 3.14159265358979 * k / 120; printf "%.8f %.8f\n", 0.5 + 0.5 * cos(2 * t), 0.12 * sin(2 * t) * sin(t) }
}' >"$work/wing.dat"
awk 'BEGIN { print "u"; for (i = 0; i <= 400; i++) printf "%.17g\n", i / 400 }' >"$work/u.csv"
for degree in 2 3 5; do
    "$thb" fit-curve "$work/wing.dat" --degree "$degree" -o "$work/wing.json" -o "$work/wing.step" -o "$work/wing.dxf" \
        -o "$work/wing.svg" >"$work/wing.txt"
    "$thb" eval "$work/wing.json" "$work/u.csv" >"$work/wing.csv"
    "$python" tests/peers/check_curve.py "$work/wing.dxf" "$work/wing.csv"
    "$python" tests/peers/check_curve.py "$work/wing.svg" "$work/wing.csv"
    awk 'NR == 1 { print $0 ",z" } NR > 1 { print $0 ",0" }' "$work/wing.csv" >"$work/wing-3.csv"
    "$python" tests/peers/check_step.py "$work/wing.step" "$work/wing-3.csv"
done
echo "wing: passed"

# Whole parts in six patches: a round one and a cube.
for shape in "" --cube; do
    "$python" tests/peers/make_layout.py "$work/part.off" "$work/part.layout.json" $shape
    "$thb" fit "$work/part.off" --layout "$work/part.layout.json" -o "$work/part.step"
    "$python" tests/peers/check_solid.py "$work/part.step" "$work/part.off" >"$work/part.json"
done
echo "solids: passed"
