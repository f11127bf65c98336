//! Topologies and other files that inputs refer to: `inspect` shows them, and jobs notice when they change.

use std::fs;

use serde_json::Value;

use crate::harness::{Workshop, sample};

/// A trajectory of 12 atoms in three frames, and its topology.
fn trajectory() -> Workshop {
    let shop = Workshop::new();
    for (from, to) in [("double.trr", "md.trr"), ("water.gro", "conf.gro")] {
        let from = sample(&format!("molecules/{from}"));
        fs::copy(from, shop.join(to)).expect("a copy");
    }
    shop
}

/// Another atom in the topology.
fn change(shop: &Workshop) {
    let text = fs::read_to_string(shop.join("conf.gro")).expect("a topology");
    let changed = text.replacen("OW", " C", 1);
    assert_ne!(changed, text);
    fs::write(shop.join("conf.gro"), changed).expect("writable");
}

const TOPOLOGY: [&str; 2] = ["--topology", "conf.gro"];

#[test]
fn inspect_shows_the_attributes_of_a_topology() {
    let shop = trajectory();
    let names = |options: &[&str]| -> Vec<String> {
        let ran = shop.run(&[&["inspect", "--json", "md.trr"], options].concat()).expect(0);
        let text = ran.text();
        let first: Value =
            serde_json::from_str(text.lines().next().expect("a frame")).expect("an object");
        let attributes = first["attributes"].as_array().expect("attributes");
        attributes.iter().map(|a| a["name"].as_str().expect("a name").to_owned()).collect()
    };
    assert_eq!(names(&[]), ["velocity"]);
    let all = ["velocity", "element", "residue", "residue_name", "atom_name"];
    assert_eq!(names(&TOPOLOGY), all);
    let ran = shop.run(&["inspect", "md.trr", "--topology", "conf.gro"]);
    assert!(ran.expect(0).text().contains("element"));
    shop.run(&["inspect", "md.trr", "--topology", "nothing.gro"]).expect(2).prints("nothing.gro");
    // A topology of other atoms
    fs::copy(sample("molecules/quartz.xyz"), shop.join("other.xyz")).expect("a copy");
    shop.run(&["inspect", "md.trr", "--topology", "other.xyz"])
        .expect(1)
        .prints("give the topology");
}

#[test]
fn jobs_notice_that_a_topology_has_changed() {
    let shop = trajectory();
    let convert = |options: &[&str]| {
        shop.run(&[&["convert", "md.trr", "-o", "native"], &TOPOLOGY[..], options].concat())
    };
    let ran = convert(&[]).expect(0);
    let frames = ran.rendered();
    assert!(!frames.is_empty());
    convert(&[]).expect(0).prints("are done already");
    let small = ["--width=32", "--height=18", "--samples=1", "--color-by", "element"];
    let render = |options: &[&str]| {
        shop.run(
            &[&["render", "md.trr", "-o", "out/f.#.exr"], &TOPOLOGY[..], &small, options].concat(),
        )
    };
    assert_eq!(render(&[]).expect(0).rendered(), frames);
    render(&[]).expect(0).prints("are done already");
    change(&shop);
    for ran in [convert(&[]), render(&[])] {
        assert_ne!(ran.code(), Some(0), "{}", ran.errors());
        assert!(ran.errors().contains("conf.gro"), "{}", ran.errors());
    }
    assert_eq!(convert(&["--force"]).expect(0).rendered(), frames);
    assert_eq!(render(&["--force"]).expect(0).rendered(), frames);
    // Without the topology it is another job
    let ran = shop.run(&["convert", "md.trr", "-o", "native"]);
    assert_ne!(ran.code(), Some(0), "{}", ran.errors());
}

#[test]
fn jobs_notice_that_a_file_of_an_external_link_has_changed() {
    let shop = Workshop::new();
    fs::create_dir(shop.join("parts")).expect("writable");
    for file in ["linked.hdf5", "parts/first.h5", "parts/second.h5", "parts/type.h5"] {
        fs::copy(sample(&format!("hdf5_links/{file}")), shop.join(file)).expect("a copy");
    }
    let inspected = shop.run(&["inspect", "linked.hdf5"]).expect(0).text();
    let others = "refers to other files: parts/first.h5, parts/type.h5";
    assert!(inspected.contains(others), "{inspected}");
    let render = |options: &[&str]| {
        let fixed = ["render", "linked.hdf5", "-o", "out/f.#.exr", "--radius=0.1"];
        let small = ["--width=32", "--height=18", "--samples=1"];
        shop.run(&[&fixed[..], &small, options].concat())
    };
    assert_eq!(render(&[]).expect(0).rendered().len(), 1);
    render(&[]).expect(0).prints("are done already");
    // A coordinate in the file behind the virtual data set behind the link
    let path = shop.join("parts/second.h5");
    let bytes = fs::read(&path).expect("readable");
    fs::write(&path, &bytes[..bytes.len() - 1]).expect("writable");
    let ran = render(&[]);
    assert_ne!(ran.code(), Some(0), "{}", ran.errors());
    assert!(ran.errors().contains("second.h5"), "{}", ran.errors());
}
