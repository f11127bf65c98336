//! What each format allows, on files made by hand.

use std::path::Path;

use spherule_formats::MemoryBudget;
use spherule_formats::mesh::{Mesh, parse_mesh, read_mesh};

use crate::make;

/// The mesh in `bytes`; the name has no extension, so the content decides.
fn parse(bytes: impl AsRef<[u8]>) -> Result<Mesh, String> {
    parse_mesh(bytes.as_ref(), Path::new("a"), MemoryBudget::UNLIMITED).map_err(|e| e.to_string())
}

#[track_caller]
fn triangles(bytes: impl AsRef<[u8]>) -> Vec<[u32; 3]> {
    parse(bytes).expect("a good file").triangles
}

#[track_caller]
fn fails(bytes: impl AsRef<[u8]>, words: &str) {
    let error = parse(bytes).expect_err("a bad file");
    assert!(error.contains(words), "{error}");
}

#[test]
fn whole_files_of_every_format_are_read() {
    for (name, extension, bytes) in make::whole() {
        let mesh = parse(&bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (4, 2), "{name}");
        assert_eq!(mesh.vertices[2], [1.0, 1.5, 0.25], "{name}");
        let named =
            parse_mesh(&bytes, Path::new(&format!("a.{extension}")), MemoryBudget::UNLIMITED);
        assert_eq!(named, Ok(mesh), "{name}");
    }
}

#[test]
fn obj_indices_may_be_relative_and_have_other_indices() {
    let vertices = "v 0 0 0\nv 1 0 0\nv 1 1 0 1.0\nv 0 1 0 0.5 0.5 0.5\n";
    let faces = [
        "f 1 2 3 4",
        "f -4 -3 -2 -1",
        "f 1/1 2/2 3/3 4/4",
        "f 1//1 2//1 3//1 4//1",
        "f 1/1/1 2/1/1 3/1/1 4/1/1",
        "f 1 2 \\\n3 4",
        "f 1 2 3 4 # one quad",
        "\tf 1 2 3 4\r",
        "# C:\\models\\\nf 1 2 3 4",
    ];
    for face in faces {
        let text = format!("# made by hand\no quad\n{vertices}vn 0 0 1\nusemtl a\n{face}\nl 1 2\n");
        assert_eq!(triangles(&text), [[0, 1, 2], [0, 2, 3]], "{face}");
    }
    // Faces between the vertices count back from where they are, and may refer to vertices that follow.
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nf 1 2 4\nv 0 0 1\nf -1 -2 -3\n";
    assert_eq!(triangles(text), [[0, 1, 2], [0, 1, 3], [3, 2, 1]]);
    fails(
        "v 0 0 0\nf 1 -1 -2\n",
        "byte 8: \"f 1 -1 -2\" refers to vertex -2; vertices before it: 1",
    );
}

#[test]
fn vertices_that_are_not_finite_are_kept() {
    let mesh = parse("v nan 0 -inf\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("a good file");
    assert!(mesh.vertices[0][0].is_nan() && mesh.vertices[0][2] == f64::NEG_INFINITY);
    assert_eq!(mesh.triangles.len(), 1);
}

#[test]
fn stl_merges_equal_vertices() {
    let one = "facet normal 0 0 0\nouter loop\nvertex 0 -0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    let two = "facet normal 0 0 0\n  OUTER LOOP\nVERTEX -0 0 0\nvertex 0 1 0\nvertex nan 0 1\nendloop\nendfacet\n";
    let text = format!("solid a b\n{one}endsolid\n\nsolid\r\n{two}endsolid a b\n");
    let mesh = parse(text).expect("a good file");
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.vertices.len(), 4);
}

#[test]
fn the_length_decides_which_stl_it_is() {
    let mut binary = make::stl_binary();
    let expected = triangles(&binary);
    binary[..5].copy_from_slice(b"solid");
    assert_eq!(triangles(&binary), expected);
    binary.push(0);
    fails(&binary, "byte 80: 2 triangles of a binary STL need 184 bytes, the file has 185");
}

#[test]
fn strips_turn_every_second_triangle() {
    let text = |indices: &str, count: usize| {
        format!(
            "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 5 float\n0 0 0 1 0 0 0 1 0 1 1 0 0 2 0\n\
             TRIANGLE_STRIPS 1 {}\n{count} {indices}\n",
            count + 1
        )
    };
    assert_eq!(triangles(text("0 1 2 3 4", 5)), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
    // Repeated corners join two parts.
    assert_eq!(triangles(text("0 1 2 2 2 3 4", 7)), [[0, 1, 2], [2, 3, 4]]);
}

#[test]
fn faces_of_ply_may_come_first_and_have_more_properties() {
    let text = "ply\nformat ascii 1.0\nelement face 2\nproperty uchar flag\nproperty list uchar int vertex_index\n\
                property list uchar float texcoord\nelement vertex 4\nproperty double x\nproperty double y\n\
                property double z\nproperty uchar red\nend_header\n7 3 0 1 2 2 0.5 0.5\n\n7 4 0 1 2 3 0\n\
                0 0 0 1\n1 0 0 1\n1 1 0 1\n0 1 0 1\n";
    assert_eq!(triangles(text), [[0, 1, 2], [0, 1, 2], [0, 2, 3]]);
    fails(
        text.replace("vertex_index", "corners"),
        "faces without a list of integers vertex_indices",
    );
    fails(
        text.replace("int vertex_index", "float vertex_index"),
        "faces without a list of integers",
    );
}

#[test]
fn a_face_of_two_volumes_is_not_part_of_the_surface() {
    // Two tetrahedra on both sides of a triangle, which is a cell itself, and a triangle of its own.
    let cells = |cells: &str, types: &str| {
        let count = types.split(' ').count();
        let size = cells.split(' ').count();
        format!(
            "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 float\n\
             0 0 0 1 0 0 0 1 0 0 0 1 0 0 -1\nCELLS {count} {size}\n{cells}\nCELL_TYPES {count}\n{types}\n"
        )
    };
    let both = triangles(cells("4 0 1 2 3 3 0 1 2 4 0 1 2 4", "10 5 10"));
    assert_eq!(both.len(), 6);
    assert!(both.iter().all(|triangle| triangle.contains(&3) || triangle.contains(&4)));
    let one = triangles(cells("4 0 1 2 3 3 0 1 2 3 0 1 4", "10 5 5"));
    assert_eq!(one.len(), 5);
    // Without volumes, all polygons are kept.
    let none = triangles(cells("3 0 1 2 3 2 1 0 2 0 1 4 0 1 4 2", "5 7 3 8"));
    assert_eq!(none, [[0, 1, 2], [2, 1, 0], [0, 1, 2], [0, 2, 4]]);
    fails(cells("4 0 1 2 3", "24"), "cells of VTK type 24 are not read");
    fails(cells("3 0 1 2", "10"), "cell 0 has 3 vertices");
}

#[test]
fn files_without_faces_say_so() {
    let particles = [
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n",
        "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n0 0 0\nVERTICES 1 2\n1 0\n",
        "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"1\"><Points><DataArray type=\"Float32\" \
         NumberOfComponents=\"3\" format=\"ascii\">0 0 0</DataArray></Points></Piece></PolyData></VTKFile>",
        "v 0 0 0\nl 1 1\n",
        "solid\nendsolid\n",
    ];
    for text in particles {
        fails(text, "the file has no faces; particles are read as [input]");
    }
}

#[test]
fn other_files_are_refused() {
    fails("", "the file is empty");
    fails(
        "glTF....",
        "not a mesh in a format that spherule reads, which are stl, obj, ply, vtk, vtp and vtu",
    );
    fails("1 2 3\n", "not a mesh in a format that spherule reads");
    fails("<VTKFile type=\"PPolyData\">", "give one of the files in it");
    fails("<VTKFile type=\"ImageData\">", "a VTK file of type ImageData is not read");
    let directory = tempfile::tempdir().expect("a temporary directory");
    let error = read_mesh(directory.path(), MemoryBudget::UNLIMITED).expect_err("a directory");
    assert!(error.to_string().contains("a directory, where a file was expected"), "{error}");
}
