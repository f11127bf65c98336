//! What the options of `spherule scale` understand.

use crate::accel::Structure;
use crate::cli::generate;
use crate::manifest::nearest;
use crate::scale::{Motion, Representation};

/// Longest time for a cell: a day.
const MOST_SECONDS: f64 = 86_400.0;

pub(super) fn particles(text: &str) -> Result<usize, String> {
    let count = generate::count(text)?;
    if u32::try_from(count).is_err() {
        return Err(format!(
            "{text} are too many, a tree holds fewer than 2^32 particles"
        ));
    }
    Ok(count)
}

pub(super) fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok();
    seconds
        .filter(|s| *s > 0.0 && *s <= MOST_SECONDS)
        .ok_or_else(|| format!("expected seconds above 0 and up to {MOST_SECONDS}"))
}

pub(super) fn structure(text: &str) -> Result<Structure, String> {
    one_of(&Structure::ALL, Structure::name, text)
}

pub(super) fn motion(text: &str) -> Result<Motion, String> {
    one_of(&Motion::ALL, Motion::name, text)
}

pub(super) fn representation(text: &str) -> Result<Representation, String> {
    one_of(&Representation::ALL, Representation::name, text)
}

fn one_of<T: Copy>(all: &[T], name: fn(T) -> &'static str, text: &str) -> Result<T, String> {
    all.iter()
        .copied()
        .find(|t| name(*t) == text)
        .ok_or_else(|| {
            let known: Vec<&str> = all.iter().copied().map(name).collect();
            let hint = nearest(text, &known).map(|n| format!("; did you mean {n}?"));
            let hint = hint.unwrap_or_default();
            format!("expected one of {}{hint}", known.join(", "))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_known_or_guessed() {
        assert_eq!(structure("lbvh"), Ok(Structure::Lbvh));
        let wrong = structure("lbhv").unwrap_err();
        assert!(wrong.ends_with("; did you mean lbvh?"), "{wrong}");
        assert_eq!(
            motion("spiral").unwrap_err(),
            "expected one of rotation, translation, both"
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
        assert!(particles("4294967296").unwrap_err().contains("2^32"));
    }
}
