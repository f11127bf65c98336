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
const WARM_UP: usize = 20;
/// Largest number of particles whose pictures are compared with those of the CPU.
const MAX_COMPARED: usize = 20_000_000;

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
        for data in Data::ALL {
            measure(&mut renderer, &Case { data, ..Case::thesis(size) });
        }
        measure(&mut renderer, &Case { radii: Radii::Each, ..Case::thesis(size) });
        measure(&mut renderer, &Case { max_depth: 1, ..Case::thesis(size) });
    }
    Ok(())
}

fn compare(renderer: &mut SceneRenderer, size: usize) {
    if size > MAX_COMPARED {
        return;
    }
    for data in Data::ALL {
        for radii in [Radii::Common, Radii::Each] {
            let case = Case { data, radii, ..Case::thesis(size) };
            let difference = support::compare(renderer, &case, SimdLevel::best());
            println!("{size} {data:?} {radii:?}: {difference:?}");
        }
    }
}

/// Prints the milliseconds of builds and pictures, while the camera turns.
fn measure(renderer: &mut SceneRenderer, case: &Case) {
    let particles = Particles::new(case);
    let shading = spherule_tracer::render::ParticleShading::constant(glam::Vec3::splat(0.7));
    let never = std::sync::atomic::AtomicBool::new(false);
    let [mut build, mut trace, mut wall] = [0.0; 3];
    let mut bytes = 0;
    renderer.prepare(&particles.spheres(), &shading).expect("the frame fits");
    for number in 0..WARM_UP + PICTURES {
        let start = std::time::Instant::now();
        let scene = support::scene(case, 0.02 * (number as f64 - 16.0));
        let cost = renderer.measure(&scene, &case.settings(), &never).expect("nothing stops it");
        if number >= WARM_UP {
            build += cost.build_seconds;
            trace += cost.trace_seconds;
            wall += start.elapsed().as_secs_f64();
            bytes = cost.bytes;
        }
    }
    let [build, trace, wall] = [build, trace, wall].map(|sum| 1e3 * sum / PICTURES as f64);
    println!(
        "{} {:?} {:?} depth {}: build {build:.3} ms, trace {trace:.3} ms, {:.0} images/s on the device, \
         whole {wall:.2} ms, {} MiB",
        case.particles,
        case.data,
        case.radii,
        case.max_depth,
        1e3 / (build + trace),
        bytes >> 20,
    );
}
