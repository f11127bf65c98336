//! Which values of a category are those of walls: by the codes of known programs, because they rest around others that
//! move, or because they surround the others.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use spherule_formats::Attribute;

/// Why values are those of walls.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WallSign {
    /// They are the codes of walls in files of this kind.
    Code(&'static str),
    /// They rest while the others move.
    Rest,
    /// They surround the others.
    Around,
}

/// Values of walls in a category.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WallValues {
    /// The values, rising.
    pub values: Vec<i64>,
    /// Why they are walls.
    pub sign: WallSign,
}

/// A particle of a sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member {
    /// Its value.
    pub(super) value: i64,
    /// Its place.
    pub(super) position: DVec3,
    /// Whether it moves; false without velocities.
    pub(super) is_moving: bool,
}

/// Number of cells along each side of a box by which walls are told from bodies.
const CELLS: usize = 8;

/// Largest part of the cells inside the box of walls that have particles.
const MAX_FILLED: f64 = 0.35;

/// How many times the part of the cells at the sides that have particles is that of the cells inside, at least.
const CONTRAST: f64 = 2.0;

/// Fewest particles that surround others: of a few at random, one may be outside on each side.
const MIN_AROUND: usize = 200;

/// The walls among the values of the attribute `name`, in particles with these `attributes`.
pub(super) fn walls(
    name: &str,
    attributes: &[Attribute],
    members: &[Member],
) -> Option<WallValues> {
    let mut groups = Groups::new();
    for member in members {
        groups.entry(member.value).or_default().push(*member);
    }
    let found = |values: Vec<i64>, sign: WallSign| {
        let is_some = !values.is_empty() && values.len() < groups.len();
        is_some.then_some(WallValues { values, sign })
    };
    // Values that a program or the name of the attribute explains need no search
    if is_dualsphysics(attributes)
        && let Some(values) = dualsphysics_walls(name, members, &groups)
    {
        return found(values, WallSign::Code("DualSPHysics"));
    }
    if is_boundary_flag(name) {
        let values = groups.keys().copied().filter(|value| *value != 0).collect();
        return found(values, WallSign::Code("boundary flags"));
    }
    // At rest around others that move
    let is_any_moving = members.iter().any(|member| member.is_moving);
    let (candidates, sign) = if is_any_moving {
        (resting_walls(members, &groups), WallSign::Rest)
    } else {
        (surrounding_walls(members, &groups), WallSign::Around)
    };
    // A bed of grains rests, too
    let shell: Vec<DVec3> =
        members.iter().filter(|m| candidates.contains(&m.value)).map(|m| m.position).collect();
    found(candidates, sign).filter(|_| is_shell(&shell))
}

/// The particles with each value.
type Groups = BTreeMap<i64, Vec<Member>>;

/// Whether no particle of a group moves.
fn is_resting(group: &[Member]) -> bool {
    group.iter().all(|member| !member.is_moving)
}

/// The values of walls in particles of DualSPHysics; None if the attribute `name` does not tell.
fn dualsphysics_walls(name: &str, members: &[Member], groups: &Groups) -> Option<Vec<i64>> {
    let is_code_of_wall: fn(i64) -> bool = match &*name.to_ascii_lowercase() {
        // mkbound + 11, of floating bodies too, and mkfluid + 1; fixed, moving, floating and fluid
        "mk" => |mk| mk > 10,
        "type" => |kind| kind < 2,
        _ => return None,
    };
    let is_wall =
        |value: &i64| is_code_of_wall(*value) && (name != "Mk" || is_resting(&groups[value]));
    // A body in the fluid is not in front of it
    let others: Vec<Member> =
        members.iter().filter(|member| !is_wall(&member.value)).copied().collect();
    let is_around = |value: &i64| !is_within(&groups[value], &others);
    Some(groups.keys().copied().filter(is_wall).filter(is_around).collect())
}

/// The values of particles that rest, and only those around all that move if there are such values.
fn resting_walls(members: &[Member], groups: &Groups) -> Vec<i64> {
    let resting: Vec<i64> =
        groups.keys().copied().filter(|value| is_resting(&groups[value])).collect();
    let contains =
        |value: &i64| contains(&groups[value], members.iter().filter(|member| member.is_moving));
    // Walls of several kinds are around the others together; an obstacle among them is not
    let alone: Vec<i64> = resting.iter().copied().filter(contains).collect();
    if alone.is_empty() { resting } else { alone }
}

/// The values of many particles around all particles with other values.
fn surrounding_walls(members: &[Member], groups: &Groups) -> Vec<i64> {
    let others = |value: i64| members.iter().filter(move |member| member.value != value);
    let surrounds =
        |value: &i64| groups[value].len() >= MIN_AROUND && contains(&groups[value], others(*value));
    groups.keys().copied().filter(surrounds).collect()
}

/// Whether an attribute marks particles of a boundary.
fn is_boundary_flag(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    ["boundary", "is_boundary", "isboundary", "is_wall", "wall"].contains(&&*name)
}

/// Whether particles have attributes that DualSPHysics writes.
fn is_dualsphysics(attributes: &[Attribute]) -> bool {
    let has = |name: &str| attributes.iter().any(|a| a.name.eq_ignore_ascii_case(name));
    has("Idp") && (has("Rhop") || has("Press"))
}

/// The box of some points.
fn bounds(points: impl Iterator<Item = DVec3>) -> Option<(DVec3, DVec3)> {
    points.map(|p| (p, p)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// The axes along which a box has an extent.
fn axes((min, max): (DVec3, DVec3)) -> Vec<usize> {
    let extent = max - min;
    (0..3).filter(|axis| extent[*axis] > 1e-3 * extent.max_element()).collect()
}

/// Whether the box of a `wall` contains that of the `others` on all sides but one.
pub(super) fn contains<'a>(wall: &[Member], others: impl Iterator<Item = &'a Member>) -> bool {
    let own = bounds(wall.iter().map(|member| member.position));
    let (Some(own), Some(theirs)) = (own, bounds(others.map(|member| member.position))) else {
        return false;
    };
    let axes = axes(own);
    let beyond = |axis: &usize| {
        usize::from(own.0[*axis] < theirs.0[*axis]) + usize::from(own.1[*axis] > theirs.1[*axis])
    };
    let around: usize = axes.iter().map(beyond).sum();
    axes.len() >= 2 && around + 1 >= 2 * axes.len()
}

/// Whether the box of a `body` is within that of the `others`, with others on all sides.
fn is_within(body: &[Member], others: &[Member]) -> bool {
    let [own, theirs] =
        [body, others].map(|members| bounds(members.iter().map(|member| member.position)));
    let (Some(own), Some(theirs)) = (own, theirs) else {
        return false;
    };
    let is_between =
        |axis: &usize| own.0[*axis] > theirs.0[*axis] && own.1[*axis] < theirs.1[*axis];
    axes(theirs).iter().all(is_between)
}

/// Whether points are the walls of their box, or a single layer, and not a body that fills it.
pub(super) fn is_shell(points: &[DVec3]) -> bool {
    let Some((min, max)) = bounds(points.iter().copied()) else {
        return false;
    };
    // A layer or a line has no inside
    let axes = axes((min, max));
    if axes.len() < 2 {
        return true;
    }
    // Find the cells with particles, inside the box and at its sides
    let [mut inside, mut at_sides] = [BTreeSet::new(), BTreeSet::new()];
    for point in points {
        let cell: Vec<usize> = axes
            .iter()
            .map(|axis| {
                let at = (point[*axis] - min[*axis]) / (max[*axis] - min[*axis]) * CELLS as f64;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "within the box"
                )]
                let cell = (at as usize).min(CELLS - 1);
                cell
            })
            .collect();
        let is_inside = cell.iter().all(|at| (1..CELLS - 1).contains(at));
        let filled = if is_inside { &mut inside } else { &mut at_sides };
        filled.insert(cell);
    }
    // Compare how many of them there are with how many there could be
    let power = u32::try_from(axes.len()).unwrap_or(3);
    let [all, inner] = [CELLS, CELLS - 2].map(|side| side.pow(power));
    #[expect(clippy::cast_precision_loss, reason = "few cells")]
    let [inside, at_sides] = [(inside.len(), inner), (at_sides.len(), all - inner)]
        .map(|(some, of)| some as f64 / of as f64);
    // A few particles at random fill few cells, but as many inside as at the sides
    inside <= MAX_FILLED && at_sides >= CONTRAST * inside
}

#[cfg(test)]
mod tests {
    use spherule_formats::AttributeData;

    use super::*;

    /// A tank of `side` particles along each edge, open at the top, with fluid in it.
    fn tank(side: i32, [wall, fluid]: [i64; 2], is_moving: bool) -> Vec<Member> {
        let all = (0..side.pow(3)).map(|i| [i % side, i / side % side, i / side.pow(2)]);
        let member = |[x, y, z]: [i32; 3]| {
            let is_wall = x == 0 || y == 0 || z == 0 || x == side - 1 || y == side - 1;
            let position = DVec3::new(x.into(), y.into(), z.into());
            let value = if is_wall { wall } else { fluid };
            let is_fluid = !is_wall && z < side / 2;
            (is_wall || is_fluid).then_some(Member {
                value,
                position,
                is_moving: is_moving && !is_wall,
            })
        };
        all.filter_map(member).collect()
    }

    fn named(names: &[&str]) -> Vec<Attribute> {
        let attribute = |name: &&str| Attribute {
            name: (*name).to_owned(),
            components: 1,
            data: AttributeData::F32(Vec::new()),
        };
        names.iter().map(attribute).collect()
    }

    #[test]
    fn tanks_are_walls_at_rest_too() {
        let expected = |sign| Some(WallValues { values: vec![7], sign });
        assert_eq!(walls("type", &[], &tank(12, [7, 3], true)), expected(WallSign::Rest));
        assert_eq!(walls("type", &[], &tank(12, [7, 3], false)), expected(WallSign::Around));
        // Two fluids in layers, and a ball in a fluid
        let layers: Vec<Member> = tank(12, [1, 1], false)
            .into_iter()
            .map(|m| Member { value: i64::from(m.position.z > 4.0), ..m })
            .collect();
        assert_eq!(walls("type", &[], &layers), None);
        let ball: Vec<Member> = tank(12, [1, 1], false)
            .into_iter()
            .map(|m| Member {
                value: i64::from(m.position.distance(DVec3::new(5.0, 5.0, 3.0)) < 2.5),
                ..m
            })
            .collect();
        assert_eq!(walls("type", &[], &ball), None);
    }

    #[test]
    fn a_bed_at_rest_is_no_wall() {
        let bed = tank(12, [1, 1], false)
            .into_iter()
            .filter(|m| m.position.z < 6.0)
            .map(|m| Member { value: 0, ..m });
        let ball = |i: i32| Member {
            value: 1,
            position: DVec3::new(5.0, 5.0, 8.0 + f64::from(i)),
            is_moving: true,
        };
        // Filled, as the tank is hollow
        let full = (0..8)
            .flat_map(|x| (0..8).flat_map(move |y| (0..4).map(move |z| [x, y, z])))
            .map(|at| Member {
                value: 0,
                position: DVec3::from_array(at.map(f64::from)),
                is_moving: false,
            });
        let all: Vec<Member> = bed.chain(full).chain((0..4).map(ball)).collect();
        assert_eq!(walls("type", &[], &all), None);
    }

    #[test]
    fn mixtures_at_random_have_no_walls() {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        for count in [300, 3000] {
            for _ in 0..20 {
                let member = |index: i64| Member {
                    value: index % 2,
                    position: DVec3::new(uniform(), uniform(), uniform()),
                    is_moving: false,
                };
                let all: Vec<Member> = (0..count).map(member).collect();
                assert_eq!(walls("type", &[], &all), None);
            }
        }
    }

    #[test]
    fn flags_of_a_boundary_are_known() {
        let found = walls("boundary", &[], &tank(5, [1, 0], false)).expect("walls");
        assert_eq!(found.values, [1]);
    }

    #[test]
    fn codes_of_dualsphysics_are_known() {
        let attributes = named(&["Idp", "Vel", "Rhop", "Type", "Mk"]);
        for (name, codes) in [("Mk", [11, 1]), ("Type", [0, 3])] {
            let found = walls(name, &attributes, &tank(6, codes, false)).expect("walls");
            assert_eq!(found.values, [codes[0]]);
            assert_eq!(found.sign, WallSign::Code("DualSPHysics"));
        }
        // A body that the fluid surrounds
        let mut all = tank(12, [0, 3], false);
        let inside = DVec3::new(5.0, 5.0, 3.0);
        all.iter_mut().filter(|m| m.position.distance(inside) < 1.5).for_each(|m| m.value = 1);
        assert_eq!(walls("Type", &attributes, &all).expect("walls").values, [0]);
        // All of one kind
        assert_eq!(walls("Mk", &attributes, &tank(3, [1, 2], false)), None);
    }
}
