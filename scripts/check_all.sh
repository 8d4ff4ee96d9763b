#!/usr/bin/env bash
# The slower checks, before a release: a second compiler, static analysis, the thread sanitizer, headers that stand alone,
# the installed package. Writes docs/reports/checks.md. Planted defects take hours and have scripts/mutate.sh.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/dependencies.sh"
source "$here/parts.sh"
source "$here/package_check.sh"

if (($# > 0)); then
  echo "usage: scripts/check_all.sh    (no options; logs go to build/logs)"
  [[ $1 == -h || $1 == --help ]] && exit 0
  exit 2
fi

logs=$supple_root/build/logs
clang_build=$supple_root/build/clang

build_clang() {
  cmake -S "$supple_root" -B "$clang_build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_COMPILER=clang++ \
    -DSUPPLE_WARNINGS_AS_ERRORS=ON -DSUPPLE_BUILD_TESTS=ON \
    -DCMAKE_EXPORT_COMPILE_COMMANDS=ON && cmake --build "$clang_build"
}
test_clang() { ctest --test-dir "$clang_build" -j "$supple_jobs" --output-on-failure --no-tests=error; }

analyse() {
  sed -n 's/^ *"file": "\(.*\)",*$/\1/p' "$clang_build/compile_commands.json" | grep -E '/(src|cli)/' | sort -u |
    xargs -P "$supple_jobs" -n 2 clang-tidy --quiet -p "$clang_build"
}

test_tsan() {
  cd "$supple_root" && TSAN_OPTIONS="suppressions=$here/tsan_suppressions.txt ignore_noninstrumented_modules=1 halt_on_error=1" \
    ctest --preset tsan -j "$supple_jobs" --no-tests=error
}

install_packages build run test check

if part "build (clang)" "$logs/build_clang.log" build_clang; then
  part "tests (clang)" "$logs/tests_clang.log" test_clang || true
  part "static analysis" "$logs/analysis.log" analyse || true
else
  for name in "tests (clang)" "static analysis"; do skip_part "$name" "no build"; done
fi
if part "build (thread sanitizer)" "$logs/build_tsan.log" configure_and_build tsan all; then
  part "tests (thread sanitizer)" "$logs/tests_tsan.log" test_tsan || true
else
  skip_part "tests (thread sanitizer)" "no build"
fi
if part "build (release)" "$logs/build_release.log" configure_and_build release all -DSUPPLE_BUILD_TESTS=ON; then
  part "headers stand alone" "$logs/headers.log" \
    configure_and_build release all_verify_interface_header_sets || true
  part "installed package" "$logs/package.log" check_package "$supple_root/build/release" || true
else
  skip_part "headers stand alone" "no build"
  skip_part "installed package" "no build"
fi

failed=0
print_summary || failed=1
mkdir -p "$supple_root/docs/reports"
{
  echo "# Checks"
  echo
  echo "Written by \`scripts/check_all.sh\` with $(g++ --version | head -n 1), $(clang++ --version | head -n 1)."
  echo "Times are those of $supple_jobs processors; a compiler cache that is warm makes the builds shorter."
  echo
  echo "| check | result | time [s] |"
  echo "|---|---|---|"
  for k in "${!part_names[@]}"; do
    echo "| ${part_names[k]} | ${part_results[k]} | ${part_seconds[k]} |"
  done
} >"$supple_root/docs/reports/checks.md"
echo "wrote docs/reports/checks.md"
exit $failed
