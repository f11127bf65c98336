//! Packets against single rays: the same to the bit.

use super::*;
use crate::accel::topology::Link;
use crate::accel::traverse::TreeHit;
use crate::accel::wide::WideTree;
use crate::accel::{Coherence, TreeHits};
use crate::blocks::Node;
use crate::ray::{PACKET_SIZE, RayPacket};

/// Arrangement of the rays of a packet.
#[derive(Debug, Clone, Copy)]
pub(super) enum Shape {
    /// From one point through a square.
    Camera,
    /// From nearby points to one point.
    Shadow,
    /// Parallel, as far apart as the scene is wide.
    Wide,
    /// From inside a particle, in all directions.
    Inside,
    /// Along an axis or nearly so, on both sides of it.
    Axis,
    /// Random rays.
    Any,
}

pub(super) const SHAPES: [Shape; 6] =
    [Shape::Camera, Shape::Shadow, Shape::Wide, Shape::Inside, Shape::Axis, Shape::Any];

/// 1 to 16 rays at a particle of `scene`.
pub(super) fn packet(scene: &Scene, shape: Shape, random: &mut Random) -> RayPacket {
    let index = (random.next() * scene.centers.len() as f32) as usize;
    let target = scene.centers.get(index).copied().unwrap_or(Vec3::ZERO);
    let radius = scene.typical_radius();
    let mut way = (random.point() * 2.0 - 1.0).normalize_or(Vec3::X);
    if let Shape::Axis = shape {
        way = [Vec3::X, -Vec3::Y, Vec3::Z][index % 3];
    }
    let width = radius * 10.0_f32.powf(random.next() * 3.0 - 2.0);
    let eye = target - way * (radius * 6.0).max(3.0);
    let mut near = |width: f32| target + (random.point() * 2.0 - 1.0) * width;
    let rays: Vec<Ray> = (0..PACKET_SIZE)
        .map(|_| {
            let (from, to) = match shape {
                Shape::Camera => (eye, near(width)),
                Shape::Shadow => (near(width) - way * radius, target + way * 4.0),
                Shape::Wide => {
                    let start = near(1.0) - way * 3.0;
                    (start, start + way)
                }
                Shape::Inside => (near(0.3 * radius), near(radius)),
                Shape::Axis => (eye, near(1e-7)),
                Shape::Any => (near(2.0), near(radius)),
            };
            Ray::new(from, (to - from).normalize_or(Vec3::X))
        })
        .collect();
    let len = 1 + (random.next() * 1.5 * PACKET_SIZE as f32) as usize;
    let mut packet = RayPacket::default();
    for ray in rays.iter().take(len) {
        // Some rays end early or begin late.
        let choice = (random.next() * 8.0) as u32;
        let distance = (target - ray.origin).length();
        packet.push(&Ray {
            t_max: if choice == 0 { distance } else { ray.t_max },
            t_min: if choice == 1 { distance } else { ray.t_min },
            ..*ray
        });
    }
    packet
}

/// Returns the number of rays that hit.
#[track_caller]
pub(super) fn check_packet(tree: &TreeView, packet: &RayPacket, what: &str) -> usize {
    // The copy that is found depends on the leaves that were visited.
    let sphere = |slot| {
        if tree.has_copies { tree.particle(slot) } else { slot }
    };
    let bits = |hit: TreeHit| (hit.t.to_bits(), sphere(hit.slot));
    let alone: Vec<_> =
        packet.rays().map(|ray| (tree.nearest(&ray).map(bits), tree.any_hit(&ray))).collect();
    for coherence in [Coherence::Coherent, Coherence::Incoherent] {
        let mut hits = TreeHits::default();
        tree.nearest_lanes(packet, coherence, &mut hits);
        let occluded = tree.occluded_lanes(packet, coherence);
        for lane in 0..PACKET_SIZE {
            let (t, slot) = (hits.t[lane], hits.slot[lane]);
            let is_hit = slot != TreeHits::NO_SLOT;
            assert_eq!(is_hit, hits.mask() >> lane & 1 == 1);
            let together = (is_hit.then(|| bits(TreeHit { t, slot })), occluded >> lane & 1 == 1);
            let expected = alone.get(lane).copied().unwrap_or((None, false));
            assert_eq!(together, expected, "{what}, {coherence:?}, lane {lane} of {packet:?}");
        }
    }
    alone.iter().filter(|(hit, _)| hit.is_some()).count()
}

/// The same tree with links.
fn linked(tree: &WideTree) -> Vec<Link> {
    let ends = tree
        .level_starts
        .iter()
        .skip(1)
        .map(|start| *start as usize)
        .chain([tree.nodes.len()])
        .take(tree.level_starts.len());
    let view = tree.view();
    let mut links = Vec::new();
    for (level, end) in ends.enumerate() {
        let start = tree.level_starts[level] as usize;
        for (index, node) in tree.nodes[start..end].iter().enumerate() {
            let first = view.implicit().first_child(level as u32, index);
            links.push(match tree.level_starts.get(level + 1) {
                Some(below) => Link::new(*below as usize + first, Node::child_count(node), 0),
                None => Link::new(0, 0, first),
            });
        }
    }
    links
}

// 13 scenes under all settings, with ids and without; each ray of a packet is traced alone, too.
#[test]
fn packets_match_single_rays() {
    for scene in awkward_scenes() {
        for settings in all_settings() {
            for keep_indices in [true, false] {
                let settings = BuildSettings { keep_indices, ..settings };
                let mut builder = TreeBuilder::new();
                builder.build(&scene.spheres(), &settings);
                let mut hits = check_shapes(&scene, builder.tree_mut());
                if builder.tree().links.is_empty() {
                    builder.tree_mut().links = linked(builder.tree());
                    hits += check_shapes(&scene, builder.tree_mut());
                }
                assert!(hits > 160 || scene.centers.is_empty(), "{}", scene.name);
            }
        }
    }
}

/// Returns the number of rays that hit, over all levels.
#[track_caller]
fn check_shapes(scene: &Scene, tree: &mut WideTree) -> usize {
    let mut hits = 0;
    for level in tested_levels() {
        tree.set_simd(level);
        for shape in SHAPES {
            let mut random = Random(17);
            for _ in 0..5 {
                let packet = packet(scene, shape, &mut random);
                let what = format!("{} {level:?} {shape:?}", scene.name);
                hits += check_packet(&tree.view(), &packet, &what);
            }
        }
    }
    hits
}

#[test]
fn empty_packet_hits_nothing() {
    let scene = Scene::common("one", vec![Vec3::ZERO], 1.0);
    let mut builder = TreeBuilder::new();
    builder.build(&scene.spheres(), &BuildSettings::default());
    let view = builder.tree().view();
    // Also an empty packet that held rays before.
    let mut emptied = RayPacket::default();
    emptied.push(&Ray::new(Vec3::X * -3.0, Vec3::X));
    assert_eq!(check_packet(&view, &emptied, "one ray"), 1);
    emptied.clear();
    for nothing in [RayPacket::default(), emptied] {
        assert_eq!(check_packet(&view, &nothing, "no rays"), 0);
    }
}

#[test]
fn ties_in_a_packet_go_to_the_lower_index() {
    let scene = Scene::common("coincident", vec![Vec3::splat(0.25); 100], 0.5);
    let mut builder = TreeBuilder::new();
    builder.build(&scene.spheres(), &BuildSettings::default());
    let mut packet = RayPacket::default();
    for lane in 0..PACKET_SIZE {
        let aim = Vec3::new(0.25, 0.2, 0.2 + 0.005 * lane as f32);
        packet.push(&Ray::new(Vec3::NEG_X * 5.0, (aim + Vec3::X * 5.0).normalize()));
    }
    for level in tested_levels() {
        builder.tree_mut().set_simd(level);
        let view = builder.tree().view();
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            let mut hits = TreeHits::default();
            view.nearest_lanes(&packet, coherence, &mut hits);
            assert_eq!(
                hits.slot.map(|slot| view.particle(slot)),
                [0; PACKET_SIZE],
                "{level:?} {coherence:?}"
            );
        }
    }
}
