//! From latitude and longitude to the equal-area octahedral map: the mean radiance of each texel.
//!
//! Each pixel is divided into parts that are much smaller than texels. A part becomes a square of its area in the map,
//! and is shared out among the up to four texels below it. The map takes a row of parts, which have the same distance
//! to the pole, to a square around the centre or the corners, along which the longitude is linear.

use glam::{DVec3, Vec3};
use spherule_tree::math::narrow;

use super::image::{EnvironmentImage, edge_cosine};
use super::{COLUMNS, ROWS};

/// Radiance times area, and area, in texels.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    radiance: DVec3,
    area: f64,
}

/// The mean radiance of each texel of a map with edges of `side` texels, row by row.
pub(super) fn octahedral(image: &EnvironmentImage, side: usize) -> Vec<[f32; 3]> {
    // Parts along the edge of a pixel: about 100 for each texel
    let parts = (side / 32).max(1);
    // All rows have the same longitudes
    let columns = COLUMNS * parts;
    let places: Vec<Place> = (0..columns).map(|column| Place::new(column, columns)).collect();
    let mut sums = vec![Sum::default(); side * side];
    for (row, pixels) in image.rows().enumerate() {
        for part in 0..parts {
            add_row(&mut sums, side, [row * parts + part, parts], pixels, &places);
        }
    }
    let mean = |sum: &Sum| (sum.radiance / sum.area).to_array().map(narrow);
    sums.iter().map(mean).collect()
}

/// Where a longitude is in the map.
struct Place {
    /// The quadrant, by the signs of its coordinates.
    signs: [f64; 2],
    /// The position in it from the x axis to the y axis, 0 to 1.
    along: f64,
}

impl Place {
    /// The middle of a column of parts.
    fn new(column: usize, columns: usize) -> Self {
        let turn = (column as f64 + 0.5) * 4.0 / columns as f64;
        let quadrant = turn.floor();
        let along = turn - quadrant;
        let (x, y, along) = match quadrant {
            0.0 => (1.0, 1.0, along),
            1.0 => (-1.0, 1.0, 1.0 - along),
            2.0 => (-1.0, -1.0, along),
            _ => (1.0, -1.0, 1.0 - along),
        };
        Self { signs: [x, y], along }
    }
}

/// Adds a row of parts of `pixels`.
fn add_row(
    sums: &mut [Sum],
    side: usize,
    [row, parts]: [usize; 2],
    pixels: &[[f32; 3]],
    places: &[Place],
) {
    let (rows, columns) = (ROWS * parts, COLUMNS * parts);
    let (top, bottom) = (edge_cosine(row, rows), edge_cosine(row + 1, rows));
    let z = 0.5 * (top + bottom);
    let r = (1.0 - z.abs()).sqrt();
    let scale = 0.5 * side as f64;
    // The sphere has the area of the whole map
    let area = 0.5 * (top - bottom) / columns as f64 * (side * side) as f64;
    let edge = area.sqrt();
    for (rgb, places) in pixels.iter().zip(places.chunks(parts)) {
        let radiance = Vec3::from_array(*rgb).as_dvec3();
        for Place { signs: [x_sign, y_sign], along } in places {
            let (x, y) = ((1.0 - along) * r, along * r);
            let (x, y) = if z < 0.0 { (1.0 - y, 1.0 - x) } else { (x, y) };
            let columns = Ends::new((x_sign * x + 1.0) * scale, edge, side);
            let rows = Ends::new((y_sign * y + 1.0) * scale, edge, side);
            add_square(sums, side, &columns, &rows, radiance);
        }
    }
}

/// The texels at both ends of a square along an axis, with their parts of its edge.
struct Ends {
    first: usize,
    last: usize,
    widths: [f64; 2],
}

impl Ends {
    /// Those of a square with this centre and edge, in texels. Beyond the border of the map, it counts for those at the
    /// border.
    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    fn new(center: f64, edge: f64, side: usize) -> Self {
        let (low, high) = (center - 0.5 * edge, center + 0.5 * edge);
        let (first, last) = ((low as usize).min(side - 1), (high as usize).min(side - 1));
        let before = if first == last { edge } else { last as f64 - low };
        Self { first, last, widths: [before, edge - before] }
    }
}

/// Adds a square to the texels below it. Nearly all are in a single one.
#[inline(always)]
fn add_square(sums: &mut [Sum], side: usize, columns: &Ends, rows: &Ends, radiance: DVec3) {
    let [left, right] = columns.widths;
    let [above, below] = rows.widths;
    sums[rows.first * side + columns.first].add(left * above, radiance);
    if columns.last != columns.first {
        sums[rows.first * side + columns.last].add(right * above, radiance);
    }
    if rows.last != rows.first {
        sums[rows.last * side + columns.first].add(left * below, radiance);
        if columns.last != columns.first {
            sums[rows.last * side + columns.last].add(right * below, radiance);
        }
    }
}

impl Sum {
    #[inline(always)]
    fn add(&mut self, area: f64, radiance: DVec3) {
        self.radiance += area * radiance;
        self.area += area;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::environment::octahedral::square_to_sphere;

    #[test]
    fn texels_have_the_radiance_of_their_direction() {
        let of = |d: Vec3| Vec3::new(1.0, 2.0 + d.x + 0.5 * d.y, (1.0 + d.z).powi(2));
        let image = EnvironmentImage::from_fn(of);
        for side in [16, 128, 256] {
            let tolerance = 3.0 / side as f32;
            for (i, rgb) in octahedral(&image, side).iter().enumerate() {
                let at = |i: usize| (i as f32 + 0.5) / side as f32 * 2.0 - 1.0;
                let direction = Vec3::from_array(square_to_sphere(at(i % side), at(i / side)));
                let difference = (Vec3::from_array(*rgb) - of(direction)).abs().max_element();
                assert!(difference < tolerance, "{side} {i}: {rgb:?} {}", of(direction));
                assert!((rgb[0] - 1.0).abs() < 1e-6);
            }
        }
    }

    // Twelve maps are resampled as a whole: a pixel may lose power at a pole or an edge.
    #[test]
    fn single_pixels_keep_their_power() {
        for side in [128_usize, 256] {
            for (row, column) in [(0, 5), (40, 511), (127, 0), (128, 64), (200, 129), (255, 300)] {
                let pixel = row * COLUMNS + column;
                let white = |i: usize| if i == pixel { Vec3::ONE } else { Vec3::ZERO };
                let image = EnvironmentImage::new((0..COLUMNS * ROWS).map(white));
                let texels = octahedral(&image, side);
                let found: f64 = texels.iter().map(|rgb| f64::from(rgb[0])).sum();
                let found = found * 4.0 * std::f64::consts::PI / (side * side) as f64;
                let wanted = f64::from(image.integral(|_| 1.0).x);
                assert!((found / wanted - 1.0).abs() < 0.01, "{side} {row}: {found} {wanted}");
            }
        }
    }
}
