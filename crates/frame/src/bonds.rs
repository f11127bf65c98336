//! Bonds between particles, as files list them.

/// Two particles with a bond, by their indices.
pub type Bond = [u32; 2];

/// The index of a particle that is left out.
const GONE: u32 = u32::MAX;

/// Renumbers `bonds` of `count` particles for those with the `kept` indices, in their order. Bonds of others are
/// removed.
pub fn renumber(bonds: &mut Vec<Bond>, count: usize, kept: &[u32]) {
    if bonds.is_empty() {
        return;
    }
    let mut places = vec![GONE; count];
    for (place, index) in (0..).zip(kept) {
        places[*index as usize] = place;
    }
    bonds.retain_mut(|bond| {
        *bond = bond.map(|index| places.get(index as usize).copied().unwrap_or(GONE));
        !bond.contains(&GONE)
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bonds_follow_the_particles_that_are_kept() {
        let all = vec![[0, 1], [1, 4], [4, 2], [4, 9]];
        let mut bonds = all.clone();
        renumber(&mut bonds, 5, &[1, 2, 4]);
        assert_eq!(bonds, [[0, 2], [2, 1]]);
        let mut bonds = all;
        renumber(&mut bonds, 5, &[]);
        assert_eq!(bonds, Vec::<Bond>::new());
    }
}
