//! A device renders the pictures of the CPU.
//!
//! `SPHERULE_GPU=required` makes these tests fail without an adapter; otherwise they pass then, since not every machine
//! has one. Continuous integration installs a driver that runs on the CPU.

#[path = "../examples/support/mod.rs"]
mod support;

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};

use spherule_gpu::{Arithmetic, Checks, Device, GpuError, SceneRenderer};
use spherule_tracer::render::Stop;
use spherule_tree::math::SimdLevel;
use support::{Case, Data, Difference, Glass, Opacity, Paths, Radii};

/// Half the distance of neighbouring 16-bit floats below 2, where the colours of these pictures are.
const HALF_UNIT_OF_F16: f32 = 0.5 / 1024.0;

/// A device, or None on a machine without one.
fn device(checks: Checks) -> Option<Device> {
    match Device::open(0, checks) {
        Ok(device) => Some(device),
        Err(GpuError::NoAdapter) if std::env::var_os("SPHERULE_GPU").is_none() => None,
        Err(error) => panic!("{error}"),
    }
}

/// The kernels of the CPU that round as the device does.
fn same_arithmetic(device: &Device) -> SimdLevel {
    match device.arithmetic() {
        Arithmetic::Fused => SimdLevel::best(),
        Arithmetic::Separate => SimdLevel::Portable,
    }
}

fn assert_equal(case: &Case, difference: &Difference) {
    let Difference { ids, depths, normals, positions, coverages, color, rays, .. } = *difference;
    assert_eq!([ids, depths, normals, positions, coverages], [0; 5], "{case:?}");
    assert!(color <= HALF_UNIT_OF_F16, "{case:?}: {color}");
    assert!(rays, "{case:?}");
}

#[test]
fn planes_equal_those_of_the_cpu() {
    let Some(device) = device(Checks::On) else { return };
    let level = same_arithmetic(&device);
    let mut renderer = SceneRenderer::new(Arc::new(device));
    for data in Data::ALL {
        for radii in [Radii::Common, Radii::Each] {
            let case = Case { data, radii, ..Case::small() };
            assert_equal(&case, &support::compare(&mut renderer, &case, level));
        }
    }
}

#[test]
fn every_setting_equals_the_cpu() {
    let Some(device) = device(Checks::Off) else { return };
    let level = same_arithmetic(&device);
    let mut renderer = SceneRenderer::new(Arc::new(device));
    let small = Case::small();
    for case in [
        Case { max_depth: 1, ..small },
        Case { max_depth: 5, samples: 1, ..small },
        Case { is_parallel: true, ..small },
        Case { is_mapped: true, ..small },
        Case { is_studio: true, ..small },
        Case { has_ground: true, ..small },
        Case { has_ground: true, is_studio: true, has_mattes: true, ..small },
        Case { window: Some([-5, 9]), ..small },
        Case { particles: 1, ..small },
        Case { particles: 9, ..small },
        Case { particles: 2049, ..small },
    ] {
        assert_equal(&case, &support::compare(&mut renderer, &case, level));
    }
}

/// Compilers of drivers for CPUs round some of the rays through a lens in another way.
const ROUNDED_BY_LENS: usize = 30;

#[test]
fn depth_of_field_is_that_of_the_cpu() {
    let Some(device) = device(Checks::Off) else { return };
    let level = same_arithmetic(&device);
    let mut renderer = SceneRenderer::new(Arc::new(device));
    let case = Case { has_lens: true, particles: 400, ..Case::small() };
    let found = support::compare(&mut renderer, &case, level);
    let Difference { ids, depths, normals, positions, mean, .. } = found;
    assert!(
        [ids, depths, normals, positions].into_iter().max() <= Some(ROUNDED_BY_LENS),
        "{found:?}"
    );
    assert!(mean < 1e-3, "{found:?}");
}

/// Both draw the same picture, with the same noise. A ray that has left a rough surface may meet another sphere, which
/// the last bit of its direction decides.
#[test]
fn denoised_pictures_are_those_of_the_cpu() {
    let Some(device) = device(Checks::On) else { return };
    let level = same_arithmetic(&device);
    let mut renderer = SceneRenderer::new(Arc::new(device));
    let few = Case { particles: 400, ..Case::small() };
    let of = |paths| Case { paths: Some(paths), samples: 5, ..few };
    for case in [
        Case { is_mapped: true, is_studio: true, ..few },
        of(Paths::Look),
        // A transparent background with shadows, and metal whose glints have a limit
        of(Paths::Catcher),
        of(Paths::Metal),
        // Smaller than a tile, and than the window
        Case { width: 3, height: 2, ..of(Paths::Look) },
        Case { width: 1, height: 1, ..of(Paths::Look) },
    ] {
        let [difference, change] = support::compare_denoised(&mut renderer, &case, level);
        assert!(difference < 1e-4, "{case:?}: {difference}");
        assert!(change > 100.0 * difference || case.width == 1, "{case:?}: {change}");
    }
}

#[test]
fn paths_are_those_of_the_cpu() {
    let Some(device) = device(Checks::On) else { return };
    let level = same_arithmetic(&device);
    let mut renderer = SceneRenderer::new(Arc::new(device));
    for paths in Paths::ALL {
        // One of them has random numbers of another sequence
        let seed = if paths == Paths::Lights { 9 } else { 0 };
        let case = Case { paths: Some(paths), samples: 5, seed, particles: 400, ..Case::small() };
        let found = support::compare(&mut renderer, &case, level);
        let Difference { ids, depths, normals, positions, mean, bias, ray_ratio, .. } = found;
        let most = if paths == Paths::Lens { ROUNDED_BY_LENS } else { 0 };
        let most_of_all = [ids, depths, normals, positions].into_iter().max();
        assert!(most_of_all <= Some(most), "{paths:?}: {found:?}");
        assert!(mean.max(bias) < 1e-3, "{paths:?}: {found:?}");
        assert!((ray_ratio - 1.0).abs() < 1e-3, "{paths:?}: {found:?}");
    }
}

/// Rays end at the same spheres, which random numbers choose; shadow rays lose the same part of their light.
#[test]
fn opacities_are_those_of_the_cpu() {
    let Some(device) = device(Checks::On) else { return };
    let level = same_arithmetic(&device);
    let mut renderer = SceneRenderer::new(Arc::new(device));
    let small = Case { opacity: Some(Opacity::Common(0.4)), ..Case::small() };
    for case in [
        small,
        Case { opacity: Some(Opacity::Each), is_mapped: true, is_studio: true, ..small },
        Case { opacity: Some(Opacity::Common(0.0)), ..small },
        Case { opacity: Some(Opacity::Style(0.3)), ..small },
        Case { radii: Radii::Each, data: Data::Clusters, seed: 3, ..small },
        Case { data: Data::Coincident, particles: 50, ..small },
    ] {
        assert_equal(&case, &support::compare(&mut renderer, &case, level));
    }
    for paths in [Paths::Matte, Paths::Metal, Paths::Catcher, Paths::Lights] {
        let case = Case { paths: Some(paths), particles: 400, samples: 5, ..small };
        for opacity in [Opacity::Common(0.4), Opacity::Each, Opacity::Style(0.3)] {
            let case = Case { opacity: Some(opacity), ..case };
            let found = support::compare(&mut renderer, &case, level);
            let Difference { ids, depths, mean, bias, ray_ratio, .. } = found;
            assert_eq!([ids, depths], [0; 2], "{case:?}");
            assert!(mean.max(bias) < 1e-3, "{case:?}: {found:?}");
            assert!((ray_ratio - 1.0).abs() < 1e-3, "{case:?}: {found:?}");
        }
    }
}

#[test]
fn indirect_light_has_the_limit_of_the_cpu() {
    let Some(device) = device(Checks::On) else { return };
    let level = same_arithmetic(&device);
    let mut renderer = SceneRenderer::new(Arc::new(device));
    for paths in [Paths::Plastic, Paths::Mirrors, Paths::Coats, Paths::Lights, Paths::Ambient] {
        let clamp = Some(0.1);
        let case = Case { paths: Some(paths), samples: 5, particles: 400, clamp, ..Case::small() };
        let found = support::compare(&mut renderer, &case, level);
        let Difference { ids, depths, mean, bias, lost: [lost, expected], .. } = found;
        assert_eq!([ids, depths], [0; 2], "{paths:?}");
        assert!(mean.max(bias) < 1e-3, "{paths:?}: {found:?}");
        assert!(expected > 1e-3 && (lost / expected - 1.0).abs() < 1e-3, "{paths:?}: {found:?}");
    }
    // A limit that nothing reaches takes nothing
    let case = Case { paths: Some(Paths::Metal), clamp: Some(1e6), ..Case::small() };
    assert_eq!(support::film(&mut renderer, &case).1.lost_steps, 0);
}

/// Also parts of pixels that the ground covers.
#[test]
fn mattes_are_those_of_the_cpu() {
    let Some(device) = device(Checks::On) else { return };
    let level = same_arithmetic(&device);
    let mut renderer = SceneRenderer::new(Arc::new(device));
    let whitted = Case { has_mattes: true, samples: 8, particles: 400, ..Case::small() };
    for case in [
        whitted,
        Case { paths: Some(Paths::Metal), opacity: Some(Opacity::Style(0.5)), ..whitted },
        Case { paths: Some(Paths::Catcher), ..whitted },
        Case { paths: Some(Paths::Lights), ..whitted },
    ] {
        let found = support::compare(&mut renderer, &case, level);
        assert_eq!([found.ids, found.mattes], [0; 2], "{case:?}");
    }
}

/// By the first interaction, by light group, and what a shadow takes away.
#[test]
fn parts_of_the_light_are_those_of_the_cpu() {
    let Some(device) = device(Checks::On) else { return };
    let level = same_arithmetic(&device);
    let mut renderer = SceneRenderer::new(Arc::new(device));
    // Light has no other parts in the other kinds
    let kinds =
        [Paths::Look, Paths::Catcher, Paths::Lights, Paths::Ambient, Paths::Mirrors, Paths::Coats];
    for paths in kinds {
        let opacity = (paths == Paths::Coats).then_some(Opacity::Style(0.5));
        let case = Case { paths: Some(paths), samples: 5, particles: 400, ..Case::small() };
        let found =
            support::compare(&mut renderer, &Case { has_layers: true, opacity, ..case }, level);
        let Difference { mean, bias, layers: [difference, size], .. } = found;
        assert!(mean.max(bias).max(difference) < 1e-3 && size > 1.0, "{paths:?}: {found:?}");
    }
    // Rays split at the first surface, too
    for (glass, paths) in [(Glass::Smooth, Paths::Lights), (Glass::Absorbing, Paths::Look)] {
        let case =
            Case { glass: Some(glass), paths: Some(paths), has_layers: true, ..case_of_glass() };
        let found = support::compare(&mut renderer, &case, level);
        let Difference { mean, layers: [difference, size], .. } = found;
        assert!(mean.max(difference) < 1e-3 && size > 1.0, "{case:?}: {found:?}");
    }
    // With a limit of indirect light, each part loses as much
    for paths in [Paths::Coats, Paths::Lights] {
        let clamp = Some(0.1);
        let case =
            Case { paths: Some(paths), samples: 5, clamp, has_layers: true, ..Case::small() };
        let found = support::compare(&mut renderer, &case, level);
        let Difference { layers: [difference, size], lost: [lost, _], .. } = found;
        assert!(difference < 1e-3 && size > 1.0 && lost > 1e-3, "{paths:?}: {found:?}");
    }
}

fn case_of_glass() -> Case {
    Case { particles: 300, max_depth: 6, samples: 3, width: 45, height: 31, ..Case::small() }
}

/// Rays split at particles as on the CPU, and shadow rays pass them straight.
#[test]
fn glass_is_that_of_the_cpu() {
    let Some(device) = device(Checks::On) else { return };
    let level = same_arithmetic(&device);
    let mut renderer = SceneRenderer::new(Arc::new(device));
    let of = |glass| Case { glass: Some(glass), ..case_of_glass() };
    let of_paths = |glass, paths| Case { paths: Some(paths), ..of(glass) };
    for case in [
        Case { is_studio: true, ..of(Glass::Absorbing) },
        Case { is_mapped: true, radii: Radii::Each, ..of(Glass::Colored) },
        of_paths(Glass::Absorbing, Paths::Look),
        Case { clamp: Some(0.1), ..of_paths(Glass::Smooth, Paths::Lights) },
        Case { is_mapped: true, ..of_paths(Glass::Colored, Paths::Catcher) },
        of_paths(Glass::Rough, Paths::Look),
        // Light passes copies of a sphere one after the other
        Case { data: Data::Coincident, particles: 3, ..of_paths(Glass::Smooth, Paths::Lights) },
    ] {
        let found = support::compare(&mut renderer, &case, level);
        let Difference { ids, depths, normals, mean, bias, ray_ratio, .. } = found;
        assert_eq!([ids, depths, normals], [0; 3], "{case:?}");
        assert!(mean.max(bias) < 1e-3, "{case:?}: {found:?}");
        assert!((ray_ratio - 1.0).abs() < 1e-3, "{case:?}: {found:?}");
    }
}

/// Each ray sees particles and the camera at its own time.
#[test]
fn motion_blur_is_that_of_the_cpu() {
    let Some(device) = device(Checks::On) else { return };
    let level = same_arithmetic(&device);
    let mut renderer = SceneRenderer::new(Arc::new(device));
    let small = Case { has_motion: true, samples: 6, ..Case::small() };
    for case in [
        small,
        Case { radii: Radii::Each, data: Data::Clusters, is_parallel: true, ..small },
        Case { data: Data::Coincident, particles: 50, ..small },
        Case { opacity: Some(Opacity::Each), is_studio: true, ..small },
    ] {
        assert_equal(&case, &support::compare(&mut renderer, &case, level));
    }
    for paths in [Paths::Look, Paths::Lens, Paths::Lights] {
        let case = Case { paths: Some(paths), particles: 400, ..small };
        let found = support::compare(&mut renderer, &case, level);
        assert!(found.mean.max(found.bias) < 1e-3, "{paths:?}: {found:?}");
    }
}

#[test]
fn every_run_gives_the_same_bytes() {
    let Some(device) = device(Checks::Off) else { return };
    let mut renderer = SceneRenderer::new(Arc::new(device));
    let case = Case { is_studio: true, ..Case::small() };
    let first = support::film(&mut renderer, &case).0;
    assert!(first.color.iter().any(|color| color[3] > 0.0));
    for _ in 0..2 {
        assert!(support::film(&mut renderer, &case).0 == first);
    }
}

#[test]
fn more_than_an_array_holds_is_refused() {
    let Some(device) = device(Checks::Off) else { return };
    let max = device.adapter().max_array;
    // A software driver has 128 MiB; a GPU more than a test should allocate
    if max > 256 << 20 {
        return;
    }
    let mut renderer = SceneRenderer::new(Arc::new(device));
    let particles = usize::try_from(max / 12 + 1).unwrap();
    let case = Case { particles, ..Case::small() };
    let error = support::prepare(&mut renderer, &case).unwrap_err();
    assert!(matches!(error, GpuError::TooLarge { .. }), "{error}");
    // The device still works
    let small = Case::small();
    support::prepare(&mut renderer, &small).unwrap();
    assert!(support::film(&mut renderer, &small).0.color.iter().any(|color| color[3] > 0.0));
}

#[test]
fn a_raised_flag_stops_a_picture() {
    let Some(device) = device(Checks::Off) else { return };
    let mut renderer = SceneRenderer::new(Arc::new(device));
    let error =
        support::stopped(&mut renderer, &Case::small(), &AtomicBool::new(true)).unwrap_err();
    assert_eq!(error.to_string(), "interrupted");
}

/// Remembers what is done. Is raised as soon as a part of the picture is, or never.
struct Parts {
    done: Mutex<Vec<u32>>,
    is_raised_by_first: bool,
}

impl Stop for Parts {
    fn is_raised(&self) -> bool {
        self.is_raised_by_first && self.done.lock().unwrap().iter().any(|count| *count > 0)
    }

    fn pixels_done(&self, count: u32) {
        self.done.lock().unwrap().push(count);
    }
}

#[test]
fn long_pictures_show_their_progress_and_can_be_stopped() {
    let Some(device) = device(Checks::Off) else { return };
    let mut renderer = SceneRenderer::new(Arc::new(device));
    // Seven batches, and the first has ended before the fifth is started
    let case = Case { samples: 7 * 16, ..Case::small() };
    let [all, first] = [false, true]
        .map(|is_raised_by_first| Parts { done: Mutex::default(), is_raised_by_first });
    support::stopped(&mut renderer, &case, &all).unwrap();
    let done = all.done.into_inner().unwrap();
    let pixels = case.width * case.height;
    assert_eq!(done.iter().sum::<u32>(), pixels);
    assert_eq!(done[..5], [0, 0, 0, 0, pixels / 7], "{done:?}");
    let error = support::stopped(&mut renderer, &case, &first).unwrap_err();
    assert_eq!(error.to_string(), "interrupted");
    assert_eq!(first.done.into_inner().unwrap(), done[..5]);
}

/// Loses the device when it is asked for the second time, in the middle of a picture.
struct Loss(Arc<Device>, AtomicU32);

impl Stop for Loss {
    fn is_raised(&self) -> bool {
        if self.1.fetch_add(1, Ordering::Relaxed) == 1 {
            self.0.destroy();
        }
        false
    }
}

#[test]
fn a_lost_device_fails_pictures() {
    let Some(device) = device(Checks::Off) else { return };
    let device = Arc::new(device);
    let mut renderer = SceneRenderer::new(Arc::clone(&device));
    // Three batches
    let case = Case { samples: 40, ..Case::small() };
    let loss = Loss(Arc::clone(&device), AtomicU32::new(0));
    let expected = format!("{} was lost: ", device.adapter().name);
    // It stays lost: also the next picture fails, and so does the first one of another renderer
    for _ in 0..2 {
        let error = support::stopped(&mut renderer, &case, &loss).unwrap_err().to_string();
        assert!(error.starts_with(&expected), "{error}");
    }
    let mut renderer = SceneRenderer::new(Arc::clone(&device));
    let error = support::stopped(&mut renderer, &case, &loss).unwrap_err().to_string();
    assert!(error.starts_with(&expected), "{error}");
}

#[test]
fn unknown_adapters_are_refused() {
    let count = spherule_gpu::adapters().len();
    let error = Device::open(count + 3, Checks::Off).unwrap_err();
    let expected = if count == 0 {
        GpuError::NoAdapter
    } else {
        GpuError::UnknownAdapter { index: count + 3, count }
    };
    assert_eq!(error, expected);
}
