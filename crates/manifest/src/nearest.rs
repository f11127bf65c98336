//! Suggestions for misspelled names.

/// The known word that was probably meant, if one is similar enough.
pub fn nearest<'k>(word: &str, known: &[&'k str]) -> Option<&'k str> {
    let distance = |k: &str| strsim::damerau_levenshtein(&word.to_lowercase(), &k.to_lowercase());
    let best = known.iter().min_by_key(|k| distance(k))?;
    let is_part = word.len() >= 4 && best.contains(word) || best.len() >= 4 && word.contains(*best);
    let limit = (word.chars().count().max(best.chars().count()) / 3).max(1);
    (is_part || distance(best) <= limit).then_some(*best)
}
