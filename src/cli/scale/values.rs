//! Parsers of the options of `spherule scale`.

use spherule_formats::ValueError;

use crate::accel::Structure;
use crate::cli::generate;
use crate::manifest::nearest;
use crate::scale::{Motion, Representation};

/// Maximum time per cell in seconds: one day.
const MAX_SECONDS: f64 = 86_400.0;

pub(super) fn particles(text: &str) -> Result<usize, ValueError> {
    let count = generate::count(text)?;
    if u32::try_from(count).is_err() {
        return Err(ValueError::new("fewer than 2^32 particles", text));
    }
    Ok(count)
}

pub(super) fn seconds(text: &str) -> Result<f64, ValueError> {
    let seconds = text.parse().ok();
    seconds
        .filter(|s| *s > 0.0 && *s <= MAX_SECONDS)
        .ok_or_else(|| ValueError::new(format!("seconds above 0, at most {MAX_SECONDS}"), text))
}

pub(super) fn structure(text: &str) -> Result<Structure, ValueError> {
    one_of(&Structure::ALL, Structure::name, text)
}

pub(super) fn motion(text: &str) -> Result<Motion, ValueError> {
    one_of(&Motion::ALL, Motion::name, text)
}

pub(super) fn representation(text: &str) -> Result<Representation, ValueError> {
    one_of(&Representation::ALL, Representation::name, text)
}

fn one_of<T: Copy>(all: &[T], name: fn(T) -> &'static str, text: &str) -> Result<T, ValueError> {
    all.iter().copied().find(|t| name(*t) == text).ok_or_else(|| {
        let known: Vec<&str> = all.iter().copied().map(name).collect();
        ValueError::one_of(&known, text).with_similar(nearest(text, &known))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_names_have_suggestions() {
        assert_eq!(structure("lbvh"), Ok(Structure::Lbvh));
        let wrong = structure("lbhv").unwrap_err().to_string();
        assert!(wrong.ends_with("; did you mean lbvh?"), "{wrong}");
        assert_eq!(
            motion("spiral").unwrap_err().to_string(),
            "expected one of rotation, translation, both, found \"spiral\""
        );
        assert!(representation("").is_err());
    }

    #[test]
    fn times_are_positive_and_finite() {
        assert_eq!(seconds("0.5"), Ok(0.5));
        for wrong in ["0", "-1", "nan", "inf", "1e9", "", "a while"] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
        assert_eq!(particles("1e6"), Ok(1_000_000));
        assert!(particles("4294967296").unwrap_err().expected.contains("2^32"));
    }
}
