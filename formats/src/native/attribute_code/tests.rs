//! Codes of a few values by hand, and of any values against reading them back.

use proptest::prelude::*;

use super::*;

fn f32s(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Values as they are read back, and the error.
fn coded(
    stored: StoredType,
    ranges: &[[f64; 2]],
    scalar: ScalarType,
    values: &[u8],
) -> (Vec<f64>, f64) {
    let mut out = vec![7];
    let error = encode_run(stored, ranges, scalar, values, &mut out);
    assert_eq!(out[0], 7, "a run is appended");
    let range = |place: usize| {
        let component = place % ranges.len().max(1);
        ranges.get(component).copied().unwrap_or_default()
    };
    let codes = out[1..].chunks_exact(stored.size()).enumerate();
    let read = codes.map(|(place, code)| stored.value(code, range(place)));
    (read.collect(), error)
}

#[test]
fn half_precision_rounds_to_eleven_bits() {
    let values = f32s(&[1.0, -0.5, 2049.0, 0.0]);
    let (read, error) = coded(StoredType::Half, &[], ScalarType::F32, &values);
    assert_eq!(read, [1.0, -0.5, 2048.0, 0.0]);
    assert_eq!(error, 1.0);
}

#[test]
fn half_precision_keeps_what_is_no_number() {
    let values = f32s(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY]);
    let (read, error) = coded(StoredType::Half, &[], ScalarType::F32, &values);
    assert!(read[0].is_nan() && read[1] == f64::INFINITY && read[2] == f64::NEG_INFINITY);
    assert_eq!(error, 0.0);
}

#[test]
fn values_beyond_half_precision_are_an_error() {
    let values = f32s(&[70_000.0]);
    let (_, error) = coded(StoredType::Half, &[], ScalarType::F32, &values);
    let told = check_error("density", StoredType::Half, error).expect_err("too large");
    assert_eq!(
        told.to_string(),
        "attribute density has values that do not fit f16, whose largest number is 65504; store it as it is"
    );
    assert!(check_error("density", StoredType::Half, 0.5).is_ok());
}

#[test]
fn each_component_has_its_range() {
    let values = f32s(&[0.0, -1.0, 255.0, 1.0, 100.3, 0.0]);
    let ranges = ValueRanges::of_run(2, ScalarType::F32, &values);
    let ranges = ranges.finish("v").expect("finite");
    assert_eq!(ranges, [[0.0, 255.0], [-1.0, 1.0]]);
    let (read, error) = coded(StoredType::Ranged, &ranges, ScalarType::F32, &values);
    assert_eq!(read[..5], [0.0, -1.0, 255.0, 1.0, 100.0]);
    assert!(
        (error - f64::from(100.3_f32) + 100.0).abs() < 1e-12,
        "{error}"
    );
}

#[test]
fn ranges_of_nothing_and_of_one_value() {
    let none = ValueRanges::none(2).finish("v").expect("nothing to refuse");
    assert_eq!(none, [[0.0; 2]; 2]);
    let one = ValueRanges::of_run(1, ScalarType::U8, &[9, 9]);
    let ranges = one.finish("v").expect("finite");
    assert_eq!(
        coded(StoredType::Ranged, &ranges, ScalarType::U8, &[9, 9]),
        (vec![9.0; 2], 0.0)
    );
}

#[test]
fn eight_bits_refuse_what_is_no_number() {
    for bad in [f32::NAN, f32::INFINITY] {
        let first = ValueRanges::of_run(1, ScalarType::F32, &f32s(&[1.0, bad]));
        let both = ValueRanges::of_run(1, ScalarType::F32, &f32s(&[1.0])).join(first);
        let told = both.finish("density").expect_err("not finite").to_string();
        assert!(
            told.starts_with("attribute density has values that are not finite"),
            "{told}"
        );
        let coded = coded(
            StoredType::Ranged,
            &[[0.0, 1.0]],
            ScalarType::F32,
            &f32s(&[bad]),
        );
        assert_eq!(coded.1, f64::INFINITY);
    }
}

#[test]
fn a_range_beyond_single_precision_is_an_error() {
    let values: Vec<u8> = [-1e300_f64, 1e300]
        .iter()
        .flat_map(|v| v.to_le_bytes())
        .collect();
    let ranges = ValueRanges::of_run(1, ScalarType::F64, &values);
    let ranges = ranges.finish("v").expect("finite");
    let (_, error) = coded(StoredType::Ranged, &ranges, ScalarType::F64, &values);
    assert!(check_error("v", StoredType::Ranged, error).is_err());
}

#[test]
fn integers_beyond_doubles_count_their_rounding() {
    let odd = (1_i64 << 60) + 1;
    let ranges = ValueRanges::of_run(1, ScalarType::I64, &odd.to_le_bytes());
    let ranges = ranges.finish("v").expect("finite");
    let (_, error) = coded(
        StoredType::Ranged,
        &ranges,
        ScalarType::I64,
        &odd.to_le_bytes(),
    );
    assert_eq!(error, 1.0);
}

#[test]
fn ids_are_not_coded() {
    for name in ["id", "ID", "Idp", "ids"] {
        for code in [AttributeCode::Half, AttributeCode::Ranged] {
            assert!(code.stored(name, ScalarType::U32).is_err(), "{name}");
        }
        let exact = AttributeCode::Exact.stored(name, ScalarType::U32);
        assert_eq!(
            exact.expect("as they are"),
            StoredType::Plain(ScalarType::U32)
        );
    }
    let half = AttributeCode::Half.stored("velocity", ScalarType::F32);
    assert_eq!(half.expect("no id"), StoredType::Half);
}

proptest! {
    #[test]
    fn what_is_read_back_is_within_the_error(
        values in prop::collection::vec(-1e4_f32..1e4, 0..100),
        components in 1_usize..4,
    ) {
        let whole = values.len() / components * components;
        let values = &values[..whole];
        let bytes = f32s(values);
        let ranges = ValueRanges::of_run(components, ScalarType::F32, &bytes);
        let ranges = ranges.finish("v").expect("finite");
        for stored in [StoredType::Half, StoredType::Ranged] {
            let (read, error) = coded(stored, &ranges, ScalarType::F32, &bytes);
            prop_assert_eq!(read.len(), values.len());
            for (value, read) in values.iter().zip(read) {
                prop_assert!((f64::from(*value) - read).abs() <= error);
            }
            let widest = ranges.iter().map(|r| r[1] - r[0]).fold(0.0, f64::max);
            let most = match stored {
                StoredType::Ranged => widest / 510.0 + 1e-3,
                _ => 4.0,
            };
            prop_assert!(error <= most, "{} of {}", error, most);
        }
    }

    #[test]
    fn runs_are_coded_alike_however_they_are_cut(
        values in prop::collection::vec(-1e4_f32..1e4, 30_000..30_003),
        cut in 0_usize..10_000,
    ) {
        let bytes = f32s(&values[..30_000]);
        let (first, second) = bytes.split_at(cut * 12);
        let whole = ValueRanges::of_run(3, ScalarType::F32, &bytes);
        let parts = [first, second].map(|run| ValueRanges::of_run(3, ScalarType::F32, run));
        prop_assert_eq!(&whole, &parts.into_iter().reduce(ValueRanges::join).expect("two"));
        let ranges = whole.finish("v").expect("finite");
        let (mut all, mut pieces) = (Vec::new(), Vec::new());
        let scalar = ScalarType::F32;
        let error = encode_run(StoredType::Ranged, &ranges, scalar, &bytes, &mut all);
        let errors = [first, second]
            .map(|run| encode_run(StoredType::Ranged, &ranges, scalar, run, &mut pieces));
        prop_assert_eq!(all, pieces);
        prop_assert_eq!(error, errors[0].max(errors[1]));
    }
}
