//! Converts one row of a plane to the samples of the file.

use bytemuck::{cast_slice, cast_slice_mut};
use glam::Vec3;
use half::f16;
use half::slice::{HalfBitsSliceExt, HalfFloatSliceExt};

use super::planes::Source;
use crate::render::FilmRows;

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
    pub(super) fn line(&mut self, rows: &FilmRows, row: usize, source: Source) -> &[u8] {
        let width = rows.width as usize;
        let range = row * width..(row + 1) * width;
        self.words.resize(width, 0);
        // Half floats have a buffer of their own
        match source {
            Source::Color(component) => return self.halves(&rows.color[range], component),
            Source::LayerColor(i) => return self.layer_halves(layer(rows, row), rows.floats, i),
            _ => {}
        }
        let axis = |plane: Option<&[Vec3]>, axis, words: &mut [u32]| {
            let vectors = &plane.expect(HAS_PLANE)[range.clone()];
            copy_axis(cast_slice(vectors), axis, words);
        };
        // Copy the other sources as words of four bytes
        let words = &mut self.words[..];
        match source {
            Source::Color(_) | Source::LayerColor(_) => unreachable!("done above"),
            Source::Layer(i) | Source::ParticleLayer(i) => {
                for (word, floats) in words.iter_mut().zip(layer(rows, row).chunks(rows.floats)) {
                    *word = floats[i].to_bits().to_le();
                }
            }
            Source::Normal(component) => axis(rows.normal, component, words),
            Source::Position(component) => axis(rows.position, component, words),
            Source::Velocity(component) => axis(rows.velocity, component, words),
            Source::Albedo(component) => axis(rows.albedo, component, words),
            Source::Depth => {
                let depth = &rows.depth.expect(HAS_PLANE)[range];
                copy(depth, words, |z| z.to_bits());
            }
            Source::Id => copy(&rows.id.expect(HAS_PLANE)[range], words, |id| id),
        }
        cast_slice(&self.words)
    }

    /// Converts a colour component to half-floats: to nearest, ties to even, the same on every machine. Clamps values
    /// to the finite range and counts those it has changed.
    fn halves(&mut self, colors: &[[f32; 4]], component: usize) -> &[u8] {
        self.floats.resize(colors.len(), 0.0);
        let floats = &mut self.floats[..];
        let clamped = match component {
            0 => clamp_component::<0>(colors, floats),
            1 => clamp_component::<1>(colors, floats),
            2 => clamp_component::<2>(colors, floats),
            _ => clamp_component::<3>(colors, floats),
        };
        self.clamped += u64::from(clamped);
        self.converted()
    }

    /// Converts float `i` of the layers of each pixel as a colour.
    fn layer_halves(&mut self, layers: &[f32], floats: usize, i: usize) -> &[u8] {
        self.floats.clear();
        self.floats.extend(layers.chunks(floats).map(|pixel| pixel[i]));
        for value in &mut self.floats {
            let fits = value.abs() <= HALF_MAX;
            self.clamped += u64::from(!fits);
            let limited = value.clamp(-HALF_MAX, HALF_MAX);
            *value = if value.is_nan() { 0.0 } else { limited };
        }
        self.converted()
    }

    /// The floats of the line as half-floats.
    fn converted(&mut self) -> &[u8] {
        let bits: &mut [u16] = &mut cast_slice_mut(&mut self.words)[..self.floats.len()];
        let halves: &mut [f16] = bits.reinterpret_cast_mut();
        halves.convert_from_f32_slice(&self.floats);
        for bits in bits.iter_mut() {
            *bits = bits.to_le();
        }
        cast_slice(bits)
    }
}

/// The layers of row `row` of `rows`.
fn layer<'a>(rows: &FilmRows<'a>, row: usize) -> &'a [f32] {
    let width = rows.width as usize * rows.floats;
    &rows.layers.expect(HAS_PLANE)[row * width..(row + 1) * width]
}

const HAS_PLANE: &str = "films have the planes of the layout that was made for them";

/// Copies the bits of `values` to `words`, with the bytes in the order of the file.
fn copy<T: Copy>(values: &[T], words: &mut [u32], bits: impl Fn(T) -> u32) {
    for (word, value) in words.iter_mut().zip(values) {
        *word = bits(*value).to_le();
    }
}

fn copy_axis(vectors: &[[f32; 3]], axis: usize, words: &mut [u32]) {
    match axis {
        0 => copy(vectors, words, |v| v[0].to_bits()),
        1 => copy(vectors, words, |v| v[1].to_bits()),
        _ => copy(vectors, words, |v| v[2].to_bits()),
    }
}

/// Copies component `C` of `colors`, clamped to the finite range of half-floats; NaN becomes 0. Returns the number of
/// values that changed. The loop has no branches, so that the compiler vectorises it.
fn clamp_component<const C: usize>(colors: &[[f32; 4]], floats: &mut [f32]) -> u32 {
    let mut clamped = 0;
    for (float, color) in floats.iter_mut().zip(colors) {
        let value = color[C];
        let fits = value.abs() <= HALF_MAX;
        clamped += u32::from(!fits);
        let limited = value.clamp(-HALF_MAX, HALF_MAX);
        *float = if value.is_nan() { 0.0 } else { limited };
    }
    clamped
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
