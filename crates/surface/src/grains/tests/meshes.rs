//! Grains that are meshes.

use std::sync::Arc;

use glam::Vec3;

use super::{
    GrainMesh, GrainMeshError, GrainShape, GrainSurface, Heap, MAX_GRAIN_TRIANGLES, Random,
};
use crate::mesh::MeshNormals;
use crate::{Shape, Side};

const CUBE: [[u32; 4]; 6] =
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];

/// Vertices and triangles of the cube from -1 to 1.
fn cube() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let sign = |bit: u32| if bit == 0 { -1.0 } else { 1.0 };
    let vertices = (0..8).map(|v| Vec3::new(sign(v & 1), sign(v & 2), sign(v & 4))).collect();
    let halves = CUBE.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    (vertices, halves.collect())
}

fn mesh(vertices: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<GrainMesh, GrainMeshError> {
    GrainMesh::new(vertices, triangles, MeshNormals::Flat)
}

pub(super) fn tetrahedron() -> GrainShape {
    let points = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
    GrainShape::Mesh(Arc::new(GrainMesh::convex(&points.map(Vec3::from)).expect("a body")))
}

/// Compares meshes of cubes to cuboids.
#[track_caller]
fn assert_cubes(cube: GrainMesh) {
    let heap = Heap::random(30, Vec3::new(2.0, 0.0, 0.0), 1.0, [0.1, 0.4], 71);
    let trees = [GrainShape::Cuboid, GrainShape::Mesh(Arc::new(cube))].map(|s| heap.tree(s));
    let mut random = Random(3);
    let (mut hits, mut differing) = (0, 0);
    for _ in 0..1000 {
        let center = Vec3::new(2.0, 0.0, 0.0);
        let ray = super::towards(center + 2.0 * random.vector(), center + random.vector());
        let [a, b] = [&trees[0], &trees[1]]
            .map(|tree| GrainSurface::new(tree).crossing(&ray, Side::Outside));
        match (a, b) {
            (Some(a), Some(b)) if a.particle == b.particle => {
                hits += 1;
                assert!((a.t - b.t).abs() < 2e-5 && (a.point - b.point).length() < 2e-5);
                differing += u32::from((a.normal - b.normal).length() > 1e-5);
            }
            (None, None) => {}
            _ => differing += 1,
        }
    }
    assert!(hits > 300 && differing < 5, "{hits} {differing}");
}

#[test]
fn cubes_are_cuboids() {
    let (vertices, mut triangles) = cube();
    assert_cubes(mesh(vertices.clone(), triangles.clone()).expect("closed"));
    // With the inside out, which is turned
    for corners in &mut triangles {
        corners.reverse();
    }
    assert_cubes(mesh(vertices.clone(), triangles.clone()).expect("closed"));
    // With own vertices for each triangle, as in STL files
    let own: Vec<Vec3> = triangles.iter().flatten().map(|v| vertices[*v as usize]).collect();
    let numbers: Vec<u32> = (0..36).collect();
    let separate = numbers.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect();
    assert_cubes(mesh(own, separate).expect("closed"));
    // The hull of the corners and of points inside
    let mut points = vertices;
    points.extend([Vec3::ZERO, 0.5 * Vec3::X, Vec3::X, Vec3::new(0.3, 1.0, 0.2)]);
    assert_cubes(GrainMesh::convex(&points).expect("a body"));
}

#[test]
fn hulls_contain_their_points() {
    let mut random = Random(5);
    for count in [4, 5, 20, 200] {
        let points: Vec<Vec3> = (0..count).map(|_| random.vector().normalize()).collect();
        let hull = GrainMesh::convex(&points).expect("a body");
        // Points of a sphere are all corners: Euler's formula
        assert_eq!(hull.triangle_count(), 2 * count - 4);
    }
    let flat: Vec<Vec3> = (0..20).map(|_| random.vector() * Vec3::new(1.0, 1.0, 0.0)).collect();
    let message = |error: GrainMeshError| error.to_string();
    let expected = "the 20 points of a convex grain are in a plane, so it has no volume";
    assert_eq!(GrainMesh::convex(&flat).map_err(message).expect_err("flat"), expected);
    for points in [vec![], vec![Vec3::X], vec![Vec3::X; 9]] {
        assert!(matches!(GrainMesh::convex(&points), Err(GrainMeshError::Flat(_))));
    }
    assert_eq!(GrainMesh::convex(&[Vec3::NAN]).expect_err("NaN"), GrainMeshError::NotFinite(0));
}

#[test]
fn meshes_that_are_not_closed_are_refused() {
    let (vertices, triangles) = cube();
    let message = |vertices: &[Vec3], triangles: &[[u32; 3]]| {
        mesh(vertices.to_vec(), triangles.to_vec()).expect_err("not closed").to_string()
    };
    // A triangle less, and one too many
    let open = message(&vertices, &triangles[1..]);
    assert!(
        open.starts_with("the mesh of a grain is not closed: the edge from (-1, -1, -1)"),
        "{open}"
    );
    assert!(open.ends_with("has one triangle, but needs two"), "{open}");
    let twice = [&triangles[..], &triangles[..1]].concat();
    assert!(message(&vertices, &twice).ends_with("has 3 triangles, but needs two"));
    // One triangle turned
    let mut turned = triangles.clone();
    turned[3].swap(0, 1);
    assert!(message(&vertices, &turned).contains("opposite orientations"));
    // Nothing, an index too many, NaN, and too many triangles
    assert_eq!(message(&vertices, &[]), "the mesh of a grain has no triangles");
    assert_eq!(message(&vertices, &[[0, 0, 1]]), "the mesh of a grain has no triangles");
    assert!(message(&vertices, &[[0, 1, 8]]).contains("refers to vertex 8"));
    assert_eq!(
        message(&[Vec3::ZERO, Vec3::NAN], &triangles[..0]),
        "vertex 1 of the mesh of a grain is not finite"
    );
    let many = vec![[0, 1, 2]; MAX_GRAIN_TRIANGLES + 1];
    assert_eq!(
        message(&vertices, &many),
        "the mesh of a grain has 1000001 triangles, but the limit is 1000000; simplify it"
    );
}

#[test]
fn smooth_normals_are_turned_with_the_grain() {
    let (vertices, triangles) = cube();
    let smooth = GrainMesh::new(vertices, triangles, MeshNormals::Smooth(2.0)).expect("closed");
    let heap = Heap::random(1, Vec3::ZERO, 0.0, [0.5, 0.5], 1);
    let tree = heap.tree(GrainShape::Mesh(Arc::new(smooth)));
    let surface = GrainSurface::new(&tree);
    let mut random = Random(4);
    let mut turned = 0;
    for _ in 0..200 {
        let ray = super::towards(3.0 * random.vector(), 0.4 * random.vector());
        let Some(hit) = surface.crossing(&ray, Side::Outside) else { continue };
        // Normals at the corners point away from the centre
        let outward = hit.point.normalize();
        turned += u32::from(hit.shading.dot(outward) > hit.normal.dot(outward));
        assert!(hit.shading.dot(ray.direction) * hit.normal.dot(ray.direction) > 0.0);
    }
    assert!(turned > 80, "{turned}");
}
