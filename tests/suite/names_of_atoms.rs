//! Names of chains, residues and atoms from outside: conditions, colours, `inspect`, topologies and native frames.

use std::fmt::Write as _;
use std::fs;

use serde_json::Value;

use crate::harness::{Ran, Workshop};

/// Two models of a PDB file: the chains A and B, and water without a chain; only the second model has a ligand.
fn protein() -> Workshop {
    let shop = Workshop::new();
    let atoms = [
        (" N  ", "ALA", 'A'),
        (" CA ", "ALA", 'A'),
        (" C1'", "GLY", 'B'),
        ("1HB ", "GLY", 'B'),
        (" O  ", "HOH", ' '),
    ];
    let mut text = String::new();
    for model in 1..=2 {
        let ligand = (model == 2).then_some((" C9 ", "LIG", 'X'));
        let _ = writeln!(text, "MODEL     {model:4}");
        for (i, (name, residue, chain)) in atoms.into_iter().chain(ligand).enumerate() {
            let x = 3 * i;
            let _ = writeln!(
                text,
                "ATOM  {i:5} {name} {residue} {chain}   1    {x:8.3}   0.000   0.000"
            );
        }
        text += "ENDMDL\n";
    }
    fs::write(shop.join("in.pdb"), text).expect("a file");
    shop
}

const SMALL: [&str; 3] = ["--width=32", "--height=18", "--samples=1"];

fn render(shop: &Workshop, input: &str, options: &[&str]) -> Ran {
    let command = ["render", input, "-o", "out/f.#.exr", "--force", "--look=none"];
    shop.run(&[&command[..], &SMALL, options].concat())
}

/// The number of particles of the second frame that a condition keeps.
#[track_caller]
fn keeps(shop: &Workshop, input: &str, condition: &str, expected: u64) {
    let command = ["still", input, "-o", "f.png", "--look=none", "--radius=1", "--frame=2"];
    let ran = shop.run(&[&command[..], &SMALL, &["--where", condition]].concat()).expect(0);
    let text = ran.text() + &ran.errors();
    assert!(text.contains(&format!("frame 2, {expected} particle")), "{condition}: {text}");
}

#[test]
fn names_select_atoms() {
    let shop = protein();
    shop.run(&["convert", "in.pdb", "-o", "native"]).expect(0);
    // The first frame has no X
    for (condition, expected) in [
        ("chain == X", 1),
        ("residue_name in (HOH, WAT, LIG)", 2),
        ("atom_name in (\"C1'\", '1HB') && chain != A", 2),
    ] {
        keeps(&shop, "in.pdb", condition, expected);
        keeps(&shop, "native", condition, expected);
    }
    for (condition, message) in [
        ("chain == Z", "`chain` has no value `Z` (did you mean `A`?); it has `A`, `B`, `X`"),
        ("chain == 1", "`chain` is text, not a number; compare it with text in quotes"),
    ] {
        render(&shop, "in.pdb", &["--where", condition]).expect(2).prints(message);
        render(&shop, "native", &["--where", condition]).expect(2).prints(message);
    }
}

#[test]
fn names_are_categories_of_colours() {
    let shop = protein();
    let still = ["still", "in.pdb", "-o", "f.png", "--width=320", "--height=240", "--samples=1"];
    let by_chain = [&still[..], &["--color-by", "chain"]].concat();
    shop.run(&by_chain).expect(0).prints("4 categories");
    let linear = ["--color-by", "chain", "--color-scale", "linear"];
    render(&shop, "in.pdb", &linear).expect(2).prints("`chain` is text, which has no range");
    let radius = ["--set", "input.radius={attribute=\"atom_name\"}"];
    render(&shop, "in.pdb", &radius).expect(2).prints("`atom_name` is text, not a number");
    // What colours molecules unasked is the same
    shop.run(&still).expect(0).prints("elements have their usual colours");
}

#[test]
fn inspect_prints_names() {
    let shop = protein();
    let text = shop.run(&["inspect", "in.pdb"]).expect(0).text();
    assert!(text.contains("chain (i32 x 1): [0 .. 2] A, B (2 names)"), "{text}");
    assert!(text.contains("ALA, LIG, HOH, GLY (4 names)"), "{text}");
    let text = shop.run(&["inspect", "--json", "in.pdb"]).expect(0).text();
    let first: Value = serde_json::from_str(text.lines().next().expect("a step")).expect("JSON");
    let attributes = first["attributes"].as_array().expect("attributes");
    let chain = attributes.iter().find(|a| a["name"] == "chain").expect("chains");
    assert_eq!(chain["labels"], serde_json::json!({"0": "", "1": "A", "2": "B"}));
}

#[test]
fn trajectories_have_the_names_of_their_topology() {
    let shop = Workshop::new();
    for name in ["double.trr", "water.gro"] {
        let from = crate::harness::sample(&format!("molecules/{name}"));
        fs::copy(from, shop.join(name)).expect("a copy");
    }
    let mut psf = "PSF\n\n 12 !NATOM\n".to_owned();
    for i in 0..12 {
        let name = ["OW", "HW1", "HW2"][i % 3];
        let _ = writeln!(psf, "{} WAT {} SOL {name} T 0.1 1.0 0", i + 1, 1 + i / 3);
    }
    fs::write(shop.join("water.psf"), psf).expect("a file");
    for (topology, condition) in
        [("water.gro", "atom_name == OW"), ("water.psf", "segment == WAT && atom_name == OW")]
    {
        let options = ["--topology", topology, "--radius=0.1", "--where", condition];
        render(&shop, "double.trr", &options).expect(0);
        assert_eq!(shop.report("out")["totals"]["particles"], 8, "{topology}");
    }
}
