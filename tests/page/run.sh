#!/bin/sh
# Makes the page of a part and of a batch with a broken part, and checks them: run.sh PROGRAM
set -eu
thb=$(realpath "$1")
here=$(dirname "$(realpath "$0")")
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
fixtures=$here/../../fixtures
printf '1 2 3\n' > "$out/broken.xyz"
"$thb" fit -q "$fixtures/wigley_900.off" --tol 0.5% -o "$out/part.step" --report "$out/part.html" --report "$out/part.json"
# A broken part ends a batch with 1, after all others.
"$thb" fit -q "$fixtures/bonnet_1600.ply" "$fixtures/wigley_900.off" "$out/broken.xyz" --tol 0.5% -o "$out/batch" || [ $? -eq 1 ]
node "$here/check.mjs" "$out/part.html" "$out/batch/index.html"
