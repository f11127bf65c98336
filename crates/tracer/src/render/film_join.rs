//! Joins two passes of a tile with different random numbers to one picture.

use bytemuck::{cast_slice, cast_slice_mut};

use super::cryptomatte::rank;
use super::film::{FilmTile, PerPlane, Rows};
use super::planes::FilmPlane;

/// The planes of a tile after a pass, row by row.
pub(super) struct TilePass {
    color: Vec<[f32; 4]>,
    odd: Vec<[f32; 4]>,
    planes: PerPlane<Vec<u32>>,
}

impl FilmTile<'_> {
    /// What is in the tile now.
    pub(super) fn pass(&self) -> TilePass {
        TilePass {
            color: all_of(&self.color),
            odd: self.odd.as_ref().map(all_of).unwrap_or_default(),
            planes: std::array::from_fn(|plane| all_of(&self.planes[plane])),
        }
    }

    /// Makes the tile, which has a later pass, the picture of both passes. `share` is that of the `earlier` one in the
    /// samples. The data of the nearest sample are those of the earlier pass.
    pub(super) fn join(&mut self, earlier: &TilePass, share: f32) {
        let mix = |later: &mut f32, earlier: &f32| *later += share * (earlier - *later);
        let mix_all = |rows: &mut Rows<'_, [f32; 4]>, earlier: &[[f32; 4]]| {
            let later = rows.iter_mut().flat_map(|row| row.iter_mut());
            for (later, earlier) in later.zip(earlier) {
                later.iter_mut().zip(earlier).for_each(|(later, earlier)| mix(later, earlier));
            }
        };
        mix_all(&mut self.color, &earlier.color);
        if let Some(odd) = &mut self.odd {
            mix_all(odd, &earlier.odd);
        }
        let mut covered = Vec::new();
        for plane in FilmPlane::all() {
            let (number, size) = (plane as usize, self.sizes[plane as usize]);
            let later = self.planes[number].iter_mut().flat_map(|row| row.chunks_mut(size.max(1)));
            for (later, earlier) in later.zip(earlier.planes[number].chunks(size.max(1))) {
                if plane.is_from_nearest() {
                    later.copy_from_slice(earlier);
                    continue;
                }
                let (later, earlier): (&mut [f32], &[f32]) =
                    (cast_slice_mut(later), cast_slice(earlier));
                if plane.is_matte() {
                    covered.clear();
                    add_objects(&mut covered, earlier, share);
                    add_objects(&mut covered, later, 1.0 - share);
                    rank(&mut covered, 1.0, later);
                } else {
                    later.iter_mut().zip(earlier).for_each(|(later, earlier)| mix(later, earlier));
                }
            }
        }
    }
}

/// Adds the objects of a pixel of a Cryptomatte plane with a part of their coverage.
fn add_objects(covered: &mut Vec<(u32, f32)>, ranks: &[f32], share: f32) {
    let used = ranks.as_chunks::<2>().0.iter().filter(|[_, coverage]| *coverage > 0.0);
    covered.extend(used.map(|[object, coverage]| (object.to_bits(), share * coverage)));
}

fn all_of<T: Copy>(rows: &Rows<'_, T>) -> Vec<T> {
    rows.iter().flat_map(|row| row.iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::aov::DataSample;
    use crate::render::channels::Channels;
    use crate::render::film::Film;

    /// A film of a pixel with these values.
    fn film(value: f32, id: u32, objects: [f32; 4]) -> Film {
        let channels = Channels::from_names(["RGBA", "Z", "id", "noisy", "crypto_part"]).unwrap();
        let mut film = Film::default();
        film.fit(1, 1, channels, true);
        let mut bands = film.bands_mut(1);
        let tile = &mut bands[0].tiles(1)[0];
        tile.set_color(0, 0, [value, 0.0, 0.0, 1.0]);
        tile.set_odd(0, 0, [2.0 * value, 0.0, 0.0, 1.0]);
        tile.set_data(0, 0, &DataSample { id, z: value, ..DataSample::MISS });
        tile.components_mut(FilmPlane::Noisy, 0, 0).fill(value);
        tile.components_mut(FilmPlane::CryptoPart, 0, 0)[..4].copy_from_slice(&objects);
        drop(bands);
        film
    }

    #[test]
    fn passes_are_joined_by_their_samples() {
        let [a, b, c] = [7, 8, 9].map(f32::from_bits);
        let mut earlier = film(1.0, 5, [a, 0.6, b, 0.4]);
        let mut later = film(3.0, 6, [c, 0.8, b, 0.2]);
        let pass = earlier.bands_mut(1)[0].tiles(1)[0].pass();
        later.bands_mut(1)[0].tiles(1)[0].join(&pass, 0.25);
        assert_eq!(later.color, [[2.5, 0.0, 0.0, 1.0]]);
        assert_eq!(later.odd.as_ref().unwrap()[0][0], 5.0);
        assert_eq!(later.plane::<f32>(FilmPlane::Noisy).unwrap(), [2.5; 3]);
        assert_eq!(later.plane::<f32>(FilmPlane::Depth).unwrap(), [1.0]);
        assert_eq!(later.plane::<u32>(FilmPlane::Id).unwrap(), [5]);
        let ranks = later.plane::<f32>(FilmPlane::CryptoPart).unwrap();
        let found: Vec<_> = ranks.chunks(2).map(|rank| (rank[0].to_bits(), rank[1])).collect();
        let expected = [(9, 0.6), (8, 0.25), (7, 0.15)];
        for ((object, coverage), (to, of)) in found.iter().zip(expected) {
            assert!(*object == to && (coverage - of).abs() < 1e-6, "{found:?}");
        }
        assert_eq!(found[3], (0, 0.0));
    }
}
