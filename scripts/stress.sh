#!/usr/bin/env bash
# Stress tests: hostile and mutated inputs, failing memory and disks, kills, races, long runs. Rows and counts: docs/reliability.md.
#   scripts/stress.sh [ROW...] [--seed N] [--share 0.1] [--scratch DIR] [--jobs N] [--report] [--self-test]     all rows but those of libFuzzer when none is named, two to three hours on two cores
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/dependencies.sh"
source "$here/parts.sh"

build=$supple_root/build/release
previous=
for word in "$@"; do
  [[ $word == -h || $word == --help ]] && exec python3 "$supple_root/tests/stress/stress.py" --help
  [[ $previous == --build ]] && build=$word
  previous=$word
done

install_packages build run test
[[ " $* " != *" libfuzzer-"* ]] || install_packages fuzz
# Another build folder is used as it is, without building.
if [[ $build == "$supple_root/build/release" ]]; then
  log=$supple_root/build/logs/stress_build.log
  mkdir -p "$(dirname "$log")"
  targets=(stress supple_tool scenes_tests collision_tests implicit_tests core_tests benchmarks)
  # A configured folder keeps its options.
  [[ -f $build/build.ninja ]] || cmake -S "$supple_root" --preset release -DSUPPLE_BUILD_TESTS=ON >"$log" 2>&1
  grep -q '^build [^:]*supple_fit_program:' "$build/build.ninja" && targets+=(supple_fit_program)  # without CGAL there is none
  cmake --build "$build" --target "${targets[@]}" >>"$log" 2>&1 || { tail -n 40 "$log" && exit 1; }
fi
exec python3 "$supple_root/tests/stress/stress.py" "$@"
