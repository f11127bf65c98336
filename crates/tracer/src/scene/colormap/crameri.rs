//! The scientific colour maps of Fabio Crameri (version 8, doi:10.5281/zenodo.1243862), MIT licence: see
//! `crameri-LICENSE.txt`. `crameri.py` made the data.

use super::ENTRIES;

/// Names of the maps, in the order of the data: sequential and multi-sequential ones, then diverging ones, then
/// cyclic ones.
pub(super) const NAMES: [&str; 39] = [
    "acton", "bamako", "batlow", "batlowK", "batlowW", "bilbao", "buda", "bukavu", "davos",
    "devon", "fes", "glasgow", "grayC", "hawaii", "imola", "lajolla", "lapaz", "lipari", "navia",
    "nuuk", "oleron", "oslo", "tokyo", "turku", "bam", "berlin", "broc", "cork", "lisbon",
    "managua", "roma", "tofino", "vanimo", "vik", "bamO", "brocO", "corkO", "romaO", "vikO",
];

static DATA: &[u8; NAMES.len() * ENTRIES * 3] = include_bytes!("crameri.bin");

/// Entry `i` of map `number`, sRGB.
pub(super) fn entry(number: usize, i: usize) -> [u8; 3] {
    let colors = DATA.as_chunks::<3>().0;
    colors[number.min(NAMES.len() - 1) * ENTRIES + i.min(ENTRIES - 1)]
}
