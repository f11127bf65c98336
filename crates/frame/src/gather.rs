//! Copies or keeps the values of chosen particles.
//!
//! Loops run over bytes, so that they are compiled for sizes of groups and not for every type of number.

use bytemuck::Pod;
use rayon::prelude::*;

/// Particles of one task.
const TASK: usize = 4096;

/// The groups of `components` items with these indices, in the order of the indices.
///
/// # Panics
/// If there is no group with one of the indices.
pub fn gather<T: Pod>(items: &[T], components: usize, indices: &[u32]) -> Vec<T> {
    let mut gathered: Vec<T> = bytemuck::zeroed_vec(indices.len() * components);
    gather_bytes(
        bytemuck::cast_slice(items),
        components * size_of::<T>(),
        indices,
        bytemuck::cast_slice_mut(&mut gathered),
    );
    gathered
}

/// Copies the groups of `size` bytes with these indices into `to`.
fn gather_bytes(from: &[u8], size: usize, indices: &[u32], to: &mut [u8]) {
    if size == 0 {
        return;
    }
    let tasks = to.par_chunks_mut(TASK * size);
    tasks.zip(indices.par_chunks(TASK)).for_each(|(to, indices)| match size {
        1 => copy::<1>(from, indices, to),
        2 => copy::<2>(from, indices, to),
        4 => copy::<4>(from, indices, to),
        8 => copy::<8>(from, indices, to),
        12 => copy::<12>(from, indices, to),
        16 => copy::<16>(from, indices, to),
        24 => copy::<24>(from, indices, to),
        _ => {
            for (to, index) in to.chunks_exact_mut(size).zip(indices) {
                to.copy_from_slice(&from[*index as usize * size..][..size]);
            }
        }
    });
}

/// Keeps the groups of `components` items with these indices, which are ascending. Groups move within the array: the
/// pages of a new one would cost more time.
///
/// # Panics
/// If there is no group with one of the indices.
pub fn keep<T: Pod>(items: &mut Vec<T>, components: usize, indices: &[u32]) {
    keep_bytes(bytemuck::cast_slice_mut(items), components * size_of::<T>(), indices);
    items.truncate(indices.len() * components);
    items.shrink_to_fit();
}

fn keep_bytes(items: &mut [u8], size: usize, indices: &[u32]) {
    match size {
        1 => move_down::<1>(items, indices),
        2 => move_down::<2>(items, indices),
        4 => move_down::<4>(items, indices),
        8 => move_down::<8>(items, indices),
        12 => move_down::<12>(items, indices),
        16 => move_down::<16>(items, indices),
        24 => move_down::<24>(items, indices),
        _ => {
            for (to, from) in indices.iter().enumerate() {
                let from = *from as usize * size;
                items.copy_within(from..from + size, to * size);
            }
        }
    }
}

fn move_down<const SIZE: usize>(items: &mut [u8], indices: &[u32]) {
    let groups = items.as_chunks_mut::<SIZE>().0;
    for (to, from) in indices.iter().enumerate() {
        groups[to] = groups[*from as usize];
    }
}

fn copy<const SIZE: usize>(from: &[u8], indices: &[u32], to: &mut [u8]) {
    let groups = from.as_chunks::<SIZE>().0;
    for (to, index) in to.as_chunks_mut::<SIZE>().0.iter_mut().zip(indices) {
        *to = groups[*index as usize];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_of_every_size_are_those_with_the_indices() {
        // More than three tasks
        let indices: Vec<u32> = (0..12_305_u32).map(|i| i * 7919 % 1000).rev().collect();
        for components in [0_u16, 1, 2, 3, 4, 5, 6, 9] {
            let items: Vec<u16> = (0..1000 * components).collect();
            let components = usize::from(components);
            let expected: Vec<u16> = indices
                .iter()
                .flat_map(|index| &items[*index as usize * components..][..components])
                .copied()
                .collect();
            assert_eq!(gather(&items, components, &indices), expected);
            let wide: Vec<f64> = items.iter().map(|item| f64::from(*item)).collect();
            let gathered = gather(&wide, components, &indices);
            assert!(
                gathered.iter().eq(expected
                    .iter()
                    .map(|item| f64::from(*item))
                    .collect::<Vec<_>>()
                    .iter())
            );
        }
        assert!(gather::<f32>(&[1.0, 2.0], 2, &[]).is_empty());
    }

    #[test]
    fn kept_groups_are_those_with_the_indices() {
        let indices: Vec<u32> = (0..1000).filter(|i| i % 7 < 3 || i % 11 == 0).collect();
        for components in [1_u16, 2, 3, 4, 5, 6, 9] {
            let items: Vec<u16> = (0..1000 * components).collect();
            let components = usize::from(components);
            let mut wide: Vec<f64> = items.iter().map(|item| f64::from(*item)).collect();
            let expected = gather(&wide, components, &indices);
            keep(&mut wide, components, &indices);
            assert_eq!(wide, expected);
            let mut kept = items.clone();
            keep(&mut kept, components, &indices);
            assert_eq!(kept, gather(&items, components, &indices));
        }
    }

    #[test]
    #[should_panic(expected = "index out of bounds")]
    fn an_index_beyond_the_items_panics() {
        gather(&[1_u32, 2, 3], 1, &[3]);
    }
}
