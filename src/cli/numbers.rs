//! Numbers on the command line that commands have in common.

/// The bound that coded positions keep if none is given: a fraction of the radius.
pub(super) const USUAL_BOUND: f64 = 0.02;

/// A largest error: 0 or more.
pub(super) fn not_negative(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if value >= 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(format!("`{text}` is no error; 0.02 is one"))
    }
}

/// A radius: above 0.
pub(super) fn positive(text: &str) -> Result<f32, String> {
    let value: f32 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if value > 0.0 && value.is_finite() {
        Ok(value)
    } else {
        Err(format!("`{text}` is no radius"))
    }
}
