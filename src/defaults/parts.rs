//! Parts of a step that are walls, by their names.

/// Words in the names of walls.
const WALLS: [&str; 14] = [
    "bound",
    "wall",
    "piston",
    "container",
    "tank",
    "floor",
    "lid",
    "paddle",
    "wavemaker",
    "box",
    "frame",
    "solid_wall",
    "dummy",
    "ghost",
];

/// The parts of a step, divided.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Walls {
    /// Names of the parts that are no walls.
    pub kept: Vec<String>,
    /// Names of the walls.
    pub left_out: Vec<String>,
}

/// The walls among parts with these `names`; None if there are no walls, or nothing else.
pub fn walls<S: AsRef<str>>(names: &[S]) -> Option<Walls> {
    let is_wall = |name: &&S| {
        let name = name.as_ref().to_ascii_lowercase();
        WALLS.iter().any(|word| name.contains(word))
    };
    let (left_out, kept): (Vec<&S>, Vec<&S>) = names.iter().partition(is_wall);
    let owned = |names: Vec<&S>| names.into_iter().map(|n| n.as_ref().to_owned()).collect();
    (!left_out.is_empty() && !kept.is_empty())
        .then(|| Walls { kept: owned(kept), left_out: owned(left_out) })
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
        assert_eq!(walls(&["boundary", "wall"]), None);
        assert_eq!(walls::<&str>(&[]), None);
    }
}
