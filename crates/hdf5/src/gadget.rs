//! Snapshots of GADGET, AREPO, GIZMO, SWIFT and codes like these: groups `PartType0`, `PartType1`... with
//! `Coordinates`.

use std::sync::Arc;

use glam::{DMat3, DVec3};

use super::dialect::{Dialect, StepInfo, integer, listed, units};
use super::node::{Node, dataset_number, dataset_text};
use super::piece::Piece;
use super::properties::PropertyFinder;
use super::slice::Slice;
use super::stored::Stored;
use super::table::{Part, ParticleTable};
use super::values::Values;
use spherule_frame::{MemoryBudget, ParseError, ScalarType, SimulationCell};
use spherule_readers::ValueNames;
use spherule_readers::read::notes::cell_note;

/// What the names of the groups of types begin with.
const TYPE: &str = "PartType";
const COORDINATES: &str = "Coordinates";
const MASSES: &str = "Masses";

/// Usual content of the types, by number.
const USUAL: [&str; 7] = [
    "gas",
    "dark matter",
    "disk, or background dark matter",
    "bulge, sinks or tracers",
    "stars",
    "black holes",
    "neutrinos",
];

/// A snapshot.
pub(super) struct Snapshot {
    root: Node,
    header: Option<Node>,
    /// Numbers of types that have coordinates, with their groups.
    types: Vec<(u32, Node)>,
    /// Names of groups of types without.
    without: Vec<String>,
}

/// Number of files that a snapshot is divided among.
pub(super) fn file_count(root: &Node) -> u64 {
    let header = root.group("Header").ok().flatten();
    let count = header.and_then(|header| header.number("NumFilesPerSnapshot")).and_then(integer);
    count.and_then(|count| u64::try_from(count).ok()).unwrap_or(1)
}

/// Whether the snapshot consists of virtual data sets: SWIFT writes such a file beside those with the values, and says
/// so in the header.
pub(super) fn is_virtual(root: &Node) -> bool {
    let header = root.group("Header").ok().flatten();
    header.is_some_and(|header| header.number("Virtual") == Some(1.0))
}

impl Snapshot {
    /// The snapshot in the file; `None` if it has another layout.
    ///
    /// # Errors
    /// [`ParseError`] if the file is damaged, or no type has coordinates.
    pub(super) fn open(root: &Node) -> Result<Option<Self>, ParseError> {
        let number = |name: &str| name.strip_prefix(TYPE)?.parse::<u32>().ok();
        // SWIFT has links with other names to the groups
        let groups = root.distinct_groups(|name| number(name).is_some())?;
        let named =
            groups.into_iter().filter_map(|(name, node)| Some((number(&name)?, name, node)));
        let mut named: Vec<(u32, String, Node)> = named.collect();
        named.sort_by_key(|(number, _, _)| *number);
        if named.is_empty() {
            return Ok(None);
        }
        let mut snapshot = Self {
            root: root.clone(),
            header: root.group("Header")?,
            types: Vec::new(),
            without: Vec::new(),
        };
        for (number, name, node) in named {
            if node.dataset(COORDINATES)?.is_some() {
                snapshot.types.push((number, node));
            } else {
                snapshot.without.push(name);
            }
        }
        if snapshot.types.is_empty() && snapshot.particle_count() > 0 {
            let what =
                format!("none of {} has a data set {COORDINATES}", listed(&snapshot.without));
            return Err(ParseError::malformed(0, what));
        }
        Ok(Some(snapshot))
    }

    fn header_number(&self, name: &str) -> Option<f64> {
        self.header.as_ref()?.number(name)
    }

    /// The cell by `BoxSize`: a cube, or a cuboid with three lengths. None without a length above 0, as in runs without
    /// boundaries. It repeats, unless SWIFT says otherwise.
    fn cell(&self) -> Option<SimulationCell> {
        let sizes = self.header.as_ref()?.numbers("BoxSize")?;
        let lengths = match sizes[..] {
            [size] => [size; 3],
            [x, y, z] => [x, y, z],
            _ => return None,
        };
        let swift = self.root.group("RuntimePars").ok().flatten();
        let periodic = swift.and_then(|parameters| parameters.number("PeriodicBoundariesOn"));
        let periodic = periodic != Some(0.0);
        let vectors = DMat3::from_diagonal(lengths.into());
        let vectors = [vectors.x_axis, vectors.y_axis, vectors.z_axis];
        let has_lengths = lengths.iter().all(|length| *length > 0.0);
        SimulationCell::new(DVec3::ZERO, vectors, [periodic; 3]).filter(|_| has_lengths)
    }

    /// Particles of this file by its header; 1 without a header.
    fn particle_count(&self) -> i64 {
        let header = self.header.as_ref();
        let counts = header.and_then(|header| header.numbers("NumPart_ThisFile"));
        counts.map_or(1, |counts| counts.into_iter().filter_map(integer).sum())
    }

    /// The particles of one type, and the names of data sets that are left out.
    fn part(
        &self,
        number: u32,
        node: &Node,
        budget: MemoryBudget,
    ) -> Result<(Part, Vec<String>), ParseError> {
        let stored = Stored::open(node, COORDINATES)?
            .map(Arc::new)
            .ok_or_else(|| ParseError::malformed(0, "Coordinates are missing"))?;
        let positions = Values::find(&stored, &Slice::ALL, budget)?;
        let Some(positions) = positions.filter(|values| matches!(values.components(), 2 | 3))
        else {
            let shape = &stored.shape;
            return Err(stored.bad(format!("shape {shape:?}, three numbers a particle are needed")));
        };
        let count = positions.count();
        self.check_count(number, &stored, count)?;
        let mut finder = PropertyFinder::new(count, budget);
        finder.exclude(&stored);
        let (_, datasets) = node.members()?;
        for name in datasets.iter().filter(|name| *name != COORDINATES) {
            finder.add(node, name, name, &Slice::ALL)?;
        }
        if let Some(mass) = self.mass_in_header(number)
            && !datasets.iter().any(|name| name == MASSES)
        {
            let piece = vec![Piece::Constant(mass, ScalarType::F64)];
            finder.found.push((MASSES.to_owned(), piece));
        }
        finder.join_vectors();
        let part = Part {
            value: number,
            name: format!("PartType{number}"),
            count,
            positions: vec![Piece::Stored(positions)],
            attributes: finder.found,
        };
        Ok((part, finder.left_out))
    }

    /// The mass of each particle of a type whose particles have no masses of their own.
    fn mass_in_header(&self, number: u32) -> Option<f64> {
        let masses = self.header.as_ref()?.numbers("MassTable")?;
        let mass = masses.get(number as usize).copied();
        mass.filter(|mass| *mass != 0.0)
    }

    /// Compares the number of coordinates with the header.
    fn check_count(&self, number: u32, stored: &Stored, count: u64) -> Result<(), ParseError> {
        let header = self.header.as_ref();
        let counts = header.and_then(|header| header.numbers("NumPart_ThisFile"));
        let stated = counts.and_then(|counts| integer(*counts.get(number as usize)?));
        match stated {
            Some(stated) if u64::try_from(stated) != Ok(count) => Err(stored.bad(format!(
                "{count} particles, Header/NumPart_ThisFile has {stated}: the snapshot is damaged or still being \
                 written"
            ))),
            _ => Ok(()),
        }
    }

    /// The program that wrote the file, and its version.
    fn code(&self) -> String {
        let swift = self.root.group("Code").ok().flatten();
        if let Some(code) = swift
            && let Some(name) = code.text("Code")
        {
            let version = code.text("Code Version").unwrap_or_default();
            return format!("snapshot of {name} {version}").trim_end().to_owned();
        }
        if let Some(version) = self.header_number("GIZMO_version") {
            return format!("snapshot of GIZMO {version}");
        }
        let has = |name: &str| matches!(self.root.group(name), Ok(Some(_)));
        if has("Parameters") && has("Config") {
            "snapshot of AREPO or GADGET-4".to_owned()
        } else {
            "snapshot of the GADGET family".to_owned()
        }
    }

    /// Names of types and numbers of particles.
    fn type_names(&self) -> String {
        let described = self.types.iter().map(|(number, node)| {
            let usual = USUAL.get(*number as usize);
            let usual = usual.map_or(String::new(), |usual| format!(", usually {usual}"));
            let count = node
                .dataset(COORDINATES)
                .ok()
                .flatten()
                .and_then(|c| c.shape().first().copied())
                .unwrap_or(0);
            format!("{number} = {TYPE}{number} ({count} particles{usual})")
        });
        described.collect::<Vec<String>>().join(", ")
    }

    /// Units of coordinates and velocities by their attributes, and of the header.
    fn units(&self) -> Vec<String> {
        let mut all = Vec::new();
        for name in [COORDINATES, "Velocities"] {
            let dataset = self.types.first().and_then(|(_, node)| node.dataset(name).ok()?);
            let unit = dataset.and_then(|dataset| {
                if let Some(expression) =
                    dataset_text(&dataset, "Expression for physical CGS units")
                {
                    return Some(expression);
                }
                let number =
                    |names: [&str; 2]| names.iter().find_map(|name| dataset_number(&dataset, name));
                let cgs = number(["to_cgs", "CGSConversionFactor"])?;
                let a = number(["a_scaling", "aexp-scale-exponent"]).unwrap_or(0.0);
                let h = number(["h_scaling", "h-scale-exponent"]).unwrap_or(0.0);
                Some(format!("a^{a} h^{h} {cgs:e} (CGS)"))
            });
            all.extend(unit.map(|unit| format!("{name} {unit}")));
        }
        let unit_group = self.root.group("Units").ok().flatten();
        let parameters = self.root.group("Parameters").ok().flatten();
        let holders = [&unit_group, &parameters, &self.header];
        for (name, keys, unit) in [
            ("length", ["Unit length in cgs (U_L)", "UnitLength_in_cm"], "cm"),
            ("time", ["Unit time in cgs (U_t)", "UnitTime_in_s"], "s"),
        ] {
            let mut holders = holders.into_iter().flatten();
            let found = holders.find_map(|h| keys.iter().find_map(|key| h.number(key)));
            all.extend(found.map(|number| format!("1 of {name} is {number:e} {unit}")));
        }
        all
    }
}

impl Dialect for Snapshot {
    fn steps(&self, _budget: MemoryBudget) -> Result<Vec<StepInfo>, ParseError> {
        Ok(vec![StepInfo { number: None, time: self.header_number("Time") }])
    }

    fn table(&self, _step: usize, budget: MemoryBudget) -> Result<ParticleTable, ParseError> {
        let mut parts = Vec::new();
        for (number, node) in &self.types {
            parts.push(self.part(*number, node, budget)?.0);
        }
        let time = self.header_number("Time");
        // Also with one type: later snapshots may have more.
        let table = ParticleTable::new(parts, true).at(time, None);
        Ok(table.in_cell(self.cell()))
    }

    fn value_names(&self) -> Vec<ValueNames> {
        let name = |number: u32| match number {
            0 | 1 | 4 | 5 => USUAL[number as usize].to_owned(),
            // They differ from code to code
            _ => format!("{TYPE}{number}"),
        };
        let names = self.types.iter().map(|(number, _)| (i64::from(*number), name(*number)));
        vec![ValueNames { attribute: "part".to_owned(), names: names.collect() }]
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = vec![format!("HDF5, {}", self.code())];
        notes.push(format!(
            "all particle types that have {COORDINATES} are read; attribute `part` is the number of the type: {}",
            self.type_names()
        ));
        if !self.without.is_empty() {
            notes.push(format!("without {COORDINATES}: {}", listed(&self.without)));
        }
        let files = file_count(&self.root);
        if files > 1 {
            notes.push(format!(
                "one of {files} files of a snapshot; give their directory, or a pattern such as snap_010.*.hdf5, to read \
                 them together"
            ));
        }
        notes.extend(units(&self.units()));
        let redshift = self.header_number("Redshift").filter(|z| *z != 0.0);
        if let (Some(z), Some(time)) = (redshift, self.header_number("Time"))
            && (time * (1.0 + z) - 1.0).abs() < 1e-6
        {
            notes.push(format!("Header/Time is the scale factor, at redshift {z}"));
        }
        let left_out: Vec<String> = self
            .types
            .iter()
            .filter_map(|(number, node)| self.part(*number, node, MemoryBudget::UNLIMITED).ok())
            .flat_map(|(_, left_out)| left_out)
            .collect();
        if !left_out.is_empty() {
            let what = "not one group of numbers for each particle, or not readable, so left out";
            notes.push(format!("{what}: {}", listed(&left_out)));
        }
        if self.cell().is_some() {
            notes.push(cell_note(None));
        }
        notes
    }
}
