"""Writes the sample meshes of this folder, and expected.tsv, with the libraries that users have.

    pip install trimesh==5.2.0 pyvista==0.49.1 vtk==9.7.2 meshio==5.3.5 numpy==2.4.6 scipy networkx
    python make.py

expected.tsv has a line for each file: the number of vertices and triangles, the lowest and highest coordinates, the
area, and the volume (the integral of x, times the x of the normal, over the surface). trimesh computes area and volume
from the shapes, not from the files; only the vertex and triangle counts depend on how a format stores them.
"""

from pathlib import Path

import meshio
import numpy as np
import pyvista as pv
import trimesh
import vtk

HERE = Path(__file__).parent
table = []


def row(name, vertices, triangles):
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    used = np.asarray(vertices)
    numbers = [*used.min(axis=0), *used.max(axis=0), mesh.area, mesh.volume]
    table.append("\t".join([name, str(len(vertices)), str(len(triangles)), *(f"{n:.9g}" for n in numbers)]))


def fan(polygons):
    return np.array([[p[0], p[i], p[i + 1]] for p in polygons for i in range(1, len(p) - 1)])


def poly_data(vertices, polygons):
    return pv.PolyData(vertices, faces=np.concatenate([[len(p), *p] for p in polygons]))


def legacy(name, data, binary, version):
    writer = vtk.vtkDataSetWriter()
    writer.SetFileName(str(HERE / name))
    writer.SetInputData(data)
    writer.SetFileVersion(version)
    writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
    assert writer.Write() == 1


def xml(name, data, mode, compressor):
    writer = vtk.vtkXMLPolyDataWriter() if name.endswith("vtp") else vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(HERE / name))
    writer.SetInputData(data)
    {"ascii": writer.SetDataModeToAscii, "inline": writer.SetDataModeToBinary}.get(mode, writer.SetDataModeToAppended)()
    writer.SetEncodeAppendedData(mode == "base64")
    kinds = {"none": writer.SetCompressorTypeToNone, "zlib": writer.SetCompressorTypeToZLib}
    kinds |= {"lz4": writer.SetCompressorTypeToLZ4, "lzma": writer.SetCompressorTypeToLZMA}
    kinds[compressor]()
    assert writer.Write() == 1


XML = [("ascii", "none"), ("inline", "zlib"), ("base64", "none"), ("raw", "lz4"), ("raw", "none"), ("raw", "lzma")]


def every_vtk(stem, data, extension, vertices, triangles):
    for binary in (False, True):
        for version, words in ((42, "4.2"), (51, "5.1")):
            name = f"{stem}-{'binary' if binary else 'ascii'}-{version}.vtk"
            legacy(name, data, binary, version)
            assert f"Version {words}" in (HERE / name).read_bytes()[:40].decode()
            row(name, vertices, triangles)
    for mode, compressor in XML:
        name = f"{stem}-{mode}-{compressor}.{extension}"
        xml(name, data, mode, compressor)
        row(name, vertices, triangles)


def sphere():
    """An icosphere away from the origin: triangles only."""
    mesh = trimesh.creation.icosphere(subdivisions=1, radius=0.5)
    vertices = np.asarray(mesh.vertices, dtype=np.float32).astype(float) + [2.0, 0.25, -1.0]
    faces = np.asarray(mesh.faces)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    data = poly_data(vertices, faces)
    mesh.export(HERE / "sphere-binary.stl")
    # A binary file whose header begins like a text file, as some programs write it.
    bytes = (HERE / "sphere-binary.stl").read_bytes()
    (HERE / "sphere-solid.stl").write_bytes(b"solid sphere".ljust(80) + bytes[80:])
    (HERE / "sphere-ascii.stl").write_text(trimesh.exchange.stl.export_stl_ascii(mesh))
    mesh.export(HERE / "sphere-trimesh.obj")
    for encoding in ("ascii", "binary"):
        (HERE / f"sphere-trimesh-{encoding}.ply").write_bytes(mesh.export(file_type="ply", encoding=encoding))
    names = "binary.stl solid.stl ascii.stl trimesh.obj trimesh-ascii.ply trimesh-binary.ply".split()
    for name in names:
        row(f"sphere-{name}", vertices, faces)
    writer = vtk.vtkPLYWriter()
    writer.SetInputData(data)
    for order in ("little", "big"):
        name = f"sphere-vtk-{order}.ply"
        writer.SetFileName(str(HERE / name))
        writer.SetDataByteOrderToBigEndian() if order == "big" else writer.SetDataByteOrderToLittleEndian()
        assert writer.Write() == 1
        row(name, vertices, faces)
    every_vtk("sphere", data, "vtp", vertices, faces)
    # Strips, which also show whether every second triangle is turned.
    stripper = vtk.vtkStripper()
    stripper.SetInputData(data)
    stripper.Update()
    strips = stripper.GetOutput()
    assert strips.GetNumberOfStrips() > 3
    for binary, version in ((False, 42), (True, 51)):
        name = f"strips-{'binary' if binary else 'ascii'}-{version}.vtk"
        legacy(name, strips, binary, version)
        row(name, vertices, faces)
    xml("strips-raw-zlib.vtp", strips, "raw", "zlib")
    row("strips-raw-zlib.vtp", vertices, faces)


def box():
    """A tank: an open box of quads and a pentagon, in f64 that f32 cannot hold."""
    vertices = np.array(
        [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0, 0, 1.5], [2, 0, 1.5], [2, 1, 1.5], [0, 1, 1.5], [1, -0.25, 0]]
    ) + [1e5, 0.1, 0]
    polygons = [[0, 3, 2, 1, 8], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
    triangles = fan(polygons)
    data = poly_data(vertices, polygons)
    blocks = [("polygon", np.array(polygons[:1])), ("quad", np.array(polygons[1:]))]
    whole = meshio.Mesh(vertices, blocks)
    pv.save_meshio(HERE / "box-pyvista.vtu", data)
    meshio.write(HERE / "box-meshio-ascii.ply", whole, binary=False)
    meshio.write(HERE / "box-meshio-binary.ply", whole, binary=True)
    for name in ("box-pyvista.vtu", "box-meshio-ascii.ply", "box-meshio-binary.ply"):
        row(name, vertices, triangles)
    # With texture coordinates and normals, and indices that count back.
    lines = ["# a tank", "mtllib none.mtl", "o tank"] + [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += ["vt 0 0", "vn 0 0 1", "usemtl none", "s off"]
    kinds = ["{}", "{}/1", "{}//1", "{}/1/1", "{}"]
    for kind, polygon in zip(kinds, polygons):
        numbers = [i - len(vertices) if kind == "{}" and len(polygon) == 4 else i + 1 for i in polygon]
        lines.append("f " + " ".join(kind.format(n) for n in numbers))
    (HERE / "box.obj").write_text("\n".join(lines) + "\n")
    row("box.obj", vertices, triangles)
    every_vtk("box", data, "vtp", vertices, triangles)


def volumes():
    """Volumes: only their surface is read. Triangulated by hand, as the faces of one cell each."""
    grid = pv.ImageData(dimensions=(3, 3, 3), spacing=(1, 0.5, 0.25)).to_tetrahedra(5)
    tets = grid.cells_dict[int(pv.CellType.TETRA)]
    points = np.asarray(grid.points, dtype=float)
    # The points inside are vertices, too. These tetrahedra are inside out; the surface is not.
    data = pv.UnstructuredGrid({pv.CellType.TETRA: tets}, points)
    faces = surface_of(data)
    every_vtk("tets", data, "vtu", points, faces)
    # As Gmsh writes it: the triangles of the surface once more, and lines and points.
    blocks = [("vertex", [[0]]), ("line", [[0, 1]]), ("triangle", faces), ("tetra", tets)]
    for name, kind in (("tets-gmsh-42.vtk", "vtk42"), ("tets-gmsh-51.vtk", "vtk51"), ("tets-gmsh.vtu", "vtu")):
        meshio.write(HERE / name, meshio.Mesh(points, blocks), file_format=kind)
        row(name, points, faces)

    # A hexahedron, on it a pyramid, beside it a wedge, on that a tetrahedron, and a voxel and a pixel apart.
    points = np.array(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1], [0.5, 0.5, 2]]
        + [[2, 0.5, 0], [2, 0.5, 1], [1.2, 0.5, 2]]
        + [[x, y, z] for z in (0, 1) for y in (4, 5) for x in (0, 2)]
        + [[0, 8, 0], [1, 8, 0], [0, 9, 0], [1, 9, 0]],
        dtype=float,
    )
    cells = [
        (pv.CellType.HEXAHEDRON, [0, 1, 2, 3, 4, 5, 6, 7]),
        (pv.CellType.PYRAMID, [4, 5, 6, 7, 8]),
        (pv.CellType.WEDGE, [2, 1, 9, 6, 5, 10]),
        (pv.CellType.TETRA, [5, 10, 6, 11]),
        (pv.CellType.VOXEL, [12, 13, 14, 15, 16, 17, 18, 19]),
        (pv.CellType.PIXEL, [20, 21, 22, 23]),
        (pv.CellType.TRIANGLE, [4, 5, 8]),
        (pv.CellType.POLY_LINE, [0, 8, 11]),
    ]
    flat = np.concatenate([[len(c), *c] for _, c in cells])
    data = pv.UnstructuredGrid(flat, [int(kind) for kind, _ in cells], points)
    # The triangle is a face of the pyramid.
    faces = surface_of(data.extract_cells([i for i, (kind, _) in enumerate(cells) if kind != pv.CellType.TRIANGLE]))
    every_vtk("cells", data, "vtu", points, faces)

    # Two pieces in one file: VTK writes each, and the second is put behind the first.
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    faces = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]])
    texts = []
    for offset in (0, 3):
        piece = pv.UnstructuredGrid(np.array([4, 0, 1, 2, 3]), [int(pv.CellType.TETRA)], points + offset)
        xml("pieces.vtu", piece, "ascii", "none")
        texts.append((HERE / "pieces.vtu").read_text())
    second = texts[1][texts[1].index("<Piece") : texts[1].index("</UnstructuredGrid>")]
    (HERE / "pieces.vtu").write_text(texts[0].replace("</UnstructuredGrid>", second + "</UnstructuredGrid>"))
    row("pieces.vtu", np.concatenate([points, points + 3]), np.concatenate([faces, faces + 4]))


def surface_of(data):
    """Triangles of the surface that VTK finds, turned outward, which VTK does not do."""
    surface = data.extract_surface(algorithm="dataset_surface").triangulate()
    faces = surface.point_data["vtkOriginalPointIds"][surface.faces.reshape(-1, 4)[:, 1:]]
    mesh = trimesh.Trimesh(data.points, faces, process=False)
    mesh.fix_normals(multibody=True)
    assert np.isclose(mesh.volume, np.abs(data.compute_cell_sizes().cell_data["Volume"]).sum())
    return np.asarray(mesh.faces)


sphere()
box()
volumes()
(HERE / "expected.tsv").write_text("\n".join(sorted(table)) + "\n")
