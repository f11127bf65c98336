#![expect(clippy::cast_possible_truncation, reason = "small numbers that are made here")]

use std::path::Path;

use glam::{DVec3, Vec3};
use spherule_formats::{Sequence, SequenceInput, name_code};
use spherule_frame::{Attribute, Positions, label_code};

use super::*;

fn attribute(name: &str, components: usize, data: AttributeData) -> Attribute {
    Attribute { name: name.to_owned(), components, data }
}

/// More particles than are in a run, with an integer, a vector and NaN among the values.
fn particles() -> RawParticles {
    let count = RUN + 3 * BLOCK + 17;
    let value = |i: usize| ((i * 7919) % 1000) as f64 / 100.0 - 5.0;
    let positions = (0..count).map(|i| DVec3::new(value(i), value(3 * i + 1), value(7 * i + 2)));
    let velocity = (0..3 * count).map(|i| value(i) as f32);
    let density = (0..count).map(|i| match i % 10 {
        0 => f64::NAN,
        _ => value(11 * i),
    });
    RawParticles {
        positions: Positions::F64(positions.collect()),
        attributes: vec![
            attribute("Vel", 3, AttributeData::F32(velocity.collect())),
            attribute("density", 1, AttributeData::F64(density.collect())),
            attribute("type", 1, AttributeData::U8((0..count).map(|i| (i % 4) as u8).collect())),
            attribute("Idp", 1, AttributeData::I64((0..count).map(|i| i as i64 - 9).collect())),
            attribute(
                "diameter",
                1,
                AttributeData::F32((0..count).map(|i| (i % 3) as f32).collect()),
            ),
            attribute("total energy", 2, AttributeData::I16(vec![3; 2 * count])),
        ],
        time: Some(2.5),
        ..RawParticles::default()
    }
}

fn by(text: &str) -> Selection {
    Selection { condition: Some(Condition::parse(text).expect(text)), ..Selection::default() }
}

#[track_caller]
fn assert_selects(selection: &Selection, all: &RawParticles, is_kept: impl Fn(usize) -> bool) {
    let found = selection.survivors(all).expect("known names");
    let count = all.positions.len();
    let expected = (0..count).filter(|i| is_kept(*i)).map(index_u32);
    assert!(found.iter().copied().eq(expected), "{} of {count}", found.len());
}

#[test]
fn conditions_agree_with_a_plain_loop() {
    let all = particles();
    let position = |i: usize| all.positions.get(i);
    let value = |a: usize, i: usize| all.attributes[a].data.get_f64(i);
    let speed = |i: usize| all.attributes[0].magnitude(i);
    let check = |text: &str, is_kept: &dyn Fn(usize) -> bool| {
        assert_selects(&by(text), &all, is_kept);
    };
    check("speed > 2 && z < 0.5 && type == 1", &|i| {
        speed(i) > 2.0 && position(i).z < 0.5 && i % 4 == 1
    });
    check("vel.y + 2*X - -y/3 <= VEL[2] || !(density>=0)", &|i| {
        let (y, z) = (value(0, 3 * i + 1), value(0, 3 * i + 2));
        let p = position(i);
        let density = value(1, i);
        y + 2.0 * p.x + p.y / 3.0 <= z || density.is_nan() || density < 0.0
    });
    check("density == density && 1/(type-1) < 5", &|i| {
        !value(1, i).is_nan() && 1.0 / (value(2, i) - 1.0) < 5.0
    });
    check("density != 3", &|i| value(1, i) != 3.0);
    check("min(abs(x), y) > max(z, -1) && sqrt(density) > 1.5", &|i| {
        let p = position(i);
        p.x.abs().min(p.y) > p.z.max(-1.0) && value(1, i).sqrt() > 1.5
    });
    check("radius == 0.5 && id - index == -9 && time > 2.4", &|i| i % 3 == 1);
    check("`total energy`.y == 3 && `total energy` > 4", &|_| true);
    check("1e-3 > 2 && x > 0", &|_| false);
    // Operators of one level apply from the left
    check("8 / 4 / 2 - 1 - 1 == -1 && 2 + 3 * 2 == 8", &|_| true);
    check("type == 0 || type == 1 && x > 0", &|i| i % 4 == 0 || i % 4 == 1 && position(i).x > 0.0);
}

#[test]
fn ids_and_regions_select() {
    let all = particles();
    let selection = |text: &str, every| Selection {
        ids: Some(text.parse().expect(text)),
        every,
        ..Selection::default()
    };
    assert_selects(&selection("1-100,200", 1), &all, |i| (10..=109).contains(&i) || i == 209);
    assert_selects(&selection("-9-1000", 10), &all, |i| i <= 1009 && (i as i64 - 9) % 10 == 0);
    let mut without = all.clone();
    without.attributes.clear();
    assert_selects(&selection("0-9", 3), &without, |i| i <= 9 && i % 3 == 0);
    let (min, max) = (DVec3::new(-1.0, -2.0, -3.0), DVec3::splat(2.0));
    let is_in = |p: DVec3| p.x >= -1.0 && p.y >= -2.0 && p.z >= -3.0 && p.max_element() <= 2.0;
    let normal = DVec3::new(1.0, 2.0, 0.0);
    let point = DVec3::new(0.5, 0.0, 9.0);
    for (region, holds) in [
        (Region::Box { min, max }, &is_in as &dyn Fn(DVec3) -> bool),
        (Region::OutsideBox { min, max }, &|p| !is_in(p)),
        (Region::HalfSpace { point, normal }, &|p| (p.x - 0.5) + 2.0 * p.y <= 0.0),
        (Region::Slab { axis: 1, low: -0.5, high: 0.25 }, &|p| p.y >= -0.5 && p.y <= 0.25),
    ] {
        let selection = Selection { regions: vec![region], ..Selection::default() };
        assert_selects(&selection, &all, |i| holds(all.positions.get(i)));
        assert!(!region.contains(DVec3::NAN));
    }
}

#[test]
fn the_same_particles_whatever_the_threads() {
    let all = particles();
    let selection = by("x * y > z");
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(|| selection.survivors(&all))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn selected_particles_keep_all_that_is_theirs() {
    let mut all = particles();
    let original = all.clone();
    let indices = [0_u32, 5, 6, 1000];
    all.select(&indices);
    assert_eq!(all.positions.len(), 4);
    for (new, old) in indices.iter().enumerate() {
        let old = *old as usize;
        assert_eq!(all.positions.get(new), original.positions.get(old));
        for (a, b) in all.attributes.iter().zip(&original.attributes) {
            for c in 0..a.components {
                let found = a.data.get_f64(new * a.components + c);
                let expected = b.data.get_f64(old * b.components + c);
                assert_eq!(found.to_bits(), expected.to_bits(), "{}", a.name);
            }
        }
    }
}

#[test]
fn errors_say_where_and_what() {
    let long = "(".repeat(100) + "x > 1";
    for (text, expected) in [
        ("", "character 1: the condition ends here"),
        ("x", "character 1: this is a number, not a condition"),
        ("x > ", "character 5: the condition ends here"),
        ("x = 1", "character 3: `=` is not a sign of conditions: write == to compare"),
        ("x > 1 & y > 2", "character 7: `&` is not a sign of conditions: write &&"),
        ("x > 1 and y > 2", "character 7: `and` is not a sign of conditions: write && or ||"),
        ("not x > 1", "character 1: `not` is not a sign of conditions: write !"),
        ("0 < x < 1", "character 7: comparisons have two sides; join two of them with &&"),
        ("(x > 1) == 2", "character 1: `==` needs a number here, and this is a condition"),
        ("x > (y > 2)", "character 5: `>` needs a number here, and this is a condition"),
        ("x && y > 1", "character 1: `&&` needs a condition here, and this is a number"),
        ("x > 1 || y", "character 10: `||` needs a condition here"),
        ("!x > 1", "character 2: `!` needs a condition here"),
        ("-(x > 1)", "character 2: `-` needs a number here"),
        ("(x > 1", "character 7: expected `)` after the part in parentheses"),
        ("x > 1)", "character 6: unexpected `)`"),
        ("x ** 2 > 1", "character 3: `**` is not a sign of conditions: multiply"),
        ("cos(x) > 1", "character 1: unknown function `cos`; there are abs, sqrt, min, max"),
        ("min(x) > 1", "character 6: expected `,` between the two arguments of min"),
        ("sqrt(x, y) > 1", "character 7: expected `)` after the arguments of sqrt"),
        ("abs(x > 1) > 1", "character 5: `abs` needs a number here"),
        ("1e999 > x", "character 1: `1e999` is not a finite number"),
        ("v[x] > 1", "character 3: expected the number of a component"),
        ("x # 1", "character 3: unexpected character `#`"),
        ("`a > 1", "character 1: a backquote has no second one"),
        ("ä > 1 &", "character 7: `&`"),
        (&long, "more than 64 parentheses or signs"),
    ] {
        let error = Condition::parse(text).expect_err(text).to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
    let deep = "!".repeat(70) + "(x > 1)";
    assert!(Condition::parse(&deep).is_err());
    let huge = "x > 1 || ".repeat(1000) + "x > 1";
    assert!(Condition::parse(&huge).unwrap_err().what.contains("bytes"));
    // As long as is allowed, and neither deep nor slow
    let wide = "x>1||".repeat(800) + "x>1";
    assert!(Condition::parse(&wide).is_ok());
}

#[test]
fn names_without_a_value_are_found() {
    let all = particles();
    for (text, name, column) in [
        ("x > 1 && sped > 2", "sped", 10),
        ("vel.w > 1", "vel.w", 1),
        ("y < 0 || vel[3] > 1", "vel[3]", 10),
        ("height > 1", "height", 1),
    ] {
        let unknown = by(text).survivors(&all).expect_err(text);
        assert_eq!((unknown.name.as_str(), unknown.column), (name, column));
    }
    let tilted = Selection { up: Some(DVec3::new(0.0, 0.6, 0.8)), ..by("height > 0.5") };
    assert_selects(&tilted, &all, |i| {
        let place = all.positions.get(i);
        0.6 * place.y + 0.8 * place.z > 0.5
    });
    let mut empty = all.clone();
    empty.select(&[]);
    assert_eq!(by("sped > 1").survivors(&empty), Ok(Vec::new()));
    let mut timeless = all;
    timeless.time = None;
    assert!(by("time > 1").survivors(&timeless).is_err());
}

/// Counts and sums of indices by numpy: tests/data/selection/make.py.
#[test]
fn counts_are_those_of_numpy() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/selection");
    let input = SequenceInput::from_path(directory.join("particles.npz"));
    let sequence = Sequence::open(&input).expect("a frame");
    let all = sequence.load_raw(0).expect("readable");
    assert_eq!(all.positions.len(), 1100);
    assert!(matches!(all.positions, Positions::F32(_)));
    let counts = std::fs::read_to_string(directory.join("counts.tsv")).expect("a file");
    let mut lines = 0;
    for line in counts.lines() {
        let parts: Vec<&str> = line.split('\t').collect();
        let [count, sum, text] = parts[..] else {
            panic!("{line}");
        };
        let found = by(text).survivors(&all).expect(text);
        assert_eq!(found.len().to_string(), count, "{text}");
        let found = found.iter().map(|i| u64::from(*i)).sum::<u64>();
        assert_eq!(found.to_string(), sum, "{text}");
        lines += 1;
    }
    assert_eq!(lines, 5);
}

#[test]
fn nothing_else_is_selected_by_default() {
    assert!(Selection::default().is_all());
    let all =
        RawParticles { positions: Positions::F32(vec![Vec3::NAN; 3]), ..RawParticles::default() };
    assert_eq!(Selection::default().survivors(&all), Ok(vec![0, 1, 2]));
    assert_eq!(by("x < 0 || x >= 0").survivors(&all), Ok(Vec::new()));
}

/// Particles of the parts 0, 2 and 7, which are elements.
fn with_text() -> RawParticles {
    let attribute = |name: &str, values: Vec<i32>| Attribute {
        name: name.to_owned(),
        components: 1,
        data: AttributeData::I32(values),
    };
    let parts = [(0, "fluid"), (2, "/World/Wall"), (7, "8")];
    let parts = parts.map(|(number, name)| (number, name.to_owned())).into_iter().collect();
    let water = i32::try_from(name_code("water")).expect("small");
    RawParticles {
        positions: Positions::F32(vec![Vec3::ZERO; 4]),
        attributes: vec![
            attribute("part", vec![0, 2, 7, 2]),
            attribute("element", vec![6, 8, 17, water]),
        ],
        labels: [("part".to_owned(), parts)].into_iter().collect(),
        ..RawParticles::default()
    }
}

/// Particles with names of chains and atoms.
fn with_names() -> RawParticles {
    let columns =
        [("chain", ["A", "a", "X", "1", ""]), ("atom_name", ["CA", "C1'", "1HB", "LONGER", "O+"])];
    let mut all =
        RawParticles { positions: Positions::F32(vec![Vec3::ONE; 5]), ..RawParticles::default() };
    for (name, texts) in columns {
        let codes = texts.map(label_code);
        let labels =
            codes.iter().zip(texts).map(|(code, text)| (i64::from(*code), text.to_owned()));
        all.labels.insert(name.to_owned(), labels.collect());
        let data = AttributeData::I32(codes.to_vec());
        all.attributes.push(Attribute { name: name.to_owned(), components: 1, data });
    }
    all
}

#[test]
fn names_of_chains_and_atoms_are_text() {
    let (all, mut native) = (with_names(), with_names());
    native.labels.clear();
    for (text, expected) in [
        ("chain == A", &[0][..]),
        ("chain == a", &[1]),
        ("chain != A", &[1, 2, 3, 4]),
        // Not the position
        ("chain == X", &[2]),
        ("chain in (X, '1')", &[2, 3]),
        ("chain == ''", &[4]),
        ("atom_name == \"C1'\"", &[1]),
        ("atom_name == '1HB' || Atom_Name == LONGER", &[2, 3]),
        ("atom_name in (CA, 'O+') && x > 0", &[0, 4]),
        // Other frames may have them
        ("atom_name == OXT", &[]),
        ("atom_name != OXT", &[0, 1, 2, 3, 4]),
    ] {
        assert_eq!(by(text).survivors(&all).expect(text), expected, "{text}");
        assert_eq!(by(text).survivors(&native).expect(text), expected, "{text}");
    }
    // One of a list is enough
    let known = by("atom_name in (OXT, CA)");
    assert_eq!(known.check_names(&all.attributes, None, &all.labels), Ok(()));
    // Case does not matter where labels tell what is meant
    assert_eq!(by("atom_name == ca").survivors(&all), Ok(vec![0]));
    for (text, message) in [
        ("chain in (A, Z) && chain in (Q, Z)", "`chain` has no value `Q`"),
        ("chain == Z", "`chain` has no value `Z`; it has `A`, `X`, `a`, `1`"),
        (
            "chain == 1",
            "`chain` is text, not a number; compare it with text in quotes by ==, != or",
        ),
        ("x > 0 && chain in (A, 1)", "`chain` is text, not a number"),
        ("abs(chain) > 2", "`chain` is text, not a number"),
        ("chain > 2", "`chain` is text, not a number"),
    ] {
        let unknown = by(text).check_names(&all.attributes, None, &all.labels).expect_err(text);
        assert!(unknown.text_fault("").expect(text).starts_with(message), "{unknown:?}");
    }
}

#[test]
fn text_is_compared_with_names() {
    let all = with_text();
    for (text, expected) in [
        ("part == 'fluid'", &[0][..]),
        ("part == fluid", &[0]),
        ("part != FLUID", &[1, 2, 3]),
        ("part == \"wall\" && element == O", &[1]),
        ("part == '/World/Wall'", &[1, 3]),
        // A number is a number, and text may look like one
        ("part == 2", &[1, 3]),
        ("part == '8'", &[2]),
        ("part in (fluid, 7)", &[0, 2]),
        ("!(part in ('wall'))", &[0, 2]),
        ("element in (C, cl) || element == 'water'", &[0, 2, 3]),
        ("element == part + 6", &[0, 1]),
        ("element == part", &[]),
        ("element in (-1, 6)", &[0]),
    ] {
        assert_eq!(by(text).survivors(&all).expect(text), expected, "{text}");
    }
    for (text, message) in [
        ("part == wal", "`part` has no value `wal`; it has `fluid`, `/World/Wall`, `8`"),
        ("element == Xx", "`element` has no value `Xx`; it has `H`, `He`"),
        ("x == 'wall'", "`x` has numbers, and none of them is called `wall`"),
    ] {
        let unknown = by(text).survivors(&all).expect_err(text);
        assert!(unknown.text_fault("").expect(text).starts_with(message), "{unknown:?}");
    }
    for (text, expected) in [
        ("part < 'wall'", "character 8: text is compared by == or !="),
        ("'wall' == part", "character 1: text is compared by == or !="),
        ("part + 1 == 'wall'", "character 13: text is compared"),
        ("part == 'wall", "character 9: a quote has no second one"),
        ("part in wall", "character 9: expected `(` after `in`"),
        ("part in (wall", "character 14: expected `)` after the list"),
        ("part in ()", "character 10: expected a number or a name"),
    ] {
        let error = Condition::parse(text).expect_err(text).to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
}
