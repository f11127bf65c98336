//! Smooth normals.

use glam::Vec3;
use rayon::prelude::*;

use super::{TriangleMesh, triangle};
use spherule_tree::math::functions::{acos, sin_cos};

/// Unit normals at the corners of each triangle: the mean over the triangles at the corner whose normals differ from
/// that of the triangle by less than `angle` radians, weighted by the angle of each at the corner.
pub(super) fn smooth(mesh: &TriangleMesh, angle: f32) -> Vec<[Vec3; 3]> {
    let faces: Vec<Vec3> = mesh
        .indices()
        .into_par_iter()
        .map(|number| triangle::normal(&mesh.corners(number)).unwrap_or(Vec3::Z))
        .collect();
    let adjacent = Adjacency::new(mesh);
    let (_, limit) = sin_cos(angle);
    let normal_at = |number: usize, vertex: u32| {
        let own = faces[number];
        let sum = adjacent.triangles_at(vertex).iter().map(|&other| {
            let face = faces[other as usize];
            if face.dot(own) >= limit { face * angle_at(mesh, other, vertex) } else { Vec3::ZERO }
        });
        sum.sum::<Vec3>().try_normalize().unwrap_or(own)
    };
    let triangles = mesh.triangles.par_iter().enumerate();
    triangles.map(|(number, corners)| corners.map(|vertex| normal_at(number, vertex))).collect()
}

/// The angle of `triangle` at `vertex`, radians.
fn angle_at(mesh: &TriangleMesh, triangle: u32, vertex: u32) -> f32 {
    let corners = mesh.triangles[triangle as usize];
    let Some(at) = corners.iter().position(|corner| *corner == vertex) else {
        return 0.0;
    };
    let point = |step: usize| mesh.vertices[corners[(at + step) % 3] as usize];
    let edge = |step| (point(step) - point(0)).normalize_or_zero();
    acos(edge(1).dot(edge(2)).clamp(-1.0, 1.0))
}

/// The triangles at each vertex.
struct Adjacency {
    /// Where the triangles of each vertex start in `triangles`, and the total.
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl Adjacency {
    fn new(mesh: &TriangleMesh) -> Self {
        // Count the corners at each vertex, and sum up the counts
        let mut starts = vec![0; mesh.vertices.len() + 1];
        for vertex in mesh.triangles.iter().flatten() {
            starts[*vertex as usize + 1] += 1;
        }
        for vertex in 1..starts.len() {
            starts[vertex] += starts[vertex - 1];
        }
        // Distribute the triangles; a vertex keeps their order
        let mut next = starts.clone();
        let mut triangles = vec![0; mesh.len() * 3];
        for (number, corners) in (0..).zip(&mesh.triangles) {
            for vertex in corners {
                let slot = &mut next[*vertex as usize];
                triangles[*slot as usize] = number;
                *slot += 1;
            }
        }
        Self { starts, triangles }
    }

    fn triangles_at(&self, vertex: u32) -> &[u32] {
        let vertex = vertex as usize;
        &self.triangles[self.starts[vertex] as usize..self.starts[vertex + 1] as usize]
    }
}
