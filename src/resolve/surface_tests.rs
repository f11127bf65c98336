use std::path::Path;

use super::*;

fn manifest(text: &str) -> Manifest {
    let text = format!("input.path = \"data\"\n{text}");
    Manifest::parse(&text, Path::new("job.toml")).unwrap()
}

#[test]
fn each_surface_has_its_own_radius() {
    let found = Survey {
        radius: Some(0.4),
        packed_radius: Some(0.5),
        ..super::super::camera::tests::survey()
    };
    assert_eq!(radius(SurfaceKind::Spheres, &found), Some(0.4));
    assert_eq!(radius(SurfaceKind::Smooth, &found), Some(0.5));
    assert_eq!(radius(SurfaceKind::Union, &found), Some(0.9));
    let older = Survey { packed_radius: None, ..found };
    for kind in [SurfaceKind::Smooth, SurfaceKind::Union] {
        assert_eq!(radius(kind, &older), Some(0.4));
    }
}

#[test]
fn one_body_has_exact_fresnel_and_absorption() {
    let bounds = Bounds { min: glam::DVec3::ZERO, max: glam::DVec3::new(2.0, 3.0, 6.0) };
    let of = |text: &str| material(&manifest(text), &bounds);
    assert_eq!(of(""), Material::DEFAULT);
    let smooth = "render.surface = \"smooth\"\nmaterial.absorption = [0.5, 1, 1]\n";
    assert_eq!(of(smooth).fresnel, Fresnel::Exact);
    // A quarter of the diagonal, which is 7.
    let loss = of(smooth).extinction;
    assert!((loss.x - 2.0_f32.ln() / 1.75).abs() < 1e-5);
    assert_eq!([loss.y, loss.z], [0.0; 2]);
    let long = of(&format!("{smooth}material.absorption_length = 8"));
    assert!((long.extinction.x - 2.0_f32.ln() / 8.0).abs() < 1e-6);
    let colored = of("render.surface = \"smooth\"\nmaterial.absorption = \"color\"\n");
    assert_eq!((colored.color_length, colored.extinction), (Some(1.75), glam::Vec3::ZERO));
    let named = of(&format!("{smooth}material.fresnel = \"schlick\""));
    assert_eq!(named.fresnel, Fresnel::Schlick);
    assert_eq!(of("material.fresnel = \"exact\"").fresnel, Fresnel::Exact);
}

#[test]
fn scattering_is_a_colour_over_a_mean_free_path() {
    let bounds = Bounds { min: glam::DVec3::ZERO, max: glam::DVec3::new(2.0, 3.0, 6.0) };
    let of =
        |text: &str| material(&manifest(&format!("material.type = \"water\"\n{text}")), &bounds);
    assert!(!of("material.anisotropy = 0.5").scatters());
    let murky = "material.scattering = [1, 0.5, 0]\nmaterial.anisotropy = -0.4\n";
    let found = of(murky);
    assert!(found.scatters());
    // A quarter of the diagonal, which is 7
    assert_eq!(found.scattering, glam::Vec3::new(1.0 / 1.75, 0.5 / 1.75, 0.0));
    assert_eq!((found.extinction, found.anisotropy), (found.scattering, -0.4));
    let found = of(&format!(
        "{murky}material.scattering_length = 0.1\nmaterial.absorption = [0.5, 1, 1]\nmaterial.absorption_length = 2"
    ));
    assert_eq!(found.scattering, glam::Vec3::new(10.0, 5.0, 0.0));
    let absorption = found.extinction - found.scattering;
    assert!((absorption.x - 2.0_f32.ln() / 2.0).abs() < 1e-5);
    assert_eq!([absorption.y, absorption.z], [0.0; 2]);
    // The shortest length
    let dense = of(&format!("{murky}material.scattering_length = 1e-45"));
    assert_eq!((dense.scattering.x, dense.validate()), (f32::MAX, Ok(())));
    let colored = of(&format!("{murky}material.absorption = \"color\""));
    assert_eq!((colored.color_length, colored.extinction), (Some(1.75), colored.scattering));
}

#[test]
fn lengths_are_rounded_to_1_2_5() {
    for (length, expected) in [(0.9, 1.0), (1.3, 1.0), (0.017, 0.02), (3.3, 5.0), (80.0, 100.0)] {
        assert_eq!(round(length), expected, "{length}");
    }
    for nothing in [0.0, f64::NAN, f64::INFINITY, 1e-320] {
        assert_eq!(round(nothing), 1.0, "{nothing}");
    }
}
