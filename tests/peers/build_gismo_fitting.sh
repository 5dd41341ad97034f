#!/usr/bin/env bash
# Builds gismo_fitting.cpp with the sources of G+Smo that the package pygismo brings, for this machine's processor. Takes
# some minutes; needs a C++ compiler and the Python package registry.
#
# Usage: build_gismo_fitting.sh OUTPUT [PYTHON]
set -euo pipefail
output=$(realpath -m "$1")
python=$(command -v "${2:-python3}")
here=$(dirname "$(realpath "$0")")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

"$python" -m venv venv
venv/bin/pip install --quiet cmake ninja
venv/bin/pip download --quiet --no-deps --no-binary pygismo "$(grep pygismo "$here/requirements.txt")"
mkdir source build
tar -xzf pygismo-*.tar.gz -C source --strip-components 1
# The package leaves out two templates that its configuration installs.
touch source/gismo_lib.pc.in source/gismo_nolib.pc.in
PATH=$work/venv/bin:$PATH cmake -G Ninja -S source -B build -D CMAKE_POLICY_VERSION_MINIMUM=3.5 \
    -D CMAKE_BUILD_TYPE=Release -D GISMO_BUILD_LIB=OFF -D GISMO_BUILD_EXAMPLES=OFF -D GISMO_WITH_OPENMP=OFF >configure.log

flags=(-O3 -march=native -DNDEBUG -std=c++14 -w -Ibuild -Isource/src -Isource/external -Isource/optional)
# What is no template.
plain=(gsCore/gsBoundary gsCore/gsBoxTopology gsCore/gsDofMapper gsCore/gsSysInfo gsIO/gsFileManager gsIO/gsOptionList gsIO/gsXml)
sources=("${plain[@]/#/source/src/}")
g++ "${flags[@]}" "$here/gismo_fitting.cpp" "${sources[@]/%/.cpp}" source/external/gzstream/gzstream.cpp -lz -o "$output"
