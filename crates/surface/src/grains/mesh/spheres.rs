//! Triangles of spheres: icosahedra whose faces are divided into four again and again.

use std::collections::HashMap;

use glam::Vec3;

use super::MAX_GRAIN_TRIANGLES;

/// Divisions of an icosahedron: its outline is then within 0.3 % of the radius.
const DIVISIONS: u32 = 3;

/// Triangles of an icosahedron.
const FACES: [[u32; 3]; 20] = [
    [0, 11, 5],
    [0, 5, 1],
    [0, 1, 7],
    [0, 7, 10],
    [0, 10, 11],
    [1, 5, 9],
    [5, 11, 4],
    [11, 10, 2],
    [10, 7, 6],
    [7, 1, 8],
    [3, 9, 4],
    [3, 4, 2],
    [3, 2, 6],
    [3, 6, 8],
    [3, 8, 9],
    [4, 9, 5],
    [2, 4, 11],
    [6, 2, 10],
    [8, 6, 7],
    [9, 8, 1],
];

/// A sphere that belongs to a grain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GrainSphere {
    /// The centre relative to that of the grain, scene units.
    pub center: Vec3,
    /// The radius, scene units.
    pub radius: f32,
}

/// Vertices and triangles of all `spheres`: fewer for each if there are many, so that the limit of triangles holds.
pub(super) fn triangles(spheres: &[GrainSphere]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let fits = |divisions: &u32| {
        spheres.len().saturating_mul(FACES.len() << (2 * divisions)) <= MAX_GRAIN_TRIANGLES
    };
    let (directions, faces) = sphere((0..=DIVISIONS).rev().find(fits).unwrap_or(0));
    let mut vertices = Vec::with_capacity(spheres.len() * directions.len());
    let mut triangles = Vec::with_capacity(spheres.len() * faces.len());
    for sphere in spheres {
        let first = spherule_tree::order::index_u32(vertices.len());
        vertices.extend(directions.iter().map(|d| sphere.center + sphere.radius * *d));
        triangles.extend(faces.iter().map(|corners| corners.map(|vertex| first + vertex)));
    }
    (vertices, triangles)
}

/// Unit vectors to the vertices of a divided icosahedron, and its triangles, counterclockwise as seen from outside.
fn sphere(divisions: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    // An icosahedron: three rectangles whose sides have the golden ratio
    let golden = f32::midpoint(1.0, 5.0_f32.sqrt());
    let corner = |sign: f32, other: f32| [sign, other * golden, 0.0];
    let rectangle = [corner(-1.0, 1.0), corner(1.0, 1.0), corner(-1.0, -1.0), corner(1.0, -1.0)];
    let turned = (0..3).flat_map(|axis| {
        rectangle.map(|[a, b, c]| match axis {
            0 => Vec3::new(a, b, c),
            1 => Vec3::new(c, a, b),
            _ => Vec3::new(b, c, a),
        })
    });
    let mut vertices: Vec<Vec3> = turned.map(Vec3::normalize).collect();
    let mut faces = FACES.to_vec();
    // Divide each triangle at the middles of its edges, which two triangles share
    for _ in 0..divisions {
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                vertices.push((vertices[a as usize] + vertices[b as usize]).normalize());
                spherule_tree::order::index_u32(vertices.len() - 1)
            })
        };
        let mut divided = Vec::with_capacity(4 * faces.len());
        for [a, b, c] in faces {
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            divided.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        faces = divided;
    }
    (vertices, faces)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_divided_icosahedron_is_nearly_a_sphere() {
        let (vertices, faces) = sphere(DIVISIONS);
        assert_eq!((vertices.len(), faces.len()), (642, 1280));
        assert!(vertices.iter().all(|v| (v.length() - 1.0).abs() < 1e-6));
        for corners in faces {
            let [a, b, c] = corners.map(|v| vertices[v as usize]);
            let middle = (a + b + c) / 3.0;
            assert!(middle.length() > 0.99);
            assert!((b - a).cross(c - a).dot(middle) > 0.0, "seen from outside");
        }
    }

    #[test]
    fn many_spheres_have_fewer_triangles_each() {
        let spheres = vec![GrainSphere { center: Vec3::ZERO, radius: 1.0 }; 1000];
        assert_eq!(triangles(&spheres).1.len(), 1000 * 320);
        let (vertices, faces) = triangles(&[GrainSphere { center: Vec3::X, radius: 2.0 }]);
        assert_eq!(faces.len(), 1280);
        assert!(vertices.iter().all(|v| (v.distance(Vec3::X) - 2.0).abs() < 1e-5));
    }
}
