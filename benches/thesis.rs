//! Build and trace rates on the thesis's scene, ours and obvhs, as criterion groups.
//!
//! Rates of the two programs are measured minutes apart here; for their ratio on a machine that
//! does other things too see the bench `ratio`.

use std::hint::black_box;
use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, SamplingMode, Throughput};
use spherule::accel::{Structure, TreeBuilder};

mod support;

use support::obvhs::ObvhsBuilder;
use support::rays::{
    trace_primary, trace_primary_packets, trace_reflection, trace_shadow, trace_shadow_packets,
};
use support::{Case, build_ours, is_quick_run, particle_counts, structures};

/// A particle count with all trees, ready to trace.
struct Built {
    case: Case,
    ours: Vec<(Structure, TreeBuilder)>,
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let cases: Vec<Built> = particle_counts(is_quick_run())
        .into_iter()
        .map(|particles| {
            let case = Case::new(particles);
            let build = |structure| (structure, case.tree(structure));
            let ours = structures().into_iter().map(build).collect();
            Built { case, ours }
        })
        .collect();
    build(&mut criterion, &cases);
    primary(&mut criterion, &cases);
    shadow(&mut criterion, &cases);
    reflection(&mut criterion, &cases);
    criterion.final_summary();
}

/// One iteration is a frame, so few are enough and none may be dropped.
fn group<'a>(criterion: &'a mut Criterion, name: &str) -> BenchmarkGroup<'a, WallTime> {
    let mut group = criterion.benchmark_group(name);
    group
        .sample_size(10)
        .sampling_mode(SamplingMode::Flat)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(2));
    group
}

/// Trees in the memory of the tree before, as in a sequence of frames.
fn build(criterion: &mut Criterion, cases: &[Built]) {
    let mut group = group(criterion, "build");
    for Built { case, ours } in cases {
        let particles = case.scene.centers.len();
        group.throughput(Throughput::Elements(particles as u64));
        for (structure, _) in ours {
            group.bench_function(BenchmarkId::new(structure.name(), particles), |bencher| {
                let mut builder = TreeBuilder::new();
                bencher.iter(|| black_box(build_ours(*structure, &mut builder, &case.scene).nodes));
            });
        }
        group.bench_function(BenchmarkId::new("obvhs", particles), |bencher| {
            let mut builder = ObvhsBuilder::new();
            bencher.iter(|| black_box(builder.build(&case.spheres)));
        });
    }
    group.finish();
}

fn primary(criterion: &mut Criterion, cases: &[Built]) {
    let mut group = group(criterion, "primary");
    for Built { case, ours } in cases {
        let particles = case.scene.centers.len();
        let scene = &case.scene;
        let mut records = Vec::new();
        group.throughput(Throughput::Elements(scene.pixels.len() as u64));
        for (structure, builder) in ours {
            group.bench_function(BenchmarkId::new(structure.name(), particles), |bencher| {
                bencher.iter(|| trace_primary(&builder.tree().view(), scene, &mut records));
            });
            let packets = format!("{structure}-packets");
            group.bench_function(BenchmarkId::new(packets, particles), |bencher| {
                bencher.iter(|| trace_primary_packets(&builder.tree().view(), scene, &mut records));
            });
        }
        group.bench_function(BenchmarkId::new("obvhs", particles), |bencher| {
            bencher.iter(|| trace_primary(&case.obvhs, scene, &mut records));
        });
    }
    group.finish();
}

fn shadow(criterion: &mut Criterion, cases: &[Built]) {
    let mut group = group(criterion, "shadow");
    for Built { case, ours } in cases {
        let particles = case.scene.centers.len();
        let points = &case.points;
        group.throughput(Throughput::Elements(points.len() as u64));
        for (structure, builder) in ours {
            group.bench_function(BenchmarkId::new(structure.name(), particles), |bencher| {
                bencher.iter(|| trace_shadow(&builder.tree().view(), points));
            });
            let packets = format!("{structure}-packets");
            group.bench_function(BenchmarkId::new(packets, particles), |bencher| {
                bencher.iter(|| trace_shadow_packets(&builder.tree().view(), points));
            });
        }
        group.bench_function(BenchmarkId::new("obvhs", particles), |bencher| {
            bencher.iter(|| trace_shadow(&case.obvhs, points));
        });
    }
    group.finish();
}

fn reflection(criterion: &mut Criterion, cases: &[Built]) {
    let mut group = group(criterion, "reflection");
    for Built { case, ours } in cases {
        let particles = case.scene.centers.len();
        let points = &case.points;
        group.throughput(Throughput::Elements(points.len() as u64));
        for (structure, builder) in ours {
            group.bench_function(BenchmarkId::new(structure.name(), particles), |bencher| {
                bencher.iter(|| trace_reflection(&builder.tree().view(), points));
            });
        }
        group.bench_function(BenchmarkId::new("obvhs", particles), |bencher| {
            bencher.iter(|| trace_reflection(&case.obvhs, points));
        });
    }
    group.finish();
}
