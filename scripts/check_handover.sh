#!/usr/bin/env bash
# Opens the files of two runs (bodies in contact; a plate that breaks, so that the topology changes) with USD, VTK and
# Blender from the Python package index and compares them. Not part of scripts/test.sh: it loads about 600 MB.
#   scripts/check_handover.sh [SUPPLE]         the tool, default build/release/bin/supple
set -euo pipefail
cd "$(dirname "$0")/.."
tool=$(realpath "${1:-build/release/bin/supple}")
work=build/handover
mkdir -p "$work"
if [[ ! -x $work/venv/bin/python ]]; then
  python3 -m venv "$work/venv"
  "$work/venv/bin/pip" install --quiet numpy usd-core vtk OpenEXR
  # Blender's module exists for one version of Python each; without it the other checks still run.
  "$work/venv/bin/pip" install --quiet bpy || echo "no bpy for this Python: Blender is left out"
fi
failed=0
check() {
  local scene=$1 name out
  shift
  name=$(basename "$scene" .yaml)
  out=$work/$name
  echo "== $scene $*"
  "$tool" run "$scene" --out "$out" --overwrite --progress none --quiet "$@" --set output.film=false \
    --set 'output.mesh=[usd, obj, ply]' --set 'output.particles=[csv, vtk]' --set 'output.contacts=[csv, vtk]' \
    --set output.meshing.motion=true
  "$work/venv/bin/python" scripts/check_handover.py "$out" "$name" || failed=1
}
check scenes/library/contacts/two_balls.yaml --set 'output.images={size: [320, 180], formats: [png, exr]}'
check scenes/library/objects/plate_breaks.yaml --frames 1-61:6 --set output.images=false
exit "$failed"
