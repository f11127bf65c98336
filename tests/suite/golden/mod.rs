//! One small image for every feature, compared with the one in `tests/golden` by two limits: how
//! far a value may be off, and how many pixels may be off further.
//!
//! A failure writes what was expected, what came out and the difference to `golden-failures` in
//! the target directory. `SPHERULE_BLESS=1` makes the images of this machine the golden ones: look
//! at them before they are committed.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use spherule::accel::simd::SimdLevel;
use spherule::accel::view::TreeView;
use spherule::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};
use spherule::output::{ExrOptions, encode_exr};
use spherule::render::{Film, ParticleShading, render};
use spherule::surface::cut::CutSpheres;
use spherule::surface::smooth::SmoothGrid;
use spherule::surface::spheres::SphereSurface;
use spherule::surface::union::UnionSurface;
use spherule::surface::{NormalKind, PcaNormals, ShadingNormals, Shape, SurfaceKind};

use crate::picture::{Picture, Plane};
use crate::simd::tested_levels;

mod compare;
mod scenes;
mod stills;

use compare::{LIMITS, differences};
use scenes::Shot;
use stills::Still;

const BLESS: &str = "SPHERULE_BLESS";

/// Traces a shot with one instruction set.
fn trace(shot: &Shot, simd: SimdLevel) -> Film {
    let mut builder = TreeBuilder::new();
    let radius = match shot.radii.as_slice() {
        [one] => SphereRadius::Common(*one),
        each => SphereRadius::Each(each),
    };
    let spheres = Spheres { centers: &shot.centers, radius };
    builder.build(&spheres, &BuildSettings::default());
    builder.tree_mut().set_simd(simd);
    let source = ParticleShading {
        colors: shot.colors.as_colors(),
        ids: shot.ids.as_deref(),
        velocities: shot.velocities.as_deref(),
        ..ParticleShading::constant(glam::Vec3::ZERO)
    };
    let mut grid = SmoothGrid::default();
    let surface = surface(shot, builder.tree().view(), &mut grid);
    let never = AtomicBool::new(false);
    let (film, _) =
        render(&[&*surface], &shot.scene, &source, &shot.settings, &never).expect("a film");
    film
}

/// What rays hit. Every instruction set gives the same bits on a smooth surface, which is not traced in `tree`.
fn surface<'a>(
    shot: &'a Shot,
    tree: TreeView<'a>,
    grid: &'a mut SmoothGrid,
) -> Box<dyn Shape + 'a> {
    let normals = match shot.surface.normals {
        NormalKind::Pca => {
            ShadingNormals::Pca(PcaNormals::new(2.0 * shot.surface.smoothing_length))
        }
        _ => ShadingNormals::Sphere,
    };
    match shot.surface.kind {
        SurfaceKind::Spheres => {
            let spheres = SphereSurface::new(tree).with_normals(normals);
            if shot.cut.is_everywhere() {
                Box::new(spheres)
            } else {
                Box::new(CutSpheres::new(spheres, &shot.cut))
            }
        }
        SurfaceKind::Union => Box::new(UnionSurface::new(tree).with_normals(normals)),
        SurfaceKind::Smooth => {
            let built = grid.build(&shot.centers, shot.radii[0], &shot.surface, true, None);
            assert!(!built.expect("it fits").is_empty);
            Box::new(grid.surface())
        }
    }
}

/// As it stands in a file, so that both sides were rounded to half alike.
fn encode(film: &Film) -> Vec<u8> {
    encode_exr(film, &ExrOptions::default()).expect("an image").bytes
}

fn golden(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    root.join("tests/golden").join(format!("{name}.exr"))
}

/// Compares the shot `name`, traced with every instruction set of this machine.
#[track_caller]
fn check_shot(name: &str, shot: &Shot) {
    bless(name, || encode(&trace(shot, SimdLevel::best())));
    for simd in tested_levels() {
        check(name, simd.name(), &encode(&trace(shot, simd)));
    }
}

/// Compares the picture `name` that the program makes of a sample.
#[track_caller]
fn check_still(name: &str, still: &Still) {
    let image = still.render();
    bless(name, || image.clone());
    check(name, "the program", &image);
}

/// Makes `image` the golden one if that is asked for.
fn bless(name: &str, image: impl FnOnce() -> Vec<u8>) {
    if env::var_os(BLESS).is_some() {
        fs::write(golden(name), image()).expect("a golden image");
    }
}

/// Compares `image` with the golden one; `origin` is what made it.
#[track_caller]
fn check(name: &str, origin: &str, image: &[u8]) {
    let (expected, actual) = (Picture::open(&golden(name)), Picture::decode(image));
    let differing = differences(&expected, &actual, &LIMITS);
    if !differing.is_empty() {
        let messages: Vec<String> = differing.iter().map(ToString::to_string).collect();
        let folder = compare::write_failure(name, &expected, &actual, &differing);
        panic!(
            "{name} ({origin}) is not the golden image:\n{}\nsee {}; {BLESS}=1 takes the new one",
            messages.join("\n"),
            folder.display()
        );
    }
}

macro_rules! shots {
    (traced: $($shot:ident)*; rendered: $($still:ident)*;) => {
        $(
            #[test]
            fn $shot() {
                check_shot(stringify!($shot), &scenes::$shot());
            }
        )*

        $(
            #[test]
            fn $still() {
                check_still(stringify!($still), &stills::$still());
            }
        )*

        #[test]
        fn no_golden_image_is_left_over() {
            let folder = golden("x");
            let entries = fs::read_dir(folder.parent().expect("a folder")).expect("golden images");
            for entry in entries {
                let path = entry.expect("an entry").path();
                let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                let known = [$(stringify!($shot),)* $(stringify!($still),)*];
                assert!(known.contains(&stem.as_str()), "{}", path.display());
            }
        }
    };
}

shots! {
    traced:
    shadow
    cut
    reflection
    refraction
    total_reflection
    shadow_through_glass
    viridis
    turbo
    radius_per_particle
    ground
    gradient_background
    inverse_square_light
    directional_lights
    data_channels
    transparent_background
    union
    smooth
    pca_normals
    studio
    orthographic
    equirectangular
    stereo;
    rendered:
    spray
    water;
}

/// The limits must detect every visible difference and report its position.
#[test]
fn changed_image_is_detected() {
    let good = Picture::decode(&encode(&trace(&scenes::data_channels(), SimdLevel::best())));
    assert!(differences(&good, &good, &LIMITS).is_empty());
    let with = |channel: &str, pixels: usize, change: fn(f32) -> f32| {
        let mut other = good.clone();
        let Some(Plane::Float(values)) = other.planes.get_mut(channel) else {
            panic!("{channel} holds numbers");
        };
        let hit = values.iter_mut().filter(|v| v.is_finite() && **v != 0.0);
        hit.take(pixels).for_each(|v| *v = change(*v));
        differences(&good, &other, &LIMITS)
    };
    let few = LIMITS.pixels;
    assert!(with("G", usize::MAX, |v| v + 0.001).is_empty());
    assert!(with("G", few, |v| v + 1.0).is_empty());
    assert_eq!(with("G", few + 1, |v| v + 0.01).len(), 1);
    assert_eq!(with("Z", few + 1, |v| v * 1.001).len(), 1);
    assert_eq!(with("Z", few + 1, |_| f32::INFINITY).len(), 1);
    assert_eq!(with("N.X", few + 1, |_| f32::NAN).len(), 1);

    let mut other = good.clone();
    let Some(Plane::Uint(ids)) = other.planes.get_mut("id.I") else {
        panic!("ids are integers");
    };
    ids.iter_mut().take(few + 1).for_each(|id| *id ^= 1);
    assert_eq!(differences(&good, &other, &LIMITS).len(), 1);

    let mut other = good.clone();
    other.planes.remove("Z");
    assert_eq!(differences(&good, &other, &LIMITS).len(), 1);
}
