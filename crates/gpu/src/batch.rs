//! How many samples of each pixel are traced together, and the memory of their rays.

use crate::lighting::RayKinds;
use crate::pixels::NearestSample;

/// Memory of the colour and coverage of a pixel or of a sample, bytes.
pub(crate) const FILM_BYTES: u64 = 16;

/// Memory of the nearest sample of a pixel, bytes.
pub(crate) const DATA_BYTES: u64 = size_of::<NearestSample>() as u64;

/// Rays that are traced together at most, if a batch has several samples of each pixel.
pub(crate) const MOST_RAYS: u64 = 1 << 23;
/// Memory of an array for these, bytes.
const LARGEST_ARRAY: u64 = 1 << 30;
/// Samples of a pixel that are traced together at most.
const MOST_SAMPLES: u32 = 16;

/// What the arrays for the pixels and rays of a picture depend on, beside the kinds of its rays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PixelNeed {
    /// Samples of a pixel.
    pub(crate) samples: u32,
    /// Whether the film has the sums over every second sample.
    pub(crate) is_denoised: bool,
    /// Whether indirect light has a limit.
    pub(crate) has_clamp: bool,
}

/// How many planes of pixels the arrays have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Batch {
    /// Samples of a pixel that are traced together: a power of two.
    pub(crate) samples: u32,
    /// Planes of the film, and of the nearest samples, before those of the batch. A picture with one sample has none.
    pub(crate) before: [u32; 2],
    /// Planes of the film.
    film: u32,
}

impl Batch {
    /// The largest batch for a film of `pixels` with at most `most_rays` camera rays, whose arrays have at most `max_array`
    /// bytes each. (A dispatch lasts as long as its longest ray, so that small dispatches leave most of a device idle.)
    ///
    /// It is one sample with glass, where each pixel keeps rays, and with layers of light, which add up one sample after
    /// the other.
    pub(crate) fn new(
        rays: RayKinds,
        need: PixelNeed,
        pixels: u64,
        [most_rays, max_array]: [u64; 2],
    ) -> Self {
        let of = |samples| Self::with(rays, need, samples);
        let fits = |samples: u32| {
            let batch = of(samples);
            let bytes = batch.largest_bytes(rays);
            pixels * u64::from(samples) <= most_rays
                && pixels * bytes <= max_array.min(LARGEST_ARRAY)
        };
        if rays.kept.is_some() || rays.has_layers {
            return of(1);
        }
        let most = need.samples.next_power_of_two().min(MOST_SAMPLES);
        let sizes = (1..=most.ilog2()).rev().map(|bits| 1 << bits);
        of(sizes.into_iter().find(|samples| fits(*samples)).unwrap_or(1))
    }

    /// A batch of so many samples of each pixel.
    pub(crate) fn with(rays: RayKinds, need: PixelNeed, samples: u32) -> Self {
        let before = if need.samples > 1 { [1 + u32::from(need.is_denoised), 1] } else { [0; 2] };
        // Samples have a second colour where light is apart for a while
        let colors = 1 + u32::from(rays.has_lit() || need.has_clamp);
        let film = before[0] + samples * colors;
        Self { samples, before, film }
    }

    /// Memory of the film for each pixel, bytes.
    pub(crate) fn film_bytes(self) -> u64 {
        FILM_BYTES * u64::from(self.film)
    }

    /// Memory of the nearest samples for each pixel, bytes.
    pub(crate) fn data_bytes(self) -> u64 {
        DATA_BYTES * u64::from(self.before[1] + self.samples)
    }

    /// Memory of a queue of rays that go on for each pixel, bytes.
    pub(crate) fn ray_bytes(self, rays: RayKinds) -> u64 {
        rays.ray_bytes() * u64::from(self.samples)
    }

    /// Memory of the queues of shadow rays of a depth for each pixel, bytes.
    pub(crate) fn shadow_bytes(self, rays: RayKinds) -> u64 {
        rays.shadow_bytes() * u64::from(rays.sources()) * u64::from(self.samples)
    }

    /// That of the largest of these arrays.
    pub(crate) fn largest_bytes(self, rays: RayKinds) -> u64 {
        let others = self.film_bytes().max(self.data_bytes());
        self.ray_bytes(rays).max(self.shadow_bytes(rays)).max(others)
    }

    /// That of all of them.
    pub(crate) fn bytes(self, rays: RayKinds) -> u64 {
        let shadows = rays.shadow_arrays() as u64 * self.shadow_bytes(rays);
        self.film_bytes() + self.data_bytes() + 2 * self.ray_bytes(rays) + shadows
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Device;
    use crate::picture::{Picture, Samples};
    use crate::renderer::{Colors, Renderer};
    use crate::spheres::{Centers, KeyLength, Order, Radii, Spheres};

    const KINDS: RayKinds =
        RayKinds { has_paths: true, has_mirrors: false, has_layers: false, kept: None, lights: 0 };
    const NEED: PixelNeed = PixelNeed { samples: 16, is_denoised: true, has_clamp: false };
    const ANY_SIZE: u64 = u64::MAX;

    fn samples(rays: RayKinds, need: PixelNeed, pixels: u64, max_array: u64) -> u32 {
        Batch::new(rays, need, pixels, [MOST_RAYS, max_array]).samples
    }

    #[test]
    fn batches_grow_until_they_have_enough_rays() {
        for (pixels, expected) in
            [(480 * 270, 16), (960 * 540, 16), (1920 * 1080, 4), (3840 * 2160, 1), (1 << 40, 1)]
        {
            assert_eq!(samples(KINDS, NEED, pixels, ANY_SIZE), expected, "{pixels}");
        }
        // No more than there are; those of the last batch may be fewer
        for (count, expected) in [(1, 1), (2, 2), (5, 8), (100, 16)] {
            let need = PixelNeed { samples: count, ..NEED };
            assert_eq!(samples(KINDS, need, 1000, ANY_SIZE), expected, "{count}");
        }
    }

    #[test]
    fn arrays_of_batches_fit() {
        // 96 bytes of shadow rays for each of 16 samples
        assert_eq!(samples(KINDS, NEED, 10_000, 16 * 960_000), 16);
        assert_eq!(samples(KINDS, NEED, 10_000, 16 * 960_000 - 1), 8);
        assert_eq!(samples(KINDS, NEED, 10_000, 1), 1);
        // Many lights
        let lit = RayKinds { lights: 8, ..KINDS };
        assert_eq!(samples(lit, NEED, 1920 * 1080, ANY_SIZE), 1);
        let glass = RayKinds { kept: Some(2), ..KINDS };
        let parts = RayKinds { has_layers: true, ..KINDS };
        assert_eq!([glass, parts].map(|rays| samples(rays, NEED, 1000, ANY_SIZE)), [1, 1]);
    }

    #[test]
    fn the_size_of_batches_does_not_change_pictures() {
        let Some(device) = Device::for_tests() else { return };
        let coordinate = |i: u32, prime: u32| (i.wrapping_mul(prime) >> 8) as f32 / 5.6e6;
        let primes = [2_654_435_761, 2_246_822_519, 3_266_489_917];
        let centers: Vec<[f32; 3]> =
            (0..2000).map(|i| primes.map(|prime| coordinate(i, prime))).collect();
        let spheres = Spheres {
            centers: Centers::Points(&centers),
            radii: Radii::Common(0.1),
            order: Order::Any(KeyLength::Short),
            displacements: None,
            keeps_codes: false,
            keeps_copies: true,
        };
        let points: Vec<[f32; 2]> =
            (0..5).map(|i| [0.2 * i as f32, 0.9 - 0.2 * i as f32]).collect();
        let sets = [0; 41 * 23];
        let plain = Picture::for_tests([41, 23], &sets);
        let samples = Samples { count: 5, points: &points, ..plain.samples };
        let picture = Picture { samples, ..plain };
        let bytes = |most_rays: u64| {
            let mut renderer = Renderer::new(&device).with_most_rays(most_rays);
            renderer.prepare(&device, &spheres, Colors::Constant([0.5; 3])).unwrap();
            renderer.trace(&device, &picture, &|_| false).unwrap();
            let image = renderer.read(&device).unwrap();
            let pixels = image.pixels();
            (pixels.sums.to_vec(), bytemuck::cast_slice::<_, u8>(pixels.nearest).to_vec())
        };
        let single = bytes(1);
        assert!(single.0.iter().any(|sum| sum[3] > 1.0));
        for together in [2, 4, 8] {
            assert!(bytes(together * 41 * 23) == single, "{together} samples together");
        }
    }
}
