#!/usr/bin/env bash
# Runs job files of `supple job` by OpenJD, Slurm and Ray on this machine and prints the figures of docs/scaling.md. Minutes; no part of scripts/test.sh.
#   scripts/jobs.sh [--frames N] [overhead|openjd|slurm|ray|sweep ...]     all where none is named
# Needs Python with venv. Slurm needs its Debian packages and root: apt-get install slurm-wlm munge
set -eu
cd "$(dirname "$0")/.."
tool=${SUPPLE:-build/release/bin/supple}
[[ -x $tool ]] || { echo "expected the tool at $tool; build it: cmake --build build/release --target supple_tool, or set SUPPLE" >&2; exit 2; }
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
engines=${SUPPLE_ENGINES:-build/engines}  # a virtual environment with openjd-cli and ray
if [[ ! -x $engines/bin/openjd || ! -x $engines/bin/ray ]]; then
  python3 -m venv "$engines"
  "$engines/bin/pip" install --quiet openjd-cli ray
fi
"$engines/bin/python" tests/jobs/jobs.py "$tool" "$scratch/jobs" "$@"
python3 tests/jobs/machines.py
