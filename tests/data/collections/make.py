"""Makes the collections of this directory with VTK's writers, and expected.tsv with VTK's readers.

    pip install vtk==9.7.2 numpy
    python tests/data/collections/make.py

VTK has no writer for .pvd and .series: their text is that of ParaView.
"""

import json
import os
import pathlib
import sys

import numpy
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

HERE = pathlib.Path(__file__).parent
os.chdir(HERE)
sys.path.insert(0, str(HERE.parent))
import reference  # noqa: E402

rng = numpy.random.default_rng(11)
TIMES = [0.0, 0.125, 0.5]


def points(count, shift, data=None):
    """`count` vertices with a scalar and a vector."""
    data = data or vtk.vtkPolyData()
    array = vtk.vtkPoints()
    array.SetData(numpy_to_vtk(rng.normal(size=(count, 3)).astype("f4") + numpy.float32(shift), deep=True))
    data.SetPoints(array)
    cells = vtk.vtkCellArray()
    for index in range(count):
        cells.InsertNextCell(1, [index])
    if isinstance(data, vtk.vtkPolyData):
        data.SetVerts(cells)
    else:
        data.SetCells(vtk.VTK_VERTEX, cells)
    for name, values in [("density", rng.uniform(990, 1010, count)), ("velocity", rng.normal(size=(count, 3)))]:
        values = numpy_to_vtk(values.astype("f4"), deep=True)
        values.SetName(name)
        data.GetPointData().AddArray(values)
    return data


def write(writer, name, data):
    pathlib.Path(name).parent.mkdir(parents=True, exist_ok=True)
    writer.SetFileName(name)
    writer.SetInputDataObject(data)
    if hasattr(writer, "SetDataModeToAppended"):
        writer.SetDataModeToAppended()
        writer.EncodeAppendedDataOff()
    assert writer.Write() == 1, name


def write_pieces(name, count):
    """An index and its pieces. The writer gives each piece the same points, since its source has no pieces: each is
    written again with points of its own."""
    is_grid = name.endswith("pvtu")
    kind = vtk.vtkUnstructuredGrid if is_grid else vtk.vtkPolyData
    writer = vtk.vtkXMLPUnstructuredGridWriter() if is_grid else vtk.vtkXMLPPolyDataWriter()
    writer.SetNumberOfPieces(count)
    writer.SetStartPiece(0)
    writer.SetEndPiece(count - 1)
    write(writer, name, points(1, 0, kind()))
    stem, suffix = name.rsplit(".p", 1)
    for piece in range(count):
        file = f"{stem}_{piece}.{suffix}"
        assert pathlib.Path(file).exists(), file
        single = vtk.vtkXMLUnstructuredGridWriter() if is_grid else vtk.vtkXMLPolyDataWriter()
        write(single, file, points(2 + piece, 5, kind()))


def pvd(name, entries):
    lines = "".join(f'    <DataSet timestep="{t}" group="" part="{p}" file="{f}"{more}/>\n' for t, p, f, more in entries)
    pathlib.Path(name).write_text(
        '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1"\n         byte_order="LittleEndian"\n'
        f'         compressor="vtkZLibDataCompressor">\n  <Collection>\n{lines}  </Collection>\n</VTKFile>\n')


def series(name, entries):
    files = [{"name": name, "time": time} for name, time in entries]
    pathlib.Path(name).write_text(json.dumps({"file-series-version": "1.0", "files": files}, indent=1) + "\n")


def blocks(fluid, wall):
    multi = vtk.vtkMultiBlockDataSet()
    inner = vtk.vtkMultiBlockDataSet()
    inner.SetBlock(0, wall)
    inner.GetMetaData(0).Set(vtk.vtkCompositeDataSet.NAME(), "floor")
    multi.SetBlock(0, fluid)
    multi.SetBlock(1, inner)
    multi.SetBlock(2, None)
    for index, text in enumerate(["fluid", "wall", "empty"]):
        multi.GetMetaData(index).Set(vtk.vtkCompositeDataSet.NAME(), text)
    return multi


def partitioned(fluid, wall):
    data = vtk.vtkPartitionedDataSetCollection()
    data.SetPartition(0, 0, fluid)
    data.SetPartition(1, 0, wall)
    for index, text in enumerate(["fluid", "wall"]):
        data.GetMetaData(index).Set(vtk.vtkCompositeDataSet.NAME(), text)
    return data


class Expected:
    """The lines of one list."""

    def __init__(self, name):
        self.name, self.text = name, ""

    def step(self, index, number, time, parts):
        """A step that has `parts`: index of the part, data."""
        get = lambda array: numpy.concatenate([vtk_to_numpy(array(data)) for _, data in parts])
        arrays = {
            "positions": get(lambda d: d.GetPoints().GetData()),
            "density": get(lambda d: d.GetPointData().GetArray("density")),
            "velocity": get(lambda d: d.GetPointData().GetArray("velocity")),
        }
        if len(parts) > 1:
            each = [numpy.full(d.GetNumberOfPoints(), part, "u4") for part, d in parts]
            arrays["part"] = numpy.concatenate(each)
        for key, array in arrays.items():
            self.text += reference.line(self.name, index, number, time, key, array)


def read(reader, name):
    reader.SetFileName(name)
    reader.Update()
    return reader.GetOutputDataObject(0)


def leaves(data):
    walk = data.NewIterator()
    walk.InitTraversal()
    while not walk.IsDoneWithTraversal():
        yield walk.GetCurrentDataObject()
        walk.GoToNextItem()


everything = []

# A collection with two parts, the second of which is a list of pieces.
entries, expected = [], Expected("parts.pvd")
for step, time in enumerate(TIMES):
    fluid, wall = f"parts/fluid_{10 * step}.vtp", f"parts/wall_{10 * step}.pvtu"
    write(vtk.vtkXMLPolyDataWriter(), fluid, points(6 + step, 0))
    write_pieces(wall, 2)
    entries += [(time, 0, fluid, ' name="fluid"'), (time, 1, wall, ' name="wall"')]
    parts = [(0, read(vtk.vtkXMLPolyDataReader(), fluid)), (1, read(vtk.vtkXMLPUnstructuredGridReader(), wall))]
    expected.step(step, step, time, parts)
# Not in the order of their times.
pvd("parts.pvd", entries[2:] + entries[:2])
everything.append(expected)

# Series of legacy files and of XML files, and of blocks.
for suffix, writer, reader in [
    ("vtk", vtk.vtkPolyDataWriter, vtk.vtkPolyDataReader),
    ("vtp", vtk.vtkXMLPolyDataWriter, vtk.vtkXMLPolyDataReader),
    ("vtu", vtk.vtkXMLUnstructuredGridWriter, vtk.vtkXMLUnstructuredGridReader),
]:
    entries, expected = [], Expected(f"drop.{suffix}.series")
    for step, time in enumerate(TIMES[:2]):
        name = f"series/drop_{step}.{suffix}"
        made = writer()
        if suffix == "vtk":
            made.SetFileTypeToBinary()
        write(made, name, points(4 + step, 0, vtk.vtkUnstructuredGrid() if suffix == "vtu" else None))
        entries.append((name, time))
        expected.step(step, step, time, [(0, read(reader(), name))])
    series(f"drop.{suffix}.series", entries)
    everything.append(expected)

# One data set in pieces.
for suffix, reader in [("pvtu", vtk.vtkXMLUnstructuredGridReader), ("pvtp", vtk.vtkXMLPolyDataReader)]:
    name = f"pieces_7.{suffix}"
    write_pieces(name, 3)
    expected = Expected(name)
    files = sorted(p for p in HERE.glob(f"pieces_7_*.{suffix[1:]}"))
    expected.step(0, 7, None, [(index, read(reader(), str(file))) for index, file in enumerate(files)])
    everything.append(expected)

# Blocks in blocks, one of them empty, and the newer form of the same.
entries, expected = [], Expected("blocks.vtm.series")
for step, time in enumerate(TIMES):
    name = f"blocks_{step}.vtm"
    write(vtk.vtkXMLMultiBlockDataWriter(), name, blocks(points(5, 0), points(3 + step, 9)))
    entries.append((name, time))
    data = read(vtk.vtkXMLMultiBlockDataReader(), name)
    expected.step(step, step, time, list(enumerate(leaves(data))))
series("blocks.vtm.series", entries)
everything.append(expected)

write(vtk.vtkXMLPartitionedDataSetCollectionWriter(), "partitions_3.vtpc", partitioned(points(5, 0), points(3, 9)))
expected = Expected("partitions_3.vtpc")
data = read(vtk.vtkXMLPartitionedDataSetCollectionReader(), "partitions_3.vtpc")
expected.step(0, 3, None, list(enumerate(leaves(data))))
everything.append(expected)

for path in HERE.rglob("*"):
    path.chmod(0o755 if path.is_dir() else 0o644)
(HERE / "expected.tsv").write_text("".join(expected.text for expected in everything))
