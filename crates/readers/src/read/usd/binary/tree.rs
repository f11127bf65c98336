//! The prims of a binary file, and the properties that particles need.

use super::{CrateFile, NO_FIELD, NO_PATH};
use crate::read::usd::prim::{
    Metadata, Prim, PrimKind, PrimTree, Property, Value, ValueRep, is_needed, of_prims,
};
use spherule_frame::{MemoryBudget, ParseError};

/// Kinds of specs.
const ATTRIBUTE: u32 = 1;
const PRIM: u32 = 6;
const ROOT: u32 = 7;

/// The specifier of prims that are there; others are opinions about them, or classes.
const DEFINED: u32 = 0;

/// Memory for a spec or a set of fields.
const ENTRY_LEN: u64 = 160;

/// Reads the binary file `bytes`.
///
/// # Errors
/// [`ParseError`] if it is damaged, or does not fit into `budget`.
pub(in crate::read::usd) fn read(
    bytes: &[u8],
    budget: MemoryBudget,
) -> Result<(CrateFile<'_>, PrimTree), ParseError> {
    let file = CrateFile::open(bytes, budget)?;
    let count = (file.specs.len() + file.field_sets.len()) as u64;
    budget.check(count.saturating_mul(ENTRY_LEN), "the list of its objects is")?;
    let sets = FieldSets::of(&file);
    let mut builder = Builder {
        prims: Vec::new(),
        prim_of_path: vec![None; file.paths.len()],
        metadata: Metadata::default(),
        file: &file,
        sets: &sets,
    };
    builder.add_prims();
    let properties = builder.properties()?;
    let (mut prims, metadata) = (builder.prims, builder.metadata);
    let properties = of_prims(properties, &mut prims, file.token_text());
    let tree = PrimTree { prims, properties, metadata };
    Ok((file, tree))
}

/// What the fields of a set say.
#[derive(Debug, Clone, Default)]
struct FieldSet {
    start: u32,
    default: Option<ValueRep>,
    samples: Option<ValueRep>,
    type_name: Option<ValueRep>,
    specifier: Option<ValueRep>,
    active: Option<ValueRep>,
    up_axis: Option<ValueRep>,
    meters_per_unit: Option<ValueRep>,
    time_codes_per_second: Option<ValueRep>,
    frames_per_second: Option<ValueRep>,
    has_spline: bool,
    has_arcs: bool,
}

/// All sets of fields, by their start.
struct FieldSets(Vec<FieldSet>);

impl FieldSets {
    fn of(file: &CrateFile<'_>) -> Self {
        let mut sets = Vec::new();
        let mut start = 0;
        for fields in file.field_sets.split(|field| *field == NO_FIELD) {
            let mut set = FieldSet { start, ..FieldSet::default() };
            for (token, rep) in fields.iter().filter_map(|field| file.fields.get(*field as usize)) {
                set.add(file.token(*token), *rep);
            }
            let len = u32::try_from(fields.len()).unwrap_or(u32::MAX);
            start = start.saturating_add(len).saturating_add(1);
            sets.push(set);
        }
        Self(sets)
    }

    fn get(&self, start: u32) -> Option<&FieldSet> {
        let index = self.0.binary_search_by_key(&start, |set| set.start).ok()?;
        self.0.get(index)
    }
}

impl FieldSet {
    fn add(&mut self, name: &[u8], rep: ValueRep) {
        match name {
            b"default" => self.default = Some(rep),
            b"timeSamples" => self.samples = Some(rep),
            b"typeName" => self.type_name = Some(rep),
            b"specifier" => self.specifier = Some(rep),
            b"active" => self.active = Some(rep),
            b"upAxis" => self.up_axis = Some(rep),
            b"metersPerUnit" => self.meters_per_unit = Some(rep),
            b"timeCodesPerSecond" => self.time_codes_per_second = Some(rep),
            b"framesPerSecond" => self.frames_per_second = Some(rep),
            b"spline" => self.has_spline = true,
            b"references" | b"payload" | b"inheritPaths" | b"specializes" | b"variantSetNames"
            | b"clips" | b"clipSets" | b"subLayers" | b"relocates" | b"layerRelocates" => {
                self.has_arcs = true
            }
            _ => {}
        }
    }
}

/// Collects prims and properties.
struct Builder<'f, 'a> {
    prims: Vec<Prim>,
    prim_of_path: Vec<Option<usize>>,
    metadata: Metadata,
    file: &'f CrateFile<'a>,
    sets: &'f FieldSets,
}

impl Builder<'_, '_> {
    /// The first token of a value.
    fn token(&self, rep: Option<ValueRep>) -> &[u8] {
        let tokens = rep.and_then(|rep| self.file.tokens(rep).ok());
        let first = tokens.and_then(|tokens| tokens.first().copied());
        first.unwrap_or_default()
    }

    fn root(&mut self) {
        let mut root = Prim {
            name: 0..0,
            parent: None,
            kind: PrimKind::Other,
            is_dormant: false,
            has_arcs: false,
            properties: 0..0,
        };
        let spec = self.file.specs.iter().find(|spec| spec.kind == ROOT);
        if let Some((spec, set)) =
            spec.and_then(|spec| Some((spec, self.sets.get(spec.field_set)?)))
        {
            let number = |rep: Option<ValueRep>| rep.and_then(|rep| self.file.number(rep));
            root.has_arcs = set.has_arcs;
            self.metadata = Metadata {
                is_z_up: self.token(set.up_axis) == b"Z",
                meters_per_unit: number(set.meters_per_unit),
                time_codes_per_second: number(set.time_codes_per_second),
                frames_per_second: number(set.frames_per_second),
            };
            if let Some(prim) = self.prim_of_path.get_mut(spec.path as usize) {
                *prim = Some(0);
            }
        }
        self.prims.push(root);
    }

    /// Adds all prims. Only then the parents of all are known.
    fn add_prims(&mut self) {
        self.root();
        let file = self.file;
        let mut paths = vec![0];
        for spec in file.specs.iter().filter(|spec| spec.kind == PRIM) {
            let (Some(set), Some(path)) =
                (self.sets.get(spec.field_set), file.paths.get(spec.path as usize))
            else {
                continue;
            };
            let prim_of_path = &mut self.prim_of_path[spec.path as usize];
            if !path.is_defined || prim_of_path.is_some() {
                continue;
            }
            *prim_of_path = Some(self.prims.len());
            let specifier = set.specifier.and_then(ValueRep::enumerator);
            let active = set.active.and_then(ValueRep::enumerator);
            self.prims.push(Prim {
                name: file.token_range(path.token).unwrap_or_default(),
                parent: None,
                kind: PrimKind::of(self.token(set.type_name)),
                is_dormant: specifier != Some(DEFINED) || active == Some(0),
                has_arcs: set.has_arcs,
                properties: 0..0,
            });
            paths.push(spec.path);
        }
        for (prim, path) in self.prims.iter_mut().zip(&paths).skip(1) {
            let parent = file.paths.get(*path as usize).map_or(NO_PATH, |path| path.parent);
            prim.parent = self.prim_of_path.get(parent as usize).copied().flatten();
        }
    }

    /// The properties that are needed, with their prims.
    fn properties(&self) -> Result<Vec<(usize, Property)>, ParseError> {
        let mut found = Vec::new();
        for spec in self.file.specs.iter().filter(|spec| spec.kind == ATTRIBUTE) {
            let Some(path) = self.file.paths.get(spec.path as usize) else {
                continue;
            };
            let prim = self.prim_of_path.get(path.parent as usize).copied().flatten();
            if let Some(prim) = prim
                && path.is_property
                && is_needed(self.file.token(path.token))
                && let Some(set) = self.sets.get(spec.field_set)
            {
                let property = Property {
                    name: self.file.token_range(path.token).unwrap_or_default(),
                    default: set.default.map(Value::Binary),
                    samples: match set.samples {
                        Some(rep) => self.file.samples(rep)?,
                        None => None,
                    },
                    has_spline: set.has_spline,
                };
                found.push((prim, property));
            }
        }
        Ok(found)
    }
}
