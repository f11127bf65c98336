//! Walls of a tank that no attribute marks: particles at rest around others that move, or layers at the sides and the
//! bottom of a box that is open at the top.

use glam::DVec3;

use spherule_formats::{Attribute, sample_indices};

use super::sample::FrameSample;
use super::velocity_of;
use super::walls::{Member, contains, is_shell};

/// Largest number of particles that are examined.
const SAMPLE: usize = 1 << 17;

/// Walls that no attribute marks, in a frame that was read as a whole.
pub(super) fn tank_of(sample: &FrameSample, touching: f64, is_only_frame: bool) -> Option<Tank> {
    let positions = &sample.particles.positions;
    let velocity = velocity_of(&sample.particles.attributes);
    let all: Vec<DVec3> =
        sample_indices(positions.len(), SAMPLE).map(|i| positions.get(i)).collect();
    // Places in the file are those of a frame without gaps
    let is_whole = !sample.is_part() && all.len() == positions.len();
    if !all.iter().all(|p| p.is_finite()) || !(is_whole || is_only_frame) {
        return None;
    }
    let moves = |velocity: &Attribute| -> Vec<bool> {
        let indices = sample_indices(positions.len(), SAMPLE);
        indices.map(|i| i < velocity.count() && velocity.magnitude(i) != 0.0).collect()
    };
    let is_moving = velocity.map(moves).unwrap_or_default();
    Contents { positions: &all, is_moving: &is_moving, is_only_frame, touching }.tank()
}

/// Particles of a frame, and what tells them apart.
struct Contents<'a> {
    /// Positions of particles, all finite, in file order.
    positions: &'a [DVec3],
    /// Whether each of them moves; none without velocities.
    is_moving: &'a [bool],
    /// Whether there are no other frames, and no other particles.
    is_only_frame: bool,
    /// Half the distance of neighbours.
    touching: f64,
}

/// Walls without an attribute of their own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tank {
    /// The condition for the other particles.
    pub condition: String,
    /// Why there are walls.
    pub why: &'static str,
    /// A condition for all particles.
    pub all: &'static str,
}

/// Fewest particles that move beside those of a tank, as a part of all.
const MOVING: f64 = 0.1;

impl Contents<'_> {
    /// The tank, if there is one.
    fn tank(&self) -> Option<Tank> {
        if self.is_moving.contains(&true) { self.at_rest() } else { self.open_box() }
    }

    /// Walls that rest around others that move. In several frames, the particles that rest at first may move later; walls
    /// are identified by their index in the file.
    fn at_rest(&self) -> Option<Tank> {
        // Divide the particles into those at rest and those that move
        let found = self.positions.iter().zip(self.is_moving).map(|(position, is_moving)| Member {
            value: i64::from(*is_moving),
            position: *position,
            is_moving: *is_moving,
        });
        let members: Vec<Member> = found.collect();
        let (moving, resting): (Vec<Member>, Vec<Member>) =
            members.into_iter().partition(|member| member.is_moving);
        let places: Vec<DVec3> = resting.iter().map(|member| member.position).collect();
        // Check that many move, and that those at rest are walls around them
        #[expect(clippy::cast_precision_loss, reason = "counts")]
        let is_many = moving.len() as f64 >= MOVING * self.positions.len() as f64;
        let is_around = is_many && resting.len() >= MIN_WALLS && contains(&resting, moving.iter());
        if !is_around || !is_shell(&places) {
            return None;
        }
        // Describe the walls by speed in a single frame, and by index in several
        let why = "particles at rest around the others";
        if self.is_only_frame {
            return Some(Tank { condition: "speed > 0".to_owned(), why, all: "speed >= 0" });
        }
        let first = |wanted: bool| self.is_moving.iter().position(|moving| *moving == wanted);
        let last = |wanted: bool| self.is_moving.iter().rposition(|moving| *moving == wanted);
        let condition = match (first(true)?, last(true)?, first(false)?, last(false)?) {
            (_, last, first, _) if last < first => format!("index < {first}"),
            (first, _, _, last) if last < first => format!("index >= {first}"),
            _ => return None,
        };
        Some(Tank { condition, why, all: "index >= 0" })
    }

    /// A box of a few layers that is open at the top, along z or y.
    fn open_box(&self) -> Option<Tank> {
        [2, 1].into_iter().find_map(|up| OpenBox::find(self.positions, up, self.touching))
    }
}

/// The part of the height at the top where there are only walls.
const TOP: f64 = 0.08;

/// Greatest thickness of walls, as a part of the shorter side of the box.
const THICKNESS: f64 = 0.12;

/// Squares along the sides of a wall.
const SQUARES: usize = 8;

/// Fewest squares of a wall with particles, as a part of all.
const COVERED: f64 = 0.9;

/// Fewest particles inside the walls, as a part of all.
const INSIDE: f64 = 0.15;

/// Fewest particles of walls.
const MIN_WALLS: usize = 200;

struct OpenBox {
    min: DVec3,
    max: DVec3,
    up: usize,
    sides: [usize; 2],
}

impl OpenBox {
    fn find(positions: &[DVec3], up: usize, touching: f64) -> Option<Tank> {
        // Find the box, and its sides
        let ends = positions.iter().map(|p| (*p, *p));
        let (min, max) = ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
        let sides = [(up + 1) % 3, (up + 2) % 3];
        let own = Self { min, max, up, sides };
        let extent = max - min;
        let shorter = extent[sides[0]].min(extent[sides[1]]);
        // At the top are only the walls
        let height = |p: &&DVec3| p[up] > max[up] - TOP * extent[up];
        let thickness = positions.iter().filter(height).map(|p| own.depth(*p)).fold(0.0, f64::max);
        if thickness > THICKNESS * shorter {
            return None;
        }
        // Divide the particles into those near sides and bottom, and those inside
        let margin = thickness + touching;
        let (inside, walls): (Vec<DVec3>, Vec<DVec3>) =
            positions.iter().partition(|p| own.depth(**p) > margin && p[up] > min[up] + margin);
        #[expect(clippy::cast_precision_loss, reason = "counts")]
        let is_filled = inside.len() as f64 >= INSIDE * positions.len() as f64;
        if !is_filled || walls.len() < MIN_WALLS || !own.is_covered(&walls, margin) {
            return None;
        }
        // Describe what is inside
        let name = |axis: usize| ["x", "y", "z"][axis];
        let round = |value: f64| format!("{value:.4e}").parse().unwrap_or(value);
        let mut conditions = Vec::new();
        for axis in sides {
            let [low, high] = [min[axis] + margin, max[axis] - margin].map(round);
            conditions.push(format!("{0} > {low} && {0} < {high}", name(axis)));
        }
        conditions.push(format!("{} > {}", name(up), round(min[up] + margin)));
        let why = "layers at the sides of a box that is open at the top";
        Some(Tank { condition: conditions.join(" && "), why, all: "index >= 0" })
    }

    /// Distance from the nearest side.
    fn depth(&self, point: DVec3) -> f64 {
        let depths =
            self.sides.map(|axis| (point[axis] - self.min[axis]).min(self.max[axis] - point[axis]));
        depths[0].min(depths[1])
    }

    /// Whether the four sides are covered with particles of the walls.
    fn is_covered(&self, walls: &[DVec3], margin: f64) -> bool {
        let [a, b] = self.sides;
        let part =
            |p: &DVec3, axis: usize| (p[axis] - self.min[axis]) / (self.max[axis] - self.min[axis]);
        // Divide each side into squares, and count those with a particle
        [(a, b, false), (a, b, true), (b, a, false), (b, a, true)].into_iter().all(
            |(axis, along, is_high)| {
                let mut squares = [false; SQUARES * SQUARES];
                let distance = |p: &DVec3| {
                    if is_high { self.max[axis] - p[axis] } else { p[axis] - self.min[axis] }
                };
                for point in walls.iter().filter(|p| distance(p) <= margin) {
                    let [x, y] = [along, self.up].map(|axis| {
                        #[expect(
                            clippy::cast_possible_truncation,
                            clippy::cast_sign_loss,
                            reason = "0 to 1"
                        )]
                        let square = (part(point, axis) * SQUARES as f64) as usize;
                        square.min(SQUARES - 1)
                    });
                    squares[y * SQUARES + x] = true;
                }
                let covered = squares.iter().filter(|square| **square).count();
                covered as f64 >= COVERED * squares.len() as f64
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tank with two layers of walls, its fluid first, and the fluid of a height that `level` gives.
    fn tank(level: impl Fn(i32) -> i32) -> (Vec<DVec3>, usize) {
        let all = (0..24 * 16 * 16).map(|i| [i % 24, i / 24 % 16, i / (24 * 16)]);
        let is_wall = |[x, y, z]: &[i32; 3]| !(2..22).contains(x) || !(2..14).contains(y) || *z < 2;
        let (walls, others): (Vec<[i32; 3]>, Vec<[i32; 3]>) = all.partition(is_wall);
        let fluid: Vec<[i32; 3]> = others.into_iter().filter(|[x, _, z]| *z < level(*x)).collect();
        let count = fluid.len();
        let points = fluid.into_iter().chain(walls);
        (points.map(|at| DVec3::from_array(at.map(f64::from))).collect(), count)
    }

    fn contents<'a>(positions: &'a [DVec3], is_moving: &'a [bool]) -> Contents<'a> {
        Contents { positions, is_moving, is_only_frame: true, touching: 0.5 }
    }

    #[test]
    fn walls_at_rest_are_told_by_their_speed_or_their_place_in_the_file() {
        let (positions, fluid) = tank(|x| 12 - x / 3);
        let is_moving: Vec<bool> = (0..positions.len()).map(|i| i < fluid).collect();
        let found = contents(&positions, &is_moving);
        assert_eq!(found.tank().expect("a tank").condition, "speed > 0");
        let found = Contents { is_only_frame: false, ..found };
        assert_eq!(found.tank().expect("a tank").condition, format!("index < {fluid}"));
        // In an order that says nothing
        let mixed: Vec<DVec3> =
            positions.iter().rev().step_by(2).chain(positions.iter().step_by(2)).copied().collect();
        let moving: Vec<bool> =
            is_moving.iter().rev().step_by(2).chain(is_moving.iter().step_by(2)).copied().collect();
        assert_eq!(Contents { is_only_frame: false, ..contents(&mixed, &moving) }.tank(), None);
    }

    #[test]
    fn a_few_particles_at_rest_are_no_walls() {
        let row: Vec<DVec3> = (0..5).map(|i| f64::from(i) * DVec3::X).collect();
        assert_eq!(contents(&row, &[false, true, true, true, true]).tank(), None);
        // A layer that has come to rest under others
        let (positions, fluid) = tank(|_| 12);
        let fluid = &positions[..fluid];
        let is_moving: Vec<bool> = fluid.iter().map(|p| p.z > 3.0).collect();
        assert_eq!(contents(fluid, &is_moving).tank(), None);
    }

    #[test]
    fn open_boxes_are_tanks_without_velocities() {
        let (positions, _) = tank(|x| 12 - x / 3);
        let found = contents(&positions, &[]).tank().expect("a tank");
        assert_eq!(found.condition, "x > 1.5 && x < 21.5 && y > 1.5 && y < 13.5 && z > 1.5");
        // Full to the brim, the fluid alone, and a wave along two of the sides
        let (full, _) = tank(|_| 16);
        assert_eq!(contents(&full, &[]).tank(), None);
        let (all, fluid) = tank(|x| 12 - x / 3);
        assert_eq!(contents(&all[..fluid], &[]).tank(), None);
        let (wave, fluid) = tank(|x| 6 + (x - 12).abs());
        assert_eq!(contents(&wave[..fluid], &[]).tank(), None);
    }
}
