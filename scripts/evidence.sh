#!/usr/bin/env bash
# Measures what docs/evidence.md shows, and writes that page with its plots. Within an hour on two cores; times are right on a machine without other work.
#   scripts/evidence.sh [--quick] [--build DIR] [--page FILE] [PART...]
#     --quick      small sizes, a few minutes, to see that everything works; the page is build/evidence/evidence.md
#     --build DIR  a finished build (default: build/release); its tool and benchmarks are brought up to date
#     --page FILE  the page; plots go to the folder images beside it (default: docs/evidence.md; with PARTs build/evidence/evidence.md)
#     PART         only these: integrators contact queries meshes pictures scenes skips stability particles bodies conservation peers
# A part that fails or exceeds its time is a line of the page, and the exit code is 1. The page appears when it is complete.
# SUPPLE_PEERS is a folder for a virtual environment with MuJoCo and Drake (default: build/peers); without it or the package index that part says so.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/build/release
words=()
while (($# > 0)); do
  case $1 in
    --build) build=$(realpath "${2:?--build needs a folder}") && shift 2 ;;
    -h | --help) sed -n '2,9s/^# \{0,1\}//p' "${BASH_SOURCE[0]}" && exit 0 ;;
    *) words+=("$1") && shift ;;
  esac
done
[[ -f $build/CMakeCache.txt ]] || { echo "error: $build: expected a build; cmake --preset release && cmake --build build/release" >&2; exit 2; }
cmake --build "$build" --target supple_tool benchmarks >/dev/null
peers=${SUPPLE_PEERS:-$root/build/peers}
if [[ ! -x $peers/bin/python ]]; then python3 -m venv "$peers" || true; fi
for package in mujoco drake; do
  "$peers/bin/python" -c "import ${package/drake/pydrake}" 2>/dev/null || timeout 300 "$peers/bin/pip" install --quiet --disable-pip-version-check "$package" || true
done
export PYTHONDONTWRITEBYTECODE=1
PYTHONPATH=$root/scripts exec python3 -m evidence --supple "$build/bin/supple" --peers "$peers/bin/python" "${words[@]}"
