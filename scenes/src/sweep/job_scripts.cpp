#include "sweep/job_scripts.h"

namespace supple::scenes {
namespace {

constexpr std::string_view kSlurmStart = R"script(#!/usr/bin/env bash
# @JOB@
#   bash FILE              submits all tasks; submitted again, it does what is missing
#   bash FILE TASK ...     one task, as the cluster calls it
# Options of all tasks are variables of sbatch: SBATCH_PARTITION, SBATCH_ACCOUNT, SBATCH_TIMELIMIT ...
set -eu
@COMMANDS@
largest_array=${LARGEST_ARRAY:-1000}  # at most MaxArraySize of the cluster

# send NAME OPTIONS... -- TASK...: submits this file, prints the number of the job
send() {
  local name=$1 options=()
  shift
  while [[ $1 != -- ]]; do options+=("$1"); shift; done
  shift
  sbatch --parsable --requeue --kill-on-invalid-dep=yes --open-mode=append --job-name="$name" --cpus-per-task="$threads" \
    --output="${logs//%/%%}/%x.log" ${options[@]+"${options[@]}"} -- "$file" "$@" | cut -d ';' -f 1
}

# send_array NAME TASKS DEPENDENCY TASK: in arrays that the cluster takes; prints their numbers with a colon before each
send_array() {
  local name=$1 tasks=$2 dependency=$3 first=0 many
  while ((first < tasks)); do
    many=$((tasks - first < largest_array ? tasks - first : largest_array))
    printf ':%s' "$(send "$name" ${dependency:+--dependency="$dependency"} --array="0-$((many - 1))" -- "$4" "$first")"
    first=$((first + many))
  done
}
)script";

constexpr std::string_view kSlurmScene = R"script(
case ${1:-} in
  simulate) exec "${simulate[@]}" ;;
  draw)
    first=$((($2 + SLURM_ARRAY_TASK_ID) * chunk + 1))
    exec "${draw[@]}" --frames "$first-$((first + chunk - 1))"
    ;;
  film) exec "${draw[@]}" ;;
  '') ;;
  *) echo "expected simulate, draw, film or nothing, found '$1'" >&2; exit 2 ;;
esac

file=$(realpath -- "$0")
mkdir -p -- "$logs"
simulated=$(send "$name simulate" -- simulate)
drawn=$(send_array "$name draw" $(((frames + chunk - 1) / chunk)) "afterok:$simulated" draw)
film=$(send "$name film" --dependency="afterok$drawn" -- film)
echo "submitted: simulation $simulated, frames ${drawn#:}, film $film"
)script";

constexpr std::string_view kSlurmSweep = R"script(
case ${1:-} in
  point) exec "${point[@]}" --point $(($2 + SLURM_ARRAY_TASK_ID + 1)) ;;
  collect) exec "${collect[@]}" ;;
  '') ;;
  *) echo "expected point, collect or nothing, found '$1'" >&2; exit 2 ;;
esac

file=$(realpath -- "$0")
mkdir -p -- "$logs"
points_sent=$(send_array "$name point" "$points" '' point)
# Failed points are rows of the table, too.
table=$(send "$name collect" --dependency="afterany$points_sent" -- collect)
echo "submitted: points ${points_sent#:}, table $table"
)script";

constexpr std::string_view kRayStart = R"script(#!/usr/bin/env python3
"""@JOB@

On a machine of a Ray cluster: python3 FILE [--address ADDRESS] [--retries N]. Called again, it does what is missing. Tasks of machines that end are
called again on others.
"""
import argparse
import ctypes
import signal
import subprocess
import sys

import ray

@COMMANDS@


class Ended(Exception):
    """The tool was ended by a signal: the task is called again."""


def end_with_worker():
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def call(command):
    """Runs the tool."""
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, preexec_fn=end_with_worker)
    message = process.communicate()[1].decode("utf-8", "replace").strip()
    if process.returncode < 0 or process.returncode > 128:
        raise Ended(f"ended by signal {abs(process.returncode) % 128}: {command}")
    if process.returncode:
        raise RuntimeError(f"exit {process.returncode}: {message}")
    return message


def wait_for(tasks, what):
    """Returns the tasks when all have ended, with or without a failure."""
    left, done = list(tasks), 0
    while left:
        ready, left = ray.wait(left, num_returns=min(len(left), 100), timeout=10.0)
        if ready:
            done += len(ready)
            print(f"{what} {done}/{len(tasks)}", flush=True)
    return tasks


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--address", help="of the cluster (default: that of this machine)")
    parser.add_argument("--retries", type=int, default=10, help="calls of a task whose machine or process ends (default: 10)")
    arguments = parser.parse_args()
    ray.init(address=arguments.address or "auto", log_to_driver=False)
    task = ray.remote(call).options(num_cpus=THREADS, max_retries=arguments.retries, retry_exceptions=[Ended])
    try:
        run(task)
    except (ray.exceptions.RayError, RuntimeError) as error:
        sys.exit(f"failed: {error}")

)script";

constexpr std::string_view kRayScene = R"script(
def run(task):
    simulated = task.remote(SIMULATE)
    wait_for([simulated], "simulation")
    ray.get(simulated)
    drawn = [task.remote(DRAW + ["--frames", f"{first}-{first + CHUNK - 1}"]) for first in range(1, FRAMES + 1, CHUNK)]
    ray.get(wait_for(drawn, "frames, tasks"))
    ray.get(wait_for([task.remote(DRAW)], "film"))


if __name__ == "__main__":
    main()
)script";

constexpr std::string_view kRaySweep = R"script(
def run(task):
    points = [task.remote(POINT + ["--point", str(k)]) for k in range(1, POINTS + 1)]
    wait_for(points, "points")
    failed = 0
    for point in points:  # failed points are rows of the table, too
        try:
            ray.get(point)
        except ray.exceptions.RayError:
            failed += 1
    ray.get(wait_for([task.remote(COLLECT)], "table"))
    if failed:
        sys.exit(f"{failed} of {POINTS} points failed; the table says why")


if __name__ == "__main__":
    main()
)script";

std::string joined(std::string_view start, std::string_view rest) { return std::string(start) + std::string(rest); }

}  // namespace

std::string slurm_script(bool sweep) { return joined(kSlurmStart, sweep ? kSlurmSweep : kSlurmScene); }
std::string ray_script(bool sweep) { return joined(kRayStart, sweep ? kRaySweep : kRayScene); }

}  // namespace supple::scenes
