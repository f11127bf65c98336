//! Positions and vectors among column names.

use std::collections::BTreeMap;

use spherule_frame::names::{COLOR_COLUMNS, JOINED_STEMS, POSITION_STEMS, without_unit};

/// Columns that are one attribute.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ColumnGroup {
    /// The common name.
    pub(super) name: String,
    /// The column of each component.
    pub(super) columns: Vec<usize>,
}

/// Which number of a vector a column is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum NameComponent {
    Index(usize),
    Axis(usize),
}

/// `raw` without blanks, quotes and a unit in brackets around it; `[2]` is an index and no unit.
pub(super) fn clean(raw: &[u8]) -> String {
    let name = String::from_utf8_lossy(raw);
    let name = name.trim().trim_matches(['"', '\'']).trim();
    for (open, close) in [('[', ']'), ('(', ')')] {
        let unit = name.strip_suffix(close).and_then(|rest| rest.rsplit_once(open));
        if let Some((stem, unit)) = unit
            && !stem.trim().is_empty()
            && (unit.is_empty() || !unit.bytes().all(|b| b.is_ascii_digit()))
        {
            return stem.trim().to_owned();
        }
    }
    name.to_owned()
}

/// The columns of x, y and z among cleaned `names`. 2D runs may have no z.
pub(super) fn position(names: &[String]) -> Option<[Option<usize>; 3]> {
    let plain = names.iter().map(String::as_str);
    let without_units = names.iter().map(|name| without_unit(name));
    // x before xp: what follows the axis may be anything else in files that have both
    let after = names.iter().map(|name| without_unit(name));
    position_of(plain.map(split))
        .or_else(|| position_of(without_units.map(split)))
        .or_else(|| position_of(after.map(split_after)))
}

/// The columns of x, y and z among stems and components of names.
fn position_of<'a>(
    names: impl Iterator<Item = Option<(&'a str, NameComponent)>>,
) -> Option<[Option<usize>; 3]> {
    let mut found = [[None; 3]; POSITION_STEMS.len()];
    for (column, name) in names.enumerate() {
        let Some((stem, NameComponent::Axis(part) | NameComponent::Index(part))) = name else {
            continue;
        };
        let stem = stem.to_ascii_lowercase();
        let family = POSITION_STEMS.iter().position(|known| *known == stem);
        if let Some(axis) = family.and_then(|family| found[family].get_mut(part)) {
            axis.get_or_insert(column);
        }
    }
    let solid = found.iter().find(|axes| axes.iter().all(Option::is_some));
    let flat = || found.iter().find(|axes| axes[0].is_some() && axes[1].is_some());
    solid.or_else(flat).copied()
}

/// What is left of cleaned `names` without the position `axes`, vectors together, in the order of
/// the first column of each. A column without a name is left out.
pub(super) fn attributes(names: &[String], axes: [Option<usize>; 3]) -> Vec<ColumnGroup> {
    let vectors = vectors(names, axes);
    let mut grouped: BTreeMap<usize, Option<ColumnGroup>> = BTreeMap::new();
    for group in vectors {
        let first = group.columns.iter().min().copied().unwrap_or_default();
        for column in &group.columns {
            grouped.insert(*column, None);
        }
        grouped.insert(first, Some(group));
    }
    let mut attributes = Vec::new();
    for (column, name) in names.iter().enumerate() {
        match grouped.remove(&column) {
            Some(group) => attributes.extend(group),
            None if axes.contains(&Some(column)) || name.is_empty() => {}
            None => attributes.push(ColumnGroup { name: name.clone(), columns: vec![column] }),
        }
    }
    attributes
}

/// Columns of one stem whose components are 0, 1, 2... or x, y and perhaps z, each once.
fn vectors(names: &[String], axes: [Option<usize>; 3]) -> Vec<ColumnGroup> {
    let mut by_stem: BTreeMap<(&str, bool), BTreeMap<usize, Vec<usize>>> = BTreeMap::new();
    for (column, name) in names.iter().enumerate() {
        if axes.contains(&Some(column)) {
            continue;
        }
        let (key, component) = match split(name) {
            Some((stem, NameComponent::Index(index))) => ((stem, false), index),
            Some((stem, NameComponent::Axis(axis))) => ((stem, true), axis),
            None => continue,
        };
        let columns = by_stem.entry(key).or_default();
        columns.entry(component).or_default().push(column);
    }
    let mut groups = Vec::new();
    for ((stem, _), columns) in by_stem {
        let complete = columns
            .iter()
            .enumerate()
            .all(|(index, (component, columns))| index == *component && columns.len() == 1);
        if complete && columns.len() > 1 && !stem.is_empty() {
            groups.push(ColumnGroup {
                name: vector_name(stem).to_owned(),
                columns: columns.into_values().flatten().collect(),
            });
        }
    }
    groups.extend(colors(names, axes));
    groups
}

/// The columns of red, green and blue.
fn colors(names: &[String], axes: [Option<usize>; 3]) -> Option<ColumnGroup> {
    COLOR_COLUMNS.iter().find_map(|parts| {
        let column = |part: &&str| {
            let found = names.iter().position(|name| name.eq_ignore_ascii_case(part));
            found.filter(|column| !axes.contains(&Some(*column)))
        };
        Some(ColumnGroup {
            name: "color".to_owned(),
            columns: parts.iter().map(column).collect::<Option<_>>()?,
        })
    })
}

fn vector_name(stem: &str) -> &str {
    let known = JOINED_STEMS.iter().find(|(joined, _)| joined.eq_ignore_ascii_case(stem));
    known.and_then(|(_, name)| *name).unwrap_or(stem)
}

/// The stem and the component of a name: `velocity:0`, `velocity_0`, `velocity[0]`, `Vel.x`,
/// `vel_x`, `vx`; of a plain `x` the stem is empty.
fn split(name: &str) -> Option<(&str, NameComponent)> {
    let indexed = name.strip_suffix([']', ')']).and_then(|rest| rest.rsplit_once(['[', '(']));
    if let Some((stem, index)) = indexed {
        return Some((stem.trim_end(), NameComponent::Index(index.trim().parse().ok()?)));
    }
    if let Some((stem, part)) = name.rsplit_once([':', '.', '_', ' '])
        && !stem.is_empty()
    {
        if let Some(axis) = axis(part) {
            return Some((stem, NameComponent::Axis(axis)));
        }
        if !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit()) {
            return Some((stem, NameComponent::Index(part.parse().ok()?)));
        }
        return None;
    }
    let (last, _) = name.char_indices().next_back()?;
    let (stem, part) = name.split_at(last);
    let axis = axis(part)?;
    let known =
        stem.is_empty() || JOINED_STEMS.iter().any(|(joined, _)| joined.eq_ignore_ascii_case(stem));
    known.then_some((stem, NameComponent::Axis(axis)))
}

/// The component that a name begins with, and its stem: `Xp`, `x_pos`, `X_coord`.
fn split_after(name: &str) -> Option<(&str, NameComponent)> {
    let (part, stem) = name.split_at_checked(1)?;
    let stem = stem.trim_start_matches(['_', '.', ' ', ':']);
    Some((stem, NameComponent::Axis(axis(part)?)))
}

fn axis(part: &str) -> Option<usize> {
    ["x", "y", "z"].iter().position(|axis| axis.eq_ignore_ascii_case(part))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cleaned(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| clean(name.as_bytes())).collect()
    }

    #[test]
    fn names_lose_quotes_and_units() {
        let cases = [
            ("\"Points:0\"", "Points:0"),
            (" Pos.x [m]", "Pos.x"),
            ("x(m)", "x"),
            ("Rhop [kg/m^3]", "Rhop"),
            ("velocity[0]", "velocity[0]"),
            ("[m]", "[m]"),
            ("'y'", "y"),
        ];
        for (raw, expected) in cases {
            assert_eq!(clean(raw.as_bytes()), expected, "{raw}");
        }
    }

    #[test]
    fn position_columns_have_many_names() {
        for names in [
            ["x", "y", "z"],
            ["X", "Y", "Z"],
            ["Pos.x [m]", "Pos.y [m]", "Pos.z [m]"],
            ["\"Points:0\"", "\"Points:1\"", "\"Points:2\""],
            ["Points_0", "Points_1", "Points_2"],
            ["position_x", "position_y", "position_z"],
            ["px", "py", "pz"],
            ["x(m)", "y(m)", "z(m)"],
            ["PosX", "PosY", "PosZ"],
            ["coordinates[0]", "coordinates[1]", "coordinates[2]"],
            ["pos_x_mm", "pos_y_mm", "pos_z_mm"],
            ["x_m", "y_m", "z_m"],
            ["Xp", "Yp", "Zp"],
            ["x_pos", "y_pos", "z_pos"],
        ] {
            let found = position(&cleaned(&names));
            assert_eq!(found, Some([Some(0), Some(1), Some(2)]), "{names:?}");
        }
        let names = cleaned(&["px", "id", "z", "y", "x", "py", "pz"]);
        assert_eq!(position(&names), Some([Some(4), Some(3), Some(2)]));
        let flat = cleaned(&["id", "x", "y"]);
        assert_eq!(position(&flat), Some([Some(1), Some(2), None]));
        assert_eq!(position(&cleaned(&["x", "z", "id", "a", "1"])), None);
    }

    #[test]
    fn vector_components_are_joined() {
        let names = cleaned(&[
            "x",
            "y",
            "z",
            "Vel.x [m/s]",
            "Vel.y [m/s]",
            "Vel.z [m/s]",
            "vz",
            "vy",
            "vx",
            "",
            "stress:1",
            "stress:0",
            "b_0",
            "b_2",
            "a_1",
            "Block Number",
            "vel_x",
            "vel_y",
            "velocity:Magnitude",
        ]);
        let axes = position(&names).unwrap();
        let found: Vec<_> =
            attributes(&names, axes).into_iter().map(|group| (group.name, group.columns)).collect();
        let expected = [
            ("Vel", vec![3, 4, 5]),
            ("velocity", vec![8, 7, 6]),
            ("stress", vec![11, 10]),
            ("b_0", vec![12]),
            ("b_2", vec![13]),
            ("a_1", vec![14]),
            ("Block Number", vec![15]),
            ("vel", vec![16, 17]),
            ("velocity:Magnitude", vec![18]),
        ]
        .map(|(name, columns)| (name.to_owned(), columns));
        assert_eq!(found, expected);
    }
}
