//! Parts of a step that are walls, by their names.

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

/// The option that draws the particles for which one of the `conditions` holds as glass.
pub fn as_glass(conditions: impl Iterator<Item = String>) -> String {
    let conditions: Vec<String> = conditions.collect();
    let quote = if conditions.iter().any(|one| one.contains('\'')) { '"' } else { '\'' };
    let conditions = conditions.join(" || ");
    format!("--style {quote}{conditions}: smooth, material thin-glass{quote} draws them as glass")
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
