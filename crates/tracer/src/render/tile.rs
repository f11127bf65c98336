//! Tiles of an image, and the sampling order of their pixels.

use super::film::FilmTile;

/// Edge of a tile in pixels: large enough to hide the cost of scheduling, and small enough for even distribution and
/// for its samples to stay in the cache.
pub(super) const SIDE: u32 = 16;

/// Where the tile at `start` of a mosaic of `length` pixels begins in the full image: it is centred in its equal
/// share of the `full` pixels, but moved if it would extend beyond the image.
pub(super) fn mosaic_start(start: u32, length: u32, full: u32) -> u32 {
    let (number, count) = (u64::from(start / SIDE), u64::from(length.div_ceil(SIDE)));
    let exact = (2 * number + 1) * u64::from(full) / (2 * count);
    let middle = u32::try_from(exact).unwrap_or(full);
    middle.saturating_sub(SIDE / 2).min(full.saturating_sub(SIDE))
}

/// Column and row of each pixel of `tile` along a Z-order curve. Every aligned square with a power of two as its edge
/// is finished before the next one begins, so 16 consecutive samples are in 4x4 pixels or in a smaller square.
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
    use spherule_tree::ray::PACKET_SIZE;

    #[test]
    fn tiles_of_a_mosaic_lie_within_the_image() {
        let starts = |length, full| {
            let starts = (0..length).step_by(SIDE as usize);
            let all: Vec<_> = starts.map(|at| mosaic_start(at, length, full)).collect();
            all
        };
        assert_eq!(starts(48, 192), [24, 88, 152]);
        assert_eq!(starts(40, 48), [0, 16, 32]);
        assert_eq!(starts(7, 7), [0]);
        assert_eq!(starts(32, 18), [0, 2]);
    }

    #[test]
    fn sixteen_positions_form_a_square() {
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
