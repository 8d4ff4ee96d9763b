#!/usr/bin/env python3
"""Job of the scene 'two drops', fingerprint FINGERPRINT: 21 frames in 4 tasks.

On a machine of a Ray cluster: python3 FILE [--address ADDRESS] [--retries N]. Called again, it does what is missing. Tasks of machines that end are
called again on others.
"""
import argparse
import ctypes
import signal
import subprocess
import sys

import ray

THREADS = 2
FRAMES = 21
CHUNK = 6
SIMULATE = ["supple","run","/shots/John's/two drops.yaml","--out","/runs/two drops","--set","objects.left.particles.mass=0.25","--threads","2","--fingerprint","FINGERPRINT","--progress","none","--quiet","--no-pictures","--resume"]
DRAW = ["supple","render","/shots/John's/two drops.yaml","--out","/runs/two drops","--set","objects.left.particles.mass=0.25","--threads","2","--fingerprint","FINGERPRINT","--progress","none","--quiet"]


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


def run(task):
    simulated = task.remote(SIMULATE)
    wait_for([simulated], "simulation")
    ray.get(simulated)
    drawn = [task.remote(DRAW + ["--frames", f"{first}-{first + CHUNK - 1}"]) for first in range(1, FRAMES + 1, CHUNK)]
    ray.get(wait_for(drawn, "frames, tasks"))
    ray.get(wait_for([task.remote(DRAW)], "film"))


if __name__ == "__main__":
    main()
