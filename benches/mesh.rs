//! How far the smooth surface is from a mesh of the same particles, splashsurf's for instance:
//!
//! ```text
//! cargo bench --bench mesh -- water.obj dam.bgeo --radius 0.025
//! ```
//!
//! At each vertex the surface is looked for along the vertex's normal, on the side on which it is, up to two
//! radii away. Distances are in radii, positive where the vertex is outside of the surface; angles are between
//! the two normals. Without a mesh it has nothing to do.

#![expect(clippy::print_stdout, reason = "a benchmark prints its measurements")]

use std::fs;
use std::path::{Path, PathBuf};

use clap::Parser;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use spherule::ray::Ray;
use spherule::surface::smooth::SmoothGrid;
use spherule::surface::{Shape, Side, SurfaceKind, SurfaceSettings};
use spherule_formats::{FrameFile, ParticleFrame};

/// Radii along the normal in which the surface is looked for.
const REACH: f32 = 2.0;

#[derive(Parser)]
struct Options {
    /// OBJ file with vertices and as many normals.
    mesh: Option<PathBuf>,
    /// What the mesh was made of.
    particles: Option<PathBuf>,
    /// Particle radius.
    #[arg(long, default_value_t = 0.025)]
    radius: f32,
    /// From the particles, without smoothing.
    #[arg(long)]
    exact: bool,
    /// 0 to 1.
    #[arg(long)]
    smoothing: Option<f32>,
    /// Edge of a voxel, radii.
    #[arg(long)]
    voxel: Option<f32>,
    /// What cargo adds.
    #[arg(long, hide = true)]
    bench: bool,
}

struct Vertex {
    point: Vec3,
    normal: Vec3,
}

/// What is found at a vertex.
struct Difference {
    /// Radii, positive outside.
    distance: f32,
    /// Degrees.
    angle: f32,
}

fn main() {
    let options = Options::parse();
    let (Some(mesh), Some(particles)) = (&options.mesh, &options.particles) else {
        println!("mesh: nothing to compare; see the head of benches/mesh.rs");
        return;
    };
    let vertices = vertices(&fs::read_to_string(mesh).expect("a mesh"));
    let centers = centers(particles);
    let settings = options.settings();
    let mut grid = SmoothGrid::default();
    grid.build(&centers, options.radius, &settings, false, None).expect("memory for the surface");
    let found: Vec<Option<Difference>> = vertices
        .par_iter()
        .map(|vertex| difference(&grid.surface(), vertex, options.radius))
        .collect();
    let hits: Vec<&Difference> = found.iter().flatten().collect();
    println!(
        "{} vertices, at {:.2} % of them no surface within {REACH} radii",
        vertices.len(),
        100.0 * (vertices.len() - hits.len()) as f64 / vertices.len() as f64
    );
    print_percentiles("angle", "degrees", hits.iter().map(|d| d.angle).collect());
    print_percentiles("distance", "radii", hits.iter().map(|d| d.distance).collect());
}

impl Options {
    fn settings(&self) -> SurfaceSettings {
        let default = SurfaceSettings::DEFAULT;
        SurfaceSettings {
            kind: SurfaceKind::Smooth,
            exact: self.exact,
            smoothing: self.smoothing.unwrap_or(default.smoothing),
            voxel: self.voxel.unwrap_or(default.voxel),
            ..default
        }
    }
}

/// Positions of the only step in a file.
fn centers(path: &Path) -> Vec<Vec3> {
    let file = FrameFile::open(path).expect("a particle file");
    let raw = file.read(0).expect("particles");
    ParticleFrame::from_raw(raw, DVec3::ZERO).positions
}

/// The vertices of an OBJ file whose normals are in the same order.
fn vertices(text: &str) -> Vec<Vertex> {
    let triples = |name: &str| -> Vec<Vec3> {
        let values = text.lines().filter_map(|line| line.strip_prefix(name));
        values.map(triple).collect()
    };
    let (points, normals) = (triples("v "), triples("vn "));
    assert_eq!(points.len(), normals.len(), "a normal for each vertex");
    let pairs = points.into_iter().zip(normals);
    pairs.map(|(point, normal)| Vertex { point, normal: normal.normalize() }).collect()
}

fn triple(text: &str) -> Vec3 {
    let numbers: Vec<f32> =
        text.split_whitespace().map(|word| word.parse().expect("a number")).collect();
    Vec3::from_slice(&numbers)
}

/// The surface nearest to `vertex` along its normal; None where there is none in reach.
fn difference(surface: &impl Shape, vertex: &Vertex, radius: f32) -> Option<Difference> {
    let side = surface.side_of(vertex.point);
    let outward = if side == Side::Outside { -1.0 } else { 1.0 };
    let ray = Ray { t_max: REACH * radius, ..Ray::new(vertex.point, outward * vertex.normal) };
    let hit = surface.crossing(&ray, side)?;
    let cosine = hit.normal.dot(vertex.normal).clamp(-1.0, 1.0);
    Some(Difference { distance: -outward * hit.t / radius, angle: cosine.acos().to_degrees() })
}

/// Prints quantiles of all that was found.
fn print_percentiles(name: &str, unit: &str, mut values: Vec<f32>) {
    values.sort_by(f32::total_cmp);
    if values.is_empty() {
        return;
    }
    let quantile = |percent: usize| values[percent * (values.len() - 1) / 100];
    let mean = values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64;
    let [p5, p50, p95] = [5, 50, 95].map(quantile);
    println!("{name}: p5 {p5:.3}, p50 {p50:.3}, p95 {p95:.3}, mean {mean:.3} {unit}");
}
