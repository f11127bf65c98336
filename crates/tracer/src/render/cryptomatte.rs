//! Cryptomatte: objects by the hash of their name, and how much of each pixel they cover (Friedman and Jones, "Fully
//! automatic ID mattes with support for motion blur and transparency", 2015; specification 1.2.0).
//!
//! A layer has for each pixel a list of objects and their coverage, sorted by coverage. The coverage is the fraction of
//! the pixel's samples whose first surface is of the object: a box filter of one pixel. The number of names does not
//! matter, because a pixel holds hashes only.

use std::io::Write as _;

use crate::scene::Owner;

/// Name of the ground, in every kind of layer.
const GROUND: &str = "ground";
/// Name of the material of the particles, and of particles without a part.
pub const PARTICLES: &str = "particles";
/// Name of the material of foam and spray.
const SPRAY: &str = "spray";

/// MurmurHash3 by Appleby, `x86_32` with seed 0.
pub fn murmur_hash3(key: &[u8]) -> u32 {
    const FIRST: u32 = 0xcc9e_2d51;
    const SECOND: u32 = 0x1b87_3593;
    let scramble = |word: u32| {
        let word = word.wrapping_mul(FIRST);
        word.rotate_left(15).wrapping_mul(SECOND)
    };
    // Mix whole words
    let (words, tail) = key.as_chunks::<4>();
    let mut hash = 0_u32;
    for word in words {
        hash ^= scramble(u32::from_le_bytes(*word));
        hash = hash.rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    // Mix the bytes after them
    let mut last = [0; 4];
    last[..tail.len()].copy_from_slice(tail);
    hash ^= scramble(u32::from_le_bytes(last));
    // Finish; the length counts modulo 2^32
    #[expect(clippy::cast_possible_truncation, reason = "as in the definition")]
    let len = key.len() as u32;
    hash ^= len;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

/// The hash of an object's name, changed so that its bits are a finite, normal float. Never 0.
pub fn object_of(name: &[u8]) -> u32 {
    let hash = murmur_hash3(name);
    match hash >> 23 & 0xff {
        0 | 0xff => hash ^ 1 << 23,
        _ => hash,
    }
}

/// A short name on the stack.
#[derive(Debug, Clone, Copy)]
pub struct ObjectName {
    bytes: [u8; 32],
    len: usize,
}

impl ObjectName {
    /// The name of the particle with `id`: `p17`.
    pub fn of_particle(id: u32) -> Self {
        Self::of(format_args!("p{id}"))
    }

    /// The name of the particles whose attribute has `value`: `type2`.
    pub fn of_part(attribute: &str, value: i32) -> Self {
        Self::of(format_args!("{attribute}{value}"))
    }

    /// The name of all surfaces with a material of this owner: `mesh0` for meshes and rods `material0` for parts of
    /// the particles and `style0` for their styles, numbered in the order of the manifest.
    pub fn of_owner(owner: Owner) -> Self {
        match owner {
            Owner::Particles => Self::of(format_args!("{PARTICLES}")),
            Owner::Spray => Self::of(format_args!("{SPRAY}")),
            Owner::Ground => Self::of(format_args!("{GROUND}")),
            Owner::Part(number) => Self::of(format_args!("material{number}")),
            Owner::Style(number) => Self::of(format_args!("style{number}")),
            Owner::Thing(number) => Self::of(format_args!("mesh{number}")),
        }
    }

    /// Longer names are cut.
    fn of(text: std::fmt::Arguments<'_>) -> Self {
        let mut bytes = [0; 32];
        let mut rest = &mut bytes[..];
        let _ = rest.write_fmt(text);
        let len = 32 - rest.len();
        Self { bytes, len }
    }

    /// Its bytes.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

/// Writes the objects of a pixel with their coverage to `ranks`, the greatest coverage first, and then the lowest hash.
/// Unused ranks get zeros. `samples` has the object and the coverage of each sample that has one; it is changed.
pub(super) fn rank(samples: &mut Vec<(u32, f32)>, share: f32, ranks: &mut [f32]) {
    // Add up the coverage of each object; a stable sort keeps the order of the sums
    samples.sort_by_key(|(object, _)| *object);
    samples.dedup_by(|next, sum| {
        let is_same = next.0 == sum.0;
        if is_same {
            sum.1 += next.1;
        }
        is_same
    });
    samples.retain(|(_, coverage)| *coverage > 0.0);
    samples.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    // Store the first ones
    ranks.fill(0.0);
    for ([object, coverage], found) in ranks.as_chunks_mut::<2>().0.iter_mut().zip(samples) {
        *object = f32::from_bits(found.0);
        *coverage = found.1 * share;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hashes_are_those_of_the_published_vectors() {
        for (key, hash) in [
            ("", 0),
            ("a", 0x3c25_69b2),
            ("aaaa", 0x7eee_d987),
            ("hello", 0x248b_fa47),
            ("hello, world", 0x149b_bb7f),
            ("test", 0xba6b_d213),
            ("Hello, world!", 0xc036_3e43),
            ("The quick brown fox jumps over the lazy dog", 0x2e4f_f723),
        ] {
            assert_eq!(murmur_hash3(key.as_bytes()), hash, "{key}");
        }
        // Examples of manifests in the specification
        for (name, object) in [("default", 0x42c9_679f_u32), ("bunny", 0x1385_1a76)] {
            assert_eq!(object_of(name.as_bytes()), object, "{name}");
        }
    }

    #[test]
    fn objects_are_normal_floats() {
        for id in 0..200_000 {
            let object = object_of(ObjectName::of_particle(id).as_bytes());
            assert!(f32::from_bits(object).is_normal(), "{id}");
        }
        // Without the change, one name in 128 would not be
        let hash = |id| murmur_hash3(ObjectName::of_particle(id).as_bytes());
        assert!((0..200_000).any(|id| !f32::from_bits(hash(id)).is_normal()));
    }

    #[test]
    fn names_are_written_in_full() {
        let name = ObjectName::of_particle(u32::MAX);
        assert_eq!(name.as_bytes(), b"p4294967295");
        let name = ObjectName::of_part("phase", i32::MIN);
        assert_eq!(name.as_bytes(), b"phase-2147483648");
    }

    #[test]
    fn objects_are_ranked_by_coverage_and_then_by_hash() {
        let mut samples = vec![(7, 1.0), (9, 0.5), (3, 1.0), (7, 1.0), (9, 0.5), (4, 0.0)];
        let mut ranks = [9.0; 8];
        rank(&mut samples, 0.25, &mut ranks);
        let objects: Vec<_> = ranks.chunks(2).map(|r| (r[0].to_bits(), r[1])).collect();
        assert_eq!(objects, [(7, 0.5), (3, 0.25), (9, 0.25), (0, 0.0)]);
        // Objects beyond the last level are left out
        let mut samples = vec![(1, 1.0), (2, 3.0), (3, 2.0)];
        let mut ranks = [9.0; 4];
        rank(&mut samples, 1.0, &mut ranks);
        assert_eq!([ranks[1], ranks[3]], [3.0, 2.0]);
    }
}
