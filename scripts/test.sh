#!/usr/bin/env bash
# Everything a change must pass: optimised build and tests, a minimal external project on the installed package, a small film from end to end,
# the tests of core, implicit, collision and the command line with address and undefined-behaviour sanitizers in all modules, and the fuzz
# targets for a minute each.
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
# Links the test objects of the release build.
if part "build (sanitizers)" "$logs/build_sanitizers.log" configure_and_build sanitizers sanitized -DSUPPLE_CGAL=ON; then
  part "tests (sanitizers), fuzz targets" "$logs/tests_sanitizers.log" run_tests sanitizers || true
else
  skip_part "tests (sanitizers), fuzz targets" "no build"
fi

print_summary
