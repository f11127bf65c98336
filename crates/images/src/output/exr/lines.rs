//! Converts one row of a plane to the samples of the file.

use bytemuck::{cast_slice, cast_slice_mut};
use half::f16;
use half::slice::{HalfBitsSliceExt, HalfFloatSliceExt};

use super::planes::Source;
use crate::render::FilmRows;
use crate::render::planes::PlaneKind;

/// Largest finite half-float.
const HALF_MAX: f32 = 65_504.0;

/// Memory for one line, and the number of values that half-floats cannot represent.
#[derive(Debug, Default)]
pub(super) struct LineBuffer {
    floats: Vec<f32>,
    words: Vec<u32>,
    /// Number of colour values that were NaN or beyond [`HALF_MAX`], in all lines so far.
    pub(super) clamped: u64,
}

impl LineBuffer {
    /// The samples of `source` in row `row` of `rows`, as little-endian bytes.
    ///
    /// # Panics
    /// If the film lacks the plane.
    pub(super) fn line(&mut self, rows: &FilmRows, row: usize, source: Source) -> &[u8] {
        let width = rows.width as usize;
        self.words.resize(width, 0);
        let (plane, component) = match source {
            Source::Color(i) => return self.halves(&rows.color[row * width..][..width], i),
            Source::Plane(plane, component) => (plane, component),
        };
        let (words, size) = rows.plane(plane);
        let pixels = &words[row * width * size..][..width * size];
        if plane.kind() == PlaneKind::Light {
            let values = pixels.chunks_exact(size).map(|pixel| f32::from_bits(pixel[component]));
            return self.converted(values);
        }
        // Copy all other planes as words of four bytes
        let line = &mut self.words[..];
        match size {
            1 => copy::<1>(pixels, component, line),
            3 => copy::<3>(pixels, component, line),
            _ => copy_components(pixels.chunks_exact(size), component, line),
        }
        cast_slice(&self.words)
    }

    /// Converts a colour component to half-floats.
    fn halves(&mut self, colors: &[[f32; 4]], component: usize) -> &[u8] {
        match component {
            0 => self.converted(colors.iter().map(|color| color[0])),
            1 => self.converted(colors.iter().map(|color| color[1])),
            2 => self.converted(colors.iter().map(|color| color[2])),
            _ => self.converted(colors.iter().map(|color| color[3])),
        }
    }

    /// Converts `values` to half-floats: to nearest, ties to even, the same on every machine. Clamps values to the
    /// finite range and counts those it has changed; NaN becomes 0. The loop has no branches, so that the compiler
    /// vectorises it.
    fn converted(&mut self, values: impl ExactSizeIterator<Item = f32>) -> &[u8] {
        self.floats.resize(values.len(), 0.0);
        let mut clamped = 0_u32;
        for (float, value) in self.floats.iter_mut().zip(values) {
            let fits = value.abs() <= HALF_MAX;
            clamped += u32::from(!fits);
            let limited = value.clamp(-HALF_MAX, HALF_MAX);
            *float = if value.is_nan() { 0.0 } else { limited };
        }
        self.clamped += u64::from(clamped);
        let bits: &mut [u16] = &mut cast_slice_mut(&mut self.words)[..self.floats.len()];
        let halves: &mut [f16] = bits.reinterpret_cast_mut();
        halves.convert_from_f32_slice(&self.floats);
        for bits in bits.iter_mut() {
            *bits = bits.to_le();
        }
        cast_slice(bits)
    }
}

/// Copies a component of each pixel to `words`, with the bytes in the order of the file.
fn copy<const N: usize>(pixels: &[u32], component: usize, words: &mut [u32]) {
    assert!(component < N, "a component of a pixel");
    copy_components(pixels.as_chunks::<N>().0.iter(), component, words);
}

#[inline(always)]
fn copy_components<'a, P: AsRef<[u32]> + ?Sized + 'a>(
    pixels: impl Iterator<Item = &'a P>,
    component: usize,
    words: &mut [u32],
) {
    for (word, pixel) in words.iter_mut().zip(pixels) {
        *word = pixel.as_ref()[component].to_le();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `values` as half-floats, converted by the buffer, which may use instructions of the machine.
    fn converted(values: &[f32]) -> (Vec<u16>, u64) {
        let colors: Vec<[f32; 4]> = values.iter().map(|v| [*v, 0.0, 0.0, 0.0]).collect();
        let mut buffer = LineBuffer::default();
        buffer.words.resize(values.len(), 0);
        let bytes = buffer.halves(&colors, 0).to_vec();
        let bits = bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]]));
        (bits.collect(), buffer.clamped)
    }

    #[test]
    fn halves_are_rounded_as_the_portable_conversion_does() {
        // Every half-float, the midpoint to the next one, and the values just next to both, where rounding decides
        let mut values = Vec::new();
        for bits in 0..0x7bff_u16 {
            let (low, high) = (f16::from_bits(bits).to_f32(), f16::from_bits(bits + 1).to_f32());
            let middle = low + 0.5 * (high - low);
            for value in [low, middle.next_down(), middle, middle.next_up(), high.next_down()] {
                values.extend([value, -value]);
            }
        }
        values.extend([1e-45, f32::MIN_POSITIVE, -1e-40, HALF_MAX, -HALF_MAX]);
        let (bits, clamped) = converted(&values);
        assert_eq!(clamped, 0);
        for (value, bits) in values.iter().zip(bits) {
            assert_eq!(bits, f16::from_f32_const(*value).to_bits(), "{value:e}");
        }
    }

    #[test]
    fn values_outside_the_range_of_half_floats_are_counted() {
        let values = [HALF_MAX.next_up(), f32::NEG_INFINITY, f32::NAN, -f32::NAN, 1.0];
        let (bits, clamped) = converted(&values);
        assert_eq!(clamped, 4);
        assert_eq!(bits, [0x7bff, 0xfbff, 0, 0, 0x3c00]);
    }
}
