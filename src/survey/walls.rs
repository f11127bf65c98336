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

/// The walls among the values of the attribute `name`, in particles with these `attributes`.
pub(super) fn walls(
    name: &str,
    attributes: &[Attribute],
    members: &[Member],
) -> Option<WallValues> {
    let mut groups: BTreeMap<i64, Vec<Member>> = BTreeMap::new();
    for member in members {
        groups.entry(member.value).or_default().push(*member);
    }
    let found = |values: Vec<i64>, sign: WallSign| {
        let is_some = !values.is_empty() && values.len() < groups.len();
        is_some.then_some(WallValues { values, sign })
    };
    let all = || groups.keys().copied();
    if is_dualsphysics(attributes) {
        let is_wall: Option<fn(i64) -> bool> = match &*name.to_ascii_lowercase() {
            // mkbound + 11 and mkfluid + 1; fixed, moving, floating and fluid
            "mk" => Some(|mk| mk > 10),
            "type" => Some(|kind| kind < 2),
            _ => None,
        };
        if let Some(is_wall) = is_wall {
            let sign = WallSign::Code("DualSPHysics");
            return found(all().filter(|value| is_wall(*value)).collect(), sign);
        }
    }
    if is_boundary_flag(name) {
        let sign = WallSign::Code("boundary flags");
        return found(all().filter(|value| *value != 0).collect(), sign);
    }
    // At rest around others that move
    let rests = |value: &i64| groups[value].iter().all(|member| !member.is_moving);
    let is_any_moving = members.iter().any(|member| member.is_moving);
    let (candidates, sign): (Vec<i64>, _) = if is_any_moving {
        (all().filter(rests).collect(), WallSign::Rest)
    } else {
        let others = |value: i64| members.iter().filter(move |member| member.value != value);
        let contains = |value: &i64| contains(&groups[value], others(*value));
        (all().filter(contains).collect(), WallSign::Around)
    };
    // A bed of grains rests, too
    let shell: Vec<DVec3> =
        members.iter().filter(|m| candidates.contains(&m.value)).map(|m| m.position).collect();
    found(candidates, sign).filter(|_| is_shell(&shell))
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
fn contains<'a>(wall: &[Member], others: impl Iterator<Item = &'a Member>) -> bool {
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

/// Whether points are the walls of their box, or a single layer, and not a body that fills it.
fn is_shell(points: &[DVec3]) -> bool {
    let Some((min, max)) = bounds(points.iter().copied()) else {
        return false;
    };
    let axes = axes((min, max));
    if axes.len() < 2 {
        return true;
    }
    let mut filled = BTreeSet::new();
    for point in points {
        let cell = axes.iter().map(|axis| {
            let at = (point[*axis] - min[*axis]) / (max[*axis] - min[*axis]) * CELLS as f64;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "within the box"
            )]
            let cell = (at as usize).min(CELLS - 1);
            cell
        });
        let cell: Vec<usize> = cell.collect();
        // Those at the sides are walls in any case
        if cell.iter().all(|at| (1..CELLS - 1).contains(at)) {
            filled.insert(cell);
        }
    }
    let inside = (CELLS - 2).pow(u32::try_from(axes.len()).unwrap_or(3));
    #[expect(clippy::cast_precision_loss, reason = "few cells")]
    let part = filled.len() as f64 / inside as f64;
    part <= MAX_FILLED
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
        let bed = tank(12, [1, 1], false).into_iter().filter(|m| m.position.z < 6.0);
        let bed = bed.map(|m| Member { value: 0, ..m });
        let ball = |i: i32| Member {
            value: 1,
            position: DVec3::new(5.0, 5.0, 8.0 + f64::from(i)),
            is_moving: true,
        };
        // Filled, as the tank is hollow
        let full = (0..8).flat_map(|x| (0..8).flat_map(move |y| (0..4).map(move |z| [x, y, z])));
        let full = full.map(|at| Member {
            value: 0,
            position: DVec3::from_array(at.map(f64::from)),
            is_moving: false,
        });
        let all: Vec<Member> = bed.chain(full).chain((0..4).map(ball)).collect();
        assert_eq!(walls("type", &[], &all), None);
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
            let found = walls(name, &attributes, &tank(3, codes, false)).expect("walls");
            assert_eq!(found.values, [codes[0]]);
            assert_eq!(found.sign, WallSign::Code("DualSPHysics"));
        }
        // All of one kind
        assert_eq!(walls("Mk", &attributes, &tank(3, [1, 2], false)), None);
    }
}
