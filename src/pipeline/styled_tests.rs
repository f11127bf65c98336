//! Particles in several styles through the pipeline: each pixel shows the particle that its id names.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use glam::Vec3;
use spherule_formats::{PositionSlice, RawParticles};
use spherule_frame::{Attribute, AttributeData};

use crate::manifest::Manifest;
use crate::pipeline::{
    BondRule, ColorRule, ImageTask, ParticleStyle, RadiusRule, Setup, trace_particles,
};
use crate::render::{Film, FilmPlane};
use crate::resolve::{Inquiry, SceneInputs, setup};
use crate::scene::{Finish, Owner};
use crate::survey::Survey;

/// Particles of five types in a row of slabs.
fn positions() -> Vec<Vec3> {
    let place = |i: u16| {
        let [x, y, z] = [i % 5, i / 5 % 6, i / 30].map(f32::from);
        Vec3::new(8.0 * x + 0.7 * (z % 3.0), y, z)
    };
    (0..30 * 6).map(place).collect()
}

fn particles(positions: &[Vec3]) -> RawParticles<PositionSlice<'_>> {
    let scalar = |name: &str, data| Attribute { name: name.to_owned(), components: 1, data };
    let attributes = vec![
        scalar("type", AttributeData::I32((0..180).map(|i| i % 5).collect())),
        scalar("id", AttributeData::U32((1000..1180).collect())),
        scalar("charge", AttributeData::F32((0..180_u8).map(f32::from).collect())),
    ];
    RawParticles {
        positions: PositionSlice::F32(positions),
        attributes,
        time: None,
        step: None,
        cell: None,
        bonds: Vec::new(),
        notes: Vec::new(),
        labels: spherule_frame::Labels::default(),
        shapes: None,
    }
}

fn rendered(styles: &str) -> (Setup, Film, Vec<String>) {
    rendered_with("surface = \"spheres\"", styles)
}

fn rendered_with(render: &str, styles: &str) -> (Setup, Film, Vec<String>) {
    let text = format!(
        "input = {{ path = \"a\", radius = 0.4 }}\nimage = {{ width = 160, height = 60, samples = 4 }}\n\
         render = {{ ground = false, denoise = false, {render} }}\ncamera = {{ azimuth = 10, elevation = 15 }}\n\
         output.channels = [\"id\", \"P\", \"Z\", \"N\", \"albedo\", \"crypto_material\"]\n{styles}"
    );
    let manifest = Manifest::parse(&text, Path::new("job.toml")).unwrap_or_else(|e| panic!("{e}"));
    let positions = positions();
    let inquiry = Inquiry::of(&manifest);
    let questions = inquiry.styles();
    let question = inquiry.question(questions.as_ref());
    let survey = Survey::of_particles("a", &particles(&positions), question).expect("readable");
    let setup = setup(&manifest, &survey, SceneInputs::default()).expect("pictures");
    let task = ImageTask {
        frame: 0,
        index: 0,
        image: PathBuf::new(),
        preview: None,
        meshes: Vec::new(),
        next_meshes: None,
        refused: None,
    };
    let mut notes = Vec::new();
    let stop = AtomicBool::new(false);
    let note = |note| notes.push(note);
    let traced = trace_particles(&setup, particles(&positions), "a", &task, &stop, note);
    (setup, traced.expect("an image").film, notes)
}

/// Checks that the point of each pixel lies near the particle that its id names, and returns how many pixels show each
/// type. `distances`: the least and the greatest distance between point and particle of each type.
fn check_points(film: &Film, distances: [[f32; 2]; 5]) -> [usize; 5] {
    let positions = positions();
    let ids = film.plane::<u32>(FilmPlane::Id).expect("ids");
    let points = film.plane::<[f32; 3]>(FilmPlane::Position).expect("points");
    let mut pixels = [0; 5];
    for (id, point) in ids.iter().zip(points).filter(|(id, _)| **id != u32::MAX) {
        let particle = *id as usize - 1000;
        let kind = particle % 5;
        let distance = (Vec3::from_array(*point) - positions[particle]).length();
        let [low, high] = distances[kind];
        assert!((low..=high).contains(&distance), "type {kind}, particle {particle}: {distance}");
        pixels[kind] += 1;
    }
    pixels
}

const RED: &str = "color = [1, 0, 0]\n";

#[test]
fn opaque_spheres_of_all_styles_share_a_tree() {
    let styles = format!(
        "[[style]]\nwhere = \"type == 1\"\nradius = 0.5\n{RED}\
         [[style]]\nwhere = \"type <= 2\"\nradius = 0.3\ncolor_by = \"charge\"\nrange = [0, 180]\n\
         [[style]]\nwhere = \"type == 3\"\ndraw = \"hidden\"\n\
         [[style]]\nwhere = \"type == 4\"\ndraw = \"sticks\"\nradius = 0.1\nbonds = {{ find = 1.01 }}"
    );
    let (setup, film, notes) = rendered(&styles);
    assert_eq!(notes, Vec::<String>::new());
    assert_eq!(setup.picture.particles.styles_in_tree(&setup), 4);
    let near = |radius: f32| [radius - 1e-4, radius + 1e-4];
    let pixels = check_points(&film, [near(0.3), near(0.5), near(0.3), [1.0, 0.0], near(0.1)]);
    assert!(pixels[0] > 100 && pixels[1] > 100 && pixels[2] > 100, "{pixels:?}");
    assert!(pixels[3] == 0 && pixels[4] > 0, "{pixels:?}");
    // Colours are those of the style; rods have the colours of their particles, and no id
    let ids = film.plane::<u32>(FilmPlane::Id).unwrap();
    let albedo = film.plane::<[f32; 3]>(FilmPlane::Albedo).unwrap();
    for (id, albedo) in ids.iter().zip(albedo).filter(|(id, _)| **id != u32::MAX) {
        let is_red = *albedo == [1.0, 0.0, 0.0];
        assert_eq!(is_red, (*id - 1000) % 5 == 1, "{id} {albedo:?}");
    }
    let depth = film.plane::<f32>(FilmPlane::Depth).unwrap();
    let rods = ids.iter().zip(depth).filter(|(id, z)| **id == u32::MAX && z.is_finite());
    assert!(rods.count() > 100);
}

#[test]
fn bodies_of_styles_have_ids_of_their_particles() {
    let styles = format!(
        "[[style]]\nwhere = \"type == 0\"\ndraw = \"smooth\"\nradius = 0.5\ncolor_by = \"charge\"\n\
         [[style]]\nwhere = \"type == 1\"\ndraw = \"union\"\nradius = 0.7\n{RED}\
         [[style]]\nwhere = \"type == 2\"\nradius = 0.35\nmaterial = {{ type = \"metal\" }}"
    );
    let (setup, film, _) = rendered(&styles);
    assert_eq!(setup.picture.particles.styles_in_tree(&setup), 2);
    // Their objects are named by their places in the manifest, although spheres are drawn first
    let styles = setup.picture.particles.others().iter();
    let owners: Vec<Owner> =
        styles.map(|style| setup.picture.scene.material(style.material).owner).collect();
    assert_eq!(owners, [2, 0, 1].map(Owner::Style));
    let near = |radius: f32| [radius - 1e-4, radius + 1e-4];
    let pixels = check_points(&film, [[0.0, 1.2], near(0.7), near(0.35), near(0.4), near(0.4)]);
    assert!(pixels.iter().all(|pixels| *pixels > 100), "{pixels:?}");
}

#[test]
fn one_style_may_be_clear() {
    let styles = format!(
        "[[style]]\nwhere = \"type == 2\"\ndraw = \"smooth\"\nradius = 0.5\nmaterial = {{ type = \"water\" }}\n\
         [[style]]\nwhere = \"type == 1\"\nradius = 0.5\nopacity = 0.5\n{RED}"
    );
    let (setup, film, _) = rendered(&styles);
    assert_eq!(setup.picture.scene.particle_material().transmission, 1.0);
    assert_eq!(setup.picture.particles.styles_in_tree(&setup), 1);
    let near = |radius: f32| [radius - 1e-4, radius + 1e-4];
    let pixels = check_points(&film, [near(0.4), near(0.5), [0.0, 1.2], near(0.4), near(0.4)]);
    assert!(pixels.iter().all(|pixels| *pixels > 100), "{pixels:?}");
    // Each style is an object of its own
    let mattes = film.plane::<f32>(FilmPlane::CryptoMaterial).unwrap();
    assert!(mattes.iter().any(|value| *value != 0.0));
}

#[test]
fn several_styles_may_be_clear() {
    let styles = format!(
        "[[style]]\nwhere = \"type == 2\"\ndraw = \"smooth\"\nradius = 0.5\nmaterial = {{ type = \"water\" }}\n\
         [[style]]\nwhere = \"type == 1\"\nradius = 0.5\nopacity = 0.5\n{RED}\
         [[style]]\nwhere = \"type == 3\"\ndraw = \"union\"\nradius = 0.7\n\
         material = {{ type = \"glass\", ior = 1.47, absorption = [0.9, 0.5, 0.1], absorption_length = 2 }}"
    );
    let (setup, film, _) = rendered(&styles);
    let materials = setup.picture.scene.materials.iter();
    let clear: Vec<f32> = materials.filter(|m| m.transmission == 1.0).map(|m| m.ior).collect();
    assert_eq!(clear, [1.333, 1.47]);
    let oil = setup.picture.scene.materials.last().unwrap().extinction;
    assert!((oil.y + libm::logf(0.5) / 2.0).abs() < 1e-6, "{oil}");
    let near = |radius: f32| [radius - 1e-4, radius + 1e-4];
    let pixels = check_points(&film, [near(0.4), near(0.5), [0.0, 1.2], near(0.7), near(0.4)]);
    assert!(pixels.iter().all(|pixels| *pixels > 100), "{pixels:?}");
}

#[test]
fn clear_particles_without_a_style_touch_clear_styles() {
    // The bodies share the slab of each type; each pixel has an id of the body that it shows
    let styles = "material.type = \"water\"\n[[style]]\nwhere = \"y > 2.5\"\ndraw = \"smooth\"\n\
                  material = { type = \"water\", ior = 1.47 }";
    let (setup, film, _) = rendered_with("surface = \"smooth\"", styles);
    let scene = &setup.picture.scene;
    assert_eq!(scene.materials.last().unwrap().priority, 1);
    let pixels = check_points(&film, [[0.0, 1.2]; 5]);
    assert!(pixels.iter().all(|pixels| *pixels > 100), "{pixels:?}");
    let positions = positions();
    let ids = film.plane::<u32>(FilmPlane::Id).expect("ids");
    let points = film.plane::<[f32; 3]>(FilmPlane::Position).expect("points");
    let mut counts = [0; 2];
    for (id, point) in ids.iter().zip(points).filter(|(id, _)| **id != u32::MAX) {
        let is_upper = positions[*id as usize - 1000].y > 2.5;
        counts[usize::from(is_upper)] += 1;
        assert!(is_upper || point[1] < 3.2, "{id} {point:?}");
        assert!(!is_upper || point[1] > 1.8, "{id} {point:?}");
    }
    assert!(counts.iter().all(|count| *count > 100), "{counts:?}");
}

#[test]
fn styles_of_nothing_are_noted() {
    let (_, _, notes) = rendered("[[style]]\nname = \"foam\"\nwhere = \"type == 7\"");
    assert!(notes.iter().any(|note| note.contains("no particle is of style `foam`")), "{notes:?}");
}

#[test]
fn grains_have_an_opacity() {
    // How many samples of pixels show the grains of type 1, which has the spheres of another style beside it
    let coverage = |opacity: f32| {
        let (_, film, _) = rendered(&format!(
            "[[style]]\nwhere = \"type == 1\"\ndraw = \"grains\"\nsize = [0.4, 0.3, 0.2]\nopacity = {opacity}\n\
             [[style]]\nwhere = \"type == 2\"\nopacity = 0.5\n[[style]]\nwhere = \"type != 1\"\ndraw = \"hidden\""
        ));
        let ids = film.plane::<u32>(FilmPlane::Id).unwrap();
        ids.iter().filter(|id| **id != u32::MAX && (**id - 1000) % 5 == 1).count()
    };
    let [none, half, all] = [0.0, 0.5, 1.0].map(coverage);
    assert_eq!(none, 0);
    // The id is that of the nearest of four samples, which is there in 15 of 16 pixels
    assert!(half > all / 2 && half < all, "{half} {all}");
}

#[test]
fn grains_are_where_their_particles_are() {
    let styles = format!(
        "[[style]]\nwhere = \"type == 1\"\ndraw = \"grains\"\nsize = [0.6, 0.3, 0.2]\n{RED}\
         [[style]]\nwhere = \"type == 2\"\ndraw = \"grains\"\nshape = \"cuboid\"\nsize = [0.2, 0.3, 0.4]\n\
         [[style]]\nwhere = \"type == 3\"\nradius = 0.3\nopacity = 0.5"
    );
    let (setup, film, notes) = rendered(&styles);
    assert_eq!(setup.picture.particles.styles_in_tree(&setup), 2);
    assert!(notes.iter().all(|note| note.contains("they are drawn upright")), "{notes:?}");
    let near = |radius: f32| [radius - 1e-4, radius + 1e-4];
    let pixels = check_points(&film, [near(0.4), [0.2, 0.6001], [0.2, 0.54], near(0.3), near(0.4)]);
    assert!(pixels.iter().all(|pixels| *pixels > 50), "{pixels:?}");
    // The points are on the ellipsoids
    let positions = positions();
    let ids = film.plane::<u32>(FilmPlane::Id).unwrap();
    let points = film.plane::<[f32; 3]>(FilmPlane::Position).unwrap();
    let albedo = film.plane::<[f32; 3]>(FilmPlane::Albedo).unwrap();
    for ((id, point), albedo) in ids.iter().zip(points).zip(albedo) {
        let particle = id.wrapping_sub(1000) as usize;
        if *id != u32::MAX && particle % 5 == 1 {
            let own = (Vec3::from_array(*point) - positions[particle]) / Vec3::new(0.6, 0.3, 0.2);
            assert!((own.length() - 1.0).abs() < 1e-3, "{particle}: {own}");
            assert_eq!(*albedo, [1.0, 0.0, 0.0]);
        }
    }
}

#[test]
fn what_styles_do_not_say_is_as_in_the_manifest() {
    // Also beside water, whose settings take the place of those of particles without a style
    let styles = "material = { type = \"metal\", color = { attribute = \"charge\" } }\n\
                  [[style]]\nwhere = \"type == 2\"\ndraw = \"smooth\"\nradius = 0.9\ncolor = [0, 0, 1]\n\
                  material = { type = \"water\" }\n[[style]]\nwhere = \"type == 1\"";
    let (setup, ..) = rendered(styles);
    let [water, one, rest] = &setup.picture.particles.styles[..] else { panic!("three styles") };
    assert_eq!(water.radius, RadiusRule::Common(0.9));
    for style in [one, rest] {
        assert_eq!(style.radius, RadiusRule::Common(0.4));
        let finish = setup.picture.scene.material(style.material).finish;
        assert!(matches!(finish, Finish::Metal { .. }), "{finish:?}");
    }
    // They have one scale, without the water
    let range = |style: &ParticleStyle| match &style.color {
        ColorRule::Attribute { map, .. } => map.range().map(|(range, _)| range),
        _ => None,
    };
    assert_eq!(range(one), range(rest));
    assert!(range(one).is_some_and(|[low, high]| low < 5.0 && high > 170.0), "{:?}", range(one));
}

#[test]
fn parts_keep_the_bonds_of_all_particles() {
    let (setup, ..) = rendered("[bonds]\nfind = 1.01\n[[material.part]]\nparts = [2]");
    let styles = &setup.picture.particles.styles;
    assert_eq!(styles.len(), 2);
    let rules: Vec<_> = styles.iter().map(|style| style.bonds.as_ref().map(|b| &b.rule)).collect();
    assert_eq!(rules, [Some(&BondRule::Distance(1.01)); 2]);
}
