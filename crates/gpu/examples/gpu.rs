//! Compares a GPU with the CPU, and measures it: the tables of `docs/gpu.md`.
//!
//!     cargo run --release -p spherule-gpu --example gpu -- [ADAPTER] [SIZE ...]

#![allow(clippy::print_stdout, reason = "a program that prints tables")]

mod support;

use std::sync::Arc;

use spherule_gpu::{Checks, Device, SceneRenderer, adapters};
use spherule_tree::math::SimdLevel;
use support::{Case, Data, Particles, Radii};

/// Pictures of a measurement, and those before it that warm the device up.
const PICTURES: usize = 30;
const WARM_UP: usize = 100;
/// Number of particles from which only one picture is compared with that of the CPU.
const MANY: usize = 50_000_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut options = std::env::args().skip(1);
    let index = options.next().map_or(Ok(0), |number| number.parse())?;
    #[expect(clippy::cast_possible_truncation, reason = "a number of particles")]
    let size = |text: String| text.parse::<f64>().map(|size| size as usize);
    let mut sizes = options.map(size).collect::<Result<Vec<_>, _>>()?;
    if sizes.is_empty() {
        sizes = vec![100_000, 1_000_000];
    }
    for (number, adapter) in adapters().iter().enumerate() {
        println!("{number}: {adapter:?}");
    }
    let device = Device::open(index, Checks::Off)?;
    println!("arithmetic: {:?}, CPU: {}", device.arithmetic(), SimdLevel::best().name());
    let mut renderer = SceneRenderer::new(Arc::new(device));
    for &size in &sizes {
        compare(&mut renderer, size);
        for data in [Data::Box, Data::DamBreak, Data::Outlier, Data::Coincident] {
            measure(&mut renderer, &Case { data, ..Case::thesis(size) });
        }
        for data in [Data::Box, Data::Clusters] {
            measure(&mut renderer, &Case { data, radii: Radii::Each, ..Case::thesis(size) });
        }
        measure(&mut renderer, &Case { max_depth: 1, ..Case::thesis(size) });
        measure(&mut renderer, &Case::look(size));
    }
    Ok(())
}

fn compare(renderer: &mut SceneRenderer, size: usize) {
    let all = if size < MANY { &Data::ALL[..] } else { &Data::ALL[..1] };
    for &data in all {
        for radii in [Radii::Common, Radii::Each].into_iter().take(all.len()) {
            let case = Case { data, radii, ..Case::thesis(size) };
            let difference = support::compare(renderer, &case, SimdLevel::best());
            println!("{size} {data:?} {radii:?}: {difference:?}");
        }
    }
    if size < MANY {
        let difference = support::compare(renderer, &Case::look(size), SimdLevel::best());
        println!("{size}, default look: {difference:?}");
        let [difference, change] =
            support::compare_denoised(renderer, &Case::look(size), SimdLevel::best());
        println!("{size}, default look, denoised: {difference:e}; denoising changes {change:e}");
    }
}

/// Milliseconds of the host to copy a frame to the device, and to render a picture into a film.
fn host_times(
    renderer: &mut SceneRenderer,
    case: &Case,
    particles: &Particles,
    shading: &spherule_tracer::render::ParticleShading<'_>,
) -> [f64; 2] {
    let never = std::sync::atomic::AtomicBool::new(false);
    let (scene, settings) = (support::scene(case, 0.0), case.settings());
    let mut film = spherule_tracer::render::Film::default();
    let [mut copy, mut render] = [0.0; 2];
    for number in 0..2 * PICTURES {
        let start = std::time::Instant::now();
        renderer.prepare(&particles.spheres(), None, shading, false).expect("the frame fits");
        let copied = start.elapsed();
        (renderer.render_into(&mut film, &scene, shading, &settings, case.denoise(), &never))
            .expect("it renders");
        if number >= PICTURES {
            copy += copied.as_secs_f64();
            render += (start.elapsed() - copied).as_secs_f64();
        }
    }
    [copy, render].map(|sum| 1e3 * sum / PICTURES as f64)
}

/// Prints the milliseconds of builds and pictures, while the camera turns.
fn measure(renderer: &mut SceneRenderer, case: &Case) {
    let particles = Particles::new(case);
    let shading = spherule_tracer::render::ParticleShading::constant(glam::Vec3::splat(0.7));
    let never = std::sync::atomic::AtomicBool::new(false);
    let [mut build, mut trace, mut denoise, mut wall] = [0.0; 4];
    let mut bytes = 0;
    renderer.prepare(&particles.spheres(), None, &shading, false).expect("the frame fits");
    for number in 0..WARM_UP + PICTURES {
        let start = std::time::Instant::now();
        let scene = support::scene(case, 0.02 * ((number % PICTURES) as f64 - 15.0));
        let cost = (renderer.measure(&scene, &case.settings(), case.denoise(), &never))
            .expect("nothing stops it");
        if number >= WARM_UP {
            build += cost.build_seconds;
            trace += cost.trace_seconds;
            denoise += cost.denoise_seconds;
            wall += start.elapsed().as_secs_f64();
            bytes = cost.bytes;
        }
    }
    let [copy, film] = host_times(renderer, case, &particles, &shading);
    let [build, trace, denoise, wall] =
        [build, trace, denoise, wall].map(|sum| 1e3 * sum / PICTURES as f64);
    println!(
        "{} {:?} {:?} {:?} depth {}: build {build:.3} ms, trace {trace:.3} ms, denoise {denoise:.3} ms, {:.0} images/s on the device, \
         both {wall:.2} ms with the host; copy of the frame {copy:.1} ms, picture to a film {film:.1} ms; {} MiB",
        case.particles,
        case.data,
        case.radii,
        case.paths,
        case.max_depth,
        1e3 / (build + trace + denoise),
        bytes >> 20,
    );
}
