use std::path::Path;

use super::*;
use crate::Manifest;

fn read(text: &str) -> Result<Manifest, String> {
    let text = format!("input.path = \"a\"\n{text}");
    Manifest::parse(&text, Path::new("job.toml")).map_err(|e| e.to_string())
}

#[test]
fn styles_are_read_and_written() {
    let text = "[[style]]\nname = \"wall\"\nwhere = \"type == 2\"\ncolor = [0.5, 0.5, 0.5]\nopacity = 0.2\n\
                [[style]]\ndraw = \"balls-and-sticks\"\ncolor_by = \"charge\"\nmap = \"vik\"\nrange = [-1, 1]\n\
                material = { type = \"plastic\", roughness = 0.25 }\nbonds = { find = 1.5 }\n\
                [[style]]\nwhere = \"index > 3\"\ndraw = \"arrows\"\narrows = { attribute = \"f\", scale = 2 }";
    let manifest = read(text).unwrap();
    let [wall, balls, arrows] = &manifest.styles[..] else { panic!("three styles") };
    assert_eq!((wall.title(), arrows.title()), ("wall".to_owned(), "index > 3".to_owned()));
    assert_eq!(balls.bonds.as_ref().unwrap().find, Some(BondSearch::Distance(1.5)));
    let material = balls.material.as_ref().unwrap().resolved(&balls.color);
    assert_eq!(material.finish, Finish::Plastic { roughness: 0.25 });
    assert_eq!(arrows.arrows.as_ref().unwrap().scale, 2.0);
    let colors = ColorMapping {
        map: MapName::named("vik"),
        range: Some(RangeSetting::Values([-1.0, 1.0])),
        ..ColorMapping::by("charge")
    };
    assert_eq!(balls.colors(&ColorSetting::Auto), ColorSetting::Mapped(colors));
    // What is written is read as the same
    let again = Manifest::parse(&manifest.to_commented_toml(), Path::new("job.toml")).unwrap();
    assert_eq!(again.styles, manifest.styles);
    assert_eq!(again, manifest);
}

#[test]
fn impossible_styles_are_refused() {
    for (text, part) in [
        ("draw = \"stick\"", "did you mean sticks?"),
        ("where = \"type ==\"", "style.0.where"),
        ("color = [1, 0, 0]\ncolor_by = \"x\"", "style.0.color: color_by is given too"),
        ("material = { type = \"thin-glass\" }", "style.0.draw: "),
        (
            "draw = \"smooth\"\ncolor_by = \"x\"\nmaterial = { type = \"thin-glass\" }",
            "style.0.color_by: thin glass has one colour",
        ),
        (
            "draw = \"smooth\"\ncolor = { attribute = \"x\" }\nmaterial = { type = \"thin-glass\" }",
            "style.0.color: thin glass has one colour",
        ),
        (
            "material = { type = \"matte\", underlay = true }",
            "style.0.material.underlay: only thin glass is drawn behind",
        ),
        ("map = \"vik\"", "style.0.map: belongs to color_by"),
        ("range = [0, 1]", "style.0.range: belongs to color_by"),
        ("draw = \"arrows\"", "style.0.arrows: is missing; which arrows"),
        ("draw = \"trails\"", "style.0.trails: is missing"),
        ("arrows = { attribute = \"f\", scale = 1 }", "style.0.arrows: are drawn by a style"),
        ("draw = \"arrows\"\narrows = { attribute = \"f\" }", "style.0.arrows.scale: is missing"),
        ("bonds = { find = \"file\" }", "style.0.bonds: are drawn by a style"),
        ("bonds = { finds = \"file\" }", "did you mean `style.0.bonds.find`?"),
        ("material = { type = \"gold\" }", "style.0.material.type: expected"),
        ("material = { roughness = 0.1 }", "style.0.material.type: is missing"),
        ("material = { type = \"water\" }\nopacity = 0.5", "style.0.opacity: only opaque spheres"),
        ("draw = \"smooth\"\nopacity = 0.5", "style.0.opacity: only opaque spheres"),
        (
            "draw = \"sticks\"\nmaterial = { type = \"glass\" }",
            "style.0.material.type: sticks are opaque",
        ),
        ("radius = -1", "style.0.radius: expected"),
        ("shape = \"cuboid\"", "style.0.shape: belongs to a style with draw = \"grains\""),
        ("draw = \"grains\"\nsize = [1, -1, 1]", "style.0.size: expected 3 numbers above 0"),
        ("draw = \"grains\"\nsize = [1, 1]", "style.0.size: expected"),
        ("draw = \"grains\"\nshape = \"ball\"", "style.0.shape: expected"),
        ("draw = \"grains\"\nshape = \"mesh\"", "style.0.mesh: is missing"),
        ("mesh = \"a.stl\"", "style.0.mesh: belongs to a style with draw = \"grains\""),
        (
            "draw = \"grains\"\nshape = \"capsule\"\nmesh = \"a.stl\"",
            "style.0.mesh: belongs to shape = \"mesh\"",
        ),
        ("draw = \"grains\"\nmesh = \"a.##.stl\"", "style.0.mesh: has the number of a frame"),
        (
            "draw = \"grains\"\norientation = { quat = [\"a\"] }",
            "style.0.orientation.quat: unknown key; known here: quaternion",
        ),
    ] {
        let error = read(&format!("[[style]]\n{text}")).unwrap_err();
        assert!(error.contains(part), "{text}: {error}");
    }
    let error = read(&"[[style]]\n".repeat(65)).unwrap_err();
    assert!(error.contains("style: 65 styles"), "{error}");
}

/// The condition on particles that are drawn.
fn shown(text: &str) -> Option<String> {
    let selection = read(text).unwrap().selection();
    selection.condition.map(|condition| condition.as_str().to_owned())
}

#[test]
fn hidden_styles_are_conditions() {
    let style = |condition: &str, draw: &str| {
        let condition = match condition {
            "" => String::new(),
            condition => format!("where = \"{condition}\"\n"),
        };
        format!("[[style]]\n{condition}draw = \"{draw}\"\n")
    };
    assert_eq!(shown(&style("x > 1", "spheres")), None);
    assert_eq!(shown(&style("x > 1", "hidden")).unwrap(), "!(x > 1)");
    assert_eq!(shown(&(style("x > 1", "spheres") + &style("", "hidden"))).unwrap(), "x > 1");
    assert_eq!(shown(&style("", "hidden")).unwrap(), "index < 0");
    let both = style("x > 1", "hidden") + &style("y > 2", "sticks") + &style("", "hidden");
    assert_eq!(shown(&both).unwrap(), "!(x > 1) && (y > 2)");
    // A particle that an earlier style takes is drawn
    let both = style("x > 1", "spheres") + &style("y > 2", "hidden");
    assert_eq!(shown(&both).unwrap(), "(x > 1) || (!(y > 2))");
    let both = format!("select.where = \"z < 0\"\n{}", style("x > 1", "hidden"));
    assert_eq!(shown(&both).unwrap(), "(z < 0) && (!(x > 1))");
}

#[test]
fn several_clear_styles_must_be_bodies() {
    let clear = "[[style]]\nwhere = \"type == 1\"\nmaterial = { type = \"glass\" }\n";
    let bodies = format!("{clear}draw = \"union\"\n");
    let error = read(&format!("{clear}{bodies}")).unwrap_err();
    assert!(error.contains("style.0.material: style.1.material is clear, too"), "{error}");
    assert!(error.contains("set style.0.draw = \"smooth\" or \"union\""), "{error}");
    let error = read(&format!("material.type = \"water\"\n{bodies}")).unwrap_err();
    assert!(error.contains("material.type: style.0.material is clear, too"), "{error}");
    assert!(error.contains("set render.surface = \"smooth\""), "{error}");
    let water = "material.type = \"water\"\nrender.surface = \"smooth\"\n";
    assert!(read(&format!("{water}{}", bodies.repeat(7))).is_ok());
    let error = read(&format!("{water}{}", bodies.repeat(8))).unwrap_err();
    assert!(error.contains("style.7.material: 9 clear bodies, but at most 8"), "{error}");
    assert!(read(&bodies.repeat(8)).is_ok());
    let error = read(&bodies.repeat(9)).unwrap_err();
    assert!(error.contains("style.8.material: 9 clear bodies, but at most 8"), "{error}");
}
