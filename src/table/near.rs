//! What a mistyped name was meant to be.

/// Letters that a mistyped name is off by at most, and names that are offered instead.
const NEAR: usize = 3;
const MOST_MATCHES: usize = 5;
/// Letters of the shortest word that a mistyped one is held against by itself.
const SHORTEST: usize = 4;

/// A way out for a mistyped name: the likeliest ones, and where the whole list is.
pub fn near_matches(name: &str, known: &[&str], list: &str) -> String {
    // `prefix.*` is mistyped where the prefix is.
    let wanted = name.trim_end_matches(['.', '*']);
    // No name has a capital.
    let wanted = &wanted.to_lowercase();
    let last = wanted.rsplit('.').next().unwrap_or(wanted);
    let family = |k: &str| k.split('.').next().map_or(usize::MAX, |family| distance(family, wanted));
    let length = wanted.chars().count();
    // One word of several, such as unity-hdrp's first, unless it is so short that anything is like it.
    let word = |k: &str| {
        let words = k.split('-').filter(|word| length >= SHORTEST && word.len() >= SHORTEST && *word != k);
        words.map(|word| distance(word, wanted)).min().unwrap_or(usize::MAX)
    };
    // A word of which every letter is another is not mistyped.
    let most = NEAR.min(length.saturating_sub(1));
    let off = |k: &str| distance(k, wanted).min(word(k)).min(if name.ends_with('*') { family(k) } else { usize::MAX });
    let contains = |k: &str| !last.is_empty() && k.contains(last);
    let mut near: Vec<(usize, &str)> =
        known.iter().map(|k| (off(k), *k)).filter(|(off, k)| *off <= most || contains(k)).collect();
    // What is further off by two letters than another was not meant.
    let best = near.iter().map(|(off, _)| *off).min().unwrap_or(0);
    near.retain(|(off, k)| *off <= best + 1 || contains(k));
    // Two lobes may have a quantity of the same name.
    near.sort_unstable();
    near.dedup();
    let near: Vec<&str> = near.into_iter().map(|(_, k)| k).take(MOST_MATCHES).collect();
    if near.is_empty() { format!("see `{list}`") } else { format!("did you mean {}? see `{list}`", near.join(", ")) }
}

/// The number of insertions, deletions and substitutions between two words (Levenshtein), row by row.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}
