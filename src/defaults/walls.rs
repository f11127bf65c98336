//! Walls, by the names of parts, by categories, or by their shape: glass behind the others, or left out.

use spherule_formats::sequence::PART_ATTRIBUTE;
use toml::{Table, Value};

use super::Rules;
use super::style::{STYLE, glass, grey, layer};
use crate::manifest::{BondSearch, DeviceSetting, Look, Manifest, OpacitySetting};
use crate::render::IntegratorKind;
use crate::survey::{Category, Tank, WallSign, WallValues};

/// Parts of the names of walls.
const WALLS: [&str; 6] = ["bound", "wall", "piston", "container", "paddle", "wavemaker"];

/// Words that are walls, which are parts of other words as well: `lid` of `solid`.
const WALL_WORDS: [&str; 7] = ["tank", "floor", "lid", "box", "frame", "dummy", "ghost"];

/// The parts of a step, divided.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Walls {
    /// Names of the parts that are no walls.
    pub kept: Vec<String>,
    /// Names of the walls.
    pub left_out: Vec<String>,
}

/// Walls that have been found, and how the others are told from them.
struct Found {
    /// Which particles they are, and why.
    what: String,
    /// The condition that they meet.
    condition: String,
    /// The setting that leaves them out.
    without: (&'static str, Value),
    /// The option that shows them.
    shown_by: String,
    /// Whether they have values of their own in a category.
    is_by_category: bool,
}

/// Larger frames have no glass, whose surface takes time and memory.
const MAX_PARTICLES: usize = 4_000_000;

impl Rules<'_> {
    /// Draws walls as glass behind the others; where glass is not possible, they are left out. Whether some of the values of
    /// a category are those of walls.
    pub(super) fn walls(&mut self) -> bool {
        // Who has styles says what is drawn
        let is_open = self.manifest.styles.is_empty() && self.lacks(STYLE);
        let Some(found) = self.find_walls().filter(|_| is_open) else {
            return false;
        };
        let Found { what, condition, without: (key, value), shown_by, is_by_category } = found;
        if !self.lacks(key) {
            return false;
        }
        let style = |draw: &str| format!("--style {}", quoted(&format!("{condition}: {draw}")));
        if let Some((how, walls)) = self.wall_style(&condition) {
            self.found.settings.extend(layer(walls, "the defaults"));
            let hidden = style("hidden");
            self.found.lines.push(format!("{how}: {what} ({hidden} leaves them out)"));
        } else {
            let glass = style("smooth, material thin-glass");
            let line =
                format!("left out: {what} ({shown_by} shows them, {glass} draws them as glass)");
            self.set([(key, value)], Some(line));
        }
        is_by_category
    }

    /// How walls that meet a `condition` are drawn, if they are, and the style of it.
    fn wall_style(&self, condition: &str) -> Option<(&'static str, Table)> {
        let Manifest { material, clips, arrows, trails, bonds, .. } = self.manifest;
        let has_style = matches!(self.manifest.look, Look::Auto | Look::Plain | Look::Paper)
            && self.manifest.integrator() == IntegratorKind::Path
            && self.manifest.render.device != DeviceSetting::Gpu
            && self.facts.particles <= MAX_PARTICLES;
        // These are those of all particles
        let is_plain = !material.is_clear()
            && material.opacity == OpacitySetting::Constant(1.0)
            && material.parts.is_empty()
            && clips.is_empty()
            && arrows.is_empty()
            && trails.frames == 0
            && bonds.find == BondSearch::None;
        if !has_style || !is_plain {
            return None;
        }
        Some(match self.facts.flat_axis() {
            None => ("glass behind the others", glass(condition)),
            Some(_) => ("grey", grey(condition)),
        })
    }

    /// Walls by the names of parts, by category, or by their shape.
    fn find_walls(&self) -> Option<Found> {
        if let Some(Walls { kept, left_out }) = self.files.walls {
            let conditions = left_out.iter().map(|name| format!("part == {}", quoted(name)));
            return Some(Found {
                what: format!("{}, walls by name", left_out.join(", ")),
                condition: conditions.collect::<Vec<_>>().join(" || "),
                without: ("input.parts", kept.clone().into()),
                shown_by: format!("--parts {}", self.files.parts.join(",")),
                is_by_category: false,
            });
        }
        if self.is_molecular() || self.is_periodic() {
            return None;
        }
        // Parts with names are walls by these alone
        let has_names = |c: &&Category| c.name == PART_ATTRIBUTE && self.files.parts.len() > 1;
        let mut all = self.facts.categories.iter().filter(|c| !has_names(c));
        if let Some((name, WallValues { values, sign })) =
            all.find_map(|c| Some((&c.name, c.walls.as_ref()?)))
        {
            let each = |sign: &str, join: &str| {
                let all: Vec<String> =
                    values.iter().map(|value| format!("{name} {sign} {value}")).collect();
                all.join(join)
            };
            let texts: Vec<String> = values.iter().map(i64::to_string).collect();
            let why = match sign {
                WallSign::Code(kind) => format!("walls by the codes of {kind}"),
                WallSign::Rest => "which rest around the others".to_owned(),
                WallSign::Around => "which surround the others".to_owned(),
            };
            let first = values.first().copied().unwrap_or_default();
            return Some(Found {
                what: format!("particles with {name} {}, {why}", texts.join(", ")),
                condition: each("==", " || "),
                without: ("select.where", each("!=", " && ").into()),
                shown_by: format!("--where '{name} >= {first}'"),
                is_by_category: true,
            });
        }
        let Tank { condition, why, all } = self.facts.tank.as_ref()?;
        Some(Found {
            what: format!("walls, {why}"),
            condition: format!("!({condition})"),
            without: ("select.where", condition.clone().into()),
            shown_by: format!("--where '{all}'"),
            is_by_category: false,
        })
    }
}

/// A text in quotes that it has not itself.
fn quoted(text: &str) -> String {
    let quote = if text.contains('\'') { '"' } else { '\'' };
    format!("{quote}{text}{quote}")
}

/// The walls among parts with these `names`; None if there are no walls, or nothing else.
pub fn walls<S: AsRef<str>>(names: &[S]) -> Option<Walls> {
    let is_wall = |name: &&S| {
        let lower = name.as_ref().to_ascii_lowercase();
        let has_word = || words(name.as_ref()).any(|word| WALL_WORDS.contains(&&*word));
        WALLS.iter().any(|part| lower.contains(part)) || has_word()
    };
    let (left_out, kept): (Vec<&S>, Vec<&S>) = names.iter().partition(is_wall);
    let owned = |names: Vec<&S>| names.into_iter().map(|n| n.as_ref().to_owned()).collect();
    (!left_out.is_empty() && !kept.is_empty())
        .then(|| Walls { kept: owned(kept), left_out: owned(left_out) })
}

/// The words of a name in lower case: `PartTank_2` has `part` and `tank`.
fn words(name: &str) -> impl Iterator<Item = String> {
    let mut words = vec![String::new()];
    let mut is_after_small = false;
    for letter in name.chars() {
        let begins = !letter.is_alphabetic() || (is_after_small && letter.is_uppercase());
        if begins {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut().filter(|_| letter.is_alphabetic()) {
            word.extend(letter.to_lowercase());
        }
        is_after_small = letter.is_lowercase();
    }
    words.into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_are_told_by_their_names() {
        let found = walls(&["PartBound", "PartFluid"]).expect("a wall");
        assert_eq!(found.kept, ["PartFluid"]);
        assert_eq!(found.left_out, ["PartBound"]);
        assert_eq!(walls(&["fluid", "obstacle"]), None);
        for name in ["solid", "landslide", "collider", "boxwood"] {
            assert_eq!(walls(&["water", name]), None, "{name}");
        }
        for name in ["PartTank_2", "box", "lid-1", "DummyParticles"] {
            assert_eq!(walls(&["water", name]).expect("a wall").left_out, [name]);
        }
        assert_eq!(walls(&["boundary", "wall"]), None);
        assert_eq!(walls::<&str>(&[]), None);
    }
}
