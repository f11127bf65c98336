//! Why Vulkan finds no device: the loader and the drivers that it reads.

use std::env;
use std::path::{Path, PathBuf};

/// The loader.
const LOADER: &str = "libvulkan.so.1";
/// Where the system has libraries.
const LIBRARIES: [&str; 6] = [
    "/lib",
    "/usr/lib",
    "/lib64",
    "/usr/lib64",
    "/usr/lib/x86_64-linux-gnu",
    "/usr/lib/aarch64-linux-gnu",
];
/// Where drivers are described.
const DRIVERS: [&str; 3] =
    ["/etc/vulkan/icd.d", "/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"];

/// The most likely reason why there is no device, with the remedy.
pub(super) fn why_nothing_is_found() -> String {
    if !has_loader() {
        return format!("{LOADER} is missing (Debian: package libvulkan1)");
    }
    if !has_driver() {
        return "no Vulkan driver is installed: no description in /usr/share/vulkan/icd.d or \
                /etc/vulkan/icd.d, and VK_DRIVER_FILES names none. With NVIDIA, the driver needs \
                its graphics part (libGLX_nvidia.so.0) and libglvnd0; containers need the \
                capability `graphics`"
            .to_owned();
    }
    "the installed Vulkan drivers found no device; `vulkaninfo --summary` says more".to_owned()
}

/// Whether the system shows a device that may be a GPU. Without one, drivers would be loaded for nothing, and some of them
/// complain about a desktop that is missing.
pub(super) fn has_device_file() -> bool {
    let names = |directory: &str, start: &str| {
        let mut entries = Path::new(directory).read_dir().into_iter().flatten().flatten();
        entries.any(|entry| entry.file_name().to_string_lossy().starts_with(start))
    };
    !cfg!(target_os = "linux")
        || names("/dev/dri", "renderD")
        || names("/dev", "nvidia")
        || Path::new("/dev/dxg").exists()
}

fn has_loader() -> bool {
    let paths = env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    let mut all = env::split_paths(&paths).chain(LIBRARIES.map(PathBuf::from));
    all.any(|directory| directory.join(LOADER).exists())
}

fn has_driver() -> bool {
    let is_named = |name: &str| env::var_os(name).is_some_and(|files| !files.is_empty());
    let has_files = |directory: &str| {
        Path::new(directory).read_dir().is_ok_and(|mut entries| entries.next().is_some())
    };
    is_named("VK_DRIVER_FILES")
        || is_named("VK_ICD_FILENAMES")
        || DRIVERS.iter().any(|directory| has_files(directory))
}
