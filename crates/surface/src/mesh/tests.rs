//! Meshes against brute force in f64, and rays that must not slip through.

use glam::Vec3;
use proptest::prelude::*;

use super::*;
use crate::{Intersections, MaterialId, Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::ray::{Ray, RayPacket};

/// Numbers in -1..1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.vector();
            if v.length_squared() > 0.01 && v.length_squared() < 1.0 {
                return v.normalize();
            }
        }
    }
}

/// Separate triangles of side `size` in a cube.
fn soup(count: u32, size: f32, seed: u64) -> TriangleMesh {
    let mut random = Random(seed);
    let mut vertices = Vec::new();
    for _ in 0..count {
        let center = random.vector();
        vertices.extend((0..3).map(|_| center + random.vector() * size));
    }
    let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    TriangleMesh::new(vertices, triangles, MeshNormals::Flat).expect("a mesh")
}

/// A closed sphere of `rings` * `2 * rings` vertices with outward triangles, and poles.
fn sphere(rings: u32, center: Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let columns = 2 * rings;
    let mut vertices = vec![center + Vec3::Z, center - Vec3::Z];
    for ring in 1..rings {
        for column in 0..columns {
            let (sin, cos) = (std::f32::consts::PI * ring as f32 / rings as f32).sin_cos();
            let (y, x) = (std::f32::consts::TAU * column as f32 / columns as f32).sin_cos();
            vertices.push(center + Vec3::new(x * sin, y * sin, cos));
        }
    }
    let at = |ring: u32, column: u32| match ring {
        0 => 0,
        ring if ring == rings => 1,
        ring => 2 + (ring - 1) * columns + column % columns,
    };
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for column in 0..columns {
            let [a, b] = [at(ring, column), at(ring, column + 1)];
            let [c, d] = [at(ring + 1, column), at(ring + 1, column + 1)];
            if ring > 0 {
                triangles.push([a, d, b]);
            }
            if ring + 1 < rings {
                triangles.push([a, c, d]);
            }
        }
    }
    (vertices, triangles)
}

/// The nearest intersection by brute force: distance and triangle (Möller and Trumbore, 1997, in f64).
fn brute(mesh: &TriangleMesh, ray: &Ray) -> Option<(f64, u32)> {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let mut best: Option<(f64, u32)> = None;
    for triangle in mesh.indices() {
        let [a, b, c] = mesh.corners(triangle).map(|p| p.as_dvec3());
        let (e1, e2) = (b - a, c - a);
        let p = d.cross(e2);
        let determinant = e1.dot(p);
        if determinant == 0.0 {
            continue;
        }
        let s = o - a;
        let u = s.dot(p) / determinant;
        let q = s.cross(e1);
        let v = d.dot(q) / determinant;
        let t = e2.dot(q) / determinant;
        let is_inside = u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        if is_inside
            && t >= f64::from(ray.t_min)
            && t < f64::from(ray.t_max)
            && best.is_none_or(|(best, _)| t < best)
        {
            best = Some((t, triangle));
        }
    }
    best
}

fn surface(tree: &MeshTree) -> MeshSurface<'_> {
    MeshSurface::new(tree, VisibleFaces::Both, MaterialId::GROUND)
}

#[test]
fn the_nearest_triangle_is_that_of_brute_force() {
    let tree = MeshTree::new(soup(500, 0.2, 1));
    let shape = surface(&tree);
    let mut random = Random(2);
    let mut hits = 0;
    for _ in 0..4000 {
        let mut ray = Ray::new(random.vector() * 3.0, random.direction());
        ray.t_max = 4.0;
        let expected = brute(tree.mesh(), &ray);
        let found = shape.crossing(&ray, Side::Outside);
        assert_eq!(
            found.map(|hit| hit.particle),
            expected.map(|(_, triangle)| triangle),
            "{ray:?}"
        );
        let Some((hit, (t, _))) = found.zip(expected) else {
            continue;
        };
        hits += 1;
        assert!((f64::from(hit.t) - t).abs() < 1e-6 * (1.0 + t));
        let point = ray.origin.as_dvec3() + ray.direction.as_dvec3() * t;
        assert!((hit.point.as_dvec3() - point).length() < 1e-6);
        assert!((hit.normal.length() - 1.0).abs() < 1e-6);
    }
    assert!(hits > 200, "{hits} hits");
}

#[test]
fn packets_find_what_single_rays_find() {
    let tree = MeshTree::new(soup(300, 0.3, 5));
    let shape = surface(&tree);
    let mut random = Random(6);
    for _ in 0..100 {
        let mut rays = RayPacket::default();
        for _ in 0..13 {
            rays.push(&Ray::new(random.vector() * 2.0, random.direction()));
        }
        let expected: Vec<_> = rays.rays().map(|ray| shape.crossing(&ray, Side::Outside)).collect();
        let lanes = (1 << 13) - 1;
        let occluded = shape.occluded(&rays, Coherence::Incoherent, lanes);
        let mut hits = Intersections::default();
        shape.intersect(&mut rays, Coherence::Incoherent, 0, &mut hits);
        assert_eq!(hits.all(13), expected);
        for (lane, hit) in expected.iter().enumerate() {
            assert_eq!(occluded >> lane & 1 == 1, hit.is_some());
        }
    }
}

/// Rays from inside a closed mesh through its vertices and the middles of its edges, also far from the origin and
/// from far away.
#[test]
fn no_ray_leaves_a_closed_mesh() {
    for (center, distance) in
        [(Vec3::ZERO, 0.5), (Vec3::new(3e3, -2e3, 1e3), 0.5), (Vec3::ZERO, 2e4)]
    {
        let (vertices, triangles) = sphere(20, center);
        let mesh = TriangleMesh::new(vertices.clone(), triangles.clone(), MeshNormals::Flat);
        let tree = MeshTree::new(mesh.expect("a mesh"));
        let mut random = Random(9);
        for corners in &triangles {
            let [a, b, c] = corners.map(|v| vertices[v as usize]);
            for target in [a, (a + b) / 2.0, (b + c) / 2.0, (a + b + c) / 3.0] {
                let origin = center + random.direction() * distance;
                let ray = Ray::new(origin, (target - origin).normalize());
                let hit = surface(&tree).crossing(&ray, Side::Outside);
                let is_inside = distance < 1.0;
                // From outside, a ray to the silhouette may miss
                let is_silhouette = (target - center).dot(ray.direction).abs() < 0.2;
                assert!(hit.is_some() || (!is_inside && is_silhouette), "{ray:?} at {target}");
            }
        }
    }
}

#[test]
fn faces_are_told_apart_by_the_order_of_their_vertices() {
    let (vertices, triangles) = sphere(8, Vec3::ZERO);
    let mesh = TriangleMesh::new(vertices, triangles, MeshNormals::Flat).expect("a mesh");
    let tree = MeshTree::new(mesh);
    let t = |faces, origin: f32| {
        let ray = Ray::new(Vec3::new(origin, 0.1, 0.2), Vec3::X);
        let hit =
            MeshSurface::new(&tree, faces, MaterialId::GROUND).crossing(&ray, Side::Outside)?;
        Some((hit.point.x.signum(), hit.normal.dot(hit.point) > 0.0))
    };
    // Outward normals, whatever is visible
    assert_eq!(t(VisibleFaces::Both, -3.0), Some((-1.0, true)));
    assert_eq!(t(VisibleFaces::Front, -3.0), Some((-1.0, true)));
    assert_eq!(t(VisibleFaces::Back, -3.0), Some((1.0, true)));
    assert_eq!(t(VisibleFaces::Front, 0.0), None);
    assert_eq!(t(VisibleFaces::Back, 0.0), Some((1.0, true)));
}

/// Both triangles of a square contain its diagonal.
#[test]
fn equal_distances_go_to_the_lower_index() {
    let corner = |x, y| Vec3::new(x, y, 0.0);
    let vertices = vec![corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
    for triangles in [[[0, 1, 2], [0, 2, 3]], [[0, 2, 3], [0, 1, 2]]] {
        let mesh = TriangleMesh::new(vertices.clone(), triangles.into(), MeshNormals::Flat);
        let tree = MeshTree::new(mesh.expect("a mesh"));
        for x in [0.0, 0.25, 0.5, 1.0] {
            let ray = Ray::new(Vec3::new(x, x, 1.0), Vec3::NEG_Z);
            let hit = surface(&tree).crossing(&ray, Side::Outside).expect("a hit");
            assert_eq!((hit.particle, hit.t), (0, 1.0));
        }
    }
}

#[test]
fn smooth_normals_are_those_of_the_sphere_and_creases_stay_sharp() {
    let (vertices, triangles) = sphere(40, Vec3::ZERO);
    let mesh = TriangleMesh::new(vertices, triangles, MeshNormals::Smooth(0.7)).expect("a mesh");
    let tree = MeshTree::new(mesh);
    let mut random = Random(3);
    let mut flat_error = 0.0;
    for _ in 0..200 {
        let ray = Ray::new(random.direction() * 3.0, Vec3::X);
        let ray = Ray { direction: -ray.origin.normalize(), ..ray };
        let hit = surface(&tree).crossing(&ray, Side::Outside).expect("a hit");
        assert!(hit.shading.dot(hit.point.normalize()) > 0.9995, "{}", hit.shading);
        flat_error = f32::max(flat_error, 1.0 - hit.normal.dot(hit.point.normalize()));
    }
    assert!(flat_error > 5e-4, "the triangles are flat: {flat_error}");
    // Two faces of a cube
    let vertices = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let mesh = TriangleMesh::new(vertices, vec![[0, 1, 2], [0, 3, 1]], MeshNormals::Smooth(0.7));
    let mesh = mesh.expect("a mesh");
    assert_eq!(mesh.shading_normal(0, [1.0, 0.0, 0.0], Vec3::X), Vec3::Z);
    assert_eq!(mesh.shading_normal(1, [1.0, 0.0, 0.0], Vec3::X), Vec3::Y);
}

#[test]
fn damaged_triangles_are_refused_or_left_out() {
    let vertices = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::NAN, Vec3::X];
    let triangles = vec![[0, 1, 2], [0, 1, 3], [0, 1, 1], [0, 1, 4], [2, 1, 0]];
    let mesh = TriangleMesh::new(vertices.clone(), triangles, MeshNormals::Smooth(1.0));
    let mesh = mesh.expect("a mesh");
    assert_eq!(mesh.len(), 2);
    let tree = MeshTree::new(mesh);
    assert!(tree.bytes() > tree.mesh().bytes());
    let error = TriangleMesh::new(vertices, vec![[0, 1, 2], [0, 5, 1]], MeshNormals::Flat);
    let message = error.expect_err("no such vertex").to_string();
    assert_eq!(message, "triangle 1 refers to vertex 5, but there are only 5 vertices");
    // An empty mesh, and rays that are not finite
    let empty = MeshTree::new(TriangleMesh::default());
    let ray = Ray::new(Vec3::ZERO, Vec3::X);
    assert_eq!(surface(&empty).crossing(&ray, Side::Outside), None);
    for ray in [Ray::new(Vec3::NAN, Vec3::X), Ray::new(Vec3::ZERO, Vec3::INFINITY)] {
        assert_eq!(surface(&tree).crossing(&ray, Side::Outside), None);
    }
}

proptest! {
    /// Rays along the axes and in planes of vertices, where edge functions are exactly zero.
    #[test]
    fn grids_have_no_holes(x in 0u32..8, y in 0u32..8, axis in 0usize..3, half in any::<bool>()) {
        let point = |u: u32, v: u32| {
            let mut p = [0.0; 3];
            p[(axis + 1) % 3] = u as f32 / 8.0;
            p[(axis + 2) % 3] = v as f32 / 8.0;
            Vec3::from_array(p)
        };
        let vertices: Vec<Vec3> = (0..81).map(|i| point(i % 9, i / 9)).collect();
        let triangles = (0..64).flat_map(|i| {
            let a = i / 8 * 9 + i % 8;
            [[a, a + 1, a + 10], [a, a + 10, a + 9]]
        });
        let mesh = TriangleMesh::new(vertices, triangles.collect(), MeshNormals::Flat).expect("a mesh");
        let tree = MeshTree::new(mesh);
        let mut direction = Vec3::ZERO;
        direction[axis] = 1.0;
        let step = if half { 0.5 / 8.0 } else { 0.0 };
        let mut origin = point(x, y) - 5.0 * direction;
        origin[(axis + 1) % 3] += step;
        let ray = Ray::new(origin, direction);
        let hit = surface(&tree).crossing(&ray, Side::Outside);
        prop_assert_eq!(hit.map(|hit| hit.t), Some(5.0));
    }
}
