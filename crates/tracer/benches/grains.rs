//! Grains: 1e5 ellipsoids against the same number of spheres, other shapes, and the build of 1e6 grains of 100 triangles:
//!
//! ```text
//! cargo bench -p spherule-tracer --bench grains
//! ```
//!
//! Times of rays are CPU times of one thread, the least of several runs. Camera rays are coherent packets of 4 x 4 pixels,
//! shadow rays go from the points that they hit to the sun, and reflected rays are incoherent.

#![expect(clippy::print_stdout, reason = "a benchmark prints its measurements")]

use std::fs;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use glam::{DVec3, Vec3};
use spherule_surface::grains::{
    GrainMesh, GrainMotion, GrainShape, GrainSizes, GrainSurface, GrainTree, Grains,
};
use spherule_surface::mesh::MeshNormals;
use spherule_surface::spheres::SphereSurface;
use spherule_surface::{Intersections, Shape};
use spherule_tracer::render::{IntegratorKind, ParticleShading, RenderSettings, render};
use spherule_tracer::scene::{Camera, CameraView, Environment, Scene};
use spherule_tree::accel::{
    BuildSettings, Coherence, SphereRadius, Spheres, Structure, TreeBuilder,
};
use spherule_tree::ray::{Ray, RayPacket};

#[path = "../../../benches/support/cpu_time.rs"]
mod cpu_time;

use cpu_time::CpuTime;

/// Pixels along a side of the picture.
const PIXELS: usize = 640;
/// Number of times that rays are traced.
const RUNS: usize = 5;

/// Grains in a cube.
struct Heap {
    centers: Vec<Vec3>,
    orientations: Vec<[f32; 4]>,
    sizes: Vec<[f32; 3]>,
    radii: Vec<f32>,
}

impl Heap {
    /// `side`^3 grains around the points of a grid with a distance of 1, from -`side`/2 to `side`/2.
    fn new(side: u32) -> Self {
        let mut state = 1_u64;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        let mut heap = Self { centers: vec![], orientations: vec![], sizes: vec![], radii: vec![] };
        for number in 0..side.pow(3) {
            let place = [number % side, number / side % side, number / side / side];
            let corner = Vec3::from(place.map(|c| c as f32 - 0.5 * side as f32));
            heap.centers.push(corner + 0.3 * Vec3::new(next(), next(), next()));
            let q = [next(), next(), next(), next()];
            let length = q.iter().map(|c| c * c).sum::<f32>().sqrt();
            heap.orientations.push(q.map(|c| c / length));
            let radius = 0.4 + 0.1 * next();
            heap.radii.push(radius);
            // About the volume of the sphere
            heap.sizes.push([1.5 * radius, radius, 0.7 * radius]);
        }
        heap
    }

    fn tree(&self, shape: GrainShape, motion: Option<GrainMotion<'_>>) -> GrainTree {
        let grains = Grains {
            orientations: &self.orientations,
            motion,
            ..Grains::new(&self.centers, GrainSizes::Each(&self.sizes))
        };
        GrainTree::new(&grains, shape).expect("grains")
    }
}

/// Camera rays of a picture of all grains, as packets of 4 x 4 pixels.
fn camera_rays(side: f32) -> Vec<RayPacket> {
    let eye = Vec3::new(1.1, 1.3, 0.9) * side;
    let forward = -eye.normalize();
    let right = forward.cross(Vec3::Z).normalize();
    let up = right.cross(forward);
    let mut packets = Vec::new();
    for tile in 0..(PIXELS / 4).pow(2) {
        let corner = [tile % (PIXELS / 4) * 4, tile / (PIXELS / 4) * 4];
        let mut packet = RayPacket::default();
        for lane in 0..16 {
            let [x, y] = [corner[0] + lane % 4, corner[1] + lane / 4]
                .map(|c| (c as f32 + 0.5) / PIXELS as f32 - 0.5);
            let direction = (forward + 0.8 * (x * right + y * up)).normalize();
            packet.push(&Ray::new(eye, direction));
            packet.time[lane] = (lane as f32 + 0.5) / 16.0 - 0.5;
        }
        packets.push(packet);
    }
    packets
}

/// Shadow and reflected rays from the points that the camera rays hit.
fn secondary_rays(shape: &dyn Shape, camera: &[RayPacket]) -> [Vec<RayPacket>; 2] {
    let sun = Vec3::new(0.3, -0.4, 0.85).normalize();
    let mut all = [Vec::new(), Vec::new()];
    for packet in camera {
        let (mut rays, mut hits) = (*packet, Intersections::default());
        shape.intersect(&mut rays, Coherence::Coherent, 0, &mut hits);
        let mut packets = [RayPacket::default(), RayPacket::default()];
        for lane in (0..16).filter(|lane| hits.mask >> lane & 1 == 1) {
            let hit = hits.get(lane);
            let incoming = packet.ray(lane).direction;
            let origin = hit.anchor + hit.offset * hit.normal;
            packets[0].push(&Ray::new(origin, sun));
            let reflected = incoming - 2.0 * incoming.dot(hit.normal) * hit.normal;
            packets[1].push(&Ray::new(origin, reflected.normalize()));
        }
        for (all, packet) in all.iter_mut().zip(packets) {
            if !packet.is_empty() {
                all.push(packet);
            }
        }
    }
    all
}

/// Least CPU time for `packets`, nanoseconds per ray, and the number of rays that hit.
fn time(packets: &[RayPacket], mut trace: impl FnMut(&RayPacket) -> u32) -> (f64, u64) {
    let rays: usize = packets.iter().map(RayPacket::len).sum();
    let (mut best, mut hits) = (f64::INFINITY, 0);
    for _ in 0..RUNS {
        let start = CpuTime::now();
        hits = packets.iter().map(|packet| u64::from(trace(packet).count_ones())).sum();
        best = best.min(start.seconds());
    }
    (1e9 * best / rays as f64, hits)
}

/// Prints the times of camera, shadow and reflected rays.
fn measure(name: &str, shape: &dyn Shape, camera: &[RayPacket]) -> [f64; 3] {
    let [shadow, reflected] = secondary_rays(shape, camera);
    let nearest = |coherence: Coherence| {
        move |packet: &RayPacket| {
            let (mut rays, mut hits) = (*packet, Intersections::default());
            shape.intersect(&mut rays, coherence, 0, &mut hits);
            hits.mask
        }
    };
    let (first, hits) = time(camera, nearest(Coherence::Coherent));
    let any =
        |packet: &RayPacket| shape.occluded(packet, Coherence::Coherent, (1 << packet.len()) - 1);
    let (second, _) = time(&shadow, any);
    let (third, _) = time(&reflected, nearest(Coherence::Incoherent));
    println!(
        "{name:<28} camera {first:7.1} ns, shadow {second:7.1} ns, reflected {third:7.1} ns per ray; {hits} hits"
    );
    [first, second, third]
}

/// Ellipsoids against spheres with the same centres and about the same volumes.
fn compare_spheres(side: u32) {
    let heap = Heap::new(side);
    println!("{} grains, {PIXELS} x {PIXELS} pixels", heap.centers.len());
    let camera = camera_rays(side as f32);
    let mut builder = TreeBuilder::new();
    let spheres = Spheres { centers: &heap.centers, radius: SphereRadius::Each(&heap.radii) };
    builder.build(&spheres, &BuildSettings::new(Structure::Bvh));
    let spheres = measure("spheres", &SphereSurface::new(builder.tree().view()), &camera);
    let tree = heap.tree(GrainShape::Ellipsoid, None);
    let ellipsoids = measure("ellipsoids", &GrainSurface::new(&tree), &camera);
    let ratios: Vec<String> =
        spheres.iter().zip(ellipsoids).map(|(a, b)| format!("{:.2}", b / a)).collect();
    println!("{:<28} {}", "ellipsoids / spheres", ratios.join(", "));
    let view = builder.tree().view();
    let [a, b] = [&SphereSurface::new(view) as &dyn Shape, &GrainSurface::new(&tree)]
        .map(|shape| picture(shape, f64::from(side)));
    println!("picture: spheres {a:.2} s, ellipsoids {b:.2} s of CPU time, ratio {:.2}", b / a);
    // The other shapes
    let superquadric = GrainShape::Superquadric { exponents: [4.0, 4.0] };
    for shape in [GrainShape::Capsule, GrainShape::Cylinder, GrainShape::Cuboid, superquadric] {
        let tree = heap.tree(shape.clone(), None);
        measure(&format!("{shape:?}"), &GrainSurface::new(&tree), &camera);
    }
    let shape = GrainShape::Mesh(Arc::new(hundred_triangles()));
    let tree = heap.tree(shape.clone(), None);
    measure(&format!("{shape:?}"), &GrainSurface::new(&tree), &camera);
    // Ellipsoids that move by half their size and turn by 30 degrees
    let displacements = vec![Vec3::new(0.2, 0.1, 0.0); heap.centers.len()];
    let rotations = vec![Vec3::new(0.0, 0.3, 0.4); heap.centers.len()];
    let motion = GrainMotion { displacements: &displacements, rotations: &rotations };
    let tree = heap.tree(GrainShape::Ellipsoid, Some(motion));
    measure("moving ellipsoids", &GrainSurface::new(&tree), &camera);
}

/// CPU time of all threads so far, seconds, in steps of 10 ms; wall-clock time where the system does not tell.
fn process_seconds(start: Instant) -> f64 {
    let text = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Fields follow the name of the program, which is in parentheses; the times are the 14th and the 15th
    let fields = text.rsplit_once(')').map_or("", |(_, rest)| rest);
    let ticks: Vec<f64> =
        fields.split_whitespace().skip(11).take(2).filter_map(|field| field.parse().ok()).collect();
    if ticks.len() == 2 { 0.01 * (ticks[0] + ticks[1]) } else { start.elapsed().as_secs_f64() }
}

/// CPU seconds for a picture by the path integrator, the least of three.
fn picture(shape: &dyn Shape, side: f64) -> f64 {
    let view = CameraView {
        eye: DVec3::new(1.1, 1.3, 0.9) * side,
        look_at: DVec3::ZERO,
        up: DVec3::Z,
        fov: 40.0,
    };
    let scene = Scene {
        environment: Some(Arc::new(Environment::constant(Vec3::ONE))),
        ..Scene::new(Camera::new(&view, 1.0, DVec3::ZERO).expect("a view"))
    };
    let source = ParticleShading::constant(Vec3::splat(0.5));
    let settings = RenderSettings {
        samples: 4,
        integrator: IntegratorKind::Path,
        ..RenderSettings::new(480, 480)
    };
    let mut best = f64::INFINITY;
    for _ in 0..3 {
        let start = Instant::now();
        let before = process_seconds(start);
        render(&[shape], &scene, &source, &settings, &AtomicBool::new(false)).expect("a picture");
        best = best.min(process_seconds(start) - before);
    }
    best
}

/// A closed mesh of 100 triangles: rings of ten vertices and two poles.
fn hundred_triangles() -> GrainMesh {
    let mut points = vec![Vec3::Z, Vec3::NEG_Z];
    for ring in 0..5_u8 {
        let height = f32::from(ring) / 3.0 - 2.0 / 3.0;
        let radius = (1.0 - height * height).sqrt();
        for step in 0..10_u8 {
            let angle = std::f32::consts::TAU * f32::from(step) / 10.0;
            points.push(Vec3::new(radius * angle.cos(), radius * angle.sin(), height));
        }
    }
    let at = |ring: u32, step: u32| 2 + 10 * ring + step % 10;
    let mut triangles = Vec::new();
    for step in 0..10 {
        triangles.push([1, at(0, step + 1), at(0, step)]);
        triangles.push([0, at(4, step), at(4, step + 1)]);
        for ring in 0..4 {
            let [a, b] = [at(ring, step), at(ring, step + 1)];
            let [c, d] = [at(ring + 1, step), at(ring + 1, step + 1)];
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    assert_eq!(triangles.len(), 100, "triangles of the mesh");
    GrainMesh::new(points, triangles, MeshNormals::Smooth(0.7)).expect("a closed mesh")
}

/// A value of `/proc/self/status`, MiB; NaN where there is none.
fn status(name: &str) -> f64 {
    let text = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix(name));
    let number = line.and_then(|rest| rest.trim_matches([':', ' ', '\t']).split(' ').next());
    number.and_then(|number| number.parse::<f64>().ok()).map_or(f64::NAN, |kib| kib / 1024.0)
}

/// The time and the memory to build 1e6 grains of 100 triangles.
fn build_million() {
    let heap = Heap::new(100);
    let mesh = Arc::new(hundred_triangles());
    println!("{} grains of {} triangles", heap.centers.len(), mesh.triangle_count());
    for _ in 0..3 {
        // Peak memory starts anew
        let _ = fs::write("/proc/self/clear_refs", "5");
        let before = status("VmRSS");
        let start = Instant::now();
        let tree = heap.tree(GrainShape::Mesh(Arc::clone(&mesh)), None);
        println!(
            "built in {:.2} s (wall clock, {} threads): {:.1} MiB kept, {:.1} bytes per grain, peak {:.1} MiB above the {before:.1} MiB before",
            start.elapsed().as_secs_f64(),
            rayon::current_num_threads(),
            tree.bytes() as f64 / (1 << 20) as f64,
            tree.bytes() as f64 / tree.len() as f64,
            status("VmHWM") - before
        );
    }
    let tree = heap.tree(GrainShape::Mesh(mesh), None);
    measure("1e6 meshes", &GrainSurface::new(&tree), &camera_rays(100.0));
}

fn main() {
    compare_spheres(46);
    build_million();
}
