#!/usr/bin/env python3
"""Time of a job on many machines: a formula, and a simulation of its tasks, event by event. Prints the tables of docs/scaling.md.

A job is a simulation, tasks of `chunk` frames, and the film. The scheduler starts one task after the other. The storage serves one request after the
other: a task reads its states and writes its pictures through it, frame by frame.
"""
import dataclasses
import heapq
import math


@dataclasses.dataclass(frozen=True)
class Job:
    machines: int = 1000            # M, each with one task at a time
    frames: int = 10_000            # F
    simulation: float = 3600.0      # S [s]
    frame: float = 60.0             # r, a frame on one machine [s]
    chunk: int = 10                 # c, frames of a task
    overhead: float = 0.5           # t0, of a task [s]
    dispatch: float = 100.0         # d, tasks that the scheduler starts [1/s]
    traffic: float = 4e6            # b, state and picture of a frame [byte]
    bandwidth: float = 1e9          # B, of the storage [byte/s]
    operations: float = 40.0        # o, calls to the storage for a frame: open, lock, read, rename ...
    rate: float = 20_000.0          # R, calls that the storage serves [1/s]
    film: float = 0.01              # e, of a frame in the film [s]

    @property
    def tasks(self):
        return math.ceil(self.frames / self.chunk)

    @property
    def request(self):
        """Time of the storage for a frame [s]."""
        return max(self.traffic / self.bandwidth, self.operations / self.rate)

    def parts(self):
        """Lower bounds of the time of the frames [s], by what bounds it."""
        task = self.chunk * self.frame + self.overhead
        return {"machines": math.ceil(self.tasks / self.machines) * task,
                "scheduler": (self.tasks - 1) / self.dispatch + task,
                "storage": self.frames * self.request + self.frame}

    def formula(self):
        return self.simulation + max(self.parts().values()) + self.frames * self.film

    def one_machine(self):
        return self.simulation + self.frames * (self.frame + self.film)


def simulate(job):
    """Time of the job [s], by its events."""
    free = [0.0] * job.machines     # when each machine is free
    scheduler = storage = end = 0.0
    events = []                     # (time, order, frames that are left of the task): a frame asks the storage
    order = 0
    waiting = job.tasks
    while waiting or events:
        start = max(free[0], scheduler) if waiting and free else math.inf
        if events and events[0][0] <= start:
            now, _, left = heapq.heappop(events)
            storage = max(storage, now) + job.request
            if left:
                heapq.heappush(events, (storage + job.frame, order, left - 1))
                order += 1
            else:
                heapq.heappush(free, storage)
                end = max(end, storage)
            continue
        heapq.heappop(free)
        scheduler = start + 1.0 / job.dispatch
        heapq.heappush(events, (start + job.overhead + job.frame, order, job.chunk - 1))
        order += 1
        waiting -= 1
    return job.simulation + end + job.frames * job.film


def row(name, job):
    # What alone would take longest.
    parts = {"simulation": job.simulation, "machines": job.tasks * job.chunk * job.frame / job.machines, "scheduler": job.tasks / job.dispatch, "storage": job.frames * job.request}
    bound = max(parts, key=parts.get)
    time, shown = job.formula(), simulate(job)
    print(f"| {name} | {time:,.0f} | {shown:,.0f} | {job.one_machine() / shown:.0f} | {100 * job.one_machine() / shown / job.machines:.0f} % | {bound} |")


def main():
    print("| machines | formula [s] | simulated [s] | speed-up | efficiency | longest part |\n|---|---|---|---|---|---|")
    for machines in (1, 10, 100, 300, 1000, 3000, 10_000):
        row(f"{machines:,}", Job(machines=machines, chunk=10 if machines <= 1000 else 1))
    print("\n| 1,000 machines, with | formula [s] | simulated [s] | speed-up | efficiency | longest part |\n|---|---|---|---|---|---|")
    base = Job()
    for name, changes in (("as above", {}), ("a simulation of 6 minutes", {"simulation": 360.0}), ("one of 6 hours", {"simulation": 21_600.0}),
                          ("tasks of 1 frame", {"chunk": 1}), ("tasks of 25 frames", {"chunk": 25}), ("frames of 1 s", {"frame": 1.0}),
                          ("1 task a second by the scheduler", {"dispatch": 1.0}), ("10 MB/s by the storage", {"bandwidth": 1e7}),
                          ("states of 400 MB", {"traffic": 4e8}), ("100 calls a second by the storage", {"rate": 100.0})):
        row(name, dataclasses.replace(base, **changes))


if __name__ == "__main__":
    main()
