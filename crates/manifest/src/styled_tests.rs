use std::path::Path;

use glam::Vec3;
use spherule_tracer::scene::Fresnel;

use super::*;
use crate::OpacitySetting;

fn styled(text: &str) -> StyledManifest {
    let text = format!("input.path = \"a\"\n{text}");
    Manifest::parse(&text, Path::new("job.toml")).unwrap().styled()
}

#[test]
fn the_first_of_several_clear_styles_is_the_first_group() {
    let style = |kind: u8, ior: f32| {
        format!(
            "[[style]]\nwhere = \"type == {kind}\"\ndraw = \"smooth\"\n\
             material = {{ type = \"water\", ior = {ior} }}\n"
        )
    };
    let both = style(1, 1.4) + &style(2, 1.5);
    let found = styled(&both);
    assert_eq!((found.has_first, found.manifest.material.constants.ior), (true, 1.4));
    assert_eq!(
        found.division.claims.iter().map(|claim| claim.group).collect::<Vec<_>>(),
        [0, 2, 1]
    );
    // Clear particles without a style stay the first group
    let water = "material.type = \"water\"\nrender.surface = \"smooth\"\n";
    let found = styled(&format!("{water}{both}"));
    assert_eq!((found.has_first, found.styles.len()), (false, 2));
    assert_eq!(found.division.claims.iter().map(|claim| claim.group).collect::<Vec<_>>(), [1, 2]);
}

#[test]
fn a_clear_style_is_the_first_group() {
    let text = "material.color = [1, 0, 0]\n[[style]]\nwhere = \"type == 1\"\ndraw = \"smooth\"\n\
                material = { type = \"water\", ior = 1.4 }\n[[style]]\nwhere = \"type == 2\"\ndraw = \"union\"\n\
                [[style]]\nwhere = \"type == 3\"\n[[style]]\nwhere = \"type == 4\"\ndraw = \"hidden\"";
    let found = styled(text);
    assert!(found.has_first);
    assert_eq!(found.manifest.surface.kind, SurfaceKind::Smooth);
    assert_eq!(found.manifest.material.resolved(Fresnel::Exact).ior, 1.4);
    // Spheres come before bodies, and the rest is red spheres
    let draws: Vec<StyleDraw> = found.styles.iter().map(|drawn| drawn.style.draw).collect();
    assert_eq!(draws, [StyleDraw::Spheres, StyleDraw::Spheres, StyleDraw::Union]);
    assert_eq!(found.styles[1].style.color, ColorSetting::Rgb(Vec3::X));
    let groups: Vec<usize> = found.division.claims.iter().map(|claim| claim.group).collect();
    assert_eq!(groups, [0, 3, 1, 2]);
    assert_eq!(found.division.groups, 4);
    // Without a clear one, the rest is the first group
    let found = styled("[[style]]\nwhere = \"type == 2\"");
    assert_eq!((found.has_first, found.division.groups), (false, 2));
}

#[test]
fn parts_are_styles_of_the_particles_without_one() {
    let text = "material.opacity = 0.5\n[[material.part]]\nparts = [-2, 5]\ntype = \"metal\"\nroughness = 0.2\n\
                color = [1, 0, 0.5]\n[[material.part]]\nparts = [1]\n[[style]]\nwhere = \"x > 1\"\ndraw = \"union\"";
    let found = styled(text);
    assert!(!found.has_first);
    let sources: Vec<StyleSource> = found.styles.iter().map(|drawn| drawn.source).collect();
    assert_eq!(sources, [StyleSource::Part(0), StyleSource::Part(1), StyleSource::Style(0)]);
    // The style is tried first
    let groups: Vec<usize> = found.division.claims.iter().map(|claim| claim.group).collect();
    assert_eq!(groups, [3, 1, 2]);
    let metal = &found.styles[0];
    assert_eq!(metal.title(), "material.part.0");
    assert_eq!(metal.style.title(), "(part == -2) || (part == 5)");
    assert_eq!(metal.style.color, ColorSetting::Rgb(Vec3::new(1.0, 0.0, 0.5)));
    assert_eq!(metal.style.opacity, OpacitySetting::Constant(0.5));
    let material = metal.style.material.as_ref().unwrap();
    assert_eq!((material.kind, material.roughness), (StyleMaterialKind::Metal, Some(0.2)));
    // The others have the colours of all particles
    assert_eq!(found.styles[1].style.color, ColorSetting::Auto);
    let shared: Vec<bool> = found.styles.iter().map(|drawn| drawn.shares_colors).collect();
    assert_eq!(shared, [false, true, true]);
}

#[test]
fn styles_have_the_colors_of_the_material_beside_a_clear_one() {
    let water = "material.color = [1, 0, 0]\n[[style]]\nwhere = \"type == 1\"\ndraw = \"smooth\"\n\
                 material = { type = \"water\" }\ncolor = [0, 0, 1]\n[[style]]\nwhere = \"type == 2\"";
    let found = styled(water);
    assert_eq!(found.manifest.material.color, ColorSetting::Rgb(Vec3::Z));
    let colors: Vec<&ColorSetting> = found.styles.iter().map(|drawn| &drawn.style.color).collect();
    assert_eq!(colors, [&ColorSetting::Rgb(Vec3::X); 2]);
    // They share a scale without the clear one
    assert!(found.styles.iter().all(|drawn| drawn.shares_colors) && !found.first_shares);
    assert_eq!(found.usual.material.color, ColorSetting::Rgb(Vec3::X));
}
