//! The kernels that build trees, compiled for what a tree needs.

use crate::Device;
use crate::commands::Kernel;
use crate::spheres::{Encoding, KeyLength};
use crate::tree_need::BLOCK;

/// What kernels for keys depend on: the length, and how centres are stored. Only centres in any order have keys.
pub(crate) type KeyVariant = (KeyLength, Encoding);
/// What kernels for nodes depend on: whether radii are equal, how centres are stored, whether they stay coded, and whether
/// spheres move.
pub(crate) type NodeVariant = (bool, Encoding, bool, bool);

/// Kernels for keys of one length.
#[derive(Debug)]
pub(crate) struct KeyKernels {
    pub(crate) clear_bounds: Kernel,
    pub(crate) find_bounds: Kernel,
    pub(crate) first_keys: Kernel,
    pub(crate) next_keys: Kernel,
    pub(crate) keep_order: Kernel,
}

impl KeyKernels {
    pub(crate) fn new(device: &Device, (length, encoding): KeyVariant) -> Self {
        let bits = format!("const BITS: u32 = {}u;\n", 8 * length.words());
        let encoding = encoding_constant(encoding);
        let source = [&bits, &encoding, BUILD, GROUPS, CENTERS, include_str!("shaders/keys.wgsl")];
        let module = device.module(&source.concat());
        let kernel = |entry, bindings| Kernel::new(device, &module, entry, bindings);
        Self {
            clear_bounds: kernel("clear_bounds", &[2]),
            find_bounds: kernel("find_bounds", &[0, 1, 2]),
            first_keys: kernel("first_keys", &[0, 1, 2, 4]),
            next_keys: kernel("next_keys", &[0, 1, 2, 3, 4]),
            keep_order: kernel("keep_order", &[0, 4]),
        }
    }
}

/// Kernels that sort.
#[derive(Debug)]
pub(crate) struct SortKernels {
    pub(crate) histogram: Kernel,
    pub(crate) scan_digits: Kernel,
    pub(crate) scatter: Kernel,
}

impl SortKernels {
    pub(crate) fn new(device: &Device) -> Self {
        let rank = if device.has_large_subgroups() {
            include_str!("shaders/rank_subgroup.wgsl")
        } else {
            include_str!("shaders/rank_plain.wgsl")
        };
        let module = device.module(&[BUILD, include_str!("shaders/sort.wgsl"), rank].concat());
        let kernel = |entry, bindings| Kernel::new(device, &module, entry, bindings);
        Self {
            histogram: kernel("histogram", &[0, 3, 5]),
            scan_digits: kernel("scan_digits", &[0, 5, 6]),
            scatter: kernel("scatter", &[0, 3, 4, 5, 6]),
        }
    }
}

/// Kernels that build nodes, for spheres with a common radius or one for each.
#[derive(Debug)]
pub(crate) struct NodeKernels {
    /// Unless spheres stay coded.
    pub(crate) gather_spheres: Option<Kernel>,
    pub(crate) block_boxes: Kernel,
    pub(crate) build_level: Kernel,
}

impl NodeKernels {
    pub(crate) fn new(
        device: &Device,
        (is_common, encoding, keeps_codes, has_motion): NodeVariant,
        part: &str,
    ) -> Self {
        let is_coded = matches!(encoding, Encoding::Q16 | Encoding::Q10);
        let motion = format!("const HAS_MOTION: bool = {has_motion};\n");
        let centers = if is_coded {
            [
                part,
                device.arithmetic().source(),
                ARITHMETIC,
                CODED_CENTERS,
                include_str!("shaders/coded_build.wgsl"),
            ]
            .concat()
        } else {
            CENTERS.to_owned()
        };
        let blocks = if keeps_codes {
            include_str!("shaders/coded_blocks.wgsl")
        } else {
            include_str!("shaders/blocks.wgsl")
        };
        let source = [
            &tree_constants(is_common),
            &motion,
            &encoding_constant(encoding),
            BUILD,
            GROUPS,
            &centers,
            blocks,
            include_str!("shaders/nodes.wgsl"),
        ];
        let module = device.module(&source.concat());
        let of_centers: &[u32] = if is_coded { &[15, 16, 17] } else { &[] };
        let kernel = |entry, bindings: &[u32]| {
            Kernel::new(device, &module, entry, &[bindings, of_centers].concat())
        };
        Self {
            gather_spheres: (!keeps_codes)
                .then(|| kernel("gather_spheres", &[0, 1, 3, 7, 8, 9, 13, 14])),
            block_boxes: if keeps_codes {
                kernel("block_boxes", &[0, 1, 11])
            } else {
                kernel("block_boxes", &[0, 1, 3, 7, 8, 11, 14])
            },
            build_level: Kernel::new(device, &module, "build_level", &[0, 10, 11, 12]),
        }
    }
}

/// What several shaders have in common.
const BUILD: &str = include_str!("shaders/build.wgsl");
const CENTERS: &str = include_str!("shaders/centers.wgsl");
pub(crate) const GROUPS: &str = include_str!("shaders/groups.wgsl");
const ARITHMETIC: &str = include_str!("shaders/arithmetic.wgsl");
pub(crate) const CODED_CENTERS: &str = include_str!("shaders/coded_centers.wgsl");

/// The constant of the shaders for how centres are stored.
pub(crate) fn encoding_constant(encoding: Encoding) -> String {
    let number = match encoding {
        Encoding::Points => 0,
        Encoding::Blocks => 1,
        Encoding::Q16 => 2,
        Encoding::Q10 => 3,
    };
    format!("const ENCODING: u32 = {number}u;\n")
}

/// Constants of the shaders that read spheres.
pub(crate) fn tree_constants(is_common: bool) -> String {
    format!("const BLOCK: u32 = {BLOCK}u;\nconst COMMON_RADIUS: bool = {is_common};\n")
}
