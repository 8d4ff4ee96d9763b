#!/usr/bin/env bash
# Plants the defects listed in tests/*/mutations.txt one by one in a copy of the tree and checks that the tests named
# beside them fail. A line is `file|exact source text|replacement|gtest filter`; a | inside a field is written \|,
# a line that starts with # is a comment.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/dependencies.sh"
source "$here/parts.sh"

if [[ ${1:-} == -h || ${1:-} == --help ]]; then
  echo "usage: scripts/mutate.sh [--check] [MODULE ...]    e.g. scripts/mutate.sh core implicit; all modules when none is named"
  echo "--check builds nothing: it says whether every defect still has its place in the sources."
  echo "A module all of whose defects are killed gets its report, docs/reports/mutations/MODULE.md."
  exit 0
fi
check=0
if [[ ${1:-} == --check ]]; then
  check=1
  shift
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
trap 'rm -rf "$work"' EXIT
tree=$work/tree
mkdir "$tree"
tar -C "$supple_root" --exclude=./build --exclude=./out --exclude=./.git -cf - . | tar -C "$tree" -xf -
# The copy lies elsewhere each time; relative paths let the cache know it again.
export CCACHE_BASEDIR=$tree CCACHE_NOHASHDIR=1

# plant FILE FROM TO: replaces what it has once.
plant() { perl -0777 -pi -e 'BEGIN { ($from, $to) = splice @ARGV, 0, 2 } s/\Q$from\E/$to/' -- "$2" "$3" "$1"; }

# build TARGET: to a log, quietly.
build() { cmake --build "$work/build" --target "$1" >"$work/build.log" 2>&1; }

echo "configuring a copy of the tree"
cmake -S "$tree" -B "$work/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSUPPLE_BUILD_TOOL=OFF >"$work/configure.log" 2>&1 ||
  { tail -n 30 "$work/configure.log"; exit 1; }

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

failed=0
for module in "${modules[@]}"; do
  target=${module}_tests
  echo "$module: building the tests without defects"
  build "$target" || { tail -n 40 "$work/build.log"; exit 1; }
  program=$work/build/bin/$target
  cp "$program" "$work/sound"
  declare -a rows=()
  number=0 killed=0 bad=0
  while IFS= read -r line || [[ -n $line ]]; do
    number=$((number + 1))
    [[ -z $line || $line == \#* ]] && continue
    place=tests/$module/mutations.txt:$number
    split_line "$line"
    if ((${#field[@]} != 4)); then
      echo "  $place: expected 4 fields, found ${#field[@]}"
      bad=$((bad + 1))
      continue
    fi
    file=${field[0]} from=${field[1]} to=${field[2]} filter=${field[3]}
    cp "$tree/$file" "$work/original" || { bad=$((bad + 1)); continue; }
    if ! timeout 120 "$work/sound" --gtest_brief=1 --gtest_filter="$filter" >"$work/test.log" 2>&1; then
      verdict="the tests fail without the defect"
    elif ! grep -Eq '\[  PASSED  \] [1-9][0-9]* test' "$work/test.log"; then
      verdict="the filter names no test"
    elif ! has_once "$tree/$file" "$from" 2>"$work/error"; then
      verdict=$(sed "s|$tree/||" "$work/error")
    elif ! plant "$tree/$file" "$from" "$to" || ! build "$target"; then
      verdict="does not compile"
    elif timeout 120 "$program" --gtest_brief=1 --gtest_filter="$filter" >"$work/test.log" 2>&1; then
      verdict=survived
    else
      verdict=killed
    fi
    cp "$work/original" "$tree/$file"
    if [[ $verdict == killed ]]; then killed=$((killed + 1)); else bad=$((bad + 1)); fi
    printf '  %-8s %s  %s: %s -> %s\n' "$verdict" "$place" "$file" "$from" "$to"
    rows+=("| $file | \`${from//|/\\|}\` | \`${to//|/\\|}\` | \`${filter//|/\\|}\` | $verdict |")
  done <"$supple_root/tests/$module/mutations.txt"
  echo "$module: $killed killed, $bad not"
  if ((bad == 0 && killed > 0)); then write_report "$module" "$killed" "${rows[@]}"; fi
  failed=$((failed + bad))
done
((failed == 0))
