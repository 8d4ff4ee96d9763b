#!/usr/bin/env bash
# The slower checks, for use before a release: clang, static analysis, clang's sanitizers, the thread sanitizer, every header compiled alone,
# the installed package. Writes docs/checks.md. Planted defects take hours and are run by scripts/mutate.sh.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/dependencies.sh"
source "$here/parts.sh"
source "$here/package_check.sh"

usage="usage: scripts/check_all.sh [clang] [analysis] [sanitizers] [threads] [install]    all when none is named; logs go to build/logs"
for name in "$@"; do
  case $name in
    clang | analysis | sanitizers | threads | install) ;;
    -h | --help) echo "$usage" && exit 0 ;;
    *) echo "$usage" >&2 && exit 2 ;;
  esac
done
chosen=" ${*:-clang analysis sanitizers threads install} "
chose() { [[ $chosen == *" $1 "* ]]; }

logs=$supple_root/build/logs
clang_build=$supple_root/build/clang

# Without precompiled headers: clang cannot read those of GCC, and every file must include what it uses.
configure_clang() {
  cmake -S "$supple_root" -B "$clang_build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=clang++ -DSUPPLE_PRECOMPILE_HEADERS=OFF \
    -DSUPPLE_WARNINGS_AS_ERRORS=ON -DSUPPLE_BUILD_TESTS=ON -DCMAKE_EXPORT_COMPILE_COMMANDS=ON \
    -DSUPPLE_BUILD_PYTHON=ON -DPython_EXECUTABLE=/usr/bin/python3
}
build_clang() { configure_clang && cmake --build "$clang_build"; }
test_clang() { ctest --test-dir "$clang_build" -j "$supple_jobs" --output-on-failure --no-tests=error; }

analyse() {
  configure_clang &&
    sed -n 's/^ *"file": "\(.*\)",*$/\1/p' "$clang_build/compile_commands.json" | grep -E '/(src|cli|python)/' | sort -u |
    xargs -P "$supple_jobs" -n 2 clang-tidy --quiet -p "$clang_build"
}

# All modules, the tool, fits and the Python package; the test objects are those of the release build.
test_sanitizers() { cd "$supple_root" && ctest --preset sanitizers_all -j "$supple_jobs" --no-tests=error; }
build_sanitizers() {
  configure_and_build release all -DSUPPLE_BUILD_TESTS=ON -DSUPPLE_CGAL=ON -DSUPPLE_UNITY_BUILD=ON -DSUPPLE_BUILD_PYTHON=ON -DPython_EXECUTABLE=/usr/bin/python3 &&
    configure_and_build sanitizers all -DSUPPLE_CGAL=ON -DSUPPLE_BUILD_PYTHON=ON -DPython_EXECUTABLE=/usr/bin/python3
}

test_tsan() {
  cd "$supple_root" && TSAN_OPTIONS="suppressions=$here/tsan_suppressions.txt ignore_noninstrumented_modules=1 halt_on_error=1" \
    ctest --preset tsan -j "$supple_jobs" --no-tests=error
}

install_packages build run test python check

if ! chose clang; then
  :
elif part "build (clang)" "$logs/build_clang.log" build_clang; then
  part "tests (clang)" "$logs/tests_clang.log" test_clang || true
else
  skip_part "tests (clang)" "no build"
fi
! chose analysis || part "static analysis" "$logs/analysis.log" analyse || true
if ! chose sanitizers; then
  :
elif part "build (clang's sanitizers)" "$logs/build_sanitizers.log" build_sanitizers; then
  part "tests (clang's sanitizers)" "$logs/tests_sanitizers.log" test_sanitizers || true
else
  skip_part "tests (clang's sanitizers)" "no build"
fi
if ! chose threads; then
  :
elif part "build (thread sanitizer)" "$logs/build_tsan.log" configure_and_build tsan all; then
  part "tests (thread sanitizer)" "$logs/tests_tsan.log" test_tsan || true
else
  skip_part "tests (thread sanitizer)" "no build"
fi
if ! chose install; then
  :
elif part "build (release)" "$logs/build_release.log" configure_and_build release all -DSUPPLE_BUILD_TESTS=ON -DSUPPLE_CGAL=ON -DSUPPLE_BUILD_PYTHON=ON -DPython_EXECUTABLE=/usr/bin/python3; then
  part "headers stand alone" "$logs/headers.log" \
    configure_and_build release all_verify_interface_header_sets || true
  part "installed package" "$logs/package.log" check_package "$supple_root/build/release" || true
  part "Python wheel" "$logs/wheel.log" check_wheel "$supple_root/build/release" || true
  part "Debian package" "$logs/deb.log" check_deb "$supple_root/build/release" || true
  part "documentation site" "$logs/docs.log" "$here/docs.sh" "$supple_root/build/release" || true
else
  for name in "headers stand alone" "installed package" "Python wheel" "Debian package" "documentation site"; do skip_part "$name" "no build"; done
fi

failed=0
print_summary || failed=1
report=$supple_root/docs/checks.md
mkdir -p "$(dirname "$report")"
# What was not run this time keeps its last line.
declare -A rows=()
declare -a order=()
remember() {
  [[ -n ${rows[$1]+known} ]] || order+=("$1")
  rows[$1]=$2
}
while IFS= read -r line; do
  name=${line#| } name=${name%% | *}
  [[ $line == "| "*" | "* && $name != check ]] && remember "$name" "$line"
done < <(cat "$report" 2>/dev/null)
commit=$(git -C "$supple_root" rev-parse --short HEAD 2>/dev/null || echo unknown)
for k in "${!part_names[@]}"; do
  remember "${part_names[k]}" "| ${part_names[k]} | ${part_results[k]} | ${part_seconds[k]} | $commit |"
done
{
  echo "# Checks"
  echo
  echo "Written by \`scripts/check_all.sh\` with $(g++ --version | head -n 1), $(clang++ --version | head -n 1)."
  echo "Times are those of $supple_jobs processors; a compiler cache that is warm makes the builds shorter."
  echo
  echo "| check | result | time [s] | at commit |"
  echo "|---|---|---|---|"
  for name in "${order[@]}"; do echo "${rows[$name]}"; done
} >"$report"
echo "wrote docs/checks.md"
exit $failed
