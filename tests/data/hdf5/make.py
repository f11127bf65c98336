"""Makes the HDF5 files of this directory with the reference writers, and expected.tsv with the reference readers.

    pip install h5py==3.16.0 numpy==2.4.6 openpmd-api==0.17.1.post4 vtk==9.7.2
    python tests/data/hdf5/make.py

The layouts of GADGET, SWIFT, H5Part and H5MD are those of their specifications, written with h5py. The file of PySPH is
its own output (see ../pysph).
"""

import pathlib
import sys

import h5py
import numpy
import openpmd_api
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent))
import reference  # noqa: E402

rng = numpy.random.default_rng(11)
lines = []


def expect(file, index, number, time, arrays):
    """`arrays` by the names that attributes get."""
    lines.extend(reference.line(file, index, number, time, name, array) for name, array in arrays.items())


def missing(arrays, dtype):
    return numpy.full(len(arrays["positions"]), numpy.nan if dtype.kind == "f" else 0, dtype)


def joined(parts, nan=()):
    """Parts one after the other, NaN where one does not have a scalar, and the attribute `part`."""
    names = {name: None for _, arrays in parts for name in arrays}
    out = {}
    for name in names:
        kind = next(arrays[name] for _, arrays in parts if name in arrays)
        if not all(name in arrays for _, arrays in parts) and name not in nan:
            continue
        rows = [arrays.get(name, missing(arrays, kind.dtype)) for _, arrays in parts]
        out[name] = numpy.concatenate(rows)
    out["part"] = numpy.concatenate([numpy.full(len(arrays["positions"]), value, "u4") for value, arrays in parts])
    return out


def positions(count, scale=1.0, dtype="f8"):
    return rng.uniform(-scale, scale, size=(count, 3)).astype(dtype)


# GADGET: types with and without coordinates, shuffle and gzip
GADGET = {"Coordinates": "positions", "Velocities": "Velocities", "ParticleIDs": "ParticleIDs", "Masses": "Masses",
          "Density": "Density", "InternalEnergy": "InternalEnergy"}


def gadget_type(group, count, names, dtype, first_id, **storage):
    for name in names:
        if name in ("Coordinates", "Velocities"):
            data = positions(count, 5.0, dtype)
        elif name == "ParticleIDs":
            data = numpy.arange(first_id, first_id + count, dtype="u4" if dtype == "f4" else "u8")
        else:
            data = rng.uniform(size=count).astype("f4")
        group.create_dataset(name, data=data, **storage)


def gadget_parts(file):
    with h5py.File(HERE / file) as source:
        return [(int(name[8:]), {GADGET[k]: v[()] for k, v in group.items() if k in GADGET})
                for name, group in source.items() if name.startswith("PartType") and "Coordinates" in group]


def gadget():
    with h5py.File(HERE / "gadget.hdf5", "w", libver="earliest") as file:
        header = file.create_group("Header")
        header.attrs["NumPart_ThisFile"] = numpy.array([70, 50, 0, 0, 9, 2], "u4")
        header.attrs["Time"] = 0.5
        header.attrs["Redshift"] = 1.0
        header.attrs["BoxSize"] = 10.0
        header.attrs["NumFilesPerSnapshot"] = 1
        packed = {"chunks": True, "compression": "gzip", "shuffle": True}
        base = ["Coordinates", "Velocities", "ParticleIDs"]
        gadget_type(file.create_group("PartType0"), 70, base + ["Density", "InternalEnergy"], "f4", 1, **packed)
        gadget_type(file.create_group("PartType1"), 50, base, "f4", 100, **packed)
        gadget_type(file.create_group("PartType4"), 9, base + ["Masses"], "f4", 300)
        file.create_group("PartType5").create_dataset("ParticleIDs", data=numpy.arange(2, dtype="u4"))
        unit = file["PartType0/Coordinates"].attrs
        unit["to_cgs"], unit["a_scaling"], unit["h_scaling"] = 3.085678e24, 1.0, -1.0
    scalars = ("Density", "InternalEnergy", "Masses")
    expect("gadget.hdf5", 0, None, 0.5, joined(gadget_parts("gadget.hdf5"), scalars))


# GADGET: types with masses of their own, with one mass in the header, and with none
def mass_table():
    numbers = numpy.random.default_rng(12)
    parts = []
    with h5py.File(HERE / "mass-table.hdf5", "w", libver="earliest") as file:
        header = file.create_group("Header")
        header.attrs["NumPart_ThisFile"] = numpy.array([8, 6, 4], "u4")
        header.attrs["MassTable"] = numpy.array([0.5, 0.25, 0.0])
        for number, count in enumerate([8, 6, 4]):
            arrays = {"Coordinates": numbers.uniform(size=(count, 3)), "ParticleIDs": numpy.arange(count)}
            if number == 0:
                arrays["Masses"] = numbers.uniform(size=count)
            for name, array in arrays.items():
                file[f"PartType{number}/{name}"] = array
            if number == 1:
                arrays["Masses"] = numpy.full(count, 0.25)
            parts.append((number, {GADGET[name]: array for name, array in arrays.items()}))
    expect("mass-table.hdf5", 0, None, None, joined(parts, ("Masses",)))


# SWIFT: HDF5 1.10 and later, double precision, checksums, times in arrays
def swift():
    with h5py.File(HERE / "swift.hdf5", "w", libver="latest") as file:
        code = file.create_group("Code")
        code.attrs["Code"], code.attrs["Code Version"] = numpy.bytes_("SWIFT"), numpy.bytes_("2026.04")
        header = file.create_group("Header")
        header.attrs["NumPart_ThisFile"] = numpy.array([300, 40, 0, 0, 0, 0, 0], "i8")
        header.attrs["Time"] = numpy.array([0.0125])
        header.attrs["BoxSize"] = numpy.array([2.0, 2.0, 2.0])
        units = file.create_group("Units")
        units.attrs["Unit length in cgs (U_L)"] = numpy.array([3.08567758e24])
        packed = {"compression": "gzip", "shuffle": True, "fletcher32": True}
        base = ["Coordinates", "Velocities", "ParticleIDs"]
        for number, count, names in [(0, 300, base + ["Density"]), (1, 40, base)]:
            group = file.create_group(f"PartType{number}")
            rows = min(count, 64)
            for name in [name for name in names if name != "Velocities"]:
                chunks = (rows, 3) if name == "Coordinates" else (rows,)
                gadget_type(group, count, [name], "f8", 2**53, chunks=chunks, **packed)
            group.create_dataset("Velocities", data=positions(count, 5.0, "f4"), chunks=(rows, 3), **packed)
            text = numpy.bytes_("a U_L  [ cm ]")
            group["Coordinates"].attrs["Expression for physical CGS units"] = text
            file[f"{['Gas', 'DM'][number]}Particles"] = h5py.SoftLink(f"/PartType{number}")
    expect("swift.hdf5", 0, None, 0.0125, joined(gadget_parts("swift.hdf5"), ("Density",)))


# Snapshots of two files each
def snapshots():
    for index, number in enumerate([3, 4]):
        parts = []
        for piece in range(2):
            name = f"snap_{number:03}.{piece}.hdf5"
            with h5py.File(HERE / name, "w") as file:
                header = file.create_group("Header")
                counts = [20 + number, 6 * piece]
                header.attrs["NumPart_ThisFile"] = numpy.array(counts, "u4")
                header.attrs["NumFilesPerSnapshot"], header.attrs["Time"] = 2, 0.5 * number
                for kind, count in enumerate(counts):
                    if count:
                        gadget_type(file.create_group(f"PartType{kind}"), count, ["Coordinates", "ParticleIDs"], "f4",
                                    100 * piece + kind)
            parts.append(joined(gadget_parts(name)))
        expect("snap_#.*.hdf5", index, number, 0.5 * number,
               {name: numpy.concatenate([part[name] for part in parts]) for name in parts[0]})


# SWIFT: a file of virtual data sets beside the files with the values
def virtual_snapshots():
    for number in [3, 4]:
        pieces = [f"snap_{number:03}.{piece}.hdf5" for piece in range(2)]
        with h5py.File(HERE / f"snap_{number:03}.hdf5", "w") as file:
            header = file.create_group("Header")
            header.attrs["NumFilesPerSnapshot"], header.attrs["Virtual"] = [1], [1]
            header.attrs["Time"] = 0.5 * number
            for kind in range(2):
                for name in ["Coordinates", "ParticleIDs"]:
                    path, sources = f"PartType{kind}/{name}", []
                    for piece in pieces:
                        with h5py.File(HERE / piece) as source:
                            if path in source:
                                sources.append((h5py.VirtualSource(source[path]), len(source[path])))
                                dtype, row = source[path].dtype, source[path].shape[1:]
                    layout = h5py.VirtualLayout((sum(count for _, count in sources), *row), dtype)
                    end = 0
                    for source, count in sources:
                        # The file beside this one, by its name alone
                        source.path = pathlib.Path(source.path).name
                        layout[end:end + count] = source
                        end += count
                    file.create_virtual_dataset(path, layout)


# PySPH: the layout of its output, arrays with other properties, vectors with a stride
def pysph():
    with h5py.File(HERE / "pysph_250.hdf5", "w", libver="earliest") as file:
        file.attrs["version"] = 2
        solver = file.create_group("solver_data")
        solver.attrs["t"], solver.attrs["dt"], solver.attrs["count"] = 0.125, 1e-4, 250
        parts = []
        for value, (name, count) in enumerate([("boundary", 12), ("fluid", 30)]):
            arrays = file.create_group(f"particles/{name}/arrays")
            file.create_group(f"particles/{name}/constants")
            data = {"x": rng.normal(size=count), "y": rng.normal(size=count), "z": rng.normal(size=count),
                    "rho": rng.uniform(990, 1010, size=count), "gid": numpy.full(count, 2**32 - 1, "u4")}
            data.update({k: rng.normal(size=count) for k in "uvw"} if name == "fluid" else {})
            data["A"] = rng.normal(size=4 * count)
            for key, numbers in data.items():
                dataset = arrays.create_dataset(key, data=numbers, compression="gzip" if key == "rho" else None)
                dataset.attrs["stride"] = 4 if key == "A" else 1
                dataset.attrs["stored"] = True
            if name == "boundary":
                for key in "uvw":
                    attrs = arrays.create_dataset(key, data=numpy.zeros(0, "f4")).attrs
                    attrs["stored"], attrs["default"] = False, 0.5
            # PySPH gives what is not stored its default
            velocity = [data.get(k, numpy.full(count, 0.5)) for k in "uvw"]
            parts.append((value, {"positions": numpy.stack([data[k] for k in "xyz"], 1), "rho": data["rho"],
                                  "velocity": numpy.stack(velocity, 1), "gid": data["gid"], "A": data["A"].reshape(count, 4)}))
    expect("pysph_250.hdf5", 0, 250, 0.125, joined(parts))


def real_pysph():
    name = "../pysph/dam_break_3d_00100_gzip.hdf5"
    with h5py.File(HERE / name) as file:
        arrays = [group["arrays"] for group in file["particles"].values()]
        stored = {k for group in arrays for k, v in group.items() if v.shape != (0,)}
        parts = []
        for value, (_, group) in enumerate(sorted(file["particles"].items())):
            arrays = {k: v for k, v in group["arrays"].items() if k in stored}
            count = len(arrays["x"])
            # PySPH gives what is not stored its default
            data = {k: v[()] if v.shape != (0,) else numpy.full(count, float(v.attrs["default"]))
                    for k, v in arrays.items()}
            own = {k: v for k, v in data.items() if k not in "xyzuvw"}
            own["positions"] = numpy.stack([data[k] for k in "xyz"], 1)
            own["velocity"] = numpy.stack([data[k] for k in "uvw"], 1)
            parts.append((value, own))
        solver = file["solver_data"].attrs
        floats = {k for _, arrays in parts for k, v in arrays.items() if v.dtype.kind == "f" and v.ndim == 1}
        expect(name, 0, int(solver["count"]), float(solver["t"]), joined(parts, floats))


# H5Part: steps in another order than their names
def h5part():
    with h5py.File(HERE / "beam.h5part", "w", libver="earliest") as file:
        for number in [0, 5, 10]:
            step = file.create_group(f"Step#{number}")
            step.attrs["TimeValue"] = 0.25 * number
            count = 20 + number
            data = {k: rng.normal(size=count) for k in ["x", "y", "z", "px", "py", "pz"]}
            data["id"] = numpy.arange(count, dtype="i8")
            for key, numbers in data.items():
                step.create_dataset(key, data=numbers)
            arrays = {k: v for k, v in data.items() if k not in "xyz"}
            arrays["positions"] = numpy.stack([data[k] for k in "xyz"], 1)
            expect("beam.h5part", [0, 5, 10].index(number), number, 0.25 * number, arrays)


# H5MD: one group sampled with lists, one with increments and other steps
def h5md():
    with h5py.File(HERE / "polymer.h5md", "w") as file:
        meta = file.create_group("h5md")
        meta.attrs["version"] = numpy.array([1, 1], "i4")
        creator = meta.create_group("creator")
        creator.attrs["name"], creator.attrs["version"] = "make.py", "1.0"
        steps, times = numpy.array([0, 100, 200]), numpy.array([0.0, 0.5, 1.0])
        chain, water = file.create_group("particles/chain"), file.create_group("particles/water")
        data = {}

        def element(group, name, values, sampled=True):
            node = group.create_group(name)
            chunks = (1,) + values.shape[1:]
            node.create_dataset("value", data=values, chunks=chunks, maxshape=(None,) + values.shape[1:],
                                compression="gzip")
            if sampled:
                node["step"], node["time"] = steps, times
            else:
                node["step"] = 200
                node["step"].attrs["offset"] = 0
                node["time"] = 1.0
            data[group.name, name] = values

        element(chain, "position", rng.normal(size=(3, 25, 3)))
        chain["position/value"].attrs["unit"] = "nm"
        chain["position/time"].attrs["unit"] = "ps"
        element(chain, "velocity", rng.normal(size=(3, 25, 3)).astype("f4"))
        element(water, "position", rng.normal(size=(2, 10, 3)), False)
        element(water, "velocity", rng.normal(size=(2, 10, 3)).astype("f4"), False)
        for group, count in [(chain, 25), (water, 10)]:
            group["species"] = numpy.arange(count, dtype="i4") % 3
            group.create_group("box").attrs["dimension"] = 3
        for index, number in enumerate([0, 100, 200]):
            parts = []
            for value, (group, count) in enumerate([(chain, 25), (water, 10)]):
                at = index if value == 0 else {0: 0, 200: 1}.get(number)
                if at is not None:
                    parts.append((value, {"positions": data[group.name, "position"][at],
                                          "velocity": data[group.name, "velocity"][at],
                                          "species": numpy.arange(count, dtype="i4") % 3}))
            expect("polymer.h5md", index, number, times[index], joined(parts))


# openPMD by its own writer: two species, constant components, offsets, units
def openpmd():
    path = HERE / "plasma.h5"
    series = openpmd_api.Series(str(path), openpmd_api.Access.create)
    for number in [10, 20]:
        iteration = series.iterations[number]
        iteration.time, iteration.time_unit_SI = 0.5 * number, 1e-3
        for name, count in [("electrons", 40 + number), ("ions", 15)]:
            species = iteration.particles[name]
            for axis in "xyz":
                record = species["position"][axis]
                data = rng.uniform(size=count).astype("f4")
                record.reset_dataset(openpmd_api.Dataset(data.dtype, [count]))
                record.store_chunk(data)
                record.unit_SI = 1e-6
                offset = species["positionOffset"][axis]
                if name == "electrons":
                    cells = rng.integers(0, 50, size=count).astype("i4")
                    offset.reset_dataset(openpmd_api.Dataset(cells.dtype, [count]))
                    offset.store_chunk(cells)
                else:
                    offset.reset_dataset(openpmd_api.Dataset(numpy.dtype("f8"), [count]))
                    offset.make_constant(2.5)
                offset.unit_SI = 1e-6
                momentum = species["momentum"][axis]
                data = rng.normal(size=count)
                momentum.reset_dataset(openpmd_api.Dataset(data.dtype, [count]))
                momentum.store_chunk(data)
                series.flush()
            ids = numpy.arange(count, dtype="u8")
            record = species["id"][openpmd_api.Record_Component.SCALAR]
            record.reset_dataset(openpmd_api.Dataset(ids.dtype, [count]))
            record.store_chunk(ids)
            charge = species["charge"][openpmd_api.Record_Component.SCALAR]
            charge.reset_dataset(openpmd_api.Dataset(numpy.dtype("f8"), [count]))
            charge.make_constant(-1.5)
            series.flush()
    del series
    # Read again, by the reference reader
    series = openpmd_api.Series(str(path), openpmd_api.Access.read_only)
    scalar = openpmd_api.Record_Component.SCALAR
    for index, number in enumerate(series.iterations):
        iteration = series.iterations[number]
        parts = []
        for value, name in enumerate(["electrons", "ions"]):
            species = iteration.particles[name]

            def load(record, axis, species=species):
                component = species[record][axis]
                data = component.load_chunk()
                series.flush()
                return data, component.unit_SI
            axes = []
            for axis in "xyz":
                (place, unit), (offset, offset_unit) = load("position", axis), load("positionOffset", axis)
                axes.append(place.astype("f8") * unit + offset.astype("f8") * offset_unit)
            parts.append((value, {"positions": numpy.stack(axes, 1),
                                  "momentum": numpy.stack([load("momentum", a)[0] for a in "xyz"], 1),
                                  "id": load("id", scalar)[0], "charge": load("charge", scalar)[0]}))
        expect("plasma.h5", index, number, iteration.time * iteration.time_unit_SI, joined(parts))


# VTKHDF by the writer of VTK: points once, and points that change in time
def vtk_points(count):
    points = vtk.vtkPoints()
    points.SetDataTypeToDouble()
    for place in positions(count):
        points.InsertNextPoint(place)
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    verts = vtk.vtkCellArray()
    for index in range(count):
        verts.InsertNextCell(1, [index])
    data.SetVerts(verts)
    for name, numbers in [("density", rng.uniform(size=count).astype("f4")), ("velocity", positions(count))]:
        array = numpy_to_vtk(numbers, deep=True)
        array.SetName(name)
        data.GetPointData().AddArray(array)
    return data




def vtkhdf():
    writer = vtk.vtkHDFWriter()
    writer.SetInputData(vtk_points(30))
    writer.SetChunkSize(64)
    writer.SetFileName(str(HERE / "points.vtkhdf"))
    writer.Write()
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(HERE / "points.vtkhdf"))
    reader.Update()
    data = reader.GetOutput()
    point_data = data.GetPointData()
    arrays = {point_data.GetArrayName(i): vtk_to_numpy(point_data.GetArray(i))
              for i in range(point_data.GetNumberOfArrays())}
    arrays["positions"] = vtk_to_numpy(data.GetPoints().GetData())
    expect("points.vtkhdf", 0, None, None, arrays)
    # Time steps by the specification, with as many points as there are
    with h5py.File(HERE / "temporal.vtkhdf", "w") as file:
        root = file.create_group("VTKHDF")
        root.attrs["Version"] = numpy.array([2, 3])
        root.attrs.create("Type", b"UnstructuredGrid", dtype=h5py.string_dtype("ascii", 16))
        counts = numpy.array([8, 4, 11])
        root["NumberOfPoints"] = counts
        root["NumberOfCells"] = counts
        root["NumberOfConnectivityIds"] = counts
        total = int(counts.sum())
        root.create_dataset("Points", data=positions(total, dtype="f4"), chunks=(10, 3), maxshape=(None, 3))
        root["Connectivity"] = numpy.concatenate([numpy.arange(n) for n in counts])
        root["Offsets"] = numpy.concatenate([numpy.arange(n + 1) for n in counts])
        root["Types"] = numpy.ones(total, "u1")
        root.create_dataset("PointData/pressure", data=rng.uniform(size=total), chunks=(10,), compression="gzip")
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = 3
        firsts = numpy.concatenate([[0], counts.cumsum()[:-1]])
        times = numpy.array([0.0, 0.5, 2.0])
        steps["Values"], steps["PointOffsets"] = times, firsts
        steps["PartOffsets"], steps["NumberOfParts"] = numpy.arange(3), numpy.ones(3, "i8")
        steps["PointDataOffsets/pressure"] = firsts
        for name in ["CellOffsets", "ConnectivityIdOffsets"]:
            steps[name] = firsts.reshape(3, 1)
        for index in range(3):
            rows = slice(firsts[index], firsts[index] + counts[index])
            expect("temporal.vtkhdf", index, None, times[index],
                   {"positions": root["Points"][rows], "pressure": root["PointData/pressure"][rows]})


# Blocks, as VTK writes them: one lacks an array, one is an image and is left out
def vtkhdf_blocks():
    image = vtk.vtkImageData()
    image.SetDimensions(2, 2, 2)
    fluid, wall = vtk_points(9), vtk_points(5)
    wall.GetPointData().RemoveArray("density")
    blocks = [("fluid", fluid), ("grid", image), ("wall", wall)]
    collection = vtk.vtkPartitionedDataSetCollection()
    assembly = vtk.vtkDataAssembly()
    multi = vtk.vtkMultiBlockDataSet()
    for index, (name, block) in enumerate(blocks):
        collection.SetPartition(index, 0, block)
        collection.GetMetaData(index).Set(vtk.vtkCompositeDataSet.NAME(), name)
        assembly.AddDataSetIndex(assembly.AddNode(name), index)
        multi.SetBlock(index, block)
        multi.GetMetaData(index).Set(vtk.vtkCompositeDataSet.NAME(), name)
    collection.SetDataAssembly(assembly)
    for file, data in [("blocks.vtkhdf", collection), ("multi.vtkhdf", multi)]:
        writer = vtk.vtkHDFWriter()
        writer.SetInputData(data)
        writer.SetChunkSize(16)
        writer.SetFileName(str(HERE / file))
        writer.Write()
        reader = vtk.vtkHDFReader()
        reader.SetFileName(str(HERE / file))
        reader.Update()
        found = []
        leaves = reader.GetOutput().NewIterator()
        while not leaves.IsDoneWithTraversal():
            leaf = leaves.GetCurrentDataObject()
            if isinstance(leaf, vtk.vtkPointSet):
                values = leaf.GetPointData()
                found.append({values.GetArrayName(i): vtk_to_numpy(values.GetArray(i))
                              for i in range(values.GetNumberOfArrays())})
                found[-1]["positions"] = vtk_to_numpy(leaf.GetPoints().GetData())
            leaves.GoToNextItem()
        assert [len(arrays["positions"]) for arrays in found] == [9, 5]
        expect(file, 0, None, None, joined(list(enumerate(found)), ["density"]))


# No known layout: names alone, whatever the storage
def plain():
    count = 50
    with h5py.File(HERE / "plain.h5", "w") as file:
        data = {"positions": positions(count, dtype=">f8"), "velocity": positions(count, dtype=">f4"),
                "id": numpy.arange(count, dtype="u8"), "mass": rng.uniform(size=count), "flag": rng.uniform(size=count) > 0.5}
        file.create_dataset("positions", data=data["positions"], chunks=(7, 2), compression="lzf", shuffle=True)
        file.create_dataset("velocity", data=data["velocity"], chunks=(16, 3), compression="lzf")
        file.create_dataset("id", data=data["id"], chunks=(20,), scaleoffset=0)
        file.create_dataset("mass", data=data["mass"], chunks=(13,), fletcher32=True)
        file["flag"] = data["flag"]
        file["names"] = numpy.array([b"a"] * count)
        file["other_length"] = numpy.arange(3)
        file.attrs["time"] = 2.5
        little = {k: v.astype(v.dtype.newbyteorder("<")) for k, v in data.items()}
        little["flag"] = little["flag"].astype("i1")
        expect("plain.h5", 0, None, 2.5, little)
    with h5py.File(HERE / "axes.h5", "w", libver="latest", userblock_size=512) as file:
        group = file.create_group("run/gas")
        data = {k: rng.normal(size=count).astype("f4") for k in ["pos_x", "pos_y", "pos_z", "vx", "vy", "vz", "T"]}
        for index, (key, numbers) in enumerate(data.items()):
            packed = {"chunks": (16,), "compression": "gzip"} if index % 2 else {}
            group.create_dataset(key, data=numbers, **packed)
        expect("axes.h5", 0, None, None, {"positions": numpy.stack([data[f"pos_{k}"] for k in "xyz"], 1), "T": data["T"],
                                          "velocity": numpy.stack([data[f"v{k}"] for k in "xyz"], 1)})
    with h5py.File(HERE / "frames.h5", "w", libver="latest") as file:
        data = {"coordinates": positions(4 * 30, dtype="f4").reshape(4, 30, 3), "energy": rng.uniform(size=(4, 30)),
                "kind": numpy.arange(30, dtype="i2"), "time": numpy.array([0.0, 0.5, 1.0, 1.5])}
        for key, numbers in data.items():
            chunks = (3, 8, 3)[:numbers.ndim] if numbers.ndim > 1 else None
            file.create_dataset(key, data=numbers, chunks=chunks, compression="gzip" if chunks else None,
                                maxshape=(None,) + numbers.shape[1:] if chunks else None)
        for index in range(4):
            expect("frames.h5", index, index, data["time"][index],
                   {"positions": data["coordinates"][index], "energy": data["energy"][index], "kind": data["kind"]})
    with h5py.File(HERE / "table.h5", "w") as file:
        kind = numpy.dtype([("x", "f8"), ("name", "S3"), ("y", "f8"), ("z", "f8"), ("v", "f4", 3), ("id", "i4")])
        data = numpy.zeros(count, kind)
        for key in ["x", "y", "z", "v"]:
            data[key] = rng.normal(size=data[key].shape)
        data["id"] = numpy.arange(count)
        file.create_dataset("points", data=data, chunks=(8,), compression="gzip")
        expect("table.h5", 0, None, None, {"positions": numpy.stack([data[k] for k in "xyz"], 1), "v": data["v"],
                                           "id": data["id"]})


# Cells of H5MD: edges at each step, a matrix and three lengths; see crates/readers/src/read/cell_tests.rs
def cells():
    steps, times = numpy.array([0, 10, 20]), numpy.array([0.0, 1.0, 2.0])
    moving = numpy.array([[[4 + step, 0, 0], [0.5, 3, 0], [0.25, 0.75, 2 - 0.5 * step]] for step in range(3)])
    for name, edges, boundary in [("moving", moving, ["periodic", "none", "periodic"]),
                                  ("fixed", moving[1], ["periodic"] * 3),
                                  ("lengths", numpy.array([3.0, 2.5, 2.0], "f4"), ["none"] * 3)]:
        with h5py.File(HERE / f"cell-{name}.h5md", "w") as file:
            file.create_group("h5md").attrs["version"] = [1, 1]
            group = file.create_group("particles/all")
            position = group.create_group("position")
            position["value"] = numpy.zeros((3, 2, 3), "f4")
            position["step"], position["time"] = steps, times
            box = group.create_group("box")
            box.attrs["dimension"], box.attrs["boundary"] = 3, numpy.array(boundary, "S8")
            if edges.ndim == 3:
                node = box.create_group("edges")
                node["value"] = edges
                node["step"], node["time"] = position["step"], position["time"]
            else:
                box["edges"] = edges


gadget()
swift()
snapshots()
virtual_snapshots()
pysph()
real_pysph()
h5part()
h5md()
openpmd()
vtkhdf()
plain()
cells()
mass_table()
vtkhdf_blocks()
(HERE / "expected.tsv").write_text("".join(lines))
