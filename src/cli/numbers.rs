//! Parsers of numbers on the command line.

use std::str::FromStr;
use std::time::Duration;

use spherule_formats::ValueError;

/// Default error bound of encoded positions, as a fraction of the radius.
pub(super) const DEFAULT_BOUND: f64 = 0.02;

fn parse<T: FromStr>(text: &str, expected: &str) -> Result<T, ValueError> {
    text.parse().map_err(|_| ValueError::new(expected, text))
}

/// A number of pixels. The manifest checks the range.
fn pixels(text: &str) -> Result<i64, ValueError> {
    parse(text, "a number of pixels, such as 3840")
}

/// An integer in any range.
pub(super) fn whole(text: &str) -> Result<i64, ValueError> {
    parse(text, "a whole number, such as 16")
}

/// A number in any range.
pub(super) fn number(text: &str) -> Result<f64, ValueError> {
    parse(text, "a number, such as 0.5")
}

/// A number of seconds in any range.
pub(super) fn seconds(text: &str) -> Result<f64, ValueError> {
    parse(text, "a number of seconds, such as 90")
}

/// A number of pixels from 1 to `max`.
pub(super) fn pixels_to(
    max: u32,
) -> impl Fn(&str) -> Result<u32, ValueError> + Clone + Send + Sync {
    move |text| {
        let count = u32::try_from(pixels(text)?).ok();
        let in_range = count.filter(|count| (1..=max).contains(count));
        let expected = || format!("a number of pixels from 1 to {max}");
        in_range.ok_or_else(|| ValueError::new(expected(), text))
    }
}

/// An error bound: 0 or more.
pub(super) fn not_negative(text: &str) -> Result<f64, ValueError> {
    let expected = "a number from 0, such as 0.02";
    let value: f64 = parse(text, expected)?;
    let is_valid = value >= 0.0 && value.is_finite();
    is_valid.then_some(value).ok_or_else(|| ValueError::new(expected, text))
}

/// A time in seconds: 0 or more.
pub(super) fn duration(text: &str) -> Result<Duration, ValueError> {
    let expected = "a number of seconds from 0, such as 30";
    let time = Duration::try_from_secs_f64(parse(text, expected)?);
    time.map_err(|_| ValueError::new(expected, text))
}

/// A radius: above 0.
pub(super) fn positive(text: &str) -> Result<f32, ValueError> {
    let expected = "a radius above 0, such as 0.05";
    let value: f32 = parse(text, expected)?;
    let is_valid = value > 0.0 && value.is_finite();
    is_valid.then_some(value).ok_or_else(|| ValueError::new(expected, text))
}
