//! Radii by an integer value: published ones of chemical elements, by atomic number, and tables that users write.

/// Radii by an integer value of particles.
#[derive(Debug, Clone, PartialEq)]
pub enum RadiusTable {
    /// Van der Waals radii of elements, angstroms.
    VanDerWaals,
    /// Covalent radii of elements, angstroms.
    Covalent,
    /// These radii by value, rising, in the unit of the positions.
    Values(Vec<(i64, f64)>),
}

/// Radius of particles that are no element, or one without a published radius, angstroms.
const OTHER_RADIUS: f64 = 1.0;

impl RadiusTable {
    /// Whether the radii are those of elements, in angstroms.
    pub const fn is_of_elements(&self) -> bool {
        !matches!(self, Self::Values(_))
    }

    /// The radius of particles with this value, if the table has one.
    pub fn radius(&self, value: f64) -> Option<f64> {
        if value.fract() != 0.0 {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, reason = "an integer, or saturated")]
        let value = value as i64;
        match self {
            Self::VanDerWaals => published(&VAN_DER_WAALS, value),
            Self::Covalent => published(&COVALENT, value),
            Self::Values(values) => {
                let found = values.binary_search_by_key(&value, |(known, _)| *known);
                found.ok().map(|index| values[index].1)
            }
        }
    }

    /// The radius of particles whose value is not in the table; none in tables of users.
    pub fn other_radius(&self) -> Option<f64> {
        self.is_of_elements().then_some(OTHER_RADIUS)
    }
}

/// The radius of an element in angstroms, from a table in pm.
fn published(table: &[u16], number: i64) -> Option<f64> {
    let index = usize::try_from(number.checked_sub(1)?).ok()?;
    let radius = table.get(index).filter(|radius| **radius > 0)?;
    Some(f64::from(*radius) / 100.0)
}

/// Covalent radii by atomic number from 1, pm: Cordero and others, "Covalent radii revisited", Dalton Transactions, 2008.
/// Carbon is that of single bonds (sp3); manganese, iron and cobalt have a low spin.
const COVALENT: [u16; 96] = [
    31, 28, 128, 96, 84, 76, 71, 66, 57, 58, 166, 141, 121, 111, 107, 105, 102, 106, 203, 176, 170,
    160, 153, 139, 139, 132, 126, 124, 132, 122, 122, 120, 119, 120, 120, 116, 220, 195, 190, 175,
    164, 154, 147, 146, 142, 139, 145, 144, 142, 139, 139, 138, 139, 140, 244, 215, 207, 204, 203,
    201, 199, 198, 198, 196, 194, 192, 192, 189, 190, 187, 187, 175, 170, 162, 151, 144, 141, 136,
    136, 132, 145, 146, 148, 140, 150, 150, 260, 221, 215, 206, 200, 196, 190, 187, 180, 169,
];

/// Van der Waals radii by atomic number from 1, pm; 0 where there is none. Those of Bondi, "Van der Waals volumes and
/// radii", J. Phys. Chem. 68, 1964, and for elements without one there those of Alvarez, "A cartography of the van der
/// Waals territories", Dalton Transactions 42, 2013.
const VAN_DER_WAALS: [u16; 99] = [
    120, 140, 182, 198, 191, 170, 155, 152, 147, 154, 227, 173, 225, 210, 180, 180, 175, 188, 275,
    262, 258, 246, 242, 245, 245, 244, 240, 163, 140, 139, 187, 229, 185, 190, 185, 202, 321, 284,
    275, 252, 256, 245, 244, 246, 244, 163, 172, 158, 193, 217, 247, 206, 198, 216, 348, 303, 298,
    288, 292, 295, 0, 290, 287, 283, 279, 287, 281, 283, 279, 280, 274, 263, 253, 257, 249, 248,
    241, 172, 166, 155, 196, 202, 254, 0, 0, 0, 0, 0, 280, 293, 288, 186, 282, 281, 283, 305, 340,
    305, 270,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn radii_are_the_published_ones() {
        for (number, covalent, van_der_waals) in [
            (1.0, Some(0.31), Some(1.20)),
            (6.0, Some(0.76), Some(1.70)),
            (8.0, Some(0.66), Some(1.52)),
            (11.0, Some(1.66), Some(2.27)),
            (20.0, Some(1.76), Some(2.62)),
            (26.0, Some(1.32), Some(2.44)),
            (79.0, Some(1.36), Some(1.66)),
            (96.0, Some(1.69), Some(3.05)),
            (99.0, None, Some(2.70)),
            (61.0, Some(1.99), None),
            (0.0, None, None),
            (6.5, None, None),
            (-1.0, None, None),
            (1000.0, None, None),
            (f64::NAN, None, None),
            (f64::NEG_INFINITY, None, None),
        ] {
            assert_eq!(RadiusTable::Covalent.radius(number), covalent, "{number}");
            assert_eq!(RadiusTable::VanDerWaals.radius(number), van_der_waals, "{number}");
        }
    }

    #[test]
    fn users_have_radii_by_value() {
        let table = RadiusTable::Values(vec![(-2, 0.5), (1, 0.7)]);
        assert_eq!(table.radius(-2.0), Some(0.5));
        assert_eq!(table.radius(1.0), Some(0.7));
        assert_eq!(table.radius(0.0), None);
        assert_eq!(table.other_radius(), None);
    }
}
