#!/usr/bin/env bash
# Scenes that ask for far too much: `supple check` answers each as NAME.txt says, in little time and memory.
#   hostile_test.sh SUPPLE FOLDER [--write]
# NAME.txt: the exit code, then the first line of the answer. --write replaces these files.
set -u
supple=$1
folder=$2
write=${3:-}
cd "$folder" || exit 1
failures=0

most_seconds=10      # of CPU; the answer takes one, on a machine that others use, too
most_kilobytes=262144  # resident

for scene in *.yaml; do
  name=${scene%.yaml}
  # wait4 of the child alone tells its peak: `times` of the shell would be of all.
  answer=$(python3 - "$supple" "$scene" "$most_seconds" <<'PROGRAM'
import resource, subprocess, sys
program, scene, seconds = sys.argv[1], sys.argv[2], int(sys.argv[3])
limit = lambda: resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
done = subprocess.run([program, "check", scene], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, preexec_fn=limit)
usage = resource.getrusage(resource.RUSAGE_CHILDREN)
lines = done.stdout.decode(errors="replace").splitlines() or [""]
print(usage.ru_maxrss)
print(done.returncode)
print(lines[0])
PROGRAM
)
  kilobytes=$(sed -n 1p <<< "$answer")
  found=$(sed -n '2,3p' <<< "$answer")
  if [[ $write == --write ]]; then
    printf '%s\n' "$found" > "$name.txt"
  fi
  if [[ ! -f $name.txt ]] || [[ $found != "$(cat "$name.txt")" ]]; then
    printf '%s: expected\n%s\nfound\n%s\n' "$scene" "$(cat "$name.txt" 2> /dev/null)" "$found"
    failures=$((failures + 1))
  fi
  if (( kilobytes > most_kilobytes )); then
    echo "$scene: expected at most $most_kilobytes kB of memory, found $kilobytes"
    failures=$((failures + 1))
  fi
  [[ $write == --write ]] && echo "$scene: $kilobytes kB, $found"
done
exit $((failures > 0))
