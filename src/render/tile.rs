//! The pixels of a tile in the order in which they are sampled.

use super::film::FilmTile;

/// Pixels along a tile's side: enough work to hide the scheduling, small enough to share evenly and for its samples
/// to stay in the cache.
pub(super) const SIDE: u32 = 16;

/// Column and row of each pixel of `tile` along a Z-order curve, so that every aligned square of a power of two is
/// finished before the next one is begun: 16 successive samples lie in 4x4 pixels, or in a smaller square.
pub(super) fn pixels_of(tile: &FilmTile<'_>) -> impl Iterator<Item = (u32, u32)> + use<> {
    let (width, rows) = (tile.width, tile.rows);
    z_order().filter(move |(column, row)| *column < width && *row < rows)
}

fn z_order() -> impl Iterator<Item = (u32, u32)> {
    const { assert!(SIDE == 16, "four bits for each axis") };
    let every_other_bit = |code: u32| (0..4).fold(0, |v, bit| v | (code >> bit & 1 << bit));
    (0..SIDE * SIDE).map(move |code| (every_other_bit(code), every_other_bit(code >> 1)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ray::PACKET_SIZE;

    #[test]
    fn sixteen_places_are_a_square() {
        let places: Vec<_> = z_order().collect();
        for packet in places.chunks(PACKET_SIZE) {
            let (x, y) = packet[0];
            assert_eq!((x % 4, y % 4), (0, 0));
            assert!(packet.iter().all(|(a, b)| a - x < 4 && b - y < 4));
        }
        let mut sorted = places;
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), 256);
    }
}
