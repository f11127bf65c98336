//! From a numeric array to positions, without a second copy for the two common types.

use bytemuck::allocation::try_cast_vec;
use glam::{DVec3, Vec3};

use spherule_frame::{AttributeData, Positions};

/// Groups `data` (three numbers per particle; a rest is dropped) into positions: single precision
/// where that is exact (floats and integers of up to 16 bits), double for everything wider.
pub(in crate::read) fn positions(data: AttributeData) -> Positions {
    match data {
        AttributeData::F32(v) => Positions::F32(match try_cast_vec(v) {
            Ok(points) => points,
            Err((_, v)) => v.as_chunks().0.iter().map(|p| Vec3::from_array(*p)).collect(),
        }),
        AttributeData::F64(v) => Positions::F64(match try_cast_vec(v) {
            Ok(points) => points,
            Err((_, v)) => v.as_chunks().0.iter().map(|p| DVec3::from_array(*p)).collect(),
        }),
        AttributeData::I8(v) => narrow(&v),
        AttributeData::U8(v) => narrow(&v),
        AttributeData::I16(v) => narrow(&v),
        AttributeData::U16(v) => narrow(&v),
        AttributeData::I32(v) => wide(&v, f64::from),
        AttributeData::U32(v) => wide(&v, f64::from),
        #[expect(clippy::cast_precision_loss, reason = "no wider type to keep it in")]
        AttributeData::I64(v) => wide(&v, |x| x as f64),
        #[expect(clippy::cast_precision_loss, reason = "no wider type to keep it in")]
        AttributeData::U64(v) => wide(&v, |x| x as f64),
    }
}

fn narrow<T: Copy + Into<f32>>(values: &[T]) -> Positions {
    let points = values.as_chunks().0.iter();
    Positions::F32(points.map(|p: &[T; 3]| Vec3::from_array(p.map(Into::into))).collect())
}

fn wide<T: Copy>(values: &[T], to: impl Fn(T) -> f64) -> Positions {
    let points = values.as_chunks().0.iter();
    Positions::F64(points.map(|p: &[T; 3]| DVec3::from_array(p.map(&to))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn precision_follows_the_stored_type() {
        let three = positions(AttributeData::F32(vec![1.0, 2.0, 3.0]));
        assert_eq!(three, Positions::F32(vec![Vec3::new(1.0, 2.0, 3.0)]));
        let short = positions(AttributeData::I16(vec![-1, 2, 3]));
        assert_eq!(short, Positions::F32(vec![Vec3::new(-1.0, 2.0, 3.0)]));
        let int = positions(AttributeData::I32(vec![i32::MAX, 2, 3]));
        assert_eq!(int.get(0).x, f64::from(i32::MAX));
        let mut spare = Vec::with_capacity(7);
        spare.extend([1.0_f64, 2.0, 3.0]);
        assert_eq!(positions(AttributeData::F64(spare)).len(), 1);
    }
}
