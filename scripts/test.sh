#!/usr/bin/env bash
# Everything a change must pass: optimised build and tests, the tests under address and undefined-behaviour
# sanitizers, the tests of the command line by a tool whose modules core, render and scenes have sanitizers, the fuzz targets for a minute
# each, a minimal external project on the installed package, and a small film from end to end.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/dependencies.sh"
source "$here/parts.sh"
source "$here/package_check.sh"

if (($# > 0)); then
  echo "usage: scripts/test.sh    (no options; logs go to build/logs)"
  [[ $1 == -h || $1 == --help ]] && exit 0
  exit 2
fi

run_tests() { cd "$supple_root" && ctest --preset "$1" -j "$supple_jobs" --no-tests=error; }

# Makes a film of a few small frames, from the scene file to the MP4, and checks the files.
small_film() {
  local out=$supple_root/build/small_film
  rm -rf "$out"
  "$supple_root/build/release/bin/supple" run "$supple_root/tests/package/two_balls.yaml" --out "$out" || return 1
  local frames
  frames=$(find "$out/frames" -name 'two_balls.*.png' | wc -l)
  echo "$frames frames"
  ((frames >= 3)) && [[ -s $out/two_balls.mp4 ]] && grep -q '"outcome": *"done"' "$out/result.json"
}

logs=$supple_root/build/logs
install_packages build run test python fuzz

part "planted defects have places" "$logs/mutate_check.log" "$here/mutate.sh" --check || true
part "names in files built together" "$logs/together.log" "$here/together.py" || true
if part "build (release)" "$logs/build_release.log" configure_and_build release all -DSUPPLE_BUILD_TESTS=ON -DSUPPLE_CGAL=ON -DSUPPLE_UNITY_BUILD=ON \
  -DSUPPLE_BUILD_PYTHON=ON -DPython_EXECUTABLE=/usr/bin/python3; then
  part "tests (release)" "$logs/tests_release.log" run_tests release || true
  part "installed package" "$logs/package.log" check_package "$supple_root/build/release" || true
  part "small film" "$logs/small_film.log" small_film || true
else
  for name in "tests (release)" "installed package" "small film"; do skip_part "$name" "no build"; done
fi
if part "build (sanitizers)" "$logs/build_asan.log" configure_and_build asan all -DSUPPLE_UNITY_BUILD=ON; then
  part "tests (sanitizers)" "$logs/tests_asan.log" run_tests asan || true
else
  skip_part "tests (sanitizers)" "no build"
fi
if part "build (sanitized tool, fuzz)" "$logs/build_fuzz.log" configure_and_build fuzz fuzz; then
  part "sanitized tool, fuzz targets" "$logs/fuzz.log" run_tests fuzz || true
else
  skip_part "sanitized tool, fuzz targets" "no build"
fi

print_summary
