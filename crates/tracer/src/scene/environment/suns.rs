//! Suns in images: small places that are far brighter than all others.
//!
//! A few pixels with most of the light are met by chance alone, by a path as by a photon. As lights they have sharp
//! shadows and caustics without noise.

use glam::{DVec3, Vec3};
use spherule_tree::math::narrow;

use super::map::RadianceMap;
use super::{LUMINANCE, image};

/// A sun that was taken out of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapSun {
    /// Unit vector towards its centre, in the axes of an environment (x right, y back, z up).
    pub direction: Vec3,
    /// Half its apparent diameter, radians.
    pub half_angle: f64,
    /// Irradiance on a surface that faces it, linear RGB, without the sky behind it.
    pub irradiance: Vec3,
}

/// Most suns of an image.
const MAX_SUNS: usize = 4;

/// A sun has pixels that are so many times brighter than the median.
const CONTRAST: f32 = 50.0;

/// Largest solid angle of a sun with its glow, steradians: a disc of 12 degrees.
const MAX_SOLID_ANGLE: f64 = 0.034;

/// Least part of all light of the image.
const MIN_SHARE: f64 = 0.02;

/// The least median that counts, as a part of all light: a starry night is black.
const MIN_MEDIAN: f64 = 1e-3;

/// Number of pixels from which the median is determined.
const SAMPLE: usize = 1 << 16;

/// Takes the suns out of `map`, the brightest first: small places with much of its light, which become as bright as what is
/// around them.
pub fn take_suns(map: &mut RadianceMap) -> Vec<MapSun> {
    let geometry = Geometry::of(map);
    let total: f64 = map
        .pixels()
        .iter()
        .enumerate()
        .map(|(pixel, rgb)| geometry.solid_angle(pixel) * f64::from(rgb.dot(LUMINANCE)))
        .sum();
    // In front of black, only what has much of the light is a sun
    let least = narrow(f64::from(CONTRAST) * MIN_MEDIAN * total);
    let threshold = (CONTRAST * median(map.pixels())).max(least);
    let mut search =
        Search { geometry: &geometry, pixels: map.pixels(), depth: vec![0; map.pixels().len()] };
    let regions = search.regions(threshold);
    // Choose those with most light
    let light = |sun: &MapSun| f64::from(sun.irradiance.dot(LUMINANCE));
    let mut found: Vec<(MapSun, Vec3, Region)> = regions
        .into_iter()
        .map(|region| {
            let (sun, behind) = geometry.sun(map.pixels(), &region);
            (sun, behind, region)
        })
        .filter(|(sun, ..)| light(sun) >= MIN_SHARE * total)
        .collect();
    found.sort_by(|a, b| light(&b.0).total_cmp(&light(&a.0)));
    found.truncate(MAX_SUNS);
    for (_, behind, region) in &found {
        region.pixels.iter().for_each(|pixel| map.set(*pixel, *behind));
    }
    found.into_iter().map(|(sun, ..)| sun).collect()
}

/// Connected pixels that are brighter than all around them.
struct Region {
    pixels: Vec<usize>,
    /// Luminance that they exceed, and those around them do not.
    threshold: f32,
}

/// The search for regions that may be suns.
struct Search<'a> {
    geometry: &'a Geometry,
    pixels: &'a [Vec3],
    /// How often each pixel was met, each time with a higher threshold.
    depth: Vec<u8>,
}

impl Search<'_> {
    /// Connected pixels above a threshold, as large as a sun with its glow. What is larger, such as a window or the sky
    /// around a sun, is searched with a higher threshold.
    fn regions(&mut self, threshold: f32) -> Vec<Region> {
        let mut found = Vec::new();
        let all = (0..self.pixels.len()).filter(|pixel| self.is_above(*pixel, threshold)).collect();
        let mut open = vec![(all, threshold, 1)];
        while let Some((pixels, threshold, depth)) = open.pop() {
            let pixels: Vec<usize> = pixels;
            for seed in pixels {
                if self.depth[seed] >= depth {
                    continue;
                }
                let region = self.around(seed, threshold, depth);
                let size: f64 = region.iter().map(|pixel| self.geometry.solid_angle(*pixel)).sum();
                if size <= MAX_SOLID_ANGLE {
                    found.push(Region { pixels: region, threshold });
                } else if depth < u8::MAX {
                    let higher = 4.0 * threshold;
                    let within = region.into_iter().filter(|pixel| self.is_above(*pixel, higher));
                    open.push((within.collect(), higher, depth + 1));
                }
            }
        }
        found
    }

    fn is_above(&self, pixel: usize, threshold: f32) -> bool {
        self.pixels[pixel].dot(LUMINANCE) > threshold
    }

    /// The connected pixels above a threshold around one of them.
    fn around(&mut self, seed: usize, threshold: f32, depth: u8) -> Vec<usize> {
        let mut region = vec![seed];
        self.depth[seed] = depth;
        let mut next = 0;
        while let Some(pixel) = region.get(next).copied() {
            for pixel in self.geometry.around(pixel) {
                if self.depth[pixel] < depth && self.is_above(pixel, threshold) {
                    self.depth[pixel] = depth;
                    region.push(pixel);
                }
            }
            next += 1;
        }
        region
    }
}

/// The median luminance of some pixels, which are evenly distributed.
fn median(pixels: &[Vec3]) -> f32 {
    let step = pixels.len().div_ceil(SAMPLE);
    // A step that divides the width would meet a few columns only
    let mut sample: Vec<f32> =
        (0..pixels.len() / step).map(|i| pixels[i * step + i % step].dot(LUMINANCE)).collect();
    let middle = sample.len() / 2;
    *sample.select_nth_unstable_by(middle, f32::total_cmp).1
}

/// Where the pixels of a map are.
struct Geometry {
    width: usize,
    height: usize,
}

impl Geometry {
    fn of(map: &RadianceMap) -> Self {
        let [width, height] = map.size();
        Self { width, height }
    }

    fn solid_angle(&self, pixel: usize) -> f64 {
        let row = pixel / self.width;
        let height =
            image::edge_cosine(row, self.height) - image::edge_cosine(row + 1, self.height);
        height * 2.0 * std::f64::consts::PI / self.width as f64
    }

    /// The direction of the centre of a pixel. The middle column is in front.
    fn direction(&self, pixel: usize) -> DVec3 {
        let (row, column) = (pixel / self.width, pixel % self.width);
        let quarter = 0.25 * self.width as f64;
        let longitude = image::longitude(column, quarter + 0.5, self.width);
        image::direction_at(image::polar(row, 0.5, self.height), longitude)
    }

    /// The pixels around one, across the edge of the map, and not across the poles.
    fn around(&self, pixel: usize) -> impl Iterator<Item = usize> + use<> {
        let (width, height) = (self.width, self.height);
        let (row, column) = (pixel / width, pixel % width);
        let rows = row.saturating_sub(1)..(row + 2).min(height);
        rows.flat_map(move |row| {
            [width - 1, 0, 1].map(move |step| row * width + (column + step) % width)
        })
    }

    /// The sun in a region, and the radiance behind it.
    fn sun(&self, pixels: &[Vec3], region: &Region) -> (MapSun, Vec3) {
        let Region { pixels: region, threshold } = region;
        // What is behind it is seen around it
        let around = region.iter().flat_map(|pixel| self.around(*pixel)).map(|pixel| pixels[pixel]);
        let ring: Vec<DVec3> = around
            .filter(|rgb| rgb.dot(LUMINANCE) <= *threshold)
            .map(|rgb| rgb.as_dvec3())
            .collect();
        let behind = (ring.iter().sum::<DVec3>() / ring.len().max(1) as f64).as_vec3();
        // Add up the light, with its place
        let (mut irradiance, mut weight, mut place) = (DVec3::ZERO, 0.0, DVec3::ZERO);
        let light = |pixel: usize| {
            let excess = (pixels[pixel] - behind).max(Vec3::ZERO);
            self.solid_angle(pixel) * excess.as_dvec3()
        };
        let luminance = |light: DVec3| light.dot(LUMINANCE.as_dvec3());
        for pixel in region {
            let light = light(*pixel);
            irradiance += light;
            weight += luminance(light);
            place += luminance(light) * self.direction(*pixel);
        }
        let direction = place.try_normalize().unwrap_or(DVec3::Z);
        // A disc has a mean square of angles of half the square of its half angle
        let spread: f64 = region
            .iter()
            .map(|pixel| {
                let angle = direction.angle_between(self.direction(*pixel));
                luminance(light(*pixel)) * angle * angle
            })
            .sum();
        // A single pixel is as large as a disc of its area
        let least = (self.solid_angle(region[0]) / std::f64::consts::PI).sqrt();
        let half_angle = (2.0 * spread / weight.max(f64::MIN_POSITIVE)).sqrt().max(least);
        let irradiance = irradiance.as_vec3();
        (MapSun { direction: direction.as_vec3(), half_angle, irradiance }, behind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map of `width` with the sky of a radiance, and bright `pixels`.
    fn map(width: usize, sky: f32, pixels: &[(usize, f32)]) -> RadianceMap {
        let mut all = vec![Vec3::splat(sky); width * width / 2];
        for (pixel, radiance) in pixels {
            all[*pixel] = Vec3::new(*radiance, 0.9 * radiance, 0.8 * radiance);
        }
        RadianceMap::new(width, width / 2, all).unwrap()
    }

    fn total(map: &RadianceMap) -> DVec3 {
        let geometry = Geometry::of(map);
        let light = |(i, rgb): (usize, &Vec3)| geometry.solid_angle(i) * rgb.as_dvec3();
        map.pixels().iter().enumerate().map(light).sum()
    }

    #[test]
    fn a_sun_keeps_its_light_and_its_place() {
        // Ten pixels, two of them across the edge of the map
        let row = 40 * 256;
        let pixels = [
            row,
            row + 1,
            row + 2,
            row + 255,
            row + 254,
            row + 256,
            row + 257,
            row + 258,
            row + 511,
            row + 510,
        ];
        let mut map = map(256, 0.5, &pixels.map(|pixel| (pixel, 4e4)));
        let before = total(&map);
        let suns = take_suns(&mut map);
        let [sun] = &suns[..] else { panic!("{suns:?}") };
        let after = total(&map) + sun.irradiance.as_dvec3();
        assert!((after - before).abs().max_element() < 1e-4 * before.x, "{before} {after}");
        assert!(map.pixels().iter().all(|rgb| *rgb == Vec3::splat(0.5)));
        let expected = Geometry::of(&map).direction(row + 128);
        // The left edge is behind
        assert!(sun.direction.y > 0.5 && sun.direction.z > 0.0, "{sun:?} {expected}");
        assert!((1.0..3.0).contains(&sun.half_angle.to_degrees()), "{sun:?}");
    }

    #[test]
    fn what_is_no_sun_stays() {
        // An even sky, a faint pixel, a black map, and a window
        let window: Vec<(usize, f32)> = (20..60)
            .flat_map(|row| (30..90).map(move |column| (row * 256 + column, 90.0)))
            .collect();
        for mut map in [
            map(256, 0.5, &[]),
            map(256, 0.5, &[(9000, 30.0)]),
            map(256, 0.0, &[]),
            map(256, 0.5, &window),
        ] {
            let before = map.clone();
            assert_eq!(take_suns(&mut map), []);
            assert_eq!(map, before);
        }
    }

    #[test]
    fn a_sun_within_its_glow_is_found() {
        // Brightness falls with the distance from the middle of row 64
        let glow = |pixel: usize| {
            let (x, y) = ((pixel % 512) as f32 - 200.0, (pixel / 512) as f32 - 64.0);
            let far = (x * x + y * y).sqrt();
            (pixel, if far < 2.0 { 5e4 } else { (400.0 / far).max(0.4) })
        };
        let pixels: Vec<(usize, f32)> = (0..512 * 256).map(glow).collect();
        let mut map = map(512, 0.4, &pixels);
        let suns = take_suns(&mut map);
        assert_eq!(suns.len(), 1, "{suns:?}");
        assert!(suns[0].half_angle.to_degrees() < 3.0, "{suns:?}");
        let brightest = map.pixels().iter().map(|rgb| rgb.x).fold(0.0, f32::max);
        assert!(brightest < 500.0, "{brightest}");
    }
}
