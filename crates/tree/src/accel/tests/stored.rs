//! Trees over stored leaves against brute force over the same data, and trees over damaged leaves.
//!
//! Each count is tried with all encodings of positions and radii, five arrangements, and all instruction sets.

use std::borrow::Borrow;

use super::encode::{OwnedBlocks, OwnedLeaves, OwnedRadii, Positions, Radii};
use super::packets::{SHAPES, check_packet, packet};
use super::*;
use crate::accel::leaves::Leaves;
use crate::accel::simd::PacketKernel;
use crate::accel::stored::{StoredFault, StoredSettings, StoredTree};
use crate::accel::topology::Topology;
use crate::accel::view::{Resolved, TreeTask};
use crate::blocks::{
    Block, CompactBlock, Q10Block, Q16Block, StoredBlocks, StoredLeaves, StoredRadii,
};

fn settings(radius: Option<f32>) -> StoredSettings {
    StoredSettings { structure: Structure::Lbvh, radius, keep_indices: true }
}

/// Sets of `count` points: random, clustered, flat, coincident, tiny.
fn sets(count: usize) -> [(&'static str, Vec<Vec3>); 5] {
    let cloud = random_points(count, count as u64 + 1);
    let clustered = cloud.iter().enumerate().map(|(i, p)| match i % 3 {
        0 => *p,
        _ => *p * 1e-3 + 0.5,
    });
    [
        ("clustered", clustered.collect()),
        ("flat", cloud.iter().map(|p| p.with_z(0.3)).collect()),
        ("coincident", vec![Vec3::new(0.1, -0.7, 0.3); count]),
        ("tiny", cloud.iter().map(|p| *p * 1e-6 + 0.25).collect()),
        ("random", cloud),
    ]
}

/// Radii around a value that leaves gaps for rays to miss.
fn radii_of(points: &[Vec3], name: &str) -> Vec<f32> {
    let mut random = Random(points.len() as u64);
    let typical = match name {
        "tiny" => 1e-6,
        _ => 0.3 / (points.len() as f32).cbrt(),
    };
    let factor = |_| typical * (0.3 + random.next());
    (0..points.len()).map(factor).collect()
}

/// Returns the number of rays that were compared.
#[track_caller]
fn check_stored(owned: &OwnedLeaves, name: &'static str, radius: Option<f32>) -> usize {
    let mut scene = match owned.count {
        0 => Scene::common(name, Vec::new(), 0.1),
        _ => owned.scene(name, radius),
    };
    if radius.is_none() || scene.centers.windows(2).any(|pair| pair[0] != pair[1]) {
        // Not equal to the bit, because of coded positions or radii.
        scene.name = match name {
            "coincident" => "nearly coincident",
            other => other,
        };
    }
    let leaves = owned.leaves();
    let mut tree = StoredTree::new();
    let ray_count = (40_000 / scene.centers.len().max(1)).clamp(12, 60);
    let mut judged = 0;
    for keep_indices in [true, false] {
        let settings = StoredSettings { keep_indices, ..settings(radius) };
        let report = tree.build(&leaves, settings).expect(name);
        assert_eq!(report.particles, owned.count);
        assert!(report.sah_cost >= 1.0 && report.file_bytes <= report.peak_bytes);
        for level in tested_levels() {
            tree.set_simd(level);
            let view = tree.view(&leaves);
            for ray in rays(&scene, ray_count, 11) {
                judged += usize::from(check_ray(&scene, &view, &ray, keep_indices, level));
            }
            let mut random = Random(17);
            for shape in SHAPES {
                let packet = packet(&scene, shape, &mut random);
                check_packet(&view, &packet, &format!("{name} {level:?} {shape:?}"));
            }
        }
    }
    judged
}

#[track_caller]
fn check_sets(count: usize) {
    for positions in Positions::ALL {
        let mut judged = 0;
        for (name, centers) in sets(count) {
            let scene = Scene { name, radii: radii_of(&centers, name), centers };
            for radii in Radii::ALL {
                let owned = OwnedLeaves::encode(&scene, positions, radii);
                let common = scene.radii.first().copied().unwrap_or(0.1);
                if radii != Radii::None {
                    judged += check_stored(&owned, name, None);
                }
                if radii == Radii::None || radii == Radii::U8 {
                    judged += check_stored(&owned, name, Some(common));
                }
            }
        }
        assert!(judged > 200, "{count} {positions:?}: {judged} rays judged");
    }
}

#[test]
fn few_stored_particles_match_brute_force() {
    for count in [0, 1, 15, 16, 17, 127, 128, 129, 1025] {
        check_sets(count);
    }
}

#[test]
fn many_stored_particles_match_brute_force() {
    check_sets(4_000);
}

/// Loads all blocks as a traversal does.
struct LoadAll(usize);

impl TreeTask for LoadAll {
    type Output = Vec<Block>;

    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) -> Vec<Block> {
        let load = |index| *tree.leaves.load(kernel, index).borrow();
        (0..self.0).map(load).collect()
    }
}

/// Blocks decoded during a traversal equal those decoded from the file, to the bit.
#[test]
fn spheres_of_slots_are_those_stored() {
    let centers = random_points(1025, 3);
    let scene = Scene { name: "random", radii: radii_of(&centers, "random"), centers };
    for positions in Positions::ALL {
        for radii in [Radii::F32, Radii::U16, Radii::U8] {
            let owned = OwnedLeaves::encode(&scene, positions, radii);
            let stored = owned.scene("stored", None);
            let mut tree = StoredTree::new();
            tree.build(&owned.leaves(), settings(None)).expect("sound");
            for level in tested_levels() {
                tree.set_simd(level);
                let loaded = tree.view(&owned.leaves()).run(LoadAll(65));
                for (index, block) in loaded.iter().enumerate() {
                    let what = format!("{positions:?} {level:?} block {index}");
                    assert_eq!(*block, owned.leaves().block(index), "{what}");
                }
            }
            let view = tree.view(&owned.leaves());
            for slot in 0..1025 {
                let (center, radius) = view.sphere(slot);
                let index = slot as usize;
                assert_eq!((center, radius), (stored.centers[index], stored.radii[index]));
                assert_eq!(view.particle(slot), slot);
            }
        }
    }
}

/// The upper levels are built from planes and not from particles, and rays find the same hits.
#[test]
fn stored_and_built_trees_agree() {
    let scene = Scene::common("cloud", random_points(20_000, 5), 0.02);
    let owned = OwnedLeaves::encode(&scene, Positions::F32, Radii::None);
    let mut tree = StoredTree::new();
    tree.build(&owned.leaves(), settings(Some(0.02))).expect("sound");
    let view = tree.view(&owned.leaves());
    let stored = owned.scene("cloud", Some(0.02));
    let mut builder = TreeBuilder::new();
    builder.build(&stored.spheres(), &BuildSettings::new(Structure::Kdtree));
    let built = builder.tree().view();
    let mut hits = 0;
    for ray in rays(&stored, 2000, 6) {
        let nearest = |view: &TreeView| {
            let hit = view.nearest(&ray)?;
            Some((hit.t.to_bits(), view.particle(hit.slot)))
        };
        assert_eq!(nearest(&view), nearest(&built), "{ray:?}");
        hits += usize::from(nearest(&view).is_some());
    }
    assert!(hits > 1000, "{hits}");
}

/// Leaves of 3000 nodes and a tree over them.
fn sound() -> OwnedLeaves {
    let scene = Scene::common("cloud", random_points(3000 * 128 - 5, 9), 0.02);
    OwnedLeaves::encode(&scene, Positions::Q16, Radii::None)
}

#[test]
fn lowest_faulty_node_is_reported_for_any_threads() {
    let mut owned = sound();
    let good = owned.nodes.clone();
    owned.nodes[2500].child_mask = 0;
    owned.nodes[1700].origin[1] = f32::NAN;
    for threads in [1, 2, 8] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(|| {
            let mut tree = StoredTree::new();
            let fault = tree.build(&owned.leaves(), settings(Some(0.1)));
            assert_eq!(fault.err(), Some(StoredFault::Plane { node: 1700 }));
        });
    }
    owned.nodes = good;
    let trees = [1, 8].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(|| {
            let mut tree = StoredTree::new();
            let report = tree.build(&owned.leaves(), settings(Some(0.1))).expect("sound");
            (format!("{tree:?}"), report.sah_cost.to_bits())
        })
    });
    assert!(trees[0] == trees[1], "trees depend on threads");
}

#[test]
fn every_fault_has_its_message() {
    let scene = Scene { name: "cloud", centers: random_points(1025, 2), radii: vec![0.02; 1025] };
    let good = OwnedLeaves::encode(&scene, Positions::Q10, Radii::U8);
    let mut tree = StoredTree::new();
    let mut fault_of = |change: &dyn Fn(&mut OwnedLeaves)| {
        let mut owned = good.clone();
        change(&mut owned);
        let fault = tree.build(&owned.leaves(), settings(None)).err();
        fault.map(|fault| fault.to_string()).unwrap_or_default()
    };
    assert_eq!(fault_of(&|_| ()), "");
    assert_eq!(
        fault_of(&|owned| owned.count = 1 << 32),
        "4294967296 particles, but a tree holds fewer than 2^32"
    );
    assert_eq!(fault_of(&|owned| owned.count = 1024), "9 nodes, should be 8");
    assert_eq!(fault_of(&|owned| owned.count = 1040 + 1), "65 blocks, should be 66");
    assert_eq!(
        fault_of(&|owned| match &mut owned.radii {
            OwnedRadii::U8(codes) => codes.truncate(3),
            _ => unreachable!("stored so"),
        }),
        "3 blocks of radii, should be 65"
    );
    assert_eq!(
        fault_of(&|owned| owned.radii = OwnedRadii::None),
        "the particles have no radius: give one"
    );
    assert_eq!(
        fault_of(&|owned| owned.nodes[8].child_mask = 3),
        "node 8 does not have the blocks below it"
    );
    assert_eq!(
        fault_of(&|owned| owned.nodes[7] = bytemuck::Zeroable::zeroed()),
        "node 7 does not have the blocks below it"
    );
    for (origin, exponent) in [(f32::INFINITY, 100), (1e38, 100), (0.0, 255), (0.0, 254)] {
        let fault = fault_of(&|owned| {
            owned.nodes[3].origin[2] = origin;
            owned.nodes[3].exponent[2] = exponent;
            owned.nodes[3].planes[2][1] = [200; 8];
        });
        assert_eq!(fault, "node 3: a plane is not finite or beyond 8.5e37");
    }
}

/// Leaves of no particles.
const NOTHING: StoredLeaves =
    StoredLeaves { count: 0, nodes: &[], blocks: StoredBlocks::F32(&[]), radii: StoredRadii::None };

/// Overwrites memory with noise.
fn scramble<T: bytemuck::Pod>(values: &mut [T], seed: u64) {
    let mut random = Random(seed);
    for byte in bytemuck::cast_slice_mut::<T, u8>(values) {
        *byte = (random.next() * 256.0) as u8;
    }
}

/// Runs every query on a tree over invalid data.
#[track_caller]
fn trace_anything(owned: &OwnedLeaves, radius: Option<f32>) {
    let leaves = owned.leaves();
    let mut tree = StoredTree::new();
    if tree.build(&leaves, settings(radius)).is_err() {
        assert!(tree.view(&NOTHING).is_empty());
        return;
    }
    let aims = Scene::common("aims", random_points(50, 4), 0.3);
    let mut crossings = Vec::new();
    for level in tested_levels() {
        tree.set_simd(level);
        let view = tree.view(&leaves);
        for ray in rays(&aims, 30, 2) {
            view.any_hit(&ray);
            if let Some(hit) = view.nearest(&ray) {
                view.sphere(hit.slot);
                assert!(u64::from(view.particle(hit.slot)) < owned.count);
            }
            view.crossings(&ray, &mut crossings);
            assert!(crossings.iter().all(|c| u64::from(c.slot) < owned.count));
        }
        let mut random = Random(8);
        for shape in SHAPES {
            let packet = packet(&aims, shape, &mut random);
            view.any_hit_packet(&packet);
            for hit in view.nearest_packet(&packet).into_iter().flatten() {
                assert!(u64::from(view.particle(hit.slot)) < owned.count);
            }
        }
    }
}

/// Noise for positions and radii, and then for boxes as well.
#[test]
fn noise_in_leaves_is_harmless() {
    for seed in 0..12 {
        let centers = random_points(1025, seed);
        let scene = Scene { name: "cloud", radii: radii_of(&centers, "random"), centers };
        for positions in Positions::ALL {
            for radii in Radii::ALL {
                let mut owned = OwnedLeaves::encode(&scene, positions, radii);
                let radius = (radii == Radii::None).then_some(0.1);
                scramble(&mut owned.wide, seed);
                match &mut owned.blocks {
                    OwnedBlocks::F32(blocks) => scramble(blocks, seed),
                    OwnedBlocks::Q16(blocks) => scramble(blocks, seed),
                    OwnedBlocks::Q10(blocks) => scramble(blocks, seed),
                }
                match &mut owned.radii {
                    OwnedRadii::None => {}
                    OwnedRadii::F32(radii) => scramble(radii, seed),
                    OwnedRadii::U16(codes) => scramble(codes, seed),
                    OwnedRadii::U8(codes) => scramble(codes, seed),
                }
                scramble(&mut owned.radius_codes, seed);
                trace_anything(&owned, radius);
                for node in &mut owned.nodes {
                    scramble(&mut node.planes, seed);
                }
                trace_anything(&owned, radius);
                scramble(&mut owned.nodes[3..4], seed);
                trace_anything(&owned, radius);
            }
        }
    }
}

/// References to missing blocks.
#[test]
fn references_out_of_range_are_harmless() {
    let scene = Scene::common("cloud", random_points(1025, 1), 0.1);
    for last in [0, 1, 7] {
        let mut owned = OwnedLeaves::encode(&scene, Positions::Q10, Radii::None);
        let blocks = (0..65).map(|i| Q10Block::referring_to(u32::MAX - i * last));
        owned.blocks = OwnedBlocks::Q10(blocks.collect());
        trace_anything(&owned, Some(0.1));
        let blocks = (0..65).map(|i| Q16Block::referring_to(13 + i * last));
        owned.blocks = OwnedBlocks::Q16(blocks.collect());
        trace_anything(&owned, Some(0.1));
    }
}
