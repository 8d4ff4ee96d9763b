#!/usr/bin/env bash
# Plants the defects listed in tests/*/mutations.txt one by one in a copy of the tree and checks that the tests named
# beside them fail. A line is `file|exact source text|replacement|gtest filter`; a | inside a field is written \|,
# a line that starts with # is a comment.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/dependencies.sh"
source "$here/parts.sh"

if [[ ${1:-} == -h || ${1:-} == --help ]]; then
  echo "usage: scripts/mutate.sh [--check | -j N] [MODULE ...]    e.g. scripts/mutate.sh core implicit; all modules when none is named"
  echo "--check builds nothing: it says whether every defect still has its place in the sources."
  echo "-j N plants N defects at a time, each in a copy of the tree with a build of its own."
  echo "A module all of whose defects are killed gets its report, docs/reports/mutations/MODULE.md."
  exit 0
fi
check=0 jobs=1
if [[ ${1:-} == --check ]]; then
  check=1
  shift
elif [[ ${1:-} == -j ]]; then
  jobs=${2:-}
  [[ $jobs =~ ^[1-9][0-9]?$ ]] || { echo "error: -j: expected a number from 1 to 99, found '$jobs'" >&2; exit 2; }
  shift 2
fi
modules=("$@")
if ((${#modules[@]} == 0)); then
  for list in "$supple_root"/tests/*/mutations.txt; do
    [[ -f $list ]] && modules+=("$(basename "$(dirname "$list")")")
  done
fi
((${#modules[@]} > 0)) || { echo "error: no tests/*/mutations.txt found" >&2; exit 2; }
for module in "${modules[@]}"; do
  [[ -f $supple_root/tests/$module/mutations.txt ]] ||
    { echo "error: tests/$module/mutations.txt: not found" >&2; exit 2; }
done

# split_line LINE: the four fields in `field`, with \| turned into |.
split_line() {
  mapfile -t field < <(perl -e 'print map { s/\\\|/|/gr . "\n" } split /(?<!\\)\|/, $ARGV[0], -1' -- "$1")
}

# has_once FILE TEXT
has_once() { perl -0777 -e '
  my ($name, $text) = @ARGV;
  open my $in, "<", $name or die "$name: $!\n";
  my $count = () = <$in> =~ /\Q$text\E/g;
  die "$name: expected the source text once, found it $count times: $text\n" unless $count == 1;' -- "$1" "$2"; }

if ((check)); then
  lost=0
  for module in "${modules[@]}"; do
    while IFS= read -r line || [[ -n $line ]]; do
      [[ -z $line || $line == \#* ]] && continue
      split_line "$line"
      ((${#field[@]} == 4)) && (cd "$supple_root" && has_once "${field[0]}" "${field[1]}") && continue
      echo "tests/$module/mutations.txt: $line"
      lost=1
    done <"$supple_root/tests/$module/mutations.txt"
  done
  exit $lost
fi
install_packages build test

work=$(mktemp -d "${TMPDIR:-/tmp}/supple_mutate.XXXXXX")
trap 'jobs -p | xargs -r kill 2>/dev/null; rm -rf "$work"' EXIT

# plant FILE FROM TO: replaces what it has once.
plant() { perl -0777 -pi -e 'BEGIN { ($from, $to) = splice @ARGV, 0, 2 } s/\Q$from\E/$to/' -- "$2" "$3" "$1"; }

# build TARGET: in `home`, to a log, quietly.
build() { cmake --build "$home/tree/build/release" --target "$1" >"$home/build.log" 2>&1; }

# The copies lie elsewhere each time; relative paths and the layout of the tree itself let the cache know them again.
export CCACHE_NOHASHDIR=1
# Defects may leave warnings, such as of a variable that nothing uses any more.
cat >"$work/compile" <<'END'
#!/bin/sh
command -v ccache >/dev/null && set -- ccache "$@"
"$@" 2>/dev/null || exec "$@" -Wno-error
END
chmod +x "$work/compile"
for ((copy = 0; copy < jobs; ++copy)); do
  home=$work/$copy
  mkdir -p "$home/tree"
  tar -C "$supple_root" --exclude=./build --exclude=./out --exclude=./.git -cf - . | tar -C "$home/tree" -xf -
  echo "configuring a copy of the tree"
  (cd "$home/tree" && cmake --preset release -DSUPPLE_BUILD_TOOL=OFF -DCMAKE_CXX_COMPILER_LAUNCHER="$work/compile" >"$home/configure.log" 2>&1) ||
    { tail -n 30 "$home/configure.log"; exit 1; }
done

# write_report MODULE KILLED ROW...
write_report() {
  local module=$1 killed=$2
  shift 2
  mkdir -p "$supple_root/docs/reports/mutations"
  {
    echo "# Planted defects: $module"
    echo
    echo "Written by \`scripts/mutate.sh $module\`: each defect is planted alone, and the tests named beside it must fail."
    echo "$killed defects, $killed killed."
    echo
    echo "| file | source | planted instead | tests | result |"
    echo "|---|---|---|---|---|"
    printf '%s\n' "$@"
  } >"$supple_root/docs/reports/mutations/$module.md"
  echo "wrote docs/reports/mutations/$module.md"
}

# try_line PLACE LINE: plants one defect in the tree of `home`; prints the verdict, and the row of the report to $home/row.
try_line() {
  local place=$1 field verdict
  split_line "$2"
  if ((${#field[@]} != 4)); then
    echo "  $place: expected 4 fields, found ${#field[@]}"
    return 1
  fi
  local tree=$home/tree file=${field[0]} from=${field[1]} to=${field[2]} filter=${field[3]}
  cp "$tree/$file" "$home/original" || return 1
  if ! timeout 120 "$home/sound" --gtest_brief=1 --gtest_filter="$filter" >"$home/test.log" 2>&1; then
    verdict="the tests fail without the defect"
  elif ! grep -Eq '\[  PASSED  \] [1-9][0-9]* test' "$home/test.log"; then
    verdict="the filter names no test"
  elif ! has_once "$tree/$file" "$from" 2>"$home/error"; then
    verdict=$(sed "s|$tree/||" "$home/error")
  elif ! plant "$tree/$file" "$from" "$to" || ! build "$target"; then
    verdict="does not compile"
  elif timeout 120 "$home/tree/build/release/bin/$target" --gtest_brief=1 --gtest_filter="$filter" >"$home/test.log" 2>&1; then
    verdict=survived
  else
    verdict=killed
  fi
  cp "$home/original" "$tree/$file"
  printf '  %-8s %s  %s: %s -> %s\n' "$verdict" "$place" "$file" "$from" "$to"
  echo "| $file | \`${from//|/\\|}\` | \`${to//|/\\|}\` | \`${filter//|/\\|}\` | $verdict |" >"$home/row"
  [[ $verdict == killed ]]
}

# try_lines MODULE COPY: every `jobs`-th line of the module's list, in the tree of that copy; rows to $work/rows/NUMBER.
try_lines() {
  local module=$1 home=$work/$2 number=0 line
  while IFS= read -r line || [[ -n $line ]]; do
    number=$((number + 1))
    [[ -z $line || $line == \#* ]] && continue
    ((number % jobs == $2)) || continue
    try_line "tests/$module/mutations.txt:$number" "$line" && mv "$home/row" "$work/rows/$(printf %06d "$number")"
  done <"$supple_root/tests/$module/mutations.txt"
}

failed=0
for module in "${modules[@]}"; do
  target=${module}_tests
  rm -rf "$work/rows"
  mkdir "$work/rows"
  for ((copy = 0; copy < jobs; ++copy)); do
    home=$work/$copy
    export CCACHE_BASEDIR=$home/tree
    echo "$module: building the tests without defects"
    build "$target" || { tail -n 40 "$home/build.log"; exit 1; }
    cp "$home/tree/build/release/bin/$target" "$home/sound"
  done
  for ((copy = 0; copy < jobs; ++copy)); do
    CCACHE_BASEDIR=$work/$copy/tree try_lines "$module" "$copy" &
  done
  wait
  rows=()
  for row in "$work"/rows/*; do
    [[ -f $row ]] && rows+=("$(<"$row")")
  done
  lines=$(grep -cEv '^(#|$)' "$supple_root/tests/$module/mutations.txt" || true)
  bad=$((lines - ${#rows[@]}))
  echo "$module: ${#rows[@]} killed, $bad not"
  if ((bad == 0 && ${#rows[@]} > 0)); then write_report "$module" "${#rows[@]}" "${rows[@]}"; fi
  failed=$((failed + bad))
done
((failed == 0))
