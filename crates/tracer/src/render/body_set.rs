//! Sets of connected transmissive bodies that a point is inside.

/// Maximum number of connected transmissive bodies of a scene.
pub const MAX_TRANSMISSIVE_BODIES: usize = u8::BITS as usize;

/// The medium of points outside all bodies.
pub(super) const AIR: usize = MAX_TRANSMISSIVE_BODIES;

/// A set of bodies, one bit each; the first body has the highest priority.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct BodySet(u8);

impl BodySet {
    pub(super) const EMPTY: Self = Self(0);

    /// The set of one body.
    pub(super) const fn of(body: usize) -> Self {
        Self(1 << body)
    }

    pub(super) const fn is_empty(self) -> bool {
        self.0 == 0
    }

    pub(super) const fn contains(self, body: usize) -> bool {
        self.0 >> body & 1 == 1
    }

    /// The set behind the surfaces of the bodies in `crossed`.
    pub(super) const fn across(self, crossed: Self) -> Self {
        Self(self.0 ^ crossed.0)
    }

    /// The set without `body`.
    pub(super) const fn without(self, body: usize) -> Self {
        Self(self.0 & !(1 << body))
    }

    /// The body whose medium fills a point inside the bodies of the set: the one with the highest priority; [`AIR`] outside
    /// all bodies.
    pub(super) const fn medium(self) -> usize {
        self.0.trailing_zeros() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_body_fills_a_point() {
        assert_eq!(BodySet::EMPTY.medium(), AIR);
        let last = BodySet::of(MAX_TRANSMISSIVE_BODIES - 1);
        let both = last.across(BodySet::of(2));
        assert_eq!([last, both, both.without(2)].map(BodySet::medium), [7, 2, 7]);
        assert_eq!(both.across(BodySet::of(2)), last);
        assert!(both.contains(2) && !last.contains(2) && !last.is_empty());
    }
}
