#!/usr/bin/env bash
# Scenes that ask for far too much: `supple check` answers each as NAME.txt says, in a second and 256 MB.
#   hostile_test.sh SUPPLE FOLDER [--write]
# NAME.txt: the exit code, then the first line of the answer; or "any answer" where it depends on the speed of the machine. --write replaces the others.
set -u
supple=$1
folder=$2
write=${3:-}
cd "$folder" || exit 1
failures=0

most_seconds=1.0     # of processor time beyond what the program takes to start; times SUPPLE_TEST_SLOWNESS, for sanitizers
most_kilobytes=262144  # resident
slowness=${SUPPLE_TEST_SLOWNESS:-1}
# Sanitizers need more memory, too, and what they build in the time of a check is less: an answer that says so is one.
sanitized=$(nm -D "$supple" 2> /dev/null | grep -c -e __asan_init -e __tsan_init)
((sanitized > 0)) && slowness=20 most_kilobytes=$((4 * most_kilobytes))

most=$(awk "BEGIN {print $most_seconds * $slowness}")

# measure ARGUMENTS...: kilobytes, seconds, exit code, first line of the answer. The quickest of three where one is late or broken off for its time: others may use the machine, too.
measure() {
  python3 - "$supple" "$most" "$start_up" "$@" <<'PROGRAM'
import resource, subprocess, sys
program, most, start_up = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
guard = int(10 * most) + 10
limit = lambda: resource.setrlimit(resource.RLIMIT_CPU, (guard, guard))
best = None
for _ in range(3):
    # wait4 of the child alone tells its peak: `times` of the shell would be of all.
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([program, *sys.argv[4:]], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, preexec_fn=limit)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    best = seconds if best is None else min(best, seconds)
    if best - start_up <= most and b"more than the limits of a check" not in done.stdout:
        break
lines = done.stdout.decode(errors="replace").splitlines() or [""]
print(after.ru_maxrss)
print(f"{best - start_up:.2f}")
print(done.returncode)
print(lines[0])
PROGRAM
}

start_up=0
start_up=$(measure --version | sed -n 2p)
for scene in *.yaml; do
  name=${scene%.yaml}
  answer=$(measure check "$scene")
  kilobytes=$(sed -n 1p <<< "$answer")
  seconds=$(sed -n 2p <<< "$answer")
  found=$(sed -n '3,4p' <<< "$answer")
  any=$(grep -c '^any answer$' "$name.txt" 2> /dev/null)
  ((sanitized > 0)) && [[ $found == *'takes more than the limits of a check'* ]] && any=1
  if [[ $write == --write && $any != 1 ]]; then
    printf '%s\n' "$found" > "$name.txt"
  fi
  if [[ $any == 1 ]]; then
    [[ ${found%%$'\n'*} =~ ^[0346]$ ]] || { echo "$scene: found $found"; failures=$((failures + 1)); }
  elif [[ ! -f $name.txt ]] || [[ $found != "$(cat "$name.txt")" ]]; then
    printf '%s: expected\n%s\nfound\n%s\n' "$scene" "$(cat "$name.txt" 2> /dev/null)" "$found"
    failures=$((failures + 1))
  fi
  if awk "BEGIN {exit !($seconds > $most)}"; then
    echo "$scene: expected an answer after $most s of processor time beyond the start of the program, found $seconds s"
    failures=$((failures + 1))
  fi
  if (( kilobytes > most_kilobytes )); then
    echo "$scene: expected at most $most_kilobytes kB of memory, found $kilobytes"
    failures=$((failures + 1))
  fi
  [[ $write == --write ]] && echo "$scene: $seconds s, $kilobytes kB, $found"
done
exit $((failures > 0))
