use std::path::Path;

use spherule_formats::SimulationCell;

use super::*;
use crate::manifest::{
    AxisView, BondSearch, ColorSetting, GroundKind, GroundSetting, OverlayKind, RadiusSetting,
    StyleDraw, TextSize,
};
use crate::survey::{Axes, Elements, GrainRadius, ShapeSource, Tank, WallSign, WallValues};

/// Facts of a thousand particles in a unit cube without attributes.
fn facts() -> Facts {
    Facts { particles: 1000, bounds: Some((DVec3::ZERO, DVec3::ONE)), ..Facts::default() }
}

fn category(name: &str, values: &[i64], at_rest: &[i64]) -> Category {
    let walls = WallValues { values: at_rest.to_vec(), sign: WallSign::Rest };
    let walls = Some(walls).filter(|walls| !walls.values.is_empty());
    let kept = values.iter().filter(|value| !at_rest.contains(value));
    let without_walls = kept.copied().collect();
    let resting = at_rest.to_vec();
    Category { name: name.to_owned(), values: values.to_vec(), walls, without_walls, resting }
}

/// The manifest of `text` with the defaults that follow from `facts`, and the lines of the rules.
fn completed(text: &str, facts: &Facts, files: Files<'_>) -> (Manifest, String) {
    let text = format!("input.path = \"data\"\n{text}");
    // Keys before all tables
    let text = match text.split_once("look =") {
        Some((before, after)) => format!("look ={after}\n{before}"),
        None => text,
    };
    let source = ManifestSource::new(text, Path::new("job.toml"), Vec::new());
    let (manifest, _) = source.parse().unwrap();
    let found = rules(&manifest, &source, facts, files);
    let completed = source.parse_over(found.settings).unwrap();
    (completed, found.lines.join("\n"))
}

fn of(text: &str, facts: &Facts) -> Manifest {
    completed(text, facts, Files::default()).0
}

fn attribute(manifest: &Manifest) -> Option<&str> {
    match &manifest.material.color {
        ColorSetting::Mapped(by) => by.attribute.as_deref(),
        _ => None,
    }
}

fn has_legend(manifest: &Manifest) -> bool {
    let mut overlays = manifest.overlays.iter();
    overlays.any(|overlay| matches!(overlay.kind, OverlayKind::ColorBar { .. }))
}

#[test]
fn elements_have_their_colours_and_radii() {
    let mut atoms = facts();
    atoms.elements = Some(Elements { has_others: true, is_solid: false });
    atoms.has_velocities = true;
    atoms.has_time = true;
    let (manifest, lines) = completed("", &atoms, Files::default());
    assert_eq!(attribute(&manifest), Some("element"));
    assert!(matches!(manifest.input.radius, RadiusSetting::Table { scale, .. } if scale == 1.0));
    assert!(manifest.select.condition.is_some() && lines.contains("virtual sites"), "{lines}");
    assert!(has_legend(&manifest) && manifest.overlays.len() == 2);
    assert_eq!(manifest.render.ground.map(|g| g.kind), Some(crate::manifest::GroundKind::None));
    // With bonds
    atoms.has_bonds = true;
    let bonded = of("", &atoms);
    assert_eq!(bonded.bonds.find, BondSearch::File);
    assert!(matches!(bonded.input.radius, RadiusSetting::Table { scale, .. } if scale == 0.5));
    // Whatever is named stays
    let own = of(
        "input.radius = 0.3\n[bonds]\nfind = \"none\"\n[material]\ncolor = [1, 0, 0]\n[select]\nwhere = \"z > 0\"",
        &atoms,
    );
    assert_eq!(own.input.radius, RadiusSetting::Length(0.3));
    assert_eq!(own.bonds.find, BondSearch::None);
    assert!(attribute(&own).is_none() && !has_legend(&own));
    // A map alone is that of the elements
    let mapped = of("material.color.map = \"turbo\"", &atoms);
    assert_eq!(attribute(&mapped), Some("element"));
}

#[test]
fn categories_come_before_speed_and_walls_have_none() {
    let mut fluid = facts();
    fluid.has_velocities = true;
    assert!(matches!(of("", &fluid).material.color, ColorSetting::Auto));
    assert!(has_legend(&of("", &fluid)));
    fluid.categories = vec![category("type", &[0, 1, 3], &[])];
    assert_eq!(attribute(&of("", &fluid)), Some("type"));
    // One type remains: it has the colours of its speed
    fluid.categories = vec![category("type", &[0, 1, 3], &[0, 3])];
    let (manifest, lines) = completed("", &fluid, Files::default());
    assert_eq!(attribute(&manifest), None);
    assert_eq!(glass_of(&manifest), Some("type == 0 || type == 3"));
    assert!(lines.contains("glass behind the others: particles with type 0, 3"), "{lines}");
    let hint = "(--style 'type == 0 || type == 3: hidden' leaves them out)";
    assert!(lines.contains(hint), "{lines}");
    // Nor do other categories that the walls alone had
    fluid.categories.push(Category { without_walls: vec![1], ..category("mk", &[1, 11], &[]) });
    assert_eq!(attribute(&of("", &fluid)), None);
    // Frozen atoms are no walls
    fluid.elements = Some(Elements { has_others: false, is_solid: false });
    assert!(of("", &fluid).styles.is_empty());
}

#[test]
fn water_that_hides_other_molecules_is_left_out() {
    let mut solution = facts();
    solution.elements = Some(Elements { has_others: true, is_solid: false });
    solution.hiding_water = ["HOH", "SOL"].map(str::to_owned).to_vec();
    let (manifest, lines) = completed("", &solution, Files::default());
    let atoms = "element >= 1 && element <= 118";
    let condition = format!("\"{atoms} && !(residue_name in (HOH, SOL))\"");
    assert!(manifest.settings().contains(&("select.where".to_owned(), condition)));
    assert!(lines.contains("virtual sites") && lines.contains("left out: water"), "{lines}");
    // Whoever draws it has a style or a condition for it
    let style = "[[style]]\nwhere = \"residue_name == SOL\"\nopacity = 0.1";
    let condition = ("select.where".to_owned(), format!("\"{atoms}\""));
    assert!(of(style, &solution).settings().contains(&condition));
    let (_, lines) = completed("[select]\nwhere = \"z > 0\"", &solution, Files::default());
    assert!(!lines.contains("left out"), "{lines}");
}

#[test]
fn parts_have_their_names_in_the_legend() {
    let mut two = facts();
    two.categories = vec![category("part", &[0, 2], &[])];
    let parts = ["water", "wall", "ship"].map(str::to_owned);
    let files = Files { parts: &parts, ..Files::default() };
    let (manifest, _) = completed("", &two, files);
    let ColorSetting::Mapped(by) = &manifest.material.color else {
        panic!("no map");
    };
    let names = by.names.as_ref().expect("names");
    assert_eq!(names.0, [(0, "water".to_owned()), (2, "ship".to_owned())]);
}

#[test]
fn cells_are_drawn_if_the_particles_fill_them() {
    let cell = |edge: f64| {
        let edges = DVec3::AXES.map(|axis| edge * axis);
        SimulationCell::new(DVec3::ZERO, edges, [true; 3]).expect("a cell")
    };
    let mut crystal = facts();
    crystal.cell = Some(cell(1.0));
    crystal.in_cell = 1.0;
    crystal.cell_extent = [1.0; 3];
    let manifest = of("", &crystal);
    assert!(manifest.cell.visible);
    assert_eq!(manifest.camera.projection, ProjectionKind::Orthographic);
    assert_eq!(manifest.camera.angles(DVec3::Z), CELL_VIEW);
    let side = of("camera.view = \"front\"", &crystal);
    assert_eq!(side.camera.view, Some(AxisView::Front));
    // A slab with empty space above it, a heap in a large domain, and molecules that were made whole
    for (extent, in_cell, is_drawn) in
        [([1.0, 1.0, 0.3], 1.0, true), ([0.9, 0.5, 0.5], 1.0, false), ([1.0; 3], 0.5, false)]
    {
        crystal.cell_extent = extent;
        crystal.in_cell = in_cell;
        assert_eq!(of("", &crystal).cell.visible, is_drawn, "{extent:?} {in_cell}");
    }
}

#[test]
fn planes_are_seen_from_their_front_in_flat_light() {
    let mut plane = facts();
    plane.has_velocities = true;
    for (max, is_y_up, side) in [
        (DVec3::new(1.0, 0.0, 1.0), false, AxisView::Front),
        (DVec3::new(1.0, 1.0, 0.0), false, AxisView::Top),
        (DVec3::new(1.0, 1.0, 0.0), true, AxisView::Front),
        (DVec3::new(0.0, 1.0, 1.0), true, AxisView::Right),
    ] {
        plane.bounds = Some((DVec3::ZERO, max));
        let files = Files { is_y_up, ..Files::default() };
        let (manifest, _) = completed("", &plane, files);
        assert_eq!(manifest.camera.view, Some(side), "{max}");
        assert_eq!(manifest.integrator(), IntegratorKind::Whitted);
        assert_eq!(manifest.camera.projection, ProjectionKind::Orthographic);
    }
    // Shading tells atoms apart, and particles of one colour
    let lit = |plane: &Facts| of("", plane).integrator() == IntegratorKind::Path;
    let one_color = Facts { has_velocities: false, ..plane.clone() };
    let elements = Some(Elements { has_others: false, is_solid: false });
    assert!(lit(&one_color) && lit(&Facts { elements, ..plane.clone() }) && !lit(&plane));
    // Nor is anything but the light of a material that is given
    let glass = of("material.transmission = 1", &plane);
    assert_eq!(glass.material.constants.transmission, 1.0);
    assert_ne!(glass.material.constants.ambient, 1.0);
}

#[test]
fn clear_particles_have_no_legend_of_colours_that_are_not_seen() {
    let fluid = Facts { has_velocities: true, ..facts() };
    assert!(has_legend(&of("", &fluid)) && has_legend(&of("material.type = \"metal\"", &fluid)));
    for clear in ["type = \"glass\"", "type = \"water\"", "transmission = 0.5"] {
        assert!(!has_legend(&of(&format!("material.{clear}"), &fluid)), "{clear}");
    }
}

#[test]
fn looks_have_their_own_rules() {
    let mut fluid = facts();
    fluid.has_velocities = true;
    let white = Some(crate::scene::Background::Constant(glam::Vec3::ONE));
    assert_eq!(of("", &fluid).render.background, white);
    assert_eq!(of("", &fluid).camera.fov, FOV);
    let plain = of("look = \"plain\"", &fluid);
    assert!(plain.render.background == white && plain.overlays.is_empty());
    assert_ne!(of("look = \"studio\"", &fluid).render.background, white);
    for look in ["none", "whitted"] {
        let manifest = of(&format!("look = \"{look}\""), &fluid);
        let bare = Manifest::new("data").camera;
        assert!(manifest.camera == bare && manifest.overlays.is_empty(), "{look}");
    }
    // On paper, text has the size of a journal's
    let sizes = |text: &str| of(text, &fluid).overlays[0].size;
    assert_eq!(sizes("image.width = \"80mm\""), TextSize::Points(7.0));
    assert_eq!(sizes(""), TextSize::Fraction(0.032));
    let given = "image.width = \"80mm\"\n[[overlay]]\ntype = \"axes\"\n";
    assert_eq!(sizes(given), TextSize::Points(7.0));
    assert_eq!(sizes(&format!("{given}size = 0.1")), TextSize::Fraction(0.1));
    // Small pictures have no legend, and cameras that are placed keep their lens
    assert!(of("image.width = 200\nimage.height = 100", &fluid).overlays.is_empty());
    let placed = of("camera.eye = [0, -9, 0]\ncamera.look_at = [0, 0, 0]", &fluid);
    assert_eq!(placed.camera.fov, Manifest::new("").camera.fov);
    // Nothing is known of no particles
    let nothing = of("", &Facts::default());
    assert_eq!(nothing, of("look = \"auto\"", &Facts::default()));
}

/// The types of the overlays of a manifest.
fn types(manifest: &Manifest) -> Vec<&'static str> {
    manifest.overlays.iter().map(|overlay| overlay.kind.type_name()).collect()
}

#[test]
fn overlays_that_are_given_replace_those_of_their_type() {
    let mut fluid = facts();
    (fluid.has_velocities, fluid.has_time) = (true, true);
    let overlay = |kind: &str| format!("[[overlay]]\ntype = \"{kind}\"\n");
    for (given, expected) in [
        (String::new(), &["colorbar", "text"][..]),
        (overlay("axes"), &["axes", "colorbar", "text"]),
        (overlay("scale_bar"), &["scale_bar", "colorbar", "text"]),
        (overlay("text"), &["text", "colorbar"]),
        (overlay("colorbar"), &["colorbar", "text"]),
        (overlay("text") + &overlay("colorbar"), &["text", "colorbar"]),
        ("overlay = []".to_owned(), &[]),
        ("legend = false".to_owned(), &[]),
        (format!("legend = false\n{}", overlay("axes")), &["axes"]),
        (format!("{}look = \"plain\"", overlay("axes")), &["axes"]),
    ] {
        assert_eq!(types(&of(&given, &fluid)), expected, "{given}");
    }
}

#[test]
fn all_text_has_one_size() {
    let mut fluid = facts();
    (fluid.has_velocities, fluid.has_time) = (true, true);
    let sizes = |text: &str| -> Vec<TextSize> {
        of(text, &fluid).overlays.iter().map(|overlay| overlay.size).collect()
    };
    let axes = "[[overlay]]\ntype = \"axes\"\n";
    assert_eq!(sizes(axes), [TextSize::Fraction(0.032); 3]);
    assert_eq!(sizes(&format!("{axes}size = 0.05\n{axes}")), [TextSize::Fraction(0.05); 4]);
    assert_eq!(sizes(&format!("image.dpi = 300\n{axes}")), [TextSize::Points(7.0); 3]);
    // Without a legend, overlays have the default of their key
    assert_eq!(sizes(&format!("{axes}look = \"plain\"")), [TextSize::Fraction(0.026)]);
}

#[test]
fn jobs_that_go_on_have_the_defaults_of_their_plan() {
    let mut atoms = facts();
    atoms.elements = Some(Elements { has_others: true, is_solid: false });
    atoms.has_time = true;
    atoms.shape_source = Some(ShapeSource { what: "types".to_owned(), radius: Some(0.1) });
    for text in [
        "",
        "material.color.map = \"turbo\"",
        "image.samples = 4",
        "image.width = \"80mm\"\n[[overlay]]\ntype = \"axes\"",
        "legend = false",
        "overlay = []",
        "[[overlay]]\ntype = \"text\"",
        "[[style]]\ndraw = \"hidden\"\nwhere = \"x > 1\"",
    ] {
        let begun = of(text, &atoms);
        let source = ManifestSource::new(
            format!("input.path = \"data\"\n{text}"),
            Path::new("job.toml"),
            Vec::new(),
        );
        let resumed = source.parse_over(planned(&source, &begun.settings())).unwrap();
        assert_eq!(resumed.settings(), begun.settings(), "{text}");
    }
    // Walls
    let source = ManifestSource::new("input.path = \"data\"", Path::new("x"), Vec::new());
    let begun = of("", &in_tank());
    let resumed = source.parse_over(planned(&source, &begun.settings())).unwrap();
    assert_eq!(glass_of(&resumed), Some("!(speed > 0)"));
    assert_eq!(resumed.settings(), begun.settings());
    // A job of an earlier version: without rules
    let (plain, _) = source.parse().unwrap();
    let resumed = source.parse_over(planned(&source, &plain.settings())).unwrap();
    assert_eq!(resumed.settings(), plain.settings());
    assert_ne!(of("", &atoms).settings(), plain.settings());
}

#[test]
fn solids_have_covalent_radii() {
    let mut crystal = facts();
    crystal.elements = Some(Elements { has_others: false, is_solid: true });
    let (manifest, lines) = completed("", &crystal, Files::default());
    let expected = RadiusSetting::Table {
        attribute: ELEMENT.to_owned(),
        table: crate::scene::RadiusTable::Covalent,
        scale: 1.0,
    };
    assert_eq!(manifest.input.radius, expected);
    assert!(lines.contains("their covalent radii"), "{lines}");
}

#[test]
fn scalars_colour_particles_without_velocities() {
    let mut hot = facts();
    hot.scalar = Some("Temperature".to_owned());
    assert_eq!(attribute(&of("", &hot)), Some("Temperature"));
    assert!(has_legend(&of("", &hot)));
    assert_eq!(attribute(&of("material.color = [1, 0, 0]", &hot)), None);
    hot.has_velocities = true;
    assert_eq!(attribute(&of("", &hot)), None);
    hot.has_velocities = false;
    hot.categories = vec![category("type", &[1, 2], &[])];
    assert_eq!(attribute(&of("", &hot)), Some("type"));
}

#[test]
fn particles_on_a_plane_below_y_are_upright() {
    let heap = Facts { up: Some(DVec3::Y), ..facts() };
    let up = |text: &str, facts: &Facts| of(text, facts).input.up.map(|up| up.vector());
    assert_eq!(up("", &heap), Some([0.0, 1.0, 0.0]));
    assert_eq!(up("input.up = \"z\"", &heap), Some([0.0, 0.0, 1.0]));
    assert_eq!(up("", &facts()), None);
    // A format that says so needs no rule
    let files = Files { is_y_up: true, ..Files::default() };
    assert_eq!(completed("", &heap, files).0.input.up, None);
}

#[test]
fn particles_at_one_place_have_a_radius() {
    let mut point = facts();
    point.bounds = Some((DVec3::ONE, DVec3::ONE));
    let (manifest, lines) = completed("", &point, Files::default());
    assert_eq!(manifest.input.radius, RadiusSetting::Length(1.0));
    assert!(lines.contains("radius 1"), "{lines}");
}

#[test]
fn particles_at_random_distances_have_the_radius_of_their_density() {
    let mut gas = facts();
    gas.random_radius = Some(0.012_345);
    assert_eq!(of("", &gas).input.radius, RadiusSetting::Length(0.0123));
    assert_eq!(of("input.radius = 0.5", &gas).input.radius, RadiusSetting::Length(0.5));
    assert_eq!(of("render.surface = \"smooth\"", &gas).input.radius, RadiusSetting::Auto);
}

#[test]
fn columns_with_plausible_radii_are_radii() {
    let grain_radius = Some(GrainRadius { attribute: "d".to_owned(), scale: 0.5 });
    let mut grains = Facts { grain_radius, random_radius: Some(0.1), ..facts() };
    let (manifest, lines) = completed("", &grains, Files::default());
    let expected = RadiusSetting::Attribute { attribute: "d".to_owned(), scale: 0.5 };
    assert_eq!(manifest.input.radius, expected);
    assert!(lines.contains("`d` has the diameters"), "{lines}");
    assert_eq!(of("input.radius = 2.0", &grains).input.radius, RadiusSetting::Length(2.0));
    grains.elements = Some(Elements { has_others: false, is_solid: false });
    assert!(matches!(of("", &grains).input.radius, RadiusSetting::Table { .. }));
}

#[test]
fn particles_with_shapes_are_grains() {
    let source = || ShapeSource { what: "`orientation`".to_owned(), radius: Some(0.25) };
    let shaped = || Facts { shape_source: Some(source()), ..facts() };
    let (manifest, lines) = completed("", &shaped(), Files::default());
    assert_eq!(manifest.styles.len(), 1);
    assert_eq!(manifest.styles[0], Style { draw: StyleDraw::Grains, ..Style::default() });
    assert_eq!(manifest.input.radius, RadiusSetting::Length(0.25));
    let explicit = of("[[style]]\ndraw = \"grains\"", &shaped());
    assert_eq!(explicit.settings(), manifest.settings());
    assert!(lines.contains("by `orientation` (--style ': spheres' draws spheres)"), "{lines}");
    // What is for spheres keeps them
    for text in [
        "input.radius = 2.0",
        "material.opacity = 0.5",
        "material.type = \"glass\"",
        "render.surface = \"union\"",
        "look = \"none\"",
        "[[clip]]\nmode = \"cut\"\ntype = \"plane\"\nnormal = [1, 0, 0]",
    ] {
        assert!(of(text, &shaped()).styles.is_empty(), "{text}");
    }
    assert!(of("", &Facts { has_bonds: true, ..shaped() }).styles.is_empty());
    assert!(of("", &facts()).styles.is_empty());
    let spheres = of("[[style]]\ndraw = \"spheres\"", &shaped()).styles;
    assert_eq!(spheres, [Style::default()]);
}

/// The condition of the walls that are glass behind the others, if nothing else has a style.
fn glass_of(manifest: &Manifest) -> Option<&str> {
    let [style] = &manifest.styles[..] else { return None };
    let is_glass = style.is_thin_glass() && style.material.as_ref().is_some_and(|own| own.underlay);
    style.condition.as_ref().filter(|_| is_glass).map(|condition| condition.as_str())
}

/// Facts of a fluid that moves in a tank.
fn in_tank() -> Facts {
    let tank = Tank { condition: "speed > 0".to_owned(), why: "at rest", all: "speed >= 0" };
    Facts { tank: Some(tank), has_velocities: true, ..facts() }
}

#[test]
fn walls_without_an_attribute_are_glass() {
    let mut fluid = in_tank();
    let (manifest, lines) = completed("", &fluid, Files::default());
    assert_eq!(glass_of(&manifest), Some("!(speed > 0)"));
    assert!(lines.contains("glass behind the others: walls, at rest (--style '"), "{lines}");
    // Those around a plane are grey spheres
    fluid.bounds = Some((DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0)));
    let flat = of("", &fluid);
    let [style] = &flat.styles[..] else { panic!("{:?}", flat.styles) };
    assert_eq!(style.draw, StyleDraw::Spheres);
    assert!(matches!(style.color, ColorSetting::Rgb(_)));
    // Frozen atoms are none
    fluid.elements = Some(Elements { has_others: false, is_solid: true });
    assert!(of("", &fluid).styles.is_empty());
}

#[test]
fn walls_are_left_out_where_they_cannot_be_glass() {
    for text in [
        "look = \"water\"",
        "render.device = \"gpu\"",
        "material.opacity = 0.5",
        "trails.frames = 3",
        "[[arrows]]\nattribute = \"velocity\"\nscale = 0.1",
        "[[clip]]\nmode = \"cut\"\ntype = \"plane\"\nnormal = [1, 0, 0]",
    ] {
        let (manifest, lines) = completed(text, &in_tank(), Files::default());
        assert!(manifest.styles.is_empty(), "{text}");
        let condition = ("select.where".to_owned(), "\"speed > 0\"".to_owned());
        assert!(manifest.settings().contains(&condition), "{text}");
        assert!(lines.contains("left out: walls, at rest (--where 'speed >= 0' shows"), "{lines}");
    }
    let many = Facts { particles: 100_000_000, ..in_tank() };
    assert!(of("", &many).styles.is_empty());
    // Whoever says which particles are drawn, or how, means all of these
    for text in ["[select]\nwhere = \"z > 0\"", "[[style]]\ndraw = \"spheres\""] {
        let (manifest, lines) = completed(text, &in_tank(), Files::default());
        assert!(glass_of(&manifest).is_none() && !lines.contains("walls"), "{lines}");
    }
}

#[test]
fn walls_by_name_are_glass() {
    let parts = ["fluid", "Bob's wall"].map(str::to_owned);
    let found = walls(&parts);
    let files = Files { parts: &parts, walls: found.as_ref(), ..Files::default() };
    let (manifest, lines) = completed("", &facts(), files);
    assert_eq!(glass_of(&manifest), Some("part == \"Bob's wall\""));
    assert!(lines.contains("glass behind the others: Bob's wall, walls by name"), "{lines}");
    let (manifest, lines) = completed("look = \"water\"", &facts(), files);
    assert_eq!(manifest.input.parts.as_deref(), Some(&parts[..1]));
    assert!(lines.contains("(--parts fluid,Bob's wall shows them, "), "{lines}");
}

#[test]
fn molecules_show_their_broad_side() {
    let axes = Axes { directions: [DVec3::Z, DVec3::X, DVec3::Y], deviations: [5.0, 3.0, 0.5] };
    let elements = Some(Elements { has_others: false, is_solid: false });
    let mut molecule = Facts { axes: Some(axes), elements, ..facts() };
    let view = |facts: &Facts| of("", facts).camera;
    assert_eq!(view(&molecule).up, Some(DVec3::X));
    let direction = |camera: &crate::manifest::Camera| {
        let [azimuth, elevation] = camera.angles(DVec3::X);
        crate::scene::view_direction(DVec3::X, azimuth, elevation)
    };
    let toward = direction(&view(&molecule)).dot(DVec3::NEG_Y);
    assert!((0.9..0.99).contains(&toward), "{toward}");
    // A flat one is seen from there, too, and not from the top
    molecule.bounds = Some((DVec3::ZERO, DVec3::new(1.0, 0.0, 2.0)));
    assert_eq!(view(&molecule).view, None);
    assert_eq!(view(&molecule).projection, ProjectionKind::Perspective);
    // Balls, grains, and what has a side of its own, are not turned
    assert_eq!(of("camera.view = \"front\"", &molecule).camera.up, None);
    let round = Axes { deviations: [5.0, 5.0, 4.8], ..axes };
    assert_eq!(view(&Facts { axes: Some(round), elements, ..facts() }).up, None);
    assert_eq!(view(&Facts { axes: Some(axes), ..facts() }).up, None);
    // A slab of a solid lies
    let slab = Axes { directions: [DVec3::X, DVec3::Y, DVec3::Z], ..axes };
    let solid = Some(Elements { has_others: false, is_solid: true });
    assert_eq!(view(&Facts { axes: Some(slab), elements: solid, ..facts() }).up, None);
    assert!(view(&Facts { axes: Some(axes), elements: solid, ..facts() }).up.is_some());
}

#[test]
fn beads_are_no_atoms() {
    let mut beads = Facts { has_beads: true, ..facts() };
    beads.categories = vec![category("element", &[5, 16], &[])];
    let (manifest, lines) = completed("", &beads, Files::default());
    assert_eq!(attribute(&manifest), None);
    assert!(lines.contains("farther apart than atoms"), "{lines}");
    assert_eq!(manifest.render.ground.map(|g| g.kind), Some(crate::manifest::GroundKind::None));
    beads.categories.insert(0, category("bead", &[1, 8], &[]));
    let ColorSetting::Mapped(by) = of("", &beads).material.color else { panic!("no map") };
    let names = by.names.expect("names").0;
    assert_eq!(names, [(1, "backbone".to_owned()), (8, "water".to_owned())]);
}

#[test]
fn values_have_the_names_of_the_files() {
    let mut two = facts();
    two.categories = vec![category("element", &[6, 4711], &[])];
    let names = vec![(4711, "colloid".to_owned())];
    let names = [ValueNames { attribute: "element".to_owned(), names }];
    let (manifest, _) = completed("", &two, Files { names: &names, ..Files::default() });
    let ColorSetting::Mapped(by) = manifest.material.color else { panic!("no map") };
    let names = by.names.expect("names").0;
    assert_eq!(names, [(6, "C".to_owned()), (4711, "colloid".to_owned())]);
}

#[test]
fn most_of_a_cloud_without_an_end_is_in_the_picture() {
    let galaxy = Facts { has_heavy_tails: true, ..facts() };
    let fit = |text: &str| of(text, &galaxy).camera.fit;
    assert_eq!(fit(""), Some(crate::manifest::FitSetting::Percent(90.0)));
    assert_eq!(fit("camera.fit = \"all\""), Some(crate::manifest::FitSetting::All));
}

#[test]
fn boxes_that_are_nearly_empty_are_not_drawn() {
    let cell = SimulationCell::new(DVec3::ZERO, DVec3::AXES, [false; 3]).expect("a cell");
    let mut grains = Facts { cell: Some(cell), in_cell: 1.0, ..facts() };
    for (height, is_drawn) in [(0.2, false), (0.6, true)] {
        grains.cell_extent = [1.0, 1.0, height];
        assert_eq!(of("", &grains).cell.visible, is_drawn, "{height}");
    }
    // Nor one around a plane with walls
    grains.bounds = Some((DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0)));
    assert!(!of("", &grains).cell.visible);
    let periodic = SimulationCell::new(DVec3::ZERO, DVec3::AXES, [true, true, false]);
    grains.cell = Some(periodic.expect("a cell"));
    assert!(of("", &grains).cell.visible);
}

#[test]
fn gases_and_molecules_have_no_floor() {
    let ground = |facts: &Facts, files: Files<'_>| completed("", facts, files).0.render.ground;
    let none = Some(GroundSetting::of(GroundKind::None));
    assert_eq!(ground(&facts(), Files::default()), None);
    assert_eq!(ground(&Facts { is_gas: true, ..facts() }, Files::default()), none);
    assert_eq!(ground(&facts(), Files { is_molecular: true, ..Files::default() }), none);
}

#[test]
fn what_differs_gives_the_colours() {
    let by = |facts: &Facts| match of("", facts).material.color {
        ColorSetting::Mapped(by) => by.attribute,
        _ => None,
    };
    let mut fluid = Facts { has_velocities: true, scalar: Some("rho".to_owned()), ..facts() };
    assert_eq!(by(&fluid), None);
    fluid.has_even_speed = true;
    assert_eq!(by(&fluid).as_deref(), Some("rho"));
    // One kind that moves around an obstacle, and two kinds
    fluid.has_even_speed = false;
    let types = Category { walls: None, ..category("type", &[1, 2], &[2]) };
    let types = Category { without_walls: vec![1, 2], ..types };
    fluid.categories = vec![types.clone()];
    assert_eq!(by(&fluid), None);
    fluid.categories = vec![Category { resting: Vec::new(), ..types }];
    assert_eq!(by(&fluid).as_deref(), Some("type"));
}

#[test]
fn legends_make_room_beside_planes_and_below_wide_bodies() {
    let legend = |size: DVec3| {
        let mut wide = facts();
        wide.has_velocities = true;
        wide.bounds = Some((DVec3::ZERO, size));
        let manifest = of("image.width = 800\nimage.height = 400", &wide);
        let overlay = manifest.overlays[0].clone();
        let OverlayKind::ColorBar { orientation, .. } = overlay.kind else { panic!("no bar") };
        (overlay.layout, orientation)
    };
    use crate::manifest::OverlayLayout::{Auto, Beside};
    use crate::overlay::Orientation::{Horizontal, Vertical};
    assert_eq!(legend(DVec3::ONE), (Some(Auto), Vertical));
    assert_eq!(legend(DVec3::new(30.0, 3.0, 1.0)), (Some(Auto), Horizontal));
    assert_eq!(legend(DVec3::new(2.0, 1.0, 0.0)), (Some(Beside), Vertical));
    assert_eq!(legend(DVec3::new(1.0, 1.0, 0.0)), (Some(Auto), Vertical));
}

#[test]
fn surfaces_are_covered_and_have_no_floor() {
    let scan = Facts { covering_radius: Some(0.25), random_radius: Some(0.1), ..facts() };
    let manifest = of("", &scan);
    assert_eq!(manifest.input.radius, RadiusSetting::Length(0.25));
    assert_eq!(manifest.render.ground.map(|g| g.kind), Some(crate::manifest::GroundKind::None));
    let layer = Facts { has_velocities: true, ..scan };
    assert_eq!(of("", &layer).render.ground, None);
}
