//! What `check` predicts is what `render` takes: within 15 % and 2 MiB of the peak of anonymous memory, or for surfaces,
//! spray, motion blur and meshes an upper bound within 25 %.
//!
//! A comparison runs `check` and `render` over three frames. They are large, because the tolerance hides what is wrong
//! for small ones.

use std::fmt::Write as _;
use std::fs;
use std::io::{Cursor, Write as _};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::{DVec3, Vec3};
use spherule_formats::convert::{BlockSettings, BlockSource, ParticleSource};
use spherule_formats::{ParticleFrame, Positions, RawParticles, native, write};

use super::{AWAY, answer, particles, vtk};
use crate::harness::{Workshop, dam_break};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// How far predictions may be off: a part of the peak, and bytes. The stacks of threads and the small pieces that the
/// allocator keeps differ from run to run by up to 2 MiB, whatever the frame.
const TOLERANCE: (f64, f64) = (0.15, 2.0 * 1024.0 * 1024.0);

/// Runs `check` and `render` over three frames like the one that `make` makes, and compares.
#[track_caller]
fn compare(name: &str, make: impl Fn(&Path), options: &[&str]) {
    let (predicted, measured) = peaks(name, make, options);
    let difference = (predicted - measured).abs();
    let limit = TOLERANCE.0 * measured + TOLERANCE.1;
    assert!(difference <= limit, "{name} {options:?}: predicted {predicted}, measured {measured}");
}

/// The predicted and the measured peak in bytes, over three frames like the one that `make` makes.
#[track_caller]
fn peaks(name: &str, make: impl Fn(&Path), options: &[&str]) -> (f64, f64) {
    let workshop = Workshop::new();
    fs::create_dir(workshop.join("in")).expect("a directory");
    let first = workshop.join(format!("in/f_1.{name}"));
    make(&first);
    for other in [2, 3] {
        fs::hard_link(&first, workshop.join(format!("in/f_{other}.{name}"))).expect("a link");
    }
    let common = ["in", "-o", "out/f.####.exr", "--samples", "1", "--threads", "2"];
    let arguments = |command| [&[command], &common[..], &AWAY, options].concat();
    let check = workshop.run(&[&arguments("check")[..], &["--json"]].concat()).expect(0);
    workshop.run(&arguments("render")).expect(0);
    let predicted = &answer(&check)["memory"];
    let total = predicted["total"].as_f64().expect("bytes");
    let measured =
        workshop.report("out")["totals"]["rss"]["anonymous_peak"].as_f64().expect("bytes");
    (total, measured)
}

/// A block of water of particles of radius 0.01.
fn block(path: &Path, count: usize) {
    let source = BlockSource::new(BlockSettings {
        count: count as u64,
        seed: 1,
        radius: Some(0.01),
        has_velocity: false,
    });
    let mut positions = vec![DVec3::ZERO; count];
    source.read_positions(0, &mut positions).expect("there");
    let centers: Vec<Vec3> = positions.iter().map(|p| p.as_vec3()).collect();
    write::npy::write(path, &centers).expect("a file");
}

fn spf(path: &Path, count: usize) {
    let raw =
        RawParticles { positions: Positions::F32(particles(count)), ..RawParticles::default() };
    native::write(path, &ParticleFrame::from_raw(raw, DVec3::ZERO), None).expect("a file");
}

fn npy(path: &Path, count: usize) {
    write::npy::write(path, &particles(count)).expect("a file");
}

fn gz(path: &Path, bytes: &[u8]) {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).expect("memory takes all");
    let packed = encoder.finish().expect("memory takes all");
    fs::write(path, packed).expect("a file");
}

fn csv(count: usize) -> String {
    let mut text = String::from("x,y,z,id\n");
    for (id, p) in particles(count).into_iter().enumerate() {
        writeln!(text, "{:.6},{:.6},{:.6},{id}", p.x, p.y, p.z).expect("memory takes all");
    }
    text
}

fn dump(count: usize) -> String {
    let mut text =
        format!("ITEM: TIMESTEP\n1\nITEM: NUMBER OF ATOMS\n{count}\nITEM: ATOMS x y z\n");
    for p in particles(count) {
        writeln!(text, "{:.6} {:.6} {:.6}", p.x, p.y, p.z).expect("memory takes all");
    }
    text
}

/// Lines of `prefix`, x, y and z.
fn rows(count: usize, prefix: &str) -> String {
    let mut text = String::new();
    for p in particles(count) {
        writeln!(text, "{prefix}{:.6} {:.6} {:.6}", p.x, p.y, p.z).expect("memory takes all");
    }
    text
}

fn ply(count: usize) -> String {
    let head = format!("ply\nformat ascii 1.0\nelement vertex {count}\n");
    let properties = "property float x\nproperty float y\nproperty float z\nend_header\n";
    head + properties + &rows(count, "")
}

fn xyz(count: usize) -> String {
    format!("{count}\n\n{}", rows(count, "He "))
}

fn vtk_text(count: usize) -> String {
    let head = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\n";
    format!("{head}POINTS {count} float\n{}", rows(count, ""))
}

/// The bytes that `npy` writes beside `path`.
fn npy_bytes(path: &Path, count: usize) -> Vec<u8> {
    let plain = path.with_file_name("plain");
    npy(&plain, count);
    let bytes = fs::read(&plain).expect("a file");
    fs::remove_file(&plain).expect("a file");
    bytes
}

fn npz(path: &Path, count: usize) {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    zip.start_file("positions.npy", SimpleFileOptions::default()).expect("memory takes all");
    zip.write_all(&npy_bytes(path, count)).expect("memory takes all");
    let archive = zip.finish().expect("memory takes all").into_inner();
    fs::write(path, archive).expect("a file");
}

fn vtu(path: &Path, count: usize) {
    let positions = particles(count);
    let values = positions.iter().flat_map(|p| p.to_array());
    let data: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
    let head = format!(
        "<VTKFile type=\"UnstructuredGrid\" header_type=\"UInt64\"><UnstructuredGrid>\
         <Piece NumberOfPoints=\"{count}\"><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" \
         format=\"appended\" offset=\"0\"/></Points></Piece></UnstructuredGrid><AppendedData encoding=\"raw\">_"
    );
    let mut file = head.into_bytes();
    file.extend((data.len() as u64).to_le_bytes());
    file.extend(data);
    file.extend(b"</AppendedData></VTKFile>");
    fs::write(path, file).expect("a file");
}

const SMALL: [&str; 6] = ["--width", "320", "--height", "180", "--channels", "RGBA"];
const LARGE: [&str; 4] = ["--width", "1280", "--height", "720"];
const ALL: [&str; 2] = ["--channels", "RGBA,Z,N,id,P,V,albedo"];

#[test]
fn few_particles_in_a_large_image() {
    compare("npy", |path| npy(path, 100_000), &LARGE);
}

#[test]
fn passes_with_more_samples_have_points_of_their_own() {
    let options = [&SMALL[..], &["--noise", "0.1"]].concat();
    compare("npy", |path| npy(path, 50_000), &options);
}

#[test]
fn many_attributes_and_all_channels() {
    let options = [&LARGE[..], &ALL].concat();
    compare("vtk", |path| vtk(path, 200_000, true), &options);
}

#[test]
fn many_particles_in_a_small_image() {
    compare("spf", |path| spf(path, 400_000), &SMALL);
}

fn compare_structure(structure: &str) {
    let options = [&SMALL[..], &["--accelerator", structure]].concat();
    compare("npy", |path| npy(path, 150_000), &options);
}

#[test]
fn every_structure_but_the_default() {
    for structure in ["lbvh", "bvh", "sbvh"] {
        compare_structure(structure);
    }
}

/// Writes particles in the encoding that files with this extension have.
fn encoded(path: &Path, extension: &str) {
    const COUNT: usize = 80_000;
    let write = |text: String| fs::write(path, text).expect("a file");
    match extension {
        "csv" => write(csv(COUNT)),
        "csv.gz" => gz(path, csv(COUNT).as_bytes()),
        "npy.gz" => gz(path, &npy_bytes(path, COUNT)),
        "npz" => npz(path, COUNT),
        "vtu" => vtu(path, COUNT),
        "lammpstrj" => write(dump(COUNT)),
        "lammpstrj.gz" => gz(path, dump(COUNT).as_bytes()),
        "ply" => write(ply(COUNT)),
        "xyz" => write(xyz(COUNT)),
        "vtk" => write(vtk_text(COUNT)),
        "vtk.gz" => gz(path, vtk_text(COUNT).as_bytes()),
        _ => unreachable!("{extension}"),
    }
}

fn compare_encoding(extension: &str) {
    compare(extension, |path| encoded(path, extension), &SMALL);
}

// Each way to read is here once: columns and blocks, as text and as numbers, packed and plain.
#[test]
fn particle_encodings() {
    for extension in ["csv.gz", "npz", "vtu"] {
        compare_encoding(extension);
    }
}

#[test]
fn text_formats() {
    for extension in ["lammpstrj", "xyz", "vtk.gz"] {
        compare_encoding(extension);
    }
}

#[test]
#[ignore = "takes half a minute"]
fn further_encodings_and_structures() {
    for extension in ["csv", "npy.gz", "lammpstrj.gz", "ply", "vtk"] {
        compare_encoding(extension);
    }
    compare_structure("kdtree");
    compare("vtk", |path| vtk(path, 400_000, false), &SMALL);
}

#[test]
fn union_uses_the_memory_of_spheres() {
    let options = [&SMALL[..], &["--surface", "union"]].concat();
    compare("npy", |path| block(path, 150_000), &options);
}

/// As [`compare`], but the prediction may be an upper bound within 25 %.
#[track_caller]
fn compare_bound(name: &str, make: impl Fn(&Path), options: &[&str]) {
    let (predicted, measured) = peaks(name, make, options);
    let least = (1.0 - TOLERANCE.0) * measured - TOLERANCE.1;
    let most = 1.25 * measured + TOLERANCE.1;
    let is_near = (least..=most).contains(&predicted);
    assert!(is_near, "{name} {options:?}: predicted {predicted}, measured {measured}");
}

/// A block of water of which each third particle is far from all others.
fn splash(path: &Path, count: usize) {
    block(path, count);
    let bytes = fs::read(path).expect("a file");
    let values: Vec<f32> = bytes[bytes.len() - 12 * count..]
        .as_chunks::<4>()
        .0
        .iter()
        .map(|bytes| f32::from_le_bytes(*bytes))
        .collect();
    let points = values.as_chunks::<3>().0.iter().map(|point| Vec3::from_array(*point));
    let apart = points.enumerate().map(|(i, point)| if i % 3 == 0 { 4.0 * point } else { point });
    write::npy::write(path, &apart.collect::<Vec<Vec3>>()).expect("a file");
}

const SMOOTH: [&str; 4] = ["--surface", "smooth", "--radius", "0.01"];

fn compare_fine_splash(count: usize) {
    let options = [&SMALL[..], &SMOOTH, &["--set", "surface.voxel=0.7"]].concat();
    compare_bound("npy", |path| splash(path, count), &options);
}

#[test]
fn smooth_surfaces_are_predicted_from_the_survey() {
    let attributes = [&SMALL[..4], &SMOOTH].concat();
    compare_bound("npy", |path| block(path, 25_000), &attributes);
    compare_fine_splash(3_000);
}

#[test]
#[ignore = "takes half a minute"]
fn further_smooth_surfaces() {
    let plain = [&SMALL[..], &SMOOTH].concat();
    compare_bound("npy", |path| block(path, 25_000), &plain);
    compare_bound("npy", |path| splash(path, 5_000), &plain);
    compare_fine_splash(5_000);
}

#[test]
fn spray_is_predicted_from_the_survey() {
    let spray = ["--look", "water", "--radius", "0.01", "--set", "render.caustics={photons=20000}"];
    let options = [&SMALL[..], &spray].concat();
    compare_bound("npy", |path| splash(path, 10_000), &options);
}

/// Without light on the ground, which takes long. Its memory is in the frames of spray above.
const DARK: [&str; 2] = ["--set", "render.caustics={photons=0}"];

#[test]
fn frames_of_spray_alone_are_predicted() {
    // The threads sort the drops of few large cells, each in memory of its own
    let spray = ["--set", "surface.spray=true", "--radius", "0.0001"];
    for look in [["--surface", "smooth"], ["--look", "water"]] {
        let options = [&SMALL[..], &look, &spray, &DARK].concat();
        compare_bound("npy", |path| block(path, 20_000), &options);
    }
}

// The grid of the smooth surface is that of all particles, also of those that are nothing but spray, so the bound is less
// tight than others.
#[test]
fn whitewater_is_bounded_by_the_survey() {
    let splash = |path: &Path| {
        dam_break(path.parent().expect("a directory"), [9]);
        fs::rename(path.with_file_name("f_9.bgeo"), path).expect("a frame");
    };
    // Many drops, so that they are a large part
    let more = ["--look", "water", "--whitewater", "--radius", "0.02", "--set"];
    let options = [&SMALL[..], &DARK, &more, &["surface.whitewater_amount=8"]].concat();
    let (predicted, measured) = peaks("bgeo", splash, &options);
    let least = (1.0 - TOLERANCE.0) * measured - TOLERANCE.1;
    assert!((least..=2.0 * measured).contains(&predicted), "{predicted}, measured {measured}");
}

#[test]
fn moving_spheres_are_predicted() {
    let blur = ["--set", "camera.shutter=0.5", "--set", "output.frame_time=0.04"];
    let options = [&SMALL[..], &blur].concat();
    compare_bound("vtk", |path| vtk(path, 150_000, true), &options);
}

/// A binary STL file of separate triangles.
fn triangles(path: &Path, count: u32) {
    let mut file = vec![0; 80];
    file.extend(count.to_le_bytes());
    for i in 0..count {
        let at = |axis: u32| (i.wrapping_mul(7919 + 1000 * axis) % 4096) as f32 / 4096.0;
        let corner = |shift: f32| [at(0) + shift, at(1) + shift * shift, at(2)];
        let corners = [corner(0.0), corner(0.01), corner(0.02)];
        let values = [[0.0, 0.0, 1.0]].into_iter().chain(corners).flatten();
        file.extend(values.flat_map(|value: f32| value.to_le_bytes()));
        file.extend([0, 0]);
    }
    fs::write(path, file).expect("a file");
}

#[test]
fn meshes_are_predicted() {
    let directory = tempfile::tempdir().expect("a directory");
    let mesh = directory.path().join("mesh.stl");
    triangles(&mesh, 200_000);
    let mesh = mesh.to_str().expect("a name in UTF-8");
    let options = [&SMALL[..], &["--mesh", mesh]].concat();
    compare_bound("npy", |path| npy(path, 100_000), &options);
}

#[test]
#[ignore = "takes half a minute"]
fn very_many_particles() {
    compare("npy", |path| npy(path, 4_000_000), &SMALL);
    compare("spf", |path| spf(path, 4_000_000), &LARGE);
    compare("vtk", |path| vtk(path, 4_000_000, false), &SMALL);
    let options = [&SMALL[..4], &ALL].concat();
    compare("vtk", |path| vtk(path, 4_000_000, true), &options);
}
