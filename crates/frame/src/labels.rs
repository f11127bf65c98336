//! Text behind the numbers of columns.

use std::collections::BTreeMap;

/// Names of the values of columns of integers, by the names of the columns.
pub type Labels = BTreeMap<String, BTreeMap<i64, String>>;
