//! The division of particles into groups: the first condition that holds for a particle decides.

use glam::DVec3;
use spherule_frame::values::Named;
use spherule_frame::{Labels, RawParticles};

use super::{Condition, Selection, UnknownName};

/// The particles that a group takes, unless an earlier one has taken them.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// Which particles; None: all.
    pub condition: Option<Condition>,
    /// The group.
    pub group: usize,
}

/// Divides particles into groups.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Division {
    /// The claims, in the order in which they are tried. Particles without one belong to group 0.
    pub claims: Vec<Claim>,
    /// Number of groups, 1 or more.
    pub groups: usize,
    /// The direction of heights, once it is known.
    pub up: Option<DVec3>,
}

/// Particles in the order of their groups.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Divided {
    /// Indices of the particles, ascending in each group.
    pub order: Vec<u32>,
    /// Number of particles in the groups up to each, this included.
    pub ends: Vec<usize>,
}

impl Division {
    /// Whether there is but one group.
    pub fn is_one(&self) -> bool {
        self.groups <= 1
    }

    /// Checks that the names in the conditions have values; see [`Selection::check_names`].
    ///
    /// # Errors
    /// The first name that has none, or is text where a number is needed, with the number of the claim.
    pub fn check_names<A: Named>(
        &self,
        attributes: &[A],
        time: Option<f64>,
        labels: &Labels,
    ) -> Result<(), (usize, UnknownName)> {
        for (number, claim) in self.claims.iter().enumerate() {
            let selection = self.selection(claim);
            selection.check_names(attributes, time, labels).map_err(|e| (number, e))?;
        }
        Ok(())
    }

    /// Divides those of `particles` that have the indices `chosen`, ascending.
    ///
    /// # Errors
    /// A name in a condition has no value. Frames without particles need no attributes.
    pub fn divide(&self, particles: &RawParticles, chosen: &[u32]) -> Result<Divided, UnknownName> {
        // Give each particle to the first claim that wants it
        const FREE: u16 = u16::MAX;
        let mut groups = vec![FREE; particles.positions.len()];
        for claim in &self.claims {
            let group = u16::try_from(claim.group).unwrap_or(0);
            if claim.condition.is_none() {
                for taken in groups.iter_mut().filter(|taken| **taken == FREE) {
                    *taken = group;
                }
                break;
            }
            for index in self.selection(claim).survivors(particles)? {
                let taken = &mut groups[index as usize];
                if *taken == FREE {
                    *taken = group;
                }
            }
        }
        // Count the particles of each group, and put their indices in order
        let group_of = |index: &u32| match groups[*index as usize] {
            FREE => 0,
            group => usize::from(group),
        };
        let mut ends = vec![0; self.groups.max(1)];
        for index in chosen {
            ends[group_of(index)] += 1;
        }
        let mut next = Vec::with_capacity(ends.len());
        let mut total = 0;
        for end in &mut ends {
            next.push(total);
            total += *end;
            *end = total;
        }
        let mut order = vec![0; chosen.len()];
        for index in chosen {
            let place = &mut next[group_of(index)];
            order[*place] = *index;
            *place += 1;
        }
        Ok(Divided { order, ends })
    }

    fn selection(&self, claim: &Claim) -> Selection {
        Selection { condition: claim.condition.clone(), up: self.up, ..Selection::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use spherule_frame::{Attribute, AttributeData, Positions};

    fn particles() -> RawParticles {
        RawParticles {
            positions: Positions::F32(vec![glam::Vec3::ZERO; 6]),
            attributes: vec![Attribute {
                name: "type".to_owned(),
                components: 1,
                data: AttributeData::I32(vec![1, 2, 3, 1, 2, 3]),
            }],
            ..RawParticles::default()
        }
    }

    fn division(claims: &[(&str, usize)]) -> Division {
        let claim = |(text, group): &(&str, usize)| Claim {
            condition: (!text.is_empty()).then(|| Condition::parse(text).unwrap()),
            group: *group,
        };
        Division { claims: claims.iter().map(claim).collect(), groups: 3, up: None }
    }

    #[test]
    fn the_first_condition_that_holds_takes_a_particle() {
        let all: Vec<u32> = (0..6).collect();
        let divided = division(&[("type == 2", 2), ("type >= 2", 1)]).divide(&particles(), &all);
        let expected = Divided { order: vec![0, 3, 2, 5, 1, 4], ends: vec![2, 4, 6] };
        assert_eq!(divided, Ok(expected));
        // What has no condition takes the rest
        let divided = division(&[("type == 1", 2), ("", 1)]).divide(&particles(), &[1, 2, 3]);
        assert_eq!(divided, Ok(Divided { order: vec![1, 2, 3], ends: vec![0, 2, 3] }));
        // Nothing is left for a condition behind it
        let divided = division(&[("", 1), ("type == 1", 2)]).divide(&particles(), &all);
        assert_eq!(divided.unwrap().ends, [0, 6, 6]);
    }

    #[test]
    fn unknown_names_are_errors() {
        let all = division(&[("kind == 2", 1)]);
        assert_eq!(all.divide(&particles(), &[0]).unwrap_err().name, "kind");
        let raw = particles();
        let (claim, error) = all.check_names(&raw.attributes, None, &raw.labels).unwrap_err();
        assert_eq!((claim, error.name.as_str()), (0, "kind"));
    }
}
