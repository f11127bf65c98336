//! The environment for packets of rays.
//!
//! Bodies store each component on its own: loops over the components would be vectorised instead of those over lanes.

use super::light::LightSamples;
use crate::scene::Environment;
use crate::scene::environment::{EnvironmentAxes, EnvironmentTable, TableSize, Texels};
use spherule_tree::math::{
    LANES, Lanes, Lanes3, Supported, lane_kernel, lane3, lanes_in, set_lane3, splat,
};

/// Rays whose density is above this factor times the number of texels per steradian see the image: their lobe is so
/// narrow that texels would be visible.
const SHARP: f32 = 1.0 / 16.0;

/// Samples a direction towards the environment for each lane. The numbers `u` are in 0..1.
pub(in crate::render) fn sample_environment(
    simd: Supported,
    table: &EnvironmentTable,
    start: &Lanes3,
    u: &[Lanes; 2],
    samples: &mut LightSamples,
) {
    let LightSamples { rays, radiance, pdf, .. } = samples;
    let mut texel = [0; LANES];
    sample_directions(simd, table, u, &mut rays.direction, &mut texel);
    look_up_texels(simd, table, &texel, radiance, pdf);
    rays.t_min = splat(0.0);
    rays.t_max = splat(f32::INFINITY);
    rays.origin = *start;
}

/// Samples a direction towards the environment for each lane, without its radiance but with the index of its texel.
/// The numbers `u` are in 0..1.
#[inline(always)]
fn sample_directions_body(
    table: &EnvironmentTable,
    u: &[Lanes; 2],
    directions: &mut Lanes3,
    texel: &mut [u32; LANES],
) {
    match table.texels() {
        TableSize::Coarse(texels) => sample_texels(texels, table.axes(), u, directions, texel),
        TableSize::Fine(texels) => sample_texels(texels, table.axes(), u, directions, texel),
    }
}

lane_kernel! {
    pub(in crate::render) fn sample_directions(
        table: &EnvironmentTable,
        u: &[Lanes; 2],
        directions: &mut Lanes3,
        texel: &mut [u32; LANES],
    ) = sample_directions_body;
}

#[inline(always)]
fn sample_texels<const SIDE: usize, const COUNT: usize>(
    texels: &Texels<SIDE, COUNT>,
    axes: &EnvironmentAxes,
    [across, down]: &[Lanes; 2],
    [x, y, z]: &mut Lanes3,
    texel: &mut [u32; LANES],
) {
    for l in 0..LANES {
        let ([right, back, up], index) = texels.sample([across[l], down[l]]);
        let [world_x, world_y, world_z] = axes.world(right, back, up);
        x[l] = world_x;
        y[l] = world_y;
        z[l] = world_z;
        texel[l] = index;
    }
}

/// Radiance and probability density of each lane's texel.
#[inline(always)]
fn look_up<const SIDE: usize, const COUNT: usize>(
    texels: &Texels<SIDE, COUNT>,
    texel: &[u32; LANES],
    [red, green, blue]: &mut Lanes3,
    pdf: &mut Lanes,
) {
    for l in 0..LANES {
        let [r, g, b, density] = texels.record(texel[l]);
        red[l] = r;
        green[l] = g;
        blue[l] = b;
        pdf[l] = density;
    }
}

/// Radiance and probability density of the texel with the index in each lane.
#[inline(always)]
fn look_up_texels_body(
    table: &EnvironmentTable,
    texel: &[u32; LANES],
    radiance: &mut Lanes3,
    pdf: &mut Lanes,
) {
    match table.texels() {
        TableSize::Coarse(texels) => look_up(texels, texel, radiance, pdf),
        TableSize::Fine(texels) => look_up(texels, texel, radiance, pdf),
    }
}

lane_kernel! {
    fn look_up_texels(
        table: &EnvironmentTable,
        texel: &[u32; LANES],
        radiance: &mut Lanes3,
        pdf: &mut Lanes,
    ) = look_up_texels_body;
}

/// Radiance of the table along `direction` times `throughput` and the weight of the balance heuristic for the density
/// `sampled` of each direction.
#[inline(always)]
fn table_along_body(
    table: &EnvironmentTable,
    direction: &Lanes3,
    sampled: &Lanes,
    throughput: &Lanes3,
    radiance: &mut Lanes3,
) {
    // Look up the texel of each direction
    let (mut texel, mut pdf, axes) = ([0; LANES], [0.0; LANES], table.axes());
    let [right, back, up] = [axes.right, axes.back, axes.up];
    let [x, y, z] = direction;
    macro_rules! find {
        ($texels:expr) => {{
            for l in 0..LANES {
                texel[l] = $texels.index_at(
                    x[l] * right.x + y[l] * right.y + z[l] * right.z,
                    x[l] * back.x + y[l] * back.y + z[l] * back.z,
                    x[l] * up.x + y[l] * up.y + z[l] * up.z,
                );
            }
            look_up($texels, &texel, radiance, &mut pdf);
        }};
    }
    match table.texels() {
        TableSize::Coarse(texels) => find!(texels),
        TableSize::Fine(texels) => find!(texels),
    }
    // Weight its radiance against the sampling of the BSDF
    let [red, green, blue] = radiance;
    for l in 0..LANES {
        let weight = balance(sampled[l], pdf[l]);
        red[l] = throughput[0][l] * (weight * red[l]);
        green[l] = throughput[1][l] * (weight * green[l]);
        blue[l] = throughput[2][l] * (weight * blue[l]);
    }
}

lane_kernel! {
    fn table_along(
        table: &EnvironmentTable,
        direction: &Lanes3,
        sampled: &Lanes,
        throughput: &Lanes3,
        radiance: &mut Lanes3,
    ) = table_along_body;
}

/// The weight of a direction sampled with the density `sampled` that could have been sampled with `other`.
#[inline(always)]
fn balance(sampled: f32, other: f32) -> f32 {
    if sampled < f32::INFINITY { sampled / (sampled + other) } else { 1.0 }
}

/// Radiance of the environment along `direction` times `throughput`, in `lanes`. `pdf` is the density with which each
/// direction was sampled elsewhere: the balance heuristic weights it against the sampling of the environment. An
/// infinite density has the full weight.
pub(in crate::render) fn environment_along(
    simd: Supported,
    environment: &Environment,
    [direction, throughput]: [&Lanes3; 2],
    pdf: &Lanes,
    lanes: u32,
    radiance: &mut Lanes3,
) {
    let table = environment.table();
    let sharp = SHARP * table.texels_per_steradian();
    let sharp = lanes & (0..LANES).fold(0, |mask, l| mask | u32::from(pdf[l] > sharp) << l);
    if sharp != lanes {
        table_along(simd, table, direction, pdf, throughput, radiance);
    }
    for lane in lanes_in(sharp) {
        let along = lane3(direction, lane);
        let other = if pdf[lane] < f32::INFINITY { table.radiance_and_pdf(along).1 } else { 0.0 };
        let seen = balance(pdf[lane], other) * environment.radiance(along);
        set_lane3(radiance, lane, lane3(throughput, lane) * seen);
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::scene::RadianceMap;
    use crate::scene::environment::studio;
    use spherule_tree::math::{SimdLevel, splat3};

    /// A studio, and an image with a bright pixel.
    fn environments() -> [Environment; 2] {
        let axes = EnvironmentAxes::of_view(DVec3::new(0.3, 1.0, -0.2), DVec3::Z, 20.0);
        let pixel = |i: u16| if i == 99 { Vec3::new(90.0, 80.0, 70.0) } else { Vec3::splat(0.1) };
        let map = RadianceMap::new(32, 16, (0..512).map(pixel).collect()).unwrap();
        [studio(axes, Vec3::ONE), Environment::from_map(axes, &map, Vec3::ONE)]
    }

    fn levels() -> impl Iterator<Item = Supported> {
        SimdLevel::ALL.into_iter().filter(|level| level.is_supported()).map(Supported::or_best)
    }

    fn numbers(i: u16) -> [Lanes; 2] {
        let unit = |step: u16, l: u16| f32::from((i * 16 + l).wrapping_mul(step)) / 65_536.0;
        [40_503, 25_033].map(|step| std::array::from_fn(|l| unit(step, u16::try_from(l).unwrap())))
    }

    #[test]
    fn lanes_are_sampled_as_single_numbers_are() {
        for environment in environments() {
            let table = environment.table();
            for (level, i) in levels().flat_map(|level| (0..64).map(move |i| (level, i))) {
                let u = numbers(i);
                let mut samples = LightSamples::default();
                sample_environment(level, table, &splat3(Vec3::ONE), &u, &mut samples);
                for lane in lanes_in(u32::MAX >> 16) {
                    let alone = table.sample([u[0][lane], u[1][lane]]);
                    assert_eq!(lane3(&samples.rays.direction, lane), alone.direction, "{level:?}");
                    assert_eq!(lane3(&samples.radiance, lane), alone.radiance, "{level:?}");
                    assert_eq!(samples.pdf[lane], alone.pdf, "{level:?}");
                    assert_eq!(samples.rays.t_max[lane], f32::INFINITY);
                }
            }
        }
    }

    #[test]
    fn wide_lobes_see_the_table_and_narrow_ones_the_image() {
        let throughput = splat3(Vec3::new(1.0, 0.5, 0.25));
        for environment in environments() {
            let table = environment.table();
            // Density of the sampling elsewhere: a diffuse surface, a glossy one, a mirror
            let densities: [f32; LANES] =
                std::array::from_fn(|l| [0.3, 5000.0, f32::INFINITY][l % 3]);
            for (level, i) in levels().flat_map(|level| (0..64).map(move |i| (level, i))) {
                let mut directions = [[0.0; LANES]; 3];
                sample_directions(level, table, &numbers(i), &mut directions, &mut [0; LANES]);
                let mut seen = [[0.0; LANES]; 3];
                let along = [&directions, &throughput];
                environment_along(
                    level,
                    &environment,
                    along,
                    &densities,
                    u32::MAX >> 16,
                    &mut seen,
                );
                for lane in 0..LANES {
                    let direction = lane3(&directions, lane);
                    let (of_table, pdf) = table.radiance_and_pdf(direction);
                    let of_image = environment.radiance(direction);
                    let expected = match lane % 3 {
                        0 => of_table * (0.3 / (0.3 + pdf)),
                        1 => of_image * (5000.0 / (5000.0 + pdf)),
                        _ => of_image,
                    };
                    let expected = lane3(&throughput, lane) * expected;
                    let error = (lane3(&seen, lane) - expected).abs().max_element();
                    assert!(error <= 1e-6 * expected.max_element(), "{level:?} {lane}: {error}");
                }
            }
        }
    }
}
