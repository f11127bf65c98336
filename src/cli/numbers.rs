//! Parsers of numbers on the command line. They return text, as clap expects.

use std::time::Duration;

/// Default error bound of encoded positions, as a fraction of the radius.
pub(super) const DEFAULT_BOUND: f64 = 0.02;

/// A number of pixels. The manifest checks the range.
pub(super) fn pixels(text: &str) -> Result<i64, String> {
    text.parse()
        .map_err(|_| "expected a number of pixels, such as --width 3840 --height 2160".to_owned())
}

/// A whole number in any range.
pub(super) fn whole(text: &str) -> Result<i64, String> {
    text.parse()
        .map_err(|_| "expected a whole number, such as 16".to_owned())
}

/// A number in any range.
pub(super) fn number(text: &str) -> Result<f64, String> {
    text.parse()
        .map_err(|_| "expected a number, such as 0.5".to_owned())
}

/// A number of seconds in any range.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    text.parse()
        .map_err(|_| "expected seconds as a number, such as 90 for a minute and a half".to_owned())
}

/// A number of pixels from 1 to `max`.
pub(super) fn pixels_to(max: u32) -> impl Fn(&str) -> Result<u32, String> + Clone + Send + Sync {
    move |text| {
        let count = pixels(text)?;
        let fitting = u32::try_from(count).ok().filter(|c| (1..=max).contains(c));
        fitting.ok_or_else(|| format!("{count} is not in 1..={max}"))
    }
}

/// An error bound: 0 or more.
pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    let value: f64 = text
        .parse()
        .map_err(|_| format!("`{text}` is not a number"))?;
    if value >= 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(format!("`{text}` is not an error bound (example: 0.02)"))
    }
}

/// A time in seconds: 0 or more.
pub(super) fn duration(text: &str) -> Result<Duration, String> {
    let time = text.parse().ok();
    let time = time.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    time.ok_or_else(|| format!("`{text}` is not a time in seconds (example: 30)"))
}

/// A radius: above 0.
pub(super) fn positive(text: &str) -> Result<f32, String> {
    let value: f32 = text
        .parse()
        .map_err(|_| format!("`{text}` is not a number"))?;
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(format!("`{text}` is not a radius; it must be above 0"))
    }
}
