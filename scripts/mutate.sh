#!/usr/bin/env bash
# Plants the defects listed in tests/*/mutations.txt one by one in a copy of the tree and checks that the tests named
# beside them fail. A line is `file|exact source text|replacement|gtest filter`; a | inside a field is written \|,
# a line that starts with # is a comment.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/dependencies.sh"
source "$here/parts.sh"

if [[ ${1:-} == -h || ${1:-} == --help ]]; then
  echo "usage: scripts/mutate.sh [--check] [--new] [-j N] [MODULE ...]    e.g. scripts/mutate.sh core implicit; all modules when none is named"
  echo "--check builds nothing: it says whether every defect still has its place in the sources."
  echo "--new plants those that the last report of the module does not list, build/mutations/MODULE.md."
  echo "-j N plants N defects at a time, each in a copy of the tree with a build of its own."
  exit 0
fi
check=0 new=0 jobs=1
while [[ ${1:-} == -* ]]; do
  case $1 in
    --check) check=1 ;;
    --new) new=1 ;;
    -j)
      jobs=${2:-}
      [[ $jobs =~ ^[1-9][0-9]?$ ]] || { echo "error: -j: expected a number from 1 to 99, found '$jobs'" >&2; exit 2; }
      shift
      ;;
    *) echo "error: unknown option $1" >&2; exit 2 ;;
  esac
  shift
done
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

# The copies are in another folder each time; relative paths and the same layout allow hits of a compiler cache.
export CCACHE_NOHASHDIR=1
# Defects may cause warnings, such as an unused variable.
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

report_of() { echo "$supple_root/build/mutations/$1.md"; }

# row_start: of the row of the report of the line in `field`.
row_start() { echo "| ${field[0]} | \`${field[1]//|/\\|}\` | \`${field[2]//|/\\|}\` | \`${field[3]//|/\\|}\` |"; }

# write_report MODULE: for each line of its list the row of this run, or that of the last report.
write_report() {
  local module=$1 line start row field count=0 report
  report=$(report_of "$module")
  local -a rows=()
  while IFS= read -r line || [[ -n $line ]]; do
    [[ -z $line || $line == \#* ]] && continue
    count=$((count + 1))
    split_line "$line"
    start=$(row_start)
    grep -qxF -- "$start" "$work/bad" && continue
    row=$(cat "$work"/rows/* "$report" 2>/dev/null | grep -F -m 1 -- "$start" || true)
    [[ -z $row ]] || rows+=("$row")
  done <"$supple_root/tests/$module/mutations.txt"
  mkdir -p "$(dirname "$report")"
  {
    echo "# Planted defects: $module"
    echo
    echo "Written by \`scripts/mutate.sh $module\`: each defect is planted alone, and the tests named beside it must fail."
    echo "$count defects, ${#rows[@]} killed, at the commit beside them or where that has uncommitted changes (+)."
    echo
    echo "| file | source | planted instead | tests | killed at |"
    echo "|---|---|---|---|---|"
    printf '%s\n' "${rows[@]}"
  } >"$work/report"
  mv "$work/report" "$report"
  echo "wrote ${report#"$supple_root"/}"
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
  echo "$(row_start) $commit |" >"$home/row"
  [[ $verdict == killed ]]
}

# try_lines MODULE COPY: every `jobs`-th line of the module's list, in the tree of that copy; rows to $work/rows/NUMBER.
try_lines() {
  local module=$1 home=$work/$2 number=0 line field
  while IFS= read -r line || [[ -n $line ]]; do
    number=$((number + 1))
    [[ -z $line || $line == \#* ]] && continue
    ((number % jobs == $2)) || continue
    if ((new)); then
      split_line "$line"
      grep -qF -- "$(row_start)" "$(report_of "$module")" 2>/dev/null && continue
    fi
    if try_line "tests/$module/mutations.txt:$number" "$line"; then
      mv "$home/row" "$work/rows/$(printf %06d "$number")"
    else
      split_line "$line"
      row_start >>"$work/bad"
    fi
  done <"$supple_root/tests/$module/mutations.txt"
}

commit=$(git -C "$supple_root" describe --always --exclude='*' --dirty=+ 2>/dev/null || echo -)
failed=0
for module in "${modules[@]}"; do
  target=${module}_tests
  rm -rf "$work/rows" "$work/bad"
  mkdir "$work/rows"
  touch "$work/bad"
  for ((copy = 0; copy < jobs; ++copy)); do
    home=$work/$copy
    export CCACHE_BASEDIR=$home/tree
    echo "$module: building the tests without defects"
    build "$target" || { tail -n 40 "$home/build.log"; exit 1; }
    cp "$home/tree/build/release/bin/$target" "$home/sound"
  done
  workers=()
  for ((copy = 0; copy < jobs; ++copy)); do
    CCACHE_BASEDIR=$work/$copy/tree try_lines "$module" "$copy" &
    workers+=($!)
  done
  for worker in "${workers[@]}"; do wait "$worker"; done
  bad=$(wc -l <"$work/bad")
  echo "$module: $(find "$work/rows" -type f | wc -l) killed, $bad not"
  failed=$((failed + bad))
  write_report "$module"
done
((failed == 0))
