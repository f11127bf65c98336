//! The dispatch from levels to kernels.

use super::tested_levels::tested_levels;
use super::*;

/// The name of the kernel that runs it.
struct KernelName;

impl KernelTask for KernelName {
    type Output = &'static str;

    fn run<K: PacketKernel>(self, _: K) -> &'static str {
        std::any::type_name::<K>()
    }
}

/// A level that falls back to the kernel of another would pass all comparisons.
#[test]
fn each_level_runs_its_own_kernel() {
    for level in tested_levels() {
        let path = Supported::or_best(level).run(KernelName);
        let kernel = path.rsplit("::").next().unwrap_or(path);
        assert_eq!(kernel.to_lowercase(), level.name());
    }
}
