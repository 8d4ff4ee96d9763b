# shellcheck shell=bash
# Runs the parts of a longer script: one line with the time on the terminal, the output in a log. Sourced.

export CCACHE_SLOPPINESS=pch_defines,time_macros

supple_root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
supple_jobs=$(nproc 2>/dev/null || echo 2)
declare -a part_names=() part_results=() part_seconds=()

# part NAME LOG COMMAND...: runs it, log aside; on failure shows the end of the log and returns 1.
part() {
  local name=$1 log=$2 start=$SECONDS result=passed
  shift 2
  mkdir -p "$(dirname "$log")"
  printf '%-34s ' "$name"
  "$@" >"$log" 2>&1 || result=FAILED
  printf '%s, %d s\n' "$result" $((SECONDS - start))
  part_names+=("$name") part_results+=("$result") part_seconds+=($((SECONDS - start)))
  if [[ $result == FAILED ]]; then
    echo "---- the end of ${log#"$supple_root"/}:"
    # Of a test run only the failures.
    grep -Ev '^ *Start +[0-9]+: | Passed +[0-9.]+ sec$' "$log" | tail -n 60 | cut -c -240
    echo "----"
    return 1
  fi
}

# skip_part NAME REASON: for what cannot run because an earlier part failed; counts as a failure.
skip_part() {
  printf '%-34s skipped: %s\n' "$1" "$2"
  part_names+=("$1") part_results+=("skipped: $2") part_seconds+=(0)
}

# print_summary: one line per part and the total; returns 1 unless every part passed.
print_summary() {
  local k all=0
  echo
  for k in "${!part_names[@]}"; do
    printf '  %-34s %6d s  %s\n' "${part_names[k]}" "${part_seconds[k]}" "${part_results[k]}"
    [[ ${part_results[k]} == passed ]] || all=1
  done
  printf '  %-34s %6d s  %s\n' "all" "$SECONDS" "$( ((all == 0)) && echo passed || echo FAILED)"
  return $all
}

# configure_and_build PRESET TARGET|all [cmake -D...]
configure_and_build() {
  local preset=$1 target=$2
  shift 2
  cd "$supple_root" && cmake --preset "$preset" "$@" && cmake --build --preset "$preset" --target "$target"
}
