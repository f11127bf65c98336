//! What particles need of a scene: which prims have them, at which times, and values at a time.

use std::collections::BTreeSet;

use super::METADATA_BUDGET;
use super::layer::Layer;
use super::number_type::Numbers;
use super::prim::{MAX_LEVELS, PrimKind, Property, Samples};
use spherule_frame::{AttributeData, MemoryBudget, ParseError};

/// How to make a file that is read.
pub(super) const FLATTEN: &str = "flatten it: usdcat --flatten scene.usd -o flat.usdc";

/// Memory for a time.
const TIME_LEN: u64 = 32;

/// The prims of `layer` that have particles, in the order of their paths.
#[derive(Debug)]
pub(super) struct ParticlePrims {
    /// Indices of prims.
    pub(super) prims: Vec<usize>,
    /// Whether prims refer to other files, variants or classes.
    pub(super) has_arcs: bool,
}

/// A prim on the way through the scene, with what it inherits.
#[derive(Clone, Copy)]
struct Visit {
    prim: usize,
    level: usize,
    has_arcs: bool,
}

impl ParticlePrims {
    /// Finds the prims.
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] if there are none, or if their positions may depend on what is not read.
    pub(super) fn find(layer: &Layer<'_>) -> Result<Self, ParseError> {
        let children = Children::of(layer);
        let mut found = Vec::new();
        let mut pending = vec![Visit { prim: 0, level: 0, has_arcs: false }];
        while let Some(visit) = pending.pop() {
            let Some(prim) = layer.prims.get(visit.prim) else {
                continue;
            };
            if prim.is_dormant || visit.level > MAX_LEVELS {
                continue;
            }
            let has_arcs = visit.has_arcs || prim.has_arcs;
            if prim.kind != PrimKind::Other {
                if has_arcs {
                    let path = layer.path(&layer.chain(visit.prim).unwrap_or_default());
                    let what = format!(
                        "a USD file in which {path} depends on other files, variants or classes, which are not read; \
                         {FLATTEN}"
                    );
                    return Err(ParseError::unsupported(what));
                }
                found.push(visit.prim);
            }
            // Prims in an instancer are its prototypes
            if prim.kind != PrimKind::Instancer {
                let below = children.of_prim(layer, visit.prim).iter().rev();
                pending.extend(below.map(|child| Visit {
                    prim: *child,
                    level: visit.level + 1,
                    has_arcs,
                }));
            }
        }
        let has_arcs = layer.prims.iter().any(|prim| prim.has_arcs);
        match (found.is_empty(), has_arcs) {
            (false, _) => Ok(Self { prims: found, has_arcs }),
            (true, true) => Err(ParseError::unsupported(format!(
                "a USD file without points of its own, which refers to other files, variants or classes; {FLATTEN}"
            ))),
            (true, false) => Err(ParseError::unsupported(
                "a USD file without Points and PointInstancer prims; export the particles as points",
            )),
        }
    }
}

/// The prims in each prim, sorted by name.
struct Children(Vec<usize>);

impl Children {
    fn of(layer: &Layer<'_>) -> Self {
        let key = |index: &usize| {
            let prim = layer.prims.get(*index)?;
            Some((prim.parent?, layer.text(&prim.name)))
        };
        let mut all: Vec<usize> =
            (1..layer.prims.len()).filter(|index| key(index).is_some()).collect();
        all.sort_by_key(key);
        Self(all)
    }

    fn of_prim(&self, layer: &Layer<'_>, prim: usize) -> &[usize] {
        let parent = |index: &usize| layer.prims.get(*index).and_then(|prim| prim.parent);
        let start = self.0.partition_point(|index| parent(index) < Some(prim));
        let end = self.0.partition_point(|index| parent(index) <= Some(prim));
        self.0.get(start..end).unwrap_or_default()
    }
}

/// The property with the positions of a prim.
pub(super) fn positions<'l>(layer: &'l Layer<'_>, prim: usize) -> Option<&'l Property> {
    let prim = layer.prims.get(prim)?;
    let name: &[u8] = match prim.kind {
        PrimKind::Instancer => b"positions",
        _ => b"points",
    };
    layer.property(prim, name)
}

/// The time codes of all time steps: those of positions or, if these do not change, of other values. Empty if nothing
/// changes.
///
/// # Errors
/// [`ParseError::Malformed`] for lists of times that are damaged, [`ParseError::TooLarge`] for very long ones.
pub(super) fn times(
    layer: &Layer<'_>,
    prims: &ParticlePrims,
    len: usize,
    budget: MemoryBudget,
) -> Result<Vec<f64>, ParseError> {
    let positions = prims.prims.iter().filter_map(|prim| positions_samples(layer, *prim));
    let times = union(layer, positions, len, budget)?;
    if !times.is_empty() {
        return Ok(times);
    }
    let all = layer.properties.iter();
    union(layer, all.filter_map(|property| property.samples.as_ref()), len, budget)
}

fn positions_samples<'l>(layer: &'l Layer<'_>, prim: usize) -> Option<&'l Samples> {
    positions(layer, prim)?.samples.as_ref()
}

fn union<'l>(
    layer: &'l Layer<'_>,
    lists: impl Iterator<Item = &'l Samples>,
    len: usize,
    budget: MemoryBudget,
) -> Result<Vec<f64>, ParseError> {
    let mut known = BTreeSet::new();
    let mut times = Vec::new();
    for list in lists {
        let mut at = 0;
        if let Samples::Binary { times, .. } = list {
            // Writers share lists that are the same
            if !known.insert((times.start, times.end)) {
                continue;
            }
            at = times.start;
        }
        let count = layer.sample_count(list);
        let damaged =
            |what: &str| ParseError::malformed(at, format!("{what}: the file is damaged"));
        if times.len() + count > len {
            return Err(damaged("more times than the file has bytes"));
        }
        budget.check((times.len() + count) as u64 * TIME_LEN, "the list of its times is")?;
        let start = times.len();
        times.extend((0..count).map(|index| layer.sample_time(list, index)));
        let added = times.get(start..).unwrap_or_default();
        if !added.iter().all(|time| time.is_finite()) || !added.is_sorted_by(|a, b| a < b) {
            return Err(damaged("times that do not increase"));
        }
    }
    times.sort_by(f64::total_cmp);
    times.dedup();
    Ok(times)
}

/// The samples before and after a time.
enum Bracket {
    One(usize),
    /// Also the weight of the later one.
    Between(usize, f64),
}

/// Finds the samples around `time`; `None` if there are none.
fn bracket(layer: &Layer<'_>, samples: &Samples, time: f64) -> Option<Bracket> {
    let count = layer.sample_count(samples);
    let last = count.checked_sub(1)?;
    let (mut start, mut end) = (0, count);
    // The first sample after `time`
    while start < end {
        let middle = start + (end - start) / 2;
        if layer.sample_time(samples, middle) <= time {
            start = middle + 1;
        } else {
            end = middle;
        }
    }
    let Some(before) = start.checked_sub(1) else {
        return Some(Bracket::One(0));
    };
    let [from, to] = [before, start].map(|index| layer.sample_time(samples, index));
    if before == last || from >= time {
        return Some(Bracket::One(before));
    }
    Some(Bracket::Between(before, (time - from) / (to - from)))
}

/// The numbers of a property at a time code, or at no time. Numbers of floating point between two samples are
/// interpolated as OpenUSD does by default; if the samples differ in length, and for other numbers and quaternions,
/// those of the earlier sample are used.
///
/// # Errors
/// [`ParseError`] if the values are damaged or do not fit into `budget`.
pub(super) fn numbers_at(
    layer: &Layer<'_>,
    property: &Property,
    time: Option<f64>,
    budget: MemoryBudget,
) -> Result<Option<Numbers>, ParseError> {
    let sample = |samples: &Samples, index: usize, budget: MemoryBudget| {
        let value = layer.sample_value(samples, index);
        value.map_or(Ok(None), |value| layer.numbers(&value, budget))
    };
    let samples = property.samples.as_ref().zip(time);
    let found = samples.and_then(|(samples, time)| Some((samples, bracket(layer, samples, time)?)));
    match found {
        Some((samples, Bracket::One(index))) => sample(samples, index, budget),
        Some((samples, Bracket::Between(index, weight))) => {
            let Some(numbers) = sample(samples, index, budget)? else {
                return Ok(None);
            };
            let is_float = matches!(numbers.data, AttributeData::F32(_) | AttributeData::F64(_));
            if !is_float || numbers.is_quaternion {
                return Ok(Some(numbers));
            }
            let budget = budget.less(numbers.data.byte_len());
            let next = sample(samples, index + 1, budget)?;
            Ok(Some(match next {
                Some(next) => numbers.interpolated(&next, weight),
                None => numbers,
            }))
        }
        None => match &property.default {
            Some(value) => layer.numbers(value, budget),
            None => Ok(None),
        },
    }
}

/// The words of a property at a time code, which are never interpolated.
///
/// # Errors
/// [`ParseError::Malformed`] if they are damaged.
pub(super) fn tokens_at<'l>(
    layer: &'l Layer<'_>,
    property: &Property,
    time: Option<f64>,
) -> Result<Vec<&'l [u8]>, ParseError> {
    let samples = property.samples.as_ref().zip(time);
    let found = samples.and_then(|(samples, time)| Some((samples, bracket(layer, samples, time)?)));
    let value = match found {
        Some((samples, Bracket::One(index) | Bracket::Between(index, _))) => {
            layer.sample_value(samples, index)
        }
        None => property.default.clone(),
    };
    value.map_or(Ok(Vec::new()), |value| layer.tokens(&value))
}

/// Whether a property changes between the samples around `time`.
///
/// # Errors
/// As [`numbers_at`].
pub(super) fn changes_around(
    layer: &Layer<'_>,
    property: &Property,
    time: Option<f64>,
) -> Result<bool, ParseError> {
    let Some((samples, time)) = property.samples.as_ref().zip(time) else {
        return Ok(false);
    };
    let Some(Bracket::Between(index, _)) = bracket(layer, samples, time) else {
        return Ok(false);
    };
    let numbers = |index| {
        let value = layer.sample_value(samples, index);
        value.map_or(Ok(None), |value| layer.numbers(&value, METADATA_BUDGET))
    };
    Ok(numbers(index)? != numbers(index + 1)?)
}
