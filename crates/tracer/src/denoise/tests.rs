use super::*;

/// A picture. Tests change some of its planes.
#[derive(Debug, Clone)]
struct Picture {
    width: usize,
    height: usize,
    samples: u32,
    is_transparent: bool,
    color: Vec<[f32; 4]>,
    odd: Vec<[f32; 4]>,
    albedo: Vec<Vec3>,
    normal: Vec<Vec3>,
    depth: Vec<f32>,
}

/// Pseudo-random numbers of -1 to 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        let multiplied = self.0.wrapping_mul(6_364_136_223_846_793_005);
        self.0 = multiplied.wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }
}

impl Picture {
    /// Without noise: `pixel` returns colour and depth.
    fn new(width: usize, height: usize, pixel: impl Fn(usize, usize) -> (Vec3, f32)) -> Self {
        let positions = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let (color, depth): (Vec<Vec3>, Vec<f32>) = positions.map(|(x, y)| pixel(x, y)).unzip();
        let odd: Vec<_> = color.iter().map(|c| c.extend(1.0).to_array()).collect();
        Self {
            width,
            height,
            samples: 2,
            is_transparent: false,
            color: odd.clone(),
            albedo: vec![Vec3::ONE; odd.len()],
            normal: vec![Vec3::Z; odd.len()],
            odd,
            depth,
        }
    }

    fn flat(width: usize, height: usize) -> Self {
        Self::new(width, height, |_, _| (Vec3::splat(0.5), 1.0))
    }

    /// Objects with differing features, gradients, missed pixels, and noise of several strengths.
    fn random(width: usize, height: usize, seed: u64) -> Self {
        let mut random = Random(seed);
        let mut picture = Self::flat(width, height);
        picture.samples = 3;
        let objects: Vec<_> =
            (0..64).map(|_| (random.vector(), random.vector(), random.next())).collect();
        for i in 0..width * height {
            let (x, y) = (i % width, i / width);
            let (color, normal, depth) = objects[x / 9 % 8 * 8 + y / 7 % 8];
            picture.depth[i] = if depth > 0.7 {
                f32::INFINITY
            } else {
                4.0 + depth + 0.02 * x as f32 + 0.05 * y as f32 + 0.01 * random.next()
            };
            picture.albedo[i] = (0.5 * (1.0 + color) + 0.05 * random.vector()).max(Vec3::ZERO);
            picture.normal[i] = (normal + 0.1 * random.vector()).normalize();
            let light = 1.0 + (0.3 * x as f32).sin() * (0.2 * y as f32).cos();
            let noise = (3.0 * (depth + 0.3)).clamp(0.0, 0.5);
            let even = picture.albedo[i] * (light + noise * random.vector());
            let odd = picture.albedo[i] * (light + noise * random.vector());
            picture.odd[i] = odd.extend(1.0).to_array();
            picture.color[i] = even.lerp(odd, 1.0 / 3.0).extend(1.0).to_array();
        }
        picture
    }

    /// The same in front of a transparent background, with shadows on it.
    fn transparent(width: usize, height: usize, seed: u64) -> Self {
        let mut random = Random(seed + 100);
        let mut picture = Self::random(width, height, seed);
        picture.is_transparent = true;
        for (i, depth) in picture.depth.iter().enumerate() {
            let shadow = 0.5 + 0.3 * ((i % width) as f32 * 0.4).sin();
            let is_missed = !depth.is_finite();
            let mut half = || {
                let noise = 0.2 * random.next();
                if is_missed { shadow + noise } else { 1.0 - noise.max(0.0) }
            };
            let (even, odd) = (half(), half());
            let set = |rgba: &mut [f32; 4], coverage: f32| {
                let light = if is_missed { 0.0 } else { coverage };
                *rgba = rgba.map(|c| c * light);
                rgba[3] = coverage;
            };
            set(&mut picture.color[i], even + (odd - even) / 3.0);
            set(&mut picture.odd[i], odd);
        }
        picture
    }

    /// Adds noise of this amplitude to both halves.
    fn add_noise(&mut self, amplitude: f32, seed: u64) {
        let mut random = Random(seed);
        for (color, odd) in self.color.iter_mut().zip(&mut self.odd) {
            let mean = Vec3::from_slice(odd);
            let halves = [0, 1].map(|_| mean + amplitude * random.vector());
            *odd = halves[1].extend(1.0).to_array();
            *color = halves[0].midpoint(halves[1]).extend(1.0).to_array();
        }
    }

    fn input(&self) -> DenoiseInput<'_> {
        DenoiseInput {
            views: [1, 1],
            width: u32::try_from(self.width).expect("a small picture"),
            height: u32::try_from(self.height).expect("a small picture"),
            samples: self.samples,
            is_transparent: self.is_transparent,
            color: &self.color,
            odd: &self.odd,
            albedo: &self.albedo,
            normal: &self.normal,
            depth: &self.depth,
        }
    }

    fn color(&self, i: usize) -> Vec3 {
        let [r, g, b, _] = self.color[i];
        Vec3::new(r, g, b)
    }

    fn denoised(&self) -> Vec<Vec3> {
        let filtered = denoise(&self.input(), &DenoiseSettings::OPAQUE).expect("valid input");
        filtered.iter().map(|rgba| Vec3::from_slice(rgba)).collect()
    }
}

/// Instruction sets of this machine.
fn levels() -> impl Iterator<Item = SimdLevel> {
    SimdLevel::ALL.into_iter().filter(|l| l.is_supported())
}

fn bits(pixels: &[Vec3]) -> Vec<[u32; 3]> {
    let bits = |pixel: &Vec3| pixel.to_array().map(f32::to_bits);
    pixels.iter().map(bits).collect()
}

fn all_bits(pixels: &[[f32; 4]]) -> Vec<[u32; 4]> {
    pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// Compares the filter with the reference.
#[track_caller]
fn assert_equals_reference(picture: &Picture, settings: &DenoiseSettings) {
    let name = format!("{}x{} {settings:?}", picture.width, picture.height);
    let reference = brute::denoise(&picture.input(), settings);
    let filtered = denoise(&picture.input(), settings).expect("valid input");
    for (i, (pixel, expected)) in filtered.iter().zip(&reference).enumerate() {
        let color = Vec3::from_slice(pixel);
        let (x, y) = (i % picture.width, i / picture.width);
        if expected.truncate().is_finite() {
            let error = (color.as_dvec3() - expected.truncate()).abs().max_element();
            assert!(error < 2e-4, "{name}: {color} and {expected} at {x}, {y}");
        } else {
            assert_eq!(bits(&[color]), bits(&[expected.truncate().as_vec3()]), "{name}");
        }
        let coverage = f64::from(pixel[3]);
        let error = (coverage - expected.w).abs();
        let is_kept = picture.color[i][3].to_bits() == pixel[3].to_bits();
        assert!(
            error < 2e-5 || is_kept && !expected.w.is_finite(),
            "{name}: {coverage} at {x}, {y}"
        );
    }
}

// The reference follows the formulas in double precision, one pair of pixels after another.
#[test]
fn the_result_is_that_of_the_formulas() {
    for (width, height, seed) in [
        (1, 1, 1),
        (2, 2, 2),
        (1, 37, 3),
        (37, 1, 4),
        (16, 16, 5),
        (21, 13, 6),
        (18, 23, 7),
        (65, 5, 8),
    ] {
        let picture = Picture::random(width, height, seed);
        let transparent = Picture::transparent(width, height, seed);
        for settings in [DenoiseSettings::OPAQUE, DenoiseSettings::WATER] {
            assert_equals_reference(&picture, &settings);
            assert_equals_reference(&transparent, &settings);
        }
    }
    for (search, k) in [(1, 0.2), (2, 2.0), (7, 0.6), (16, 0.8)] {
        let picture = Picture::random(19, 13, u64::from(search));
        assert_equals_reference(&picture, &DenoiseSettings { search, k });
    }
}

#[test]
fn random_pictures_change() {
    let picture = Picture::random(60, 50, 1);
    let filtered = picture.denoised();
    let changes = (0..filtered.len()).map(|i| (filtered[i] - picture.color(i)).length());
    let changed = changes.filter(|change| *change > 0.03).count();
    assert!(changed * 3 > filtered.len(), "{changed}");
}

#[test]
fn the_result_does_not_depend_on_tiles_threads_and_instruction_sets() {
    let default = Execution::default();
    let of = |picture: &Picture, execution: &Execution| {
        let filtered = denoise_with(&picture.input(), &DenoiseSettings::OPAQUE, execution);
        all_bits(&filtered.expect("valid input"))
    };
    let pictures = [Picture::random(161, 67, 9), Picture::transparent(161, 67, 9)];
    let expected = pictures.each_ref().map(|picture| of(picture, &default));
    let tiles = [[3, 5], [16, 16], [50, 100], [1000, 1]];
    let executions = tiles
        .map(|tile| Execution { tile, ..default })
        .into_iter()
        .chain(levels().map(|simd| Execution { simd, ..default }));
    for execution in executions {
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let filtered = pool
                .expect("a thread pool")
                .install(|| pictures.each_ref().map(|picture| of(picture, &execution)));
            assert!(filtered == expected, "{execution:?} {threads}");
        }
    }
}

#[test]
fn pictures_of_one_colour_keep_their_bits() {
    for (samples, value) in [(2, 0.1), (3, 0.1), (5, 1e-30), (16, 7e5), (64, 0.0), (2, -0.3)] {
        for albedo in [0.0, 0.3, 1.0] {
            let mut picture = Picture::flat(40, 20);
            picture.samples = samples;
            picture.color.fill([value, value / 3.0, 0.7 * value, 1.0]);
            let color = picture.color(0);
            picture.odd.fill(color.extend(1.0).to_array());
            picture.albedo.fill(Vec3::splat(albedo));
            let filtered = picture.denoised();
            let expected = vec![color; filtered.len()];
            assert_eq!(bits(&filtered), bits(&expected), "{samples} {value} {albedo}");
        }
    }
}

#[test]
fn values_that_are_not_finite_stay_where_they_are() {
    let mut picture = Picture::random(40, 30, 3);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX];
    let mut kept = Vec::new();
    for (number, value) in bad.into_iter().enumerate() {
        let at = |x: usize| (6 * number + 3) * 40 + x;
        picture.color[at(2)][1] = value;
        picture.odd[at(9)][0] = value;
        picture.odd[at(10)][0] = value;
        picture.albedo[at(16)].z = value;
        picture.normal[at(23)].y = value;
        kept.extend([at(2), at(9), at(10), at(16), at(23)]);
        // Like a ray without an intersection
        picture.depth[at(30)] = value;
        // Ignored
        picture.color[at(37)][3] = value;
    }
    for settings in [DenoiseSettings::OPAQUE, DenoiseSettings::WATER] {
        assert_equals_reference(&picture, &settings);
    }
    let filtered = picture.denoised();
    for (i, pixel) in filtered.iter().enumerate() {
        if kept.contains(&i) {
            assert_eq!(bits(&[*pixel]), bits(&[picture.color(i)]), "{i}");
        } else {
            assert!(pixel.is_finite() && pixel.max_element() < 10.0, "{i}: {pixel}");
        }
    }
}

#[test]
fn what_is_not_negative_stays_so() {
    let mut picture = Picture::flat(30, 30);
    picture.add_noise(0.6, 1);
    for color in &mut picture.color {
        *color = color.map(|c| c.max(0.0));
    }
    let filtered = picture.denoised();
    assert!(filtered.iter().all(|pixel| pixel.min_element() >= 0.0));
}

/// Root of the mean squared difference from 0.5.
fn flat_noise(pixels: impl ExactSizeIterator<Item = Vec3>) -> f32 {
    let count = pixels.len() as f32;
    let sum: f32 = pixels.map(|p| p.distance_squared(Vec3::splat(0.5))).sum();
    (sum / count).sqrt()
}

/// The mean of all pixels of the window would have 1/9 of the noise.
#[test]
fn noise_of_a_flat_picture_falls() {
    let mut picture = Picture::flat(200, 200);
    picture.add_noise(0.3, 1);
    let before = flat_noise((0..200 * 200).map(|i| picture.color(i)));
    let ratio = before / flat_noise(picture.denoised().into_iter());
    assert!(ratio > 4.0 && ratio < 9.0, "{ratio}");
}

/// Two halves of a picture whose colours differ by less than the noise.
fn picture_with_edge(change: impl Fn(&mut Picture, usize)) -> Picture {
    let step = |x, _| (Vec3::splat(if x < 32 { 0.5 } else { 0.6 }), 1.0);
    let mut picture = Picture::new(64, 400, step);
    picture.add_noise(0.2, 1);
    for i in (0..picture.odd.len()).filter(|i| i % 64 >= 32) {
        change(&mut picture, i);
    }
    picture
}

/// The difference of brightness between the columns beside the edge.
fn step_at_edge(picture: &Picture) -> f32 {
    let filtered = picture.denoised();
    let column = |x: usize| filtered.iter().skip(x).step_by(64).map(|p| p.x).sum::<f32>();
    (column(32) - column(31)) / picture.height as f32
}

#[test]
fn edges_of_features_stay_sharp() {
    let blurred = step_at_edge(&picture_with_edge(|_, _| ()));
    assert!(blurred < 0.05, "{blurred}");
    let pictures = [
        picture_with_edge(|picture, i| picture.albedo[i] = Vec3::splat(0.8)),
        picture_with_edge(|picture, i| picture.normal[i] = Vec3::Y),
        picture_with_edge(|picture, i| picture.depth[i] = 1.2),
        picture_with_edge(|picture, i| picture.depth[i] = f32::INFINITY),
    ];
    for picture in &pictures {
        let step = step_at_edge(picture);
        assert!((step - 0.1).abs() < 0.02, "{step}");
    }
}

#[test]
fn surfaces_at_an_angle_are_not_edges() {
    let mut picture =
        Picture::new(100, 100, |x, y| (Vec3::splat(0.5), 1.0 + 0.3 * x as f32 + 0.7 * y as f32));
    picture.add_noise(0.3, 1);
    let before = flat_noise((0..100 * 100).map(|i| picture.color(i)));
    let ratio = before / flat_noise(picture.denoised().into_iter());
    assert!(ratio > 3.0, "{ratio}");
}

/// A shadow in front of a transparent background has no colour, so that only its coverage has noise.
#[test]
fn coverage_is_filtered_like_a_colour() {
    let mut random = Random(3);
    let mut picture = Picture::flat(64, 64);
    picture.is_transparent = true;
    picture.depth.fill(f32::INFINITY);
    picture.albedo.fill(Vec3::ZERO);
    picture.normal.fill(Vec3::ZERO);
    // Shadow on the left, nothing on the right
    let is_shadow = |i: usize| i % 64 < 32;
    for i in 0..64 * 64 {
        let halves = [0, 1].map(|_| if is_shadow(i) { 0.5 + 0.3 * random.next() } else { 0.0 });
        picture.odd[i] = [0.0, 0.0, 0.0, halves[1]];
        picture.color[i] = [0.0, 0.0, 0.0, halves[0].midpoint(halves[1])];
    }
    let filtered = denoise(&picture.input(), &DenoiseSettings::OPAQUE).expect("valid input");
    let deviation = |pixels: &[[f32; 4]]| {
        let shadow = (0..pixels.len()).filter(|i| is_shadow(*i));
        let squares = shadow.map(|i| (pixels[i][3] - 0.5).powi(2));
        (squares.sum::<f32>() / (32.0 * 64.0)).sqrt()
    };
    let (before, after) = (deviation(&picture.color), deviation(&filtered));
    assert!(before > 3.5 * after, "{before} {after}");
    for (i, [r, g, b, coverage]) in filtered.iter().enumerate() {
        assert!([r, g, b].iter().all(|c| c.abs() < 1e-6), "{i}");
        // Near its edge, the noise of a pixel is that of its neighbours
        let limit = if (32..34).contains(&(i % 64)) { 0.03 } else { 1e-6 };
        assert!(is_shadow(i) || *coverage <= limit, "{i}: {coverage}");
        assert!((0.0..=1.0).contains(coverage), "{i}: {coverage}");
    }
    // As the same shadow over white
    let mut white = picture.clone();
    white.is_transparent = false;
    for rgba in white.odd.iter_mut().chain(&mut white.color) {
        let light = 1.0 - rgba[3];
        *rgba = [light, light, light, 1.0];
    }
    for (rgba, white) in filtered.iter().zip(white.denoised()) {
        assert!((1.0 - rgba[3] - white.x).abs() < 1e-5, "{rgba:?} {white}");
    }
}

/// If it did, all pixels of the window would change by 50/81, which is 0.6. The eight neighbours may change more: their
/// estimate of the noise contains the sample.
#[test]
fn a_bright_sample_does_not_spread() {
    let mut picture = Picture::flat(40, 40);
    picture.add_noise(0.05, 1);
    let center = 20 * 40 + 20;
    let before = picture.denoised();
    picture.odd[center] = picture.odd[center].map(|c| c + 100.0);
    picture.color[center] = picture.color[center].map(|c| c + 50.0);
    let after = picture.denoised();
    for i in (0..before.len()).filter(|i| *i != center) {
        let change = (before[i] - after[i]).abs().max_element();
        let is_neighbour = (i / 40).abs_diff(20) <= 1 && (i % 40).abs_diff(20) <= 1;
        let limit = if is_neighbour { 1.5 } else { 0.2 };
        assert!(change < limit, "{i}: {change}");
    }
}

/// Glints: pixels that both halves have, or one.
#[test]
fn glints_do_not_become_squares() {
    for (light, glint) in [1e3, 1e4, 1e5].into_iter().flat_map(|light| {
        let shapes = [
            &[(20, 20)][..],
            &[(20, 20), (21, 20)],
            &[(20, 20), (21, 21), (20, 21)],
            &[(0, 39)],
            // The reflection of a sun in a wave
            &[(22, 20), (23, 20), (21, 21), (22, 21), (20, 22), (21, 22)],
        ];
        shapes.map(|shape| (light, shape))
    }) {
        for part_of_odd in [0.0, 0.4, 1.0] {
            let mut picture = Picture::new(40, 40, |_, _| (Vec3::ONE, 1.0));
            picture.add_noise(0.7, 1);
            let before = picture.denoised();
            let is_glint = |i: usize| glint.contains(&(i % 40, i / 40));
            for i in (0..before.len()).filter(|i| is_glint(*i)) {
                picture.odd[i] = picture.odd[i].map(|c| c + 2.0 * part_of_odd * light);
                picture.color[i] = picture.color[i].map(|c| c + light);
            }
            let after = picture.denoised();
            let name = format!("{light} {glint:?} {part_of_odd}");
            let mut sum = 0.0;
            for i in 0..before.len() {
                let change = (after[i] - before[i]).x;
                if is_glint(i) {
                    // Its light stays where it is
                    assert!((change / light - 1.0).abs() < 0.01, "{name}: {change} at {i}");
                } else {
                    // Patches of its neighbours are like no others, so that these keep their noise
                    let is_beside = |(x, y): &(usize, usize)| {
                        x.abs_diff(i % 40) <= 1 && y.abs_diff(i / 40) <= 1
                    };
                    let limit = if glint.iter().any(is_beside) { 1.0 } else { 0.3 };
                    assert!(change.abs() < limit, "{name}: {change} at {i}");
                    sum += change;
                }
            }
            assert!(sum.abs() < 8.0, "{name}: {sum} in all other pixels");
        }
    }
}

#[test]
fn invalid_input_is_an_error() {
    let picture = Picture::flat(5, 4);
    let valid = picture.input();
    let settings = DenoiseSettings::OPAQUE;
    let message = |input: &DenoiseInput<'_>, settings: &DenoiseSettings| {
        let error = denoise(input, settings).expect_err("invalid");
        error.to_string()
    };
    for samples in [0, 1] {
        let input = DenoiseInput { samples, ..valid };
        assert!(message(&input, &settings).contains("use at least 2"));
    }
    for (input, plane) in [
        (DenoiseInput { color: &picture.color[1..], ..valid }, "color"),
        (DenoiseInput { odd: &picture.odd[1..], ..valid }, "odd"),
        (DenoiseInput { albedo: &picture.albedo[1..], ..valid }, "albedo"),
        (DenoiseInput { normal: &picture.normal[1..], ..valid }, "normal"),
        (DenoiseInput { depth: &picture.depth[1..], ..valid }, "depth"),
    ] {
        let expected = format!("the plane {plane} has 19 pixels, the picture has 5x4");
        assert_eq!(message(&input, &settings), expected);
    }
    let huge = DenoiseInput { views: [1, 1], width: u32::MAX, height: u32::MAX, ..valid };
    assert!(message(&huge, &settings).contains("has 20 pixels"));
    for (search, k, expected) in [
        (0, 0.5, "search radius 0 is out of range, it must lie in 1 to 16"),
        (17, 0.5, "search radius 17 is out of range, it must lie in 1 to 16"),
        (4, 0.0, "k = 0 is out of range, it must lie in 0.001 to 1000"),
        (4, f32::NAN, "k = NaN is out of range, it must lie in 0.001 to 1000"),
    ] {
        assert_eq!(message(&valid, &DenoiseSettings { search, k }), expected);
    }
}

#[test]
fn a_picture_without_pixels_is_returned() {
    for (width, height) in [(0, 0), (0, 7), (7, 0)] {
        assert_eq!(Picture::flat(width, height).denoised(), []);
    }
}

/// Two pictures of equal size beside each other, or below each other.
fn joined<T: Copy>(a: &[T], b: &[T], width: usize, views: [u32; 2]) -> Vec<T> {
    match views {
        [2, 1] => {
            let rows = a.chunks(width).zip(b.chunks(width));
            rows.flat_map(|(a, b)| [a, b].concat()).collect()
        }
        _ => [a, b].concat(),
    }
}

#[test]
fn views_are_filtered_as_pictures_of_their_own() {
    let (width, height) = (37, 21);
    let [a, b] = [5, 6].map(|seed| Picture::random(width, height, seed));
    for views in [[2_u32, 1_u32], [1, 2]] {
        let pair = Picture {
            width: width * views[0] as usize,
            height: height * views[1] as usize,
            samples: a.samples,
            is_transparent: false,
            color: joined(&a.color, &b.color, width, views),
            odd: joined(&a.odd, &b.odd, width, views),
            albedo: joined(&a.albedo, &b.albedo, width, views),
            normal: joined(&a.normal, &b.normal, width, views),
            depth: joined(&a.depth, &b.depth, width, views),
        };
        let expected = joined(&a.denoised(), &b.denoised(), width, views);
        for tile in [[usize::MAX, TILE_ROWS], [7, 5], [16, 1]] {
            let execution = Execution { tile, ..Execution::default() };
            let input = DenoiseInput { views, ..pair.input() };
            let filtered =
                denoise_with(&input, &DenoiseSettings::OPAQUE, &execution).expect("valid input");
            let filtered: Vec<_> = filtered.iter().map(|rgba| Vec3::from_slice(rgba)).collect();
            assert_eq!(bits(&filtered), bits(&expected), "{views:?} {tile:?}");
        }
        // As one view, pixels at the seam are averaged
        assert_ne!(bits(&pair.denoised()), bits(&expected));
    }
}
