//! How long the bonds of atoms are at most, for bonds that no file lists.

/// The greatest lengths of bonds, by the elements of both atoms: the sum of their shares. This crate knows no radii; those
/// who know them make the table.
#[derive(Debug, Clone, PartialEq)]
pub struct BondLengths {
    attribute: String,
    shares: Vec<Option<f64>>,
}

impl BondLengths {
    /// Lengths for atoms with their atomic numbers in `attribute`. `share`: that of an atomic number, in the unit of the
    /// positions; none for atoms without bonds.
    pub fn new(attribute: &str, share: impl FnMut(u8) -> Option<f64>) -> Self {
        let shares = (0..=u8::MAX).map(share).collect();
        Self { attribute: attribute.to_owned(), shares }
    }

    /// The attribute with the atomic numbers.
    pub fn attribute(&self) -> &str {
        &self.attribute
    }

    /// The share of an atom with this atomic number in the lengths of its bonds; none without bonds.
    pub fn share(&self, number: f64) -> Option<f64> {
        let is_index = number.fract() == 0.0 && (0.0..=f64::from(u8::MAX)).contains(&number);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        let share = is_index.then(|| self.shares[number as usize]);
        share.flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_those_of_whole_numbers() {
        let lengths = BondLengths::new("element", |number| (number > 0).then(|| f64::from(number)));
        assert_eq!(lengths.share(8.0), Some(8.0));
        for number in [0.0, 8.5, -1.0, 256.0, f64::NAN, f64::INFINITY] {
            assert_eq!(lengths.share(number), None, "{number}");
        }
    }
}
