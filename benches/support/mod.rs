//! What both benches share: what is compared, on what, and that both programs find the same.

use std::env;

use spherule::accel::{BuildReport, BuildSettings, SphereRadius, Spheres, Structure, TreeBuilder};

pub(crate) mod obvhs;
pub(crate) mod rays;
pub(crate) mod scene;

use obvhs::{Obvhs, ObvhsBuilder};
use rays::{HitRecord, SurfacePoint, Tracer};
use scene::Scene;

/// Particle counts: a comma-separated list such as `1e5,300000`.
const PARTICLES_VARIABLE: &str = "SPHERULE_BENCH_PARTICLES";
/// Structures: a comma-separated list such as `lbvh,kdtree`.
const STRUCTURES_VARIABLE: &str = "SPHERULE_BENCH_STRUCTURES";
/// The thesis's three, with the primary rays that hit for seed 1. Every exact method finds these.
const KNOWN_HITS: [(usize, usize); 3] =
    [(100_000, 614_870), (1_000_000, 622_911), (10_000_000, 626_647)];
/// Part of the rays whose result may differ between two programs: spheres grazed within rounding.
const GRAZING: f64 = 2e-5;
/// Part of a radius by which two distances may differ.
const SAME_DISTANCE: f32 = 0.01;

/// One particle count with what all structures are compared on.
pub(crate) struct Case {
    /// Particles and primary rays.
    pub(crate) scene: Scene,
    /// The particles as obvhs takes them.
    pub(crate) spheres: Vec<obvhs::Sphere>,
    /// The other program's tree.
    pub(crate) obvhs: Obvhs,
    /// Where secondary rays start.
    pub(crate) points: Vec<SurfacePoint>,
    /// What obvhs finds by primary rays, and how many shadow and reflection rays it counts.
    records: Vec<HitRecord>,
    secondary: [usize; 2],
}

impl Case {
    /// Builds the tree to compare with.
    ///
    /// # Panics
    /// If it does not find what is known: rates would mean nothing.
    pub(crate) fn new(particles: usize) -> Self {
        let scene = Scene::thesis(particles);
        let spheres = obvhs::spheres(&scene);
        let mut builder = ObvhsBuilder::new();
        builder.build(&spheres);
        let obvhs = Obvhs::new(&scene, builder);
        let mut records = Vec::new();
        check_primary("obvhs", &scene, &obvhs, &mut records);
        let points = rays::surface_points(&obvhs, &scene, &records);
        let secondary = count_secondary(&obvhs, &points);
        Self { scene, spheres, obvhs, points, records, secondary }
    }

    /// Builds our tree by `structure`.
    ///
    /// # Panics
    /// If it does not find what obvhs finds.
    pub(crate) fn tree(&self, structure: Structure) -> TreeBuilder {
        let mut builder = TreeBuilder::new();
        build_ours(structure, &mut builder, &self.scene);
        let tree = &builder.tree().view();
        let mut records = Vec::new();
        check_primary(structure.name(), &self.scene, tree, &mut records);
        let same = |(a, b): &(&HitRecord, &HitRecord)| {
            a.distance() == b.distance()
                || (a.distance() - b.distance()).abs() <= SAME_DISTANCE * self.scene.radius
        };
        let agreeing = records.iter().zip(&self.records).filter(same).count();
        check_agreement("primary", [agreeing, records.len()], records.len());
        let [lit, hits] = count_secondary(tree, &self.points);
        check_agreement("shadow", [lit, self.secondary[0]], self.points.len());
        check_agreement("reflection", [hits, self.secondary[1]], self.points.len());
        let mut others = Vec::new();
        rays::trace_primary_packets(tree, &self.scene, &mut others);
        let distances = |records: &[HitRecord]| -> Vec<f32> {
            records.iter().map(HitRecord::distance).collect()
        };
        assert_eq!(distances(&records), distances(&others), "packets");
        assert_eq!(lit, rays::trace_shadow_packets(tree, &self.points), "packets");
        assert_eq!(hits, rays::trace_reflection_packets(tree, &self.points), "hybrid packets");
        builder
    }
}

/// Lit points and reflections that hit.
fn count_secondary<T: Tracer>(tracer: &T, points: &[SurfacePoint]) -> [usize; 2] {
    [rays::trace_shadow(tracer, points), rays::trace_reflection(tracer, points)]
}

/// Builds our tree in the memory of `builder`; indices are not kept, as nothing here needs them.
pub(crate) fn build_ours(
    structure: Structure,
    builder: &mut TreeBuilder,
    scene: &Scene,
) -> BuildReport {
    let spheres = Spheres { centers: &scene.centers, radius: SphereRadius::Common(scene.radius) };
    builder.build(&spheres, &BuildSettings { keep_indices: false, ..BuildSettings::new(structure) })
}

/// Structures to measure: from the environment, else all.
pub(crate) fn structures() -> Vec<Structure> {
    let Ok(list) = env::var(STRUCTURES_VARIABLE) else {
        return Structure::ALL.to_vec();
    };
    let parse = |name: &str| match name.trim().parse() {
        Ok(structure) => structure,
        Err(fault) => panic!("{STRUCTURES_VARIABLE}: {fault}"),
    };
    list.split(',').map(parse).collect()
}

/// Particle counts to measure: from the environment, else one small or the thesis's three.
pub(crate) fn particle_counts(quick: bool) -> Vec<usize> {
    let Ok(list) = env::var(PARTICLES_VARIABLE) else {
        let counts = KNOWN_HITS.map(|(count, _)| count);
        return if quick { counts[..1].to_vec() } else { counts.to_vec() };
    };
    list.split(',').map(parse_count).collect()
}

/// `1e6` and `1000000` alike.
fn parse_count(text: &str) -> usize {
    let value: f64 = text.trim().parse().unwrap_or(f64::NAN);
    assert!(
        (1.0..=4e9).contains(&value) && value.fract() == 0.0,
        "{PARTICLES_VARIABLE}: {text:?} is no particle count, give a list such as 1e5,1e6"
    );
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked to be a whole number in range"
    )]
    {
        value as usize
    }
}

/// Whether every measurement is to be run just once, to see that it works: with `--test`, and
/// without the `--bench` that cargo gives to benchmarks.
pub(crate) fn is_quick_run() -> bool {
    let has = |flag: &str| env::args().any(|argument| argument == flag);
    has("--test") || !has("--bench")
}

fn check_primary<T: Tracer>(name: &str, scene: &Scene, tracer: &T, records: &mut Vec<HitRecord>) {
    let hits = rays::trace_primary(tracer, scene, records);
    let particles = scene.centers.len();
    if let Some((_, known)) = KNOWN_HITS.iter().find(|(count, _)| *count == particles) {
        assert_eq!(hits, *known, "{name}: primary hits at {particles} particles");
    }
}

/// Stops a benchmark of two programs that do not do the same: `counts` out of `rays` must agree but
/// for what rounding decides.
fn check_agreement(what: &str, counts: [usize; 2], rays: usize) {
    #[expect(clippy::cast_precision_loss, reason = "millions at most")]
    let allowed = (rays as f64 * GRAZING).ceil();
    #[expect(clippy::cast_precision_loss, reason = "millions at most")]
    let difference = counts[0].abs_diff(counts[1]) as f64;
    assert!(difference <= allowed, "{what}: the programs count {counts:?} of {rays} rays");
}
