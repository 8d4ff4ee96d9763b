#!/usr/bin/env bash
# Allocations that fail: the run says so and ends with exit code 6, temporary files are gone, and what it saved is whole: --resume ends in
# the same state as an undisturbed run.
#   alloc_failure_test.sh SUPPLE LIBRARY SCRATCH [STEP]
# STEP: every how many allocations one fails; without it about forty, spread over all. The last thirtieth, where the report is written by
# a library that allocates in destructors, is looked at more closely.
set -u
supple=$1
library=$2
scratch=$3
rm -rf "$scratch"
mkdir -p "$scratch"
cd "$scratch" || exit 1
failures=0
outputs=()

cat > scene.yaml <<'SCENE'
schema: 1
duration: 0.05 s
frame_rate: 60
objects:
  - name: left
    particles: {arrange: single, at: [-0.25, 0, 0], velocity: [1, 0, 0], mass: 0.1}
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.5}}]
    contact: {modulus: 1e4, friction: 0.3}
  - name: right
    particles: {arrange: line, count: 3, spacing: 0.2, at: [0.35, 0, 0.05], mass: 0.1}
    interactions: [{law: bond_frame, stretch: 500, rotation: 1}]
    skeleton: [{shape: point, kernel: {type: wyvill, radius: 0.4}}]
    contact: {modulus: 1e4, friction: 0.3}
ground: {height: -0.4}
output: {particles: [csv, vtk], contacts: csv, mesh: ply, cell: 12 cm}
SCENE

# run FOLDER FLAGS...; the variables of alloc_failure.cpp are those of this shell.
run() {
  local folder=$1
  shift
  "$supple" run scene.yaml --out "$folder" --progress none --threads "${threads:-1}" ${outputs[@]+"${outputs[@]}"} "$@" > out.txt 2> err.txt < /dev/null
}
state_of() { grep -m1 '"state_hash"' "$1/result.json"; }
fail() {
  echo "$1"
  cat err.txt
  failures=$((failures + 1))
}

SUPPLE_FAIL_COUNT=$scratch/count LD_PRELOAD=$library run whole || { cat err.txt; exit 1; }
count=$(cat count)
state=$(state_of whole)
if (( count < 1000 )); then
  echo "expected more than 1000 allocations, found $count"
  exit 1
fi

# ends N: the N-th allocation fails.
ends() {
  local n=$1 code
  rm -rf broken
  SUPPLE_FAIL_AT=$n LD_PRELOAD=$library run broken
  code=$?
  # Few are asked for by what goes on without them.
  [[ $code == 6 || $code == 0 ]] || fail "allocation $n of $count fails: expected exit 6, found $code and:"
  [[ $code == 0 ]] || grep -q 'memory' err.txt || fail "allocation $n of $count fails: expected a message about memory, found:"
  [[ -z $(find broken -name '.*.tmp' 2> /dev/null) ]] || fail "allocation $n of $count fails: a temporary file is left"
  if [[ -d broken ]]; then
    run broken --resume || fail "after allocation $n failed: expected that --resume goes on, found:"
    [[ $(state_of broken) == "$state" ]] || fail "after allocation $n failed: expected $state, found $(state_of broken)"
  fi
}

step=${4:-$(( count / 40 ))}
for n in 1 2 30 60; do ends "$n"; done  # before main
for ((n = step; n <= count; n += step)); do ends "$n"; done
for ((n = count - count / 30; n <= count; n += 17)); do ends "$n"; done
threads=3
for ((n = 7 * step; n < count; n += 9 * step)); do ends "$n"; done
threads=1
# Pictures by the path tracer, whose triangles Embree keeps, and grids by OpenVDB.
if "$supple" run scene.yaml --out probe --progress none --set 'output={images: {size: [16, 16]}}' --set render.renderer=path > /dev/null 2>&1; then
  outputs=(--set 'output={images: {size: [32, 24], samples: 1}, film: false, grid: vdb, cell: 0.12}' --set render.renderer=path --set render.most_samples=4)
  SUPPLE_FAIL_COUNT=$scratch/count LD_PRELOAD=$library run whole --overwrite || { cat err.txt; exit 1; }
  count=$(cat count)
  for ((n = count / 30; n <= count; n += count / 30)); do ends "$n"; done
  for ((n = count - count / 3; n <= count - count / 6; n += count / 97)); do ends "$n"; done
  outputs=()
fi
# malloc, which Eigen calls: arrays that are resized are not destroyed twice.
SUPPLE_FAIL_KIND=malloc SUPPLE_FAIL_COUNT=$scratch/count LD_PRELOAD=$library run whole --overwrite || { cat err.txt; exit 1; }
count=$(cat count)
for ((n = count / 20; n <= count; n += count / 20)); do SUPPLE_FAIL_KIND=malloc ends "$n"; done
exit $((failures > 0))
