//! Help and the messages about arguments: what users read first.

use crate::harness::{Workshop, dam_break};

fn help(arguments: &[&str]) -> String {
    Workshop::new().run(arguments).expect(0).text()
}

#[test]
fn options_come_in_groups_with_examples() {
    for command in ["render", "check"] {
        let text = help(&[command, "-h"]);
        let headings = ["Input:", "Camera:", "Image:", "Look:", "Output:", "Job:", "Examples:"];
        let places: Vec<usize> = headings
            .iter()
            .map(|heading| text.find(&format!("\n{heading}\n")).expect(heading))
            .collect();
        assert!(places.is_sorted(), "{text}");
        for default in ["[default: 1920]", "[default: all]", "[default: out/frame.####.exr]"] {
            assert!(text.contains(default), "{default}");
        }
    }
    for command in [
        &["render"][..],
        &["check"],
        &["convert"],
        &["scale"],
        &["generate"],
        &["inspect"],
        &["export"],
        &["movie"],
        &["sheet"],
        &["view"],
        &["completions"],
        &["man"],
    ] {
        let short = help(&[command, &["-h"]].concat());
        let long = help(&[command, &["--help"]].concat());
        for text in [&short, &long] {
            let (_, examples) = text.split_once("Examples:\n").expect("examples");
            let first = format!("  spherule {} ", command[0]);
            let count = examples.lines().filter(|l| l.starts_with(&first)).count();
            assert_eq!(count, 3, "{examples}");
        }
        assert!(short.len() <= long.len());
    }
}

/// The commands that the help lists.
fn commands() -> Vec<String> {
    let text = help(&["--help"]);
    let (_, list) = text.split_once("Commands:\n").expect("commands");
    let lines = list.lines().take_while(|line| !line.is_empty());
    lines
        .filter_map(|line| Some(line.split_whitespace().next()?.to_owned()))
        .filter(|name| name != "help")
        .collect()
}

#[test]
fn completions_know_every_command_and_option() {
    for shell in ["bash", "zsh", "fish"] {
        let script = help(&["completions", shell]);
        for name in commands() {
            assert!(script.contains(&name), "{shell}: {name}");
        }
        for option in ["samples", "colorbar", "where"] {
            assert!(script.contains(option), "{shell}: {option}");
        }
    }
    // Values, too
    let script = help(&["completions", "bash"]);
    for values in [
        "auto plain paper studio water whitted none",
        "spheres union smooth",
        "viridis turbo plasma",
        "linear log symlog",
        "f32 q16 q10",
    ] {
        assert!(script.contains(values), "{values}");
    }
    let errors = Workshop::new().run(&["completions", "csh"]).expect(2).errors();
    assert!(errors.contains("[possible values: bash"), "{errors}");
}

#[test]
fn every_command_has_a_manual_page() {
    let program = help(&["man"]);
    assert!(program.contains(".TH spherule 1"), "{program}");
    for name in commands() {
        assert!(program.contains(&format!("spherule\\-{name}(1)")), "{name}");
        let page = help(&["man", &name]);
        assert!(page.contains(&format!("spherule\\-{name}")), "{page}");
    }
    let render = help(&["man", "render"]);
    assert!(render.contains("\\-\\-samples"));
    assert!(render.contains(concat!("\"spherule ", env!("CARGO_PKG_VERSION"), "\"")), "{render}");
    let (_, status) = render.split_once(".SH \"EXIT STATUS\"\n").expect("the codes");
    let (_, examples) = status.split_once(".SH EXAMPLES\n.nf\n").expect("examples");
    assert!(examples.contains("\\&  spherule render run1 \\-o out/frame.####.exr\n"), "{examples}");
    let errors = Workshop::new().run(&["man", "rendr"]).expect(2).errors();
    assert!(errors.contains("`rendr`") && errors.contains("render, still"), "{errors}");
}

#[test]
fn hidden_commands_are_neither_listed_nor_suggested() {
    let workshop = Workshop::new();
    let listed = help(&["--help"]);
    for (typed, hidden) in [
        ("render-fram", "render-frame"),
        ("render-frames", "render-frame"),
        ("scale-cel", "scale-cell"),
        ("scale-cells", "scale-cell"),
    ] {
        assert!(!listed.contains(hidden));
        let errors = workshop.run(&[typed]).expect(2).errors();
        assert!(!errors.contains(&format!("'{hidden}'")), "{errors}");
    }
}

/// Help and examples match the program.
#[test]
fn the_manual_of_maps_is_complete() {
    let text = include_str!("../../docs/manual/colours.md");
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1]);
    let errors = workshop.run(&["render", "in", "--map", "xyzzy"]).expect(2).errors();
    let (_, list) = errors.split_once("choose one of ").expect("a list");
    let (names, _) = list.split_once(';').expect("an end");
    assert!(names.split(", ").count() > 50, "{names}");
    for name in names.split(", ") {
        assert!(text.contains(&format!("`{name}`")), "{name}");
    }
}
